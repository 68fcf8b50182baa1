"""Captures that are broken in one known way each, or only seem so: what such a case is, and ways to break corners.

A case is a function of a seed (and of a folder to write images in, and of the photographs, where it needs them) whose docstring
says what is wrong. Modules named broken_* and harmless_* hold them by what is broken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from capture_scenes import BOARD, CAMERA, grid_of

from camcal.geometry.camera import Camera
from camcal.observations import Detection

COUNT = 16
ANY_WORD = ("rejected", "poor", "usable", "good")
TRUSTED = ("usable", "good")
WIDE = Camera(CAMERA.size, [[600, 0, 651], [0, 601, 489], [0, 0, 1]], [-0.24, 0.08, 0, 0, -0.0085])


@dataclass(frozen=True)
class Capture:
    """What somebody hands over.

    Attributes
    ----------
    views : sequence of Detection
        Corners; empty if there are images.
    images : str
        Folder or pattern of images.
    board : str
        SPEC, as they believe it to be.
    options : dict
        Further arguments of `calibrate`.
    """

    views: Sequence[Detection] = ()
    images: str = ""
    board: str = BOARD.spec
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """A broken capture and what must be said of it.

    Attributes
    ----------
    make : function
    codes : tuple of str
        The first finding has one of these codes (the first is the best; the others name the same cause less exactly).
    refused : str
        Or no camera comes out, and the error matches this pattern; empty if there must be one.
    words : tuple of str
        The word of the verdict is one of these.
    """

    make: Callable[..., Capture]
    codes: tuple[str, ...] = ()
    refused: str = ""
    words: tuple[str, ...] = ("rejected", "poor", "usable")


def case(suite: dict[str, Case], *codes: str, refused: str = "", words: tuple[str, ...] = Case.words) -> Callable[[Any], Any]:
    """Add a capture to a suite under its function's name."""

    def add(make: Callable[..., Capture]) -> Callable[..., Capture]:
        suite[make.__name__] = Case(make, codes, refused, words)
        return make

    return add


def renumbered(view: Detection, order: Any) -> Detection:
    """The same corners in another order of rows and columns."""
    return replace(view, corners_px=grid_of(view)[order].reshape(-1, 2))


def shifted(view: Detection, by: int) -> Detection:
    """Every corner under the id of the one so many places before it."""
    return replace(view.take(view.ids >= by), ids=view.ids[:-by])


def with_gross_errors(
    views: Sequence[Detection], seed: int, *, share: float, low_px: float, high_px: float
) -> tuple[list[Detection], set[tuple[str, int]]]:
    """Move a share of the corners in any direction, by distances spread evenly on a logarithmic scale; tell which."""
    rng = np.random.default_rng((seed, 99))
    starts = np.cumsum([0, *(len(view) for view in views)])
    chosen = rng.choice(starts[-1], max(1, round(share * starts[-1])), replace=False)
    moved, wrong = [], set()
    for view, start in zip(views, starts, strict=False):
        corners = view.corners_px.copy()
        for row in np.sort(chosen[(chosen >= start) & (chosen < start + len(view))] - start):
            angle, length = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(np.log(low_px), np.log(high_px)))
            offset = length * np.array([np.cos(angle), np.sin(angle)])
            inside = ((corners[row] + offset >= 0) & (corners[row] + offset <= np.array(view.size) - 1)).all()
            corners[row] = np.clip(corners[row] + (offset if inside else -offset), 0, np.array(view.size) - 1)
            wrong.add((view.source, int(view.ids[row])))
        moved.append(replace(view, corners_px=corners))
    return moved, wrong


def stored(images: Sequence[np.ndarray], folder: Path) -> str:
    """Write images as view_00.png and so on."""
    for index, image in enumerate(images):
        cv2.imwrite(str(folder / f"view_{index:02d}.png"), image)
    return str(folder / "*.png")
