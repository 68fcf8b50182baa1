"""Finds an AprilGrid: some tags decoded anywhere, the others looked for where those say they are, corners refined."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from camcal.boards.aprilgrid import BORDER_BITS, FAMILIES, AprilGrid
from camcal.detection.blur import Edges, blur_notes, edge_width_px
from camcal.detection.layout import fitting_tags, misfit_reason
from camcal.detection.sampling import Gray, reduced
from camcal.detection.sighting import FEWEST_CORNERS, Sighting, border_share, completed, dependable
from camcal.detection.tags import Tags, find_tags
from camcal.observations import Detection, Rejected

# Longer side of the images in which tags are looked for: small tags need the second, noise makes it slow.
_SEARCH_PX = (1600, 3200)
_DIAGNOSIS_PX = 1024
_DIAGNOSIS_IDS = 600
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
    best = Sighting.nothing(board)
    for tags, printed in _seen_tags(gray, board):
        if len(tags) == 0:
            if tags.others > _TOO_MANY_OTHERS:
                return Rejected(source, f"no {board.family} tags among {tags.others} squares: is it another kind of board?")
            continue
        fitting = fitting_tags(tags, printed)
        misfit = misfit_reason(tags, fitting, printed)
        if misfit:
            return Rejected(source, misfit)
        sighting = completed(gray, Sighting.of_tags(gray, printed, Tags(tags.ids[fitting], tags.corners_px[fitting])))
        best = max(best, sighting, key=lambda one: one.tag_count)
        if best.tag_count >= _FEWEST_TAGS:
            return _detection(gray, board, best, source)
    return Rejected(source, _why_not_found(gray, board, best.tag_count))


def _seen_tags(gray: Gray, board: AprilGrid) -> Iterator[tuple[Tags, AprilGrid]]:
    """Attempts to decode tags, cheap and likely ones first, each with the board as it would have to be printed."""
    for longest_px in _SEARCH_PX if max(gray.shape) > _SEARCH_PX[0] else _SEARCH_PX[:1]:
        search = reduced(gray, longest_px)
        for border_bits in sorted(BORDER_BITS, key=lambda bits: bits != board.border_bits):
            tags = find_tags(search.gray, board.family, border_bits, board.tag_count)
            yield replace(tags, corners_px=search.to_full(tags.corners_px)), replace(board, border_bits=border_bits)


def _detection(gray: Gray, board: AprilGrid, sighting: Sighting, source: str) -> Detection | Rejected:
    """What is dependable of a sighting, with notes."""
    corners = dependable(gray, sighting).reshape(-1, 2)
    ids = np.flatnonzero(np.isfinite(corners[:, 0]))
    if ids.size < FEWEST_CORNERS:
        return Rejected(source, "its tags are too small or too near the border of the image for their corners to be located")
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


def _why_not_found(gray: Gray, board: AprilGrid, tag_count: int) -> str:
    """The reason why a board is not there: too few of its tags, other tags, or none."""
    if tag_count:
        tags = "1 tag" if tag_count == 1 else f"{tag_count} tags"
        return (
            f"only {tags} of the board found, expected at least {_FEWEST_TAGS}: too small, blurred, covered or out of the image"
        )
    search = reduced(gray, _DIAGNOSIS_PX).gray
    for family in sorted(FAMILIES, key=lambda name: name != board.family):
        available = min(FAMILIES[family][1], _DIAGNOSIS_IDS)
        count = available if family == board.family else min(board.tag_count, available)
        for border_bits in BORDER_BITS:
            ids = find_tags(search, family, border_bits, count).ids
            if len(ids) >= _FEWEST_TAGS and family == board.family:
                return f"its tags are not on the board (ids {ids.min()} to {ids.max()}, expected 0 to {board.tag_count - 1})"
            if len(ids) >= _FEWEST_TAGS:
                return f"tags of {family} were seen, {board.family} was asked for"
    return f"no {board.family} tags found: the board must be in the image, sharp, large enough and not mirrored"
