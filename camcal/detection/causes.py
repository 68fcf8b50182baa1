"""Why a board was not found: another board, another print, a mirrored or spoilt picture; each reason says what to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from camcal.boards.aprilgrid import FAMILIES, OPTION_DEFAULTS, AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.detection.picture import picture_fault
from camcal.detection.reading import Print, Reading, read_tags
from camcal.detection.sampling import Gray
from camcal.detection.survey import Survey, survey

# A checkerboard is so many plain squares, with few others beside them.
_FEWEST_PLAIN = 12
_PLAIN_PER_OTHER = 4
# A grid of tags is so many squares with something in them, which differ this much in size.
_FEWEST_MARKED = 8
_ALIKE = 1.6
# Pixels that a cell of a tag needs to be read.
_LEAST_CELL_PX = 2.2


def too_small(parts: str, width_px: float, least_px: float) -> str:
    """The reason for a board that was found, but whose parts (squares, tags) show too little of their corners."""
    # Rounded down and up, so that what is too small never looks large enough.
    got, expected = np.floor(10 * width_px) / 10, np.ceil(least_px)
    return (
        f"the board is too small in the image (its {parts} are only {got:.1f} pixels wide, expected at least {expected:.0f}): "
        "move closer, or use the photographs at their full size"
    )


def why_no_checkerboard(gray: Gray, board: Checkerboard, seen: Survey) -> str:
    """The reason why a checkerboard was not found.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    board : Checkerboard
    seen : Survey
        The largest checkerboard in the image, which is not the one that was asked for, or not clear.

    Returns
    -------
    str
        Figures that differ from image to image stand in parentheses, so that reasons can be counted.
    """
    size = (board.columns, board.rows)
    if not seen.is_empty and (seen.is_larger(size) or seen.counts_squares(size)):
        return _another_checkerboard(board, seen)
    if not seen.is_empty and seen.is_cut(size):
        return _cut(board, seen)
    if not seen.is_empty and seen.complete:
        return _unclear(board, seen)
    reading = read_tags(gray)
    return _other_tags(reading) or picture_fault(gray) or _other_markers(reading) or _unclear(board, seen)


def _another_checkerboard(board: Checkerboard, seen: Survey) -> str:
    columns, rows = seen.size((board.columns, board.rows))
    asked = f"a board of {columns}x{rows} inner corners was seen, {board.columns}x{board.rows} was asked for"
    spec = replace(board, columns=columns, rows=rows).spec
    if seen.counts_squares((board.columns, board.rows)):
        return f"{asked}: were squares counted instead of inner corners? Then it is {spec}"
    return f"{asked}: is it {spec}?"


def _cut(board: Checkerboard, seen: Survey) -> str:
    size = (board.columns, board.rows)
    inside = "{}x{} of {}x{} inner corners are in the image".format(*seen.size(size), *size)
    return f"the board is cut by the frame (only {inside}): keep all of it in view"


def _unclear(board: Checkerboard, seen: Survey) -> str:
    size = (board.columns, board.rows)
    asked = "{}x{}".format(*size)
    if seen.is_empty:
        return (
            f"no checkerboard found: all {asked} inner corners must be in the image, sharp, evenly lit and large enough, "
            "with white paper around the outer squares"
        )
    columns, rows = seen.size(size)
    if (columns, rows) == size:
        return f"a board of {asked} inner corners was seen, but not clearly enough: is part of it hidden or in glare?"
    smaller = f", or is it {replace(board, columns=columns, rows=rows).spec}?" if seen.complete else "?"
    return f"only {columns}x{rows} inner corners of {asked} were seen: is part of the board hidden or in glare{smaller}"


def _other_tags(reading: Reading) -> str:
    printed = reading.printed
    if printed is None:
        return ""
    options = {"family": printed.family, "border": str(printed.border_bits)}
    differing = "".join(f":{name}={value}" for name, value in options.items() if value != OPTION_DEFAULTS[name])
    return (
        f"tags of {printed.family} were seen and no checkerboard: is the board an AprilGrid "
        f"(aprilgrid:COLUMNSxROWS:TAG:SPACING{differing})?"
    )


def _other_markers(reading: Reading) -> str:
    if not _marked_alike(reading):
        return ""
    return "squares with marks in them were seen and no checkerboard: is it a ChArUco board, or a grid of markers?"


def _marked_alike(reading: Reading) -> bool:
    """Whether there are squares of one size that have something in them."""
    sides = reading.marked_px
    typical = float(np.median(sides)) if sides.size else 0.0
    return bool(np.count_nonzero((sides < _ALIKE * typical) & (sides * _ALIKE > typical)) >= _FEWEST_MARKED)


def why_no_aprilgrid(gray: Gray, board: AprilGrid, reading: Reading, tag_count: int, misfit: str) -> str:
    """The reason why an AprilGrid was not found.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    board : AprilGrid
    reading : Reading
        What the squares in the image say.
    tag_count : int
        How many tags of the board were found; too few of them.
    misfit : str
        Why the tags do not lie where the board has them; empty if they do.

    Returns
    -------
    str
        Figures that differ from image to image stand in parentheses, so that reasons can be counted.
    """
    if reading.printed is not None and reading.printed != _asked(board, reading.printed.border_bits):
        return _another_print(board, reading.printed)
    if misfit:
        return misfit
    if reading.printed is not None:
        ids = f"ids {reading.tags.ids.min()} to {reading.tags.ids.max()}, expected 0 to {board.tag_count - 1}"
        return f"its tags are not on the board ({ids}): is it a larger board, or another one?"
    return _checkerboard(gray, reading) or picture_fault(gray) or _unread(board, reading) or _too_few(board, tag_count)


def _asked(board: AprilGrid, border_bits: int) -> Print:
    """How tags of a board are printed, whatever their border: the detector takes both."""
    return Print(board.family, border_bits)


def _another_print(board: AprilGrid, seen: Print) -> str:
    """What is different about tags that can be read."""
    differences, remedies = [], []
    if seen.family != board.family:
        differences.append(f"tags of {seen.family} were seen, {board.family} was asked for")
        border = f" and border={seen.border_bits}" if seen.border_bits != board.border_bits else ""
        remedies.append(f"set family={seen.family}{border}")
    if seen.mirrored:
        differences.append("the image is mirrored")
        remedies.append("turn off the camera's mirroring, or flip the images back")
    if seen.inverted:
        differences.append("the tags are white on black")
        remedies.append("print them black on white, or invert the images")
    return f"{', and '.join(differences)}: {', and '.join(remedies)}"


def _checkerboard(gray: Gray, reading: Reading) -> str:
    if reading.plain < max(_FEWEST_PLAIN, _PLAIN_PER_OTHER * reading.marked_px.size):
        return ""
    seen = survey(gray)
    if seen.is_empty:
        return ""
    columns, rows = seen.size((1, 0))
    return (
        f"a checkerboard of {columns}x{rows} inner corners was seen and no tags: is the board a checkerboard "
        f"(checkerboard:{columns}x{rows}:SIDE)?"
    )


def _unread(board: AprilGrid, reading: Reading) -> str:
    """What squares of one size tell that have something in them, but cannot be read."""
    if not _marked_alike(reading):
        return ""
    side = float(np.median(reading.marked_px))
    least = _LEAST_CELL_PX * (FAMILIES[board.family][0] + 2 * board.border_bits)
    if side < least:
        return (
            f"squares were seen that are too small to be read as tags ({side:.0f} pixels wide, expected at least {least:.0f}): "
            "move closer, or use the photographs at their full size"
        )
    return "squares with marks in them were seen that cannot be read as tags: are they blurred, in glare, or other markers?"


def _too_few(board: AprilGrid, tag_count: int) -> str:
    if tag_count:
        return (
            f"too few tags of the board were found (got {tag_count}): are they too small, blurred, covered or out of the image?"
        )
    return f"no {board.family} tags found: the board must be in the image, sharp, evenly lit and large enough"
