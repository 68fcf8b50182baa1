"""What the Python API refuses, in one line each."""

from __future__ import annotations

import numpy as np
import pytest
from array_scene import BOARD, POSE, TRUTH

import camcal
from camcal.observations import Detection


def test_calibrate_refuses_what_cannot_be_meant():
    """Mixtures, doubled names, another board's ids and options for files are refused by name."""
    image = np.zeros((480, 640), np.uint8)
    view = Detection("left", (640, 480), np.arange(42), np.zeros((42, 2)), np.full(42, np.nan))
    for images, options, problem in (
        ([image, "left.png"], {}, "mixture"),
        ([view, "left.png"], {}, "mixture"),
        ([view, view], {}, "'left'"),
        ([np.zeros((4, 4, 2), np.uint8)], {}, r"shape \(4, 4, 2\)"),
        ([image], {"undistort": True, "output": "x"}, "--undistort"),
        ([view], {"twin": 1}, "--twin"),
        ([view], {"only_used": True}, "--only-used"),
        ([], {}, "none given"),
    ):
        with pytest.raises(camcal.InputError, match=problem):
            camcal.calibrate(images, BOARD, **options)
    with pytest.raises(camcal.InputError, match="id 41 is not on the board"):
        camcal.calibrate([view], "checkerboard:5x4:20mm")


NO_IMAGE = r"no image \(got None\); cv2.imread returns None for a file that it cannot read\."
IMAGE = np.zeros((480, 640), np.uint8)


@pytest.mark.parametrize(
    ("images", "told"),
    [
        (None, f"^images: {NO_IMAGE}$"),
        (3, r"^images: not an image \(got int, expected an array\)\.$"),
        ([IMAGE, None, IMAGE], f"^image_0001: {NO_IMAGE}$"),
        ([None], f"^image_0000: {NO_IMAGE}$"),
        (["left.png", None], f"^image_0001: {NO_IMAGE}$"),
        ({"left.png": None}, f"^left.png: {NO_IMAGE}$"),
        ([IMAGE.tolist()], r"^image_0000: not an image \(got list, expected an array\)\.$"),
        (IMAGE, r"^images: one array \(got uint8 of shape \(480, 640\), expected several images\)\. Pass a list of arrays"),
        (np.zeros((480, 640, 3), np.uint8), r"^images: one array \(got uint8 of shape \(480, 640, 3\), expected several"),
    ],
)
def test_calibrate_says_which_image_is_none(images, told):
    """What `cv2.imread` could not read is named by its place or its name; one image is not taken for a stack of rows."""
    with pytest.raises(camcal.InputError, match=told):
        camcal.calibrate(images, BOARD)


@pytest.mark.parametrize("kind", ["bool", "int16", "float64", ">u2"])
def test_functions_of_arrays_refuse_other_pixels(kind):
    """Pixels of a kind that cameras do not give are one line that names the kind and those that are taken."""
    image = np.zeros((480, 640), kind)
    told = rf"^image: not an image \(got {image.dtype} of shape \(480, 640\), expected uint8, uint16, float32 of shape "
    for call in (lambda: camcal.detect_corners(image, BOARD), lambda: camcal.undistort_image(image, TRUTH)):
        with pytest.raises(camcal.InputError, match=told):
            call()
    with pytest.raises(camcal.InputError, match=told.replace("image:", "image_0000:")):
        camcal.calibrate([image], BOARD)


def test_functions_of_arrays_refuse_what_is_no_image():
    """None, a list, another size than the camera's, five channels, a matrix for a pose, 12 bits: an InputError of one line."""
    no_depth = camcal.Sensor(bits=12)
    for call, told in (
        (lambda: camcal.detect_corners(None, BOARD, name="left.png"), f"^left.png: {NO_IMAGE}$"),
        (lambda: camcal.undistort_image(None, TRUTH), f"^image: {NO_IMAGE}$"),
        (lambda: camcal.undistort_image([[1]], TRUTH), r"^image: not an image \(got list, expected an array\)\.$"),
        (
            lambda: camcal.undistort_image(IMAGE[:240], TRUTH),
            r"^image: not of the camera's size \(got 640x240, expected 640x480\)",
        ),
        (lambda: camcal.undistort_image(np.zeros((480, 640, 5), np.uint8), TRUTH), r"got uint8 of shape \(480, 640, 5\)"),
        (lambda: camcal.render(TRUTH, BOARD, np.eye(4)), r"^T_cam_board: not a pose \(got ndarray\)\."),
        (
            lambda: camcal.render(TRUTH, BOARD, POSE, sensor=no_depth),
            r"^sensor.bits: not a depth we write \(got 12, expected 8",
        ),
    ):
        with pytest.raises(camcal.InputError, match=told):
            call()
    assert camcal.undistort_image(np.zeros((480, 640, 2), np.uint8), TRUTH).shape == (480, 640, 2)
