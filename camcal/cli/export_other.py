"""What `camcal export` does with files that are no cameras: corners and boards."""

from __future__ import annotations

from camcal.cli.console import say, say_wrapped

OTHER_FORMATS = ("kalibr", "camcal", "csv", "vnl", "matlab")
"""Formats of boards (the first two) and of corners (the others)."""


def export_other(
    given: str,
    to: str,
    output: str | None,
    *,
    board: str | None,
    size: tuple[int, int] | None,
    only_used: bool,
    force: bool,
) -> bool:
    """Export what was given if it is a file of corners or a board; tell whether it was.

    Raises
    ------
    InputError
        If it is, and cannot be exported so.
    """
    from camcal.formats.corner_exchange.table import is_corners_path
    from camcal.workflows.export_board import export_board, is_board

    if is_corners_path(given):
        from camcal.workflows.export_corners import export_corners

        done = export_corners(given, output, to=to, board=board, size=size, only_used=only_used, force=force)
        _show(done.content, output, f"{done.what}, {done.corners} corners in {done.views} views")
        return True
    if is_board(given):
        _show(export_board(given, output, to=to, force=force), output, f"the board {given} for {to}")
        return True
    return False


def _show(content: str, output: str | None, what: str) -> None:
    """Print what was written where, or the content itself."""
    if output is None:
        say(content.rstrip("\n"))
    else:
        say_wrapped(f"{output}: {what}.")
