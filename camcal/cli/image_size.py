"""An image size on the command line: WIDTHxHEIGHT in pixels."""

from __future__ import annotations

import re

import click


def read_size(context: click.Context, parameter: click.Parameter, value: str | None) -> tuple[int, int] | None:
    """Read `WIDTHxHEIGHT`, as the callback of an option.

    Raises
    ------
    click.BadParameter
        If it is anything else, or a side is 0.
    """
    if value is None:
        return None
    match = re.fullmatch(r"([1-9]\d{0,6})[xX×]([1-9]\d{0,6})", value.strip(), re.ASCII)
    if match is None:
        raise click.BadParameter(f"{value!r} is not WIDTHxHEIGHT in pixels, such as 1920x1080.", context, parameter)
    return int(match[1]), int(match[2])
