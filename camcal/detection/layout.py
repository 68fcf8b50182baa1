"""Which of the seen tags really lie where the board has them, and which other board they would fit better."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np

from camcal.boards.aprilgrid import FAMILIES, AprilGrid
from camcal.detection.tags import Tags
from camcal.geometry.arrays import BoolArray, FloatArray

# How far a tag corner may lie, on the board, from where a single homography puts it, in tag sides. It leaves room for lens
# distortion and is still far less than the step to the next tag.
_TOLERANCE = 0.3
_FEWEST_TO_JUDGE = 4
_FITTING_SHARE = 0.7
_MOST_COLUMNS = 16


def fitting_tags(tags: Tags, board: AprilGrid) -> BoolArray:
    """Which tags lie where the board has them: the largest set that one homography explains, each id once.

    Parameters
    ----------
    tags : Tags
        Of ids below the board's number of tags.
    board : AprilGrid

    Returns
    -------
    ndarray of shape (T,)
        With a single tag there is nothing to contradict it.
    """
    if len(tags) == 0:
        return np.zeros(0, dtype=np.bool_)
    error = _errors(tags, board)
    order = np.lexsort((error, tags.ids))
    first_of_id = np.zeros(len(tags), dtype=np.bool_)
    first_of_id[order[np.unique(tags.ids[order], return_index=True)[1]]] = True
    fitting: BoolArray = first_of_id & (error <= _TOLERANCE)
    return fitting


def misfit_reason(tags: Tags, fitting: BoolArray, board: AprilGrid) -> str:
    """Why most of the seen tags do not lie where the board has them, with the board that they fit if there is one.

    Parameters
    ----------
    tags : Tags
    fitting : ndarray of shape (T,)
        Those that do, from `fitting_tags`.
    board : AprilGrid

    Returns
    -------
    str
        Empty if there is nothing to complain about.
    """
    seen = np.unique(tags.ids).size
    if seen < _FEWEST_TO_JUDGE or fitting.sum() >= _FITTING_SHARE * seen:
        return ""
    asked = f"{board.columns}x{board.rows}"
    for candidate, name in _other_layouts(board):
        if fitting_tags(tags, candidate).sum() > max(_FITTING_SHARE * seen, fitting.sum()):
            guess = f": is it {candidate.spec}?" if candidate.tag_count == board.tag_count else ": check its size"
            return f"the tags fit {name}, {asked} with the first tag at the {board.first} was asked for{guess}"
    if 2 * fitting.sum() >= seen:
        return ""
    share = f"{fitting.sum()} of {seen}"
    return f"most tags do not lie where the board has them ({share} do, {asked} asked for): check its size and spacing"


def _other_layouts(board: AprilGrid) -> Iterator[tuple[AprilGrid, str]]:
    """Boards that the given one is easily mistaken for, the likeliest first, and how to call them."""
    other_end = "top-left" if board.first == "bottom-left" else "bottom-left"
    swapped = replace(board, columns=board.rows, rows=board.columns)
    yield swapped, f"an AprilGrid of {swapped.columns}x{swapped.rows}"
    yield replace(board, first=other_end), f"an AprilGrid with the first tag at the {other_end}"
    yield (
        replace(swapped, first=other_end),
        f"an AprilGrid of {swapped.columns}x{swapped.rows} with the first tag at the {other_end}",
    )
    for columns in range(2, _MOST_COLUMNS + 1):
        rows = max(2, -(-board.tag_count // columns))
        if columns not in {board.columns, board.rows} and columns * rows <= FAMILIES[board.family][1]:
            yield replace(board, columns=columns, rows=rows), f"an AprilGrid with {columns} columns"


def _errors(tags: Tags, board: AprilGrid) -> FloatArray:
    """Each tag's largest distance on the board, in tag sides, from where the best homography puts it, shape (T,)."""
    layout = board.object_points[:, :2].reshape(-1, 4, 2)[tags.ids] / board.tag_m
    H, _ = cv2.findHomography(tags.corners_px.reshape(-1, 2), layout.reshape(-1, 2), cv2.RANSAC, _TOLERANCE, maxIters=2000)
    if np.shape(H) != (3, 3):
        return np.full(len(tags), np.inf)
    mapped = cv2.perspectiveTransform(tags.corners_px.reshape(-1, 1, 2), H).reshape(-1, 4, 2)
    errors: FloatArray = np.linalg.norm(mapped - layout, axis=2).max(axis=1)
    return errors
