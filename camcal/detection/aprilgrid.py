"""Finds an AprilGrid: some tags decoded anywhere, the others looked for where those say they are, corners refined."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from camcal.boards.aprilgrid import BORDER_BITS, AprilGrid
from camcal.detection.blur import Edges, blur_notes, edge_width_px
from camcal.detection.causes import too_small, why_no_aprilgrid
from camcal.detection.layout import fitting_tags, misfit_reason
from camcal.detection.reading import Print, Reading, read_tags
from camcal.detection.sampling import Gray, reduced
from camcal.detection.sighting import (
    FEWEST_CORNERS,
    Sighting,
    border_share,
    completed,
    dependable,
    least_tag_px,
    tag_side_px,
)
from camcal.detection.tags import Tags, find_tags
from camcal.observations import Detection, Rejected

# Longer side of the images in which tags are looked for: small tags need the second, noise makes it slow.
_SEARCH_PX = (1600, 3200)
# The detector's time grows with the square of what looks like a tag; this much is a checkerboard or a texture.
_TOO_MANY_OTHERS = 1000

# Sixteen corners on four tags that fit the board's geometry and look like its tags cannot be a chance, and they fix a pose.
_FEWEST_TAGS = 4
_POOR_SHARE = 0.5


def detect_aprilgrid(gray: Gray, board: AprilGrid, source: str) -> Detection | Rejected:
    """Find the tag corners of an AprilGrid, all or some of them.

    Parameters
    ----------
    gray : ndarray of shape (height, width)
        uint8.
    board : AprilGrid
    source : str
        Name of the image.

    Returns
    -------
    Detection or Rejected
        Tags with the other border width than the board's are used, and a note says so.
    """
    best, misfit = Sighting.nothing(board), ""
    for tags, printed in _seen_tags(gray, board):
        if len(tags) == 0 and tags.others > _TOO_MANY_OTHERS:
            return Rejected(
                source, f"no {board.family} tags among the squares seen ({tags.others}): is it another kind of board?"
            )
        sighting = _sighting(gray, tags, printed)
        if isinstance(sighting, str):
            misfit = sighting
            break
        best = max(best, sighting, key=lambda one: one.tag_count)
        if best.tag_count >= _FEWEST_TAGS:
            return _detection(gray, board, best, source)
    reading = read_tags(gray)
    if not misfit:
        sighting = _read_again(gray, board, reading)
        if isinstance(sighting, Sighting) and sighting.tag_count >= _FEWEST_TAGS:
            return _detection(gray, board, sighting, source)
        misfit = sighting if isinstance(sighting, str) else ""
    return Rejected(source, why_no_aprilgrid(gray, board, reading, best.tag_count, misfit))


def _sighting(gray: Gray, tags: Tags, printed: AprilGrid) -> Sighting | str:
    """The board that decoded tags belong to, completed, or the reason why they do not lie as they do on it."""
    fitting = fitting_tags(tags, printed)
    misfit = misfit_reason(tags, fitting, printed)
    return misfit or completed(gray, Sighting.of_tags(gray, printed, tags.chosen(fitting)))


def _read_again(gray: Gray, board: AprilGrid, reading: Reading) -> Sighting | str:
    """The same from tags that OpenCV does not decode: bloomed, blurred or small ones."""
    if reading.printed is None or reading.printed != Print(board.family, reading.printed.border_bits):
        return Sighting.nothing(board)
    on_board = reading.tags.chosen(reading.tags.ids < board.tag_count)
    return _sighting(gray, on_board, replace(board, border_bits=reading.printed.border_bits))


def _seen_tags(gray: Gray, board: AprilGrid) -> Iterator[tuple[Tags, AprilGrid]]:
    """Attempts to decode tags, cheap and likely ones first, each with the board as it would have to be printed."""
    for longest_px in _SEARCH_PX if max(gray.shape) > _SEARCH_PX[0] else _SEARCH_PX[:1]:
        search = reduced(gray, longest_px)
        for border_bits in sorted(BORDER_BITS, key=lambda bits: bits != board.border_bits):
            tags = find_tags(search.gray, board.family, border_bits, board.tag_count)
            yield replace(tags, corners_px=search.to_full(tags.corners_px)), replace(board, border_bits=border_bits)


def _detection(gray: Gray, board: AprilGrid, sighting: Sighting, source: str) -> Detection | Rejected:
    """What is dependable of a sighting, with notes."""
    side, least = tag_side_px(sighting), least_tag_px(sighting.board)
    if side < least:
        return Rejected(source, too_small("tags", side, least))
    corners = dependable(gray, sighting).reshape(-1, 2)
    ids = np.flatnonzero(np.isfinite(corners[:, 0]))
    if ids.size < FEWEST_CORNERS:
        return Rejected(
            source, "its tags are too near the border of the image, or too unclear, to be located: move it further in"
        )
    notes: tuple[str, ...] = ()
    if sighting.board.border_bits != board.border_bits:
        bits = sighting.board.border_bits
        notes += (f"its tags have a {bits}-bit border, not the board's {board.border_bits}-bit one: set border={bits}",)
    if ids.size < _POOR_SHARE * 4 * sighting.tag_count:
        notes += (f"unclear: only {ids.size} of {4 * sighting.tag_count} corners could be located well",)
    edge_width = edge_width_px(gray, _edges(sighting))
    height, width = gray.shape
    return Detection(
        source, (width, height), ids, corners[ids], np.full(ids.size, np.nan), notes + blur_notes(edge_width), edge_width
    )


def _edges(sighting: Sighting) -> tuple[Edges, Edges]:
    """The tags' bottom and top sides, and their left and right ones: ink within the border, paper in the gap."""
    board = sighting.board
    whole = sighting.corners_px[np.isfinite(sighting.corners_px).all(axis=(1, 2))]
    sides = np.stack([whole, np.roll(whole, -1, axis=1)], axis=2)
    lengths = np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=2)
    share = min(border_share(board), board.gap_m / board.tag_m)

    def family(first: int) -> Edges:
        parallel = sides[:, first::2].reshape(-1, 2, 2)
        return Edges(parallel[:, 0], parallel[:, 1], share * lengths[:, 1 - first :: 2].ravel())

    return family(0), family(1)
