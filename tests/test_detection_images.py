"""Any image in: kinds of pixels, textures without a board, tiny ones; the same answer from any thread."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from board_images import errors_px, pose_of, shoot

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.detection.detect import detect_board
from camcal.detection.sampling import gray8, reduced, sample
from camcal.observations import Detection, Rejected
from camcal.threads import single_threaded

CHECKERBOARD = Checkerboard(9, 6, 0.025)
APRILGRID = AprilGrid(6, 5, tag_m=0.03, gap_m=0.009)
CPU_LIMIT_S = 5.0


def as_kind(gray, kind):
    """Turn an 8-bit gray picture into another kind of image with the same content."""
    wide = gray.astype(np.float64)
    return {
        "uint16, dark": (wide * 8 + 100).astype(np.uint16),
        "float32": (wide / 255).astype(np.float32),
        "float64 with NaN": np.where(np.indices(gray.shape).sum(axis=0) == 0, np.nan, wide * 1e3),
        "BGR": np.dstack([gray, gray, gray]),
        "BGRA": np.dstack([gray, gray, gray, np.full_like(gray, 255)]),
        "one channel": gray[:, :, None],
        "BGR, 16 bit": np.dstack([gray, gray, gray]).astype(np.uint16) * 100,
        "not contiguous": np.dstack([gray, gray])[:, :, 0],
    }[kind]


@pytest.mark.parametrize("board", [CHECKERBOARD, APRILGRID], ids=["checkerboard", "aprilgrid"])
@pytest.mark.parametrize(
    "kind", ["uint16, dark", "float32", "float64 with NaN", "BGR", "BGRA", "one channel", "BGR, 16 bit", "not contiguous"]
)
def test_kinds_of_images(kind, board):
    """16-bit, float, colour and strided images give the corners of the 8-bit gray one; only rounding differs."""
    gray, truth = shoot(board, pose_of(board))
    found = detect_board(as_kind(gray, kind), board, "view.png")
    assert isinstance(found, Detection)
    assert found.size == (640, 480)
    assert np.abs(errors_px(found, truth)).max() < 0.5


@pytest.mark.parametrize(
    "image", [np.zeros((4, 4), np.int32), np.zeros((4, 4, 2), np.uint8), np.zeros(4, np.uint8), np.zeros((0, 4), np.uint8)]
)
def test_what_is_no_image_is_refused(image):
    """Arrays that no camera gives are a programmer's mistake."""
    with pytest.raises(ValueError, match="image:"):
        gray8(image)


def test_stretching_uses_the_whole_range():
    """A 12-bit picture in 16 bits comes out from 0 to 255, one hot pixel notwithstanding."""
    ramp = np.tile(np.linspace(500, 3500, 400), (300, 1)).astype(np.uint16)
    ramp[0, 0] = 65535
    stretched = gray8(ramp)
    assert stretched.dtype == np.uint8
    assert stretched[0, 0] == 255
    # 3000 levels onto 255 steps: the middle lies at the middle.
    assert stretched[100, 200] == pytest.approx(127.5, abs=1)


def test_colour_weights_are_those_of_bgr():
    """Gray is .114 B + .587 G + .299 R, channels in OpenCV's order: pure blue is 29."""
    blue = np.zeros((2, 2, 3), np.uint8)
    blue[..., 0] = 255
    assert gray8(blue).tolist() == [[29, 29], [29, 29]]


def test_reduced_pixels_map_back():
    """Pixel centres are integers: (0, 0) of an image reduced by 4 is (1.5, 1.5) of the full one, and back."""
    small = reduced(np.zeros((600, 800), np.uint8), 200)
    assert small.gray.shape == (150, 200)
    assert small.to_full(np.array([[0.0, 0.0]])).tolist() == [[1.5, 1.5]]
    assert small.from_full(np.array([[1.5, 1.5]])).tolist() == [[0.0, 0.0]]


def test_sampling_between_pixels():
    """Bilinear between centres, NaN outside: literals worked by hand on a 2x2 image."""
    image = np.array([[0, 100], [200, 60]], np.uint8)
    values = sample(image, np.array([[0.0, 0.0], [0.5, 0.0], [0.5, 0.5], [1.0, 1.0], [1.01, 0.0], [-0.01, 0.0]]))
    assert values[:4].tolist() == [0, 50, 90, 60]
    assert np.isnan(values[4:]).all()


@pytest.mark.parametrize("board", [CHECKERBOARD, APRILGRID], ids=["checkerboard", "aprilgrid"])
@pytest.mark.parametrize("shape", [(1, 1), (3, 2), (13, 13), (16, 400), (40, 30)])
def test_tiny_images_are_rejected(shape, board):
    """Images too small for any board, black or noisy, are rejected without an exception."""
    for image in (np.zeros(shape, np.uint8), np.random.default_rng(1).integers(0, 256, shape).astype(np.uint8)):
        assert isinstance(detect_board(image, board, "view.png"), Rejected)


def textures():
    """Pictures that make finders slow: noise, random cells, and checkerboards far finer than the one looked for."""
    rng = np.random.default_rng(5)
    noise = rng.integers(0, 256, (3000, 4000)).astype(np.uint8)
    yield "noise of 12 MP", noise
    yield "soft noise", cv2.normalize(cv2.GaussianBlur(noise[:1200, :1600], (0, 0), 3), None, 0, 255, cv2.NORM_MINMAX)
    yield "cells", np.kron(rng.integers(0, 2, (100, 130)).astype(np.uint8) * 200, np.ones((12, 12), np.uint8))
    for side in (32, 48):
        row, column = np.indices((3000, 4000)) // side
        yield f"squares of {side} px", ((row + column) % 2 * 200 + 20).astype(np.uint8)


@pytest.mark.parametrize("board", [CHECKERBOARD, APRILGRID], ids=["checkerboard", "aprilgrid"])
def test_textures_are_rejected_in_time(board):
    """No texture is taken for a board, and none takes more than five seconds of CPU."""
    for name, image in textures():
        start = time.thread_time()
        with single_threaded():
            found = detect_board(image, board, name)
        spent = time.thread_time() - start
        assert isinstance(found, Rejected), name
        assert spent < CPU_LIMIT_S, name


def test_reasons_are_clauses():
    """A reason is one line that can follow "view.png: rejected: " and name what to do."""
    for board in (CHECKERBOARD, APRILGRID):
        found = detect_board(np.full((480, 640), 90, np.uint8), board, "blank.png")
        assert isinstance(found, Rejected)
        assert found.source == "blank.png"
        assert "\n" not in found.reason
        assert not found.reason.endswith(".")
        assert found.reason[0].islower()


def test_threads_and_order_change_nothing():
    """The same bits from one thread, from two, and in any order, for images that need the randomised finders too."""
    images = [shoot(board, pose_of(board, turn_deg=7 * n), seed=n)[0] for n, board in enumerate([CHECKERBOARD, APRILGRID])]
    images.append(np.random.default_rng(2).integers(0, 256, (240, 320)).astype(np.uint8))
    images.append(shoot(CHECKERBOARD, pose_of(CHECKERBOARD, shift=(0.3, 0)))[0])

    def answer(image, board):
        found = detect_board(image, board, "view.png")
        return found.reason if isinstance(found, Rejected) else (found.ids.tobytes(), found.corners_px.tobytes(), found.notes)

    jobs = [(image, board) for image in images for board in (CHECKERBOARD, APRILGRID)]
    with single_threaded():
        alone = [answer(*job) for job in jobs]
        backwards = [answer(*job) for job in reversed(jobs)][::-1]
        with ThreadPoolExecutor(2) as pool:
            together = list(pool.map(lambda job: answer(*job), jobs))
    assert alone == backwards == together


def test_unknown_board_type_is_a_mistake():
    """A board without a detector is refused by name."""

    @dataclass(frozen=True)
    class Circles:
        """A kind of board that nobody detects."""

    with pytest.raises(TypeError, match="no detector for it \\(got Circles, expected one of Checkerboard, AprilGrid\\)"):
        detect_board(np.zeros((10, 10), np.uint8), Circles(), "view.png")
