"""How much a command says on stderr: `--quiet` and `--verbose`, before or behind the command's name."""

from __future__ import annotations

import click

_KEY = "camcal.loudness"

NO_WARNINGS = -2
NO_PROGRESS = -1
DETAILS = 1


def loudness() -> int:
    """Return how many times --verbose was given, less --quiet: -2 or less, -1, 0, 1 or more."""
    context = click.get_current_context(silent=True)
    return 0 if context is None else int(context.meta.get(_KEY, 0))


def _louder(context: click.Context, parameter: click.Parameter, count: int) -> None:
    """Add what one of the options says; the contexts of the group and of its command share what they know."""
    step = 1 if parameter.name == "verbose" else -1
    context.meta[_KEY] = context.meta.get(_KEY, 0) + step * count


def loudness_options() -> list[click.Option]:
    """Return the two options."""
    return [
        click.Option(
            ["-q", "--quiet"], count=True, expose_value=False, callback=_louder, help="No progress; -qq: no warnings either."
        ),
        click.Option(
            ["-v", "--verbose"], count=True, expose_value=False, callback=_louder, help="Say what is decided, and times."
        ),
    ]
