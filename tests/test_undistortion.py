"""Undistorted images as a pinhole would have taken them: the same picture, and straight lines straight."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from scenes import BOARD
from skimage.metrics import structural_similarity
from undistortion_scenes import bilinear, camera_of, seen_by

from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.refinement.saddle import refine_saddle
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light
from camcal.undistortion.maps import undistort_image, undistort_map, valid_mask
from camcal.undistortion.target import target_camera

COLUMNS, ROWS = 9, 6


def tilted_pose(distance: float) -> Pose:
    """The board tilted in front of the camera, its middle straight ahead."""
    turn = Pose.from_rvec([0.2, -0.3, 0.1], np.zeros(3))
    return Pose(turn.R, np.array([0, 0, distance]) - turn.R @ BOARD.object_points.mean(axis=0))


@lru_cache(maxsize=32)
def rendered(lens: str, alpha: float) -> tuple[Camera, Camera, Pose, np.ndarray, np.ndarray]:
    """A camera, its target, the board's pose, and the board rendered through each, 0..255 float32."""
    camera = camera_of(lens)
    target = target_camera(camera, alpha)
    pose = tilted_pose(0.45 if lens == "fold" else 0.36)
    images = [(255 * render_ideal(c, BOARD, pose, Light(), blur_sigma_px=1.0)).astype(np.float32) for c in (camera, target)]
    return camera, target, pose, *images


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "lanczos"])
@pytest.mark.parametrize(
    ("lens", "alpha"),
    [
        ("barrel", 0.0),
        ("barrel", 1.0),
        ("pincushion", 0.0),
        ("pincushion", 1.0),
        ("wide", 0.0),
        ("wide", 1.0),
        ("tangential", 0.0),
    ],
)
def test_undistorted_render_equals_the_pinhole_render(lens, alpha, interpolation):
    """SSIM >= 0.995 and mean difference <= 1 level inside the valid mask.

    Not for a lens that folds within the image: it squeezes the picture, so that what the pinhole sees is not there.
    """
    camera, target, _, distorted, direct = rendered(lens, alpha)
    undistort = undistort_map(camera, target)
    valid = valid_mask(undistort) > 0
    undistorted = undistort_image(distorted, undistort, interpolation=interpolation)
    _, similarity = structural_similarity(undistorted, np.where(valid, direct, 0), data_range=255, full=True)
    assert similarity[valid].mean() >= 0.995
    assert np.abs(undistorted - direct)[valid].mean() <= 1


def straightness_px(corners_px: np.ndarray) -> np.ndarray:
    """Distance of every corner from the straight line through its row, and through its column: (2 ROWS COLUMNS,)."""
    grid = corners_px.reshape(ROWS, COLUMNS, 2)
    distances = []
    for line in [*grid, *grid.transpose(1, 0, 2)]:
        around = line - line.mean(axis=0)
        distances.append(around @ np.linalg.svd(around)[2][1])
    return np.concatenate(distances)


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "lanczos"])
@pytest.mark.parametrize("lens", ["barrel", "pincushion", "wide", "tangential", "fold"])
def test_straight_lines_are_straight(lens, interpolation):
    """Rows and columns of the board in the undistorted 8-bit image: straight within 0.02 px, by splines in every corner.

    Linear interpolation blurs by as much as a corner lies between pixels, which pulls at it. Its RMS is 0.012 px here and its
    worst corner 0.028 px off, to the last digit that of an exact linear remap (see below); cubic's worst is 0.005 px off.
    """
    camera, target, pose, distorted, _ = rendered(lens, 0.0)
    image = undistort_image(np.rint(distorted).astype(np.uint8), undistort_map(camera, target), interpolation=interpolation)
    expected = target.project(pose.apply(BOARD.object_points))
    found = refine_saddle(image, np.arange(ROWS * COLUMNS), expected, BOARD).corners_px
    assert np.isfinite(found).all()
    bent = straightness_px(found)
    assert np.sqrt((bent**2).mean()) <= 0.02
    assert interpolation == "linear" or np.abs(bent).max() <= 0.02
    assert np.sqrt(((found - expected) ** 2).mean()) <= 0.02


@pytest.mark.parametrize("lens", ["barrel", "pincushion", "wide", "tangential", "fold"])
def test_no_linear_interpolation_is_straighter(lens):
    """The corners lie where they do in an image remapped in float64 by the formula: what bends them is the method itself.

    Coordinates are 2e-4 px off at most and corners average hundreds of pixels, a few of which round the other way.
    """
    camera, target, pose, distorted, _ = rendered(lens, 0.0)
    image = np.rint(distorted).astype(np.uint8)
    best = np.rint(bilinear(image, seen_by(camera, target))).astype(np.uint8)
    expected = target.project(pose.apply(BOARD.object_points))
    ours, theirs = (
        refine_saddle(i, np.arange(ROWS * COLUMNS), expected, BOARD).corners_px
        for i in (undistort_image(image, undistort_map(camera, target)), best)
    )
    assert np.abs(straightness_px(ours) - straightness_px(theirs)).max() <= 1e-3
