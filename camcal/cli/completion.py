"""What a shell may complete: files, folders, and the names that camcal ships."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

VARIABLE = "_CAMCAL_COMPLETE"
"""Set by a shell that asks for completions."""


class Completed(click.types.StringParamType):
    """Text that a shell can complete.

    Parameters
    ----------
    kind : str
        "file" or "dir": what the shell looks for, which knows how.
    names : callable, optional
        Names that come before any file.
    """

    def __init__(self, kind: str, names: Callable[[], tuple[str, ...]] = tuple) -> None:
        self._kind = kind
        self._names = names

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem[str]]:  # noqa: ARG002
        """Return the names that begin as the text does; if there are none, let the shell look for files."""
        from click.shell_completion import CompletionItem

        found = [CompletionItem(name) for name in self._names() if name.startswith(incomplete)]
        return found or [CompletionItem(incomplete, type=self._kind)]


def _boards() -> tuple[str, ...]:
    from camcal.resources import sample_board_names

    return sample_board_names()


def _configs() -> tuple[str, ...]:
    from camcal.resources import config_names

    return config_names()


_BOARD, _CONFIG = Completed("file", _boards), Completed("file", _configs)

boards = _BOARD.shell_complete
"""Completes a board: the sample boards, or a file."""
configs = _CONFIG.shell_complete
"""Completes a scenario: those that are shipped, or a file."""


def text_type(parameter: click.Parameter) -> Any:
    """Return the type of a parameter that is text, by what its name and its metavar say that it is.

    Boards and configs are names that are shipped, or files; so are, but for the names, all other arguments, and options whose
    metavar has FILE or DIR.
    """
    name = parameter.name or ""
    if name in {"board", "spec"}:
        return _BOARD
    if name in {"config", "configs"}:
        return _CONFIG
    shown = (parameter.metavar or "") if isinstance(parameter, click.Option) else "FILE"
    if "FILE" in shown:
        return Completed("file")
    return Completed("dir") if "DIR" in shown else parameter.type
