"""What the solve refuses or leaves out by name: views that tell too little, corners that no board shows, garbage."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from broken_captures import renumbered
from scenes import BOARD, detections, poses

from camcal.calibration.causes import solve_board
from camcal.calibration.parameters import parse_distortion
from camcal.calibration.solve import solve
from camcal.errors import DetectionError, SolveError
from camcal.geometry.pose import Pose
from camcal.observations import Detection, Rejected

POINTS = BOARD.object_points


def test_indistinguishable_coefficients_are_refused():
    """k1..k3 and k4..k6 all free on a mild lens say the same thing twice: an error that advises to free fewer."""
    with pytest.raises(SolveError, match="free fewer coefficients"):
        solve(detections(poses(10, 5)), POINTS, distortion=parse_distortion("k1,k2,k3,k4,k5,k6"))


def test_fronto_parallel_views_are_refused():
    """Without any tilt focal length and distance cannot be told apart: an error that says to tilt."""
    views = [Pose(p.R, p.t) for p in poses(8, 12, tilt=0.0)]
    with pytest.raises(SolveError, match="Tilt the board"):
        solve(detections(views, noise_px=0.02), POINTS)


def test_a_focal_length_that_is_not_known_is_refused():
    """Tilts below a degree leave a solvable system, but no focal length: the error gives its standard deviation."""
    with pytest.raises(SolveError, match=r"fx and fy known to ±\d+ %.*Tilt the board") as caught:
        solve(detections(poses(10, 2, tilt=0.01), noise_px=0.1), POINTS)
    assert "--distortion" not in str(caught.value)


def test_two_views_are_too_few():
    """Fewer than three usable views: an error that names the first rejected image and why."""
    with pytest.raises(DetectionError, match=r"got 2, expected at least 3.*bad\.png: no board"):
        solve(detections(poses(2, 14)), POINTS, rejected=[Rejected("bad.png", "no board found")])


def test_views_with_too_few_corners_are_rejected_by_name():
    """A view of five corners, or of one row only, is left out with its reason."""
    views = detections(poses(8, 15), noise_px=0.02)
    few = Detection("few", views[0].size, np.arange(5), views[0].corners_px[:5], np.full(5, np.nan))
    line = Detection("line", views[0].size, np.arange(9), views[0].corners_px[:9], np.full(9, np.nan))
    solved = solve([*views, few, line], POINTS)
    assert len(solved.detections) == 8
    assert {r.source: r.reason for r in solved.rejected} == {
        "few": "too few corners for a pose (got 5, expected at least 6)",
        "line": "all corners lie on one line",
    }


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        (np.tile([[300.0, 200.0]], (54, 1)), "one line or point of the image"),
        (np.linspace([0, 0], [900, 700], 54), "one line or point of the image"),
        (np.concatenate([[[9e6, 12.0]], np.mgrid[:53, :2][0] * [9.0, 7.0]]), "far outside the image .got 9e.06, 12"),
    ],
)
def test_corners_that_no_board_shows_are_rejected_by_name(corners, reason):
    """All on one pixel or line of the image, or one at nine million pixels: that view is left out, the others solved."""
    views = detections(poses(8, 15), noise_px=0.02)
    solved = solve([replace(views[3], corners_px=corners), *views[:3], *views[4:]], POINTS)
    (rejected,) = solved.rejected
    assert rejected.source == "view_003"
    assert re.search(reason, rejected.reason)
    assert solved.covariance.tobytes() == solve(views[:3] + views[4:], POINTS).covariance.tobytes()


def test_copies_of_a_view_hold_no_information():
    """A view under a second name is rejected, so that copies neither shrink the uncertainty nor make up three views."""
    views = detections(poses(8, 15), noise_px=0.1)
    copies = [replace(view, source=f"{view.source}_copy") for view in views]
    solved = solve(copies + views, POINTS)
    assert solved.covariance.tobytes() == solve(views, POINTS).covariance.tobytes()
    assert {r.reason for r in solved.rejected} == {f"the same view as {view.source}" for view in views}
    with pytest.raises(DetectionError, match="got 2, expected at least 3"):
        solve(views[:2] + copies[:2], POINTS)


def test_a_view_of_garbage_is_left_out_by_name():
    """Random corners in one view bend the camera until it is not determined: without that view it is as good as ever."""
    views = detections(poses(12, 6), noise_px=0.1)
    garbage = replace(views[5], corners_px=np.random.default_rng(0).uniform(0, 900, (54, 2)))
    solved = solve_board([garbage, *views[:5], *views[6:]], BOARD)
    (rejection,) = solved.rejected
    assert rejection.source == "view_005"
    assert "does not fit the other views" in rejection.reason
    expected = solve([*views[:5], *views[6:]], POINTS)
    np.testing.assert_allclose(solved.camera.intrinsics, expected.camera.intrinsics, rtol=1e-6, atol=1e-9)


def test_nothing_but_garbage_does_not_ask_for_tilt():
    """Corners that fit no board in any view: the SPEC is the likely cause, not the tilt or the coefficients."""
    rng = np.random.default_rng(0)
    views = [replace(view, corners_px=rng.uniform(0, 900, (54, 2))) for view in detections(poses(8, 6))]
    with pytest.raises(SolveError, match=r"view_00. fits worst .*SPEC") as caught:
        solve_board(views, BOARD)
    assert "Tilt" not in str(caught.value)
    assert "--distortion" not in str(caught.value)


def test_mirrored_corners_are_refused():
    """Corners numbered from the wrong side fit perfectly, to boards seen from behind: an error that says so."""
    views = [renumbered(view, np.s_[:, ::-1]) for view in detections(poses(9, 6), noise_px=0.1)]
    with pytest.raises(SolveError, match=r"seen from behind in 9 of 9 views: the ids or the images are mirrored"):
        solve_board(views, BOARD)


def test_mixed_image_sizes_are_a_programming_error():
    """The caller groups by size; a mixture is refused."""
    views = detections(poses(4, 20))
    with pytest.raises(ValueError, match="one image size"):
        solve([*views[:3], replace(views[3], size=(640, 480))], POINTS)
