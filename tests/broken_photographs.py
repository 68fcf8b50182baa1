"""Photographs with a defect, or with a wrong SPEC or lens; those that look broken and are not; and weaknesses to be told."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from broken_captures import TRUSTED, Capture, Case, case, stored

from camcal.boards.checkerboard import Checkerboard
from camcal.observations import Detection

CASES: dict[str, Case] = {}
HARMLESS: dict[str, Case] = {}
TOLD: dict[str, Case] = {}
LEFT, LEFT_BOARD = "opencv_left", "checkerboard:9x6:25mm"


def lefts(photos: Path) -> list[np.ndarray]:
    """The thirteen photographs of opencv_left, gray."""
    return [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted((photos / LEFT).glob("left*.jpg"))]


@case(CASES, refused="the same view as")
def copied_photographs(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Two photographs, each four times under other names."""
    return Capture(images=stored(lefts(photos)[:2] * 4, folder), board=LEFT_BOARD)


@case(CASES, "mixed_cameras")
def some_photographs_mirrored(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every other photograph is a mirror image: the principal point jumps by 45 px."""
    images = [image[:, ::-1] if index % 2 else image for index, image in enumerate(lefts(photos))]
    return Capture(images=stored(images, folder), board=LEFT_BOARD)


@case(CASES, "mixed_cameras")
def some_photographs_upside_down(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every other photograph was turned by 180 degrees."""
    images = [image[::-1, ::-1] if index % 2 else image for index, image in enumerate(lefts(photos))]
    return Capture(images=stored(images, folder), board=LEFT_BOARD)


@case(CASES, "odd_aspect")
def photographs_of_twice_the_width(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every photograph was made twice as wide."""
    images = [cv2.resize(image, (1280, 480), interpolation=cv2.INTER_CUBIC) for image in lefts(photos)]
    return Capture(images=stored(images, folder), board=LEFT_BOARD)


@case(CASES, "lens_too_simple")
def udacity_with_k1_alone(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """A wide lens and no k2."""
    images = str(photos / "udacity_wide/GOPR00[3-4]*.jpg")
    return Capture(images=images, board="checkerboard:8x6:1m", options={"refine": "saddle", "distortion": "k1"})


@case(CASES, "wrong_spacing")
def moms_with_wrong_spacing(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Gaps of .25 of a tag are given as .3."""
    board = "aprilgrid:5x4:20mm:0.3:family=tag36h10:first=top-left"
    return Capture(images=str(photos / "moms_left"), board=board, options={"refine": "saddle"})


@case(CASES, refused="tags of tag36h10 were seen, tag36h11 was asked for")
def moms_of_another_family(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Kalibr's family, which is the default."""
    return Capture(images=str(photos / "moms_left"), board="aprilgrid:5x4:20mm:0.25:first=top-left")


@case(CASES, refused="fit an AprilGrid of 5x4")
def moms_transposed(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Columns given as rows."""
    board = "aprilgrid:4x5:20mm:0.25:family=tag36h10:first=top-left"
    return Capture(images=str(photos / "moms_left"), board=board)


@case(CASES, refused="first tag at the top-left")
def moms_counted_from_below(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """The wrong end for tag 0, which is the default."""
    return Capture(images=str(photos / "moms_left"), board="aprilgrid:5x4:20mm:0.25:family=tag36h10")


@case(CASES, "fisheye", refused="fisheye")
def fisheye_plane(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Eight photographs through a lens of 180 degrees, with their reference corners."""
    board = Checkerboard(22, 22, 0.04)
    return Capture([orpc(path, board) for path in sorted((photos / "fisheye_plane").glob("*.orpc"))], board=board.spec)


def orpc(path: Path, board: Checkerboard) -> Detection:
    """Read a file of reference corners: lines of board, id, flag, x, y."""
    rows = np.array([line.split(",") for line in path.read_text().splitlines()[5:]], dtype=np.float64)
    rows = rows[np.argsort(rows[:, 1])]
    ids = rows[:, 1].astype(np.int64)
    assert ids.max() < board.feature_count
    return Detection(path.stem, (1280, 800), ids, rows[:, 3:5], np.full(ids.size, np.nan))


@case(HARMLESS, words=TRUSTED)
def plain_left(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """OpenCV's own sample."""
    return Capture(images=str(photos / LEFT), board=LEFT_BOARD)


@case(HARMLESS, words=TRUSTED)
def plain_udacity(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """A wide action camera; one board is cut by the frame."""
    return Capture(images=str(photos / "udacity_wide/GOPR*.jpg"), board="checkerboard:8x6:1m")


@case(HARMLESS, words=TRUSTED)
def turned_photographs(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every photograph was turned by 90 degrees: another camera, as good."""
    return Capture(images=stored([np.rot90(image) for image in lefts(photos)], folder), board=LEFT_BOARD)


@case(TOLD, "unsupported_coefficient", words=TRUSTED)
def swat_with_k3(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """A phone's lens and boards that leave the image's corners empty: k3 comes out as -11, or as anything else."""
    return Capture(images=str(photos / "swat_calib"), board="checkerboard:7x5:30mm")


@case(TOLD, "off_centre", words=TRUSTED)
def cropped_photographs(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """150 pixels were cut off on the left of every photograph."""
    return Capture(images=stored([image[:, 150:] for image in lefts(photos)], folder), board=LEFT_BOARD)
