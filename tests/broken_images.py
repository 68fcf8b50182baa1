"""Small rendered images of a board, broken or only seemingly so."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from broken_captures import ANY_WORD, COUNT, TRUSTED, Capture, Case, case, stored
from capture_scenes import BOARD, GRID

from camcal.detection.grid import right_handed
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor

CASES: dict[str, Case] = {}
HARMLESS: dict[str, Case] = {}
SMALL = Camera((640, 480), [[452, 0, 326.3], [0, 453, 236], [0, 0, 1]], [-0.2, 0.06])
BOARDS = {"checkerboard": BOARD, "aprilgrid": GRID}
SHOTS = 12


@lru_cache(maxsize=8)
def shots(
    board: str, seed: int, *, white: float = 0.86, count: int = SHOTS, tilt_deg: tuple[float, float] = (5.0, 45.0)
) -> tuple[np.ndarray, ...]:
    """Small images of a board, rendered."""
    sampling = PoseSampling(count, tilt_deg, (-30.0, 30.0), (0.5, 0.8))
    scenario = Scenario(board, seed, SMALL, BOARDS[board], sampling, Light(white=white), Sensor())
    return tuple(render_view(scenario, index).image for index in range(count))


def shaken(image: np.ndarray, length_px: int, *, down: bool = False) -> np.ndarray:
    """The image blurred by a straight motion."""
    kernel = np.full((length_px, 1) if down else (1, length_px), 1 / length_px)
    return cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REPLICATE)


@case(CASES, refused="fit an AprilGrid of 6x5")
def transposed_aprilgrid(seed: int, folder: Path) -> Capture:
    """A grid of 6x5 tags is given as one of 5x6."""
    return Capture(images=stored(shots("aprilgrid", seed)[:4], folder), board=replace(GRID, columns=5, rows=6).spec)


@case(CASES, refused="mirror")
def mirrored_aprilgrid(seed: int, folder: Path) -> Capture:
    """Every image is a mirror image, as selfie cameras store them."""
    return Capture(images=stored([image[:, ::-1] for image in shots("aprilgrid", seed)[:4]], folder), board=GRID.spec)


@case(CASES, refused="tags of tag36h11 were seen, tag36h10 was asked for")
def wrong_family(seed: int, folder: Path) -> Capture:
    """Tags of tag36h11 are given as tag36h10."""
    return Capture(images=stored(shots("aprilgrid", seed)[:4], folder), board=replace(GRID, family="tag36h10").spec)


@case(CASES, refused="were squares counted instead of inner corners")
def squares_for_corners(seed: int, folder: Path) -> Capture:
    """The SPEC counts the board's 10x7 squares."""
    return Capture(images=stored(shots("checkerboard", seed)[:4], folder), board="checkerboard:10x7:25mm")


@case(CASES, refused="5x4 inner corners was seen|9x6 inner corners was seen|another kind of board|no tag36h11 tags")
def another_kind_of_board(seed: int, folder: Path) -> Capture:
    """A checkerboard is given as an AprilGrid."""
    return Capture(images=stored(shots("checkerboard", seed)[:4], folder), board=GRID.spec)


@case(CASES, "blurred_views", words=ANY_WORD)
def some_views_shaken(seed: int, folder: Path) -> Capture:
    """A third of the images are blurred by a motion of 9 pixels."""
    images = shots("checkerboard", seed)
    return Capture(images=stored([shaken(image, 9) if i % 3 == 0 else image for i, image in enumerate(images)], folder))


@case(CASES, "blurred_views", words=ANY_WORD)
def every_view_shaken(seed: int, folder: Path) -> Capture:
    """Every image is blurred by a motion of 9 pixels, across or down."""
    images = shots("checkerboard", seed)
    return Capture(images=stored([shaken(image, 9, down=i % 2 == 0) for i, image in enumerate(images)], folder))


@case(CASES, "inconsistent", "structured_residuals", "outliers")
def corners_biased_by_the_finder(seed: int, folder: Path) -> Capture:  # noqa: ARG001
    """Corners of tilted boards as cv2.findChessboardCornersSB leaves them, off by a tenth of a pixel."""
    views = []
    for index, image in enumerate(shots("checkerboard", seed, count=COUNT, tilt_deg=(30.0, 50.0))):
        found, corners = cv2.findChessboardCornersSB(image, (9, 6))
        if found:
            grid = right_handed(np.asarray(corners, dtype=np.float64).reshape(6, 9, 2))
            views.append(Detection(f"{index:02d}.png", SMALL.size, np.arange(54), grid.reshape(-1, 2), np.full(54, np.nan)))
    return Capture(views, options={"distortion": "k1,k2"})


@case(HARMLESS, words=TRUSTED)
def other_border(seed: int, folder: Path) -> Capture:
    """Tags with a 2-bit border are given as tags with the official 1-bit one: they are found all the same, with a note."""
    return Capture(images=stored(shots("aprilgrid", seed), folder), board=replace(GRID, border_bits=1).spec)


@case(HARMLESS, words=TRUSTED)
def saturated(seed: int, folder: Path) -> Capture:
    """A third of the images are so bright that the paper is at the end of the scale."""
    usual, bright = shots("checkerboard", seed), shots("checkerboard", seed, white=1.25)
    return Capture(images=stored([(bright if i % 3 == 0 else usual)[i] for i in range(SHOTS)], folder))


@case(HARMLESS, words=TRUSTED)
def dim(seed: int, folder: Path) -> Capture:
    """Every image is so dark that white paper is at 45 of 255 levels."""
    images = [np.rint(image * 0.2).astype(np.uint8) for image in shots("checkerboard", seed)]
    return Capture(images=stored(images, folder))
