"""Where the corners fell, how the boards stood, which views count: each weakness of a capture is named, a good one is not."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scenes import BOARD, CAMERA, detections, poses

from camcal.boards.spec import parse_board
from camcal.calibration.solve import solve
from camcal.detection.blur import flag_blurred
from camcal.detection.detect import detect_board
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection, Outlier, Rejected
from camcal.threads import single_threaded
from camcal.trust.board_tests import board_findings
from camcal.trust.consistency import consistency
from camcal.trust.coverage import coverage_findings, reached_share
from camcal.trust.structure import structure_findings
from camcal.trust.views import view_findings

NOISE_PX = 0.1


def calibrated(views, *, camera: Camera = CAMERA, seed: int = 0):
    """Solve from noisy corners of given poses."""
    return solve(detections(views, noise_px=NOISE_PX, seed=seed, camera=camera), BOARD.object_points)


def found(calibration) -> dict[str, tuple[str, str]]:
    """Level and text of every finding, by code."""
    findings = (*coverage_findings(calibration, BOARD), *view_findings(calibration, BOARD))
    return {finding.code: (finding.level, finding.text) for finding in findings}


def facing(x_m: float, y_m: float, z_m: float, tilt_deg: tuple[float, float], turn_deg: float = 0.0) -> Pose:
    """Pose of the board's centre at a point, tilted about x and y after a turn in its plane."""
    tilts = np.radians([*tilt_deg, 0.0])
    R = Pose.from_rvec(tilts, np.zeros(3)).R @ Pose.from_rvec([0, 0, np.radians(turn_deg)], np.zeros(3)).R
    return Pose(R, np.array([x_m, y_m, z_m]) - R @ BOARD.object_points.mean(axis=0))


def test_good_capture_has_no_finding():
    """Twenty views all over the image, tilted up to 40°, near and far: every ninth is reached and nothing is said."""
    calibration = calibrated(poses(20, 0))
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    ninths = np.histogram2d(*corners.T, bins=3, range=[[0, 1280], [0, 960]])[0]
    assert (ninths > 0).all()
    assert found(calibration) == {}


def test_uncovered_side_is_named():
    """Boards that stay left of x = 840 leave the whole right third empty, and nothing else."""
    views = [seen for seen in detections(poses(60, 0), noise_px=NOISE_PX) if seen.corners_px[:, 0].max() < 840]
    level, text = found(solve(views, BOARD.object_points))["uncovered"]
    assert level == "usable"
    assert text.startswith("no corner ever reached the right third of the image")


def test_uncovered_corner_is_named():
    """Boards that keep out of the rectangle above (440, 330) leave the top-left ninth empty."""
    views = [
        seen
        for seen in detections(poses(60, 1), noise_px=NOISE_PX)
        if not ((seen.corners_px[:, 0] < 440) & (seen.corners_px[:, 1] < 330)).any()
    ]
    assert "the top-left third of the image" in found(solve(views, BOARD.object_points))["uncovered"][1]


def test_reached_share_counts_cells():
    """One corner in each of three of the 8 x 6 cells of 100 px."""
    corners = np.array([[10.0, 10.0], [50.0, 90.0], [799.4, 599.4], [100.0, 0.0]])
    assert reached_share(corners, (800, 600)) == 3 / 48


def test_central_boards():
    """Boards far away in the middle: the reach is measured to the image's corner, 800 px from its middle."""
    calibration = calibrated(poses(20, 0, reach=(0.12, 0.1), distances=(0.4, 0.6)))
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    reach = np.quantile(np.hypot(*(corners - [639.5, 479.5]).T), 0.98) / np.hypot(639.5, 479.5)
    level, text = found(calibration)["central_only"]
    assert level == "poor"
    assert f"within {100 * reach:.0f} % of the way" in text
    assert "uncovered" not in found(calibration)


def test_fronto_parallel_boards():
    """Tilts of 3° to 7° are said as the next whole degree above the largest; nothing is said where three are tilted by 20°."""
    places = [(x, y, z) for x in (-0.12, 0.0, 0.12) for y in (-0.08, 0.08) for z in (0.3, 0.45)]
    tilts = [(7, 0), (-5, 0), (0, 6), (0, -4), (3, 3), (-3, 3)]
    flat = [facing(*place, tilts[index % 6], 15.0 * index) for index, place in enumerate(places)]
    level, text = found(calibrated(flat))["fronto_parallel"]
    assert level == "poor"
    assert text in {"every view is within 7° of fronto-parallel", "every view is within 8° of fronto-parallel"}
    tilted = [facing(0.05, 0, 0.35, (20, 0)), facing(-0.05, 0, 0.35, (-20, 0)), facing(0, 0.05, 0.35, (0, 20))]
    assert "fronto_parallel" not in found(calibrated([*flat, *tilted]))
    level, text = found(calibrated([*flat, *tilted[:2]]))["fronto_parallel"]
    assert level == "usable"
    assert text == "only 2 of 14 views are tilted by 15° or more"


def test_parallel_boards():
    """Boards that are all tilted by 25° the same way, to 2°, are called parallel although each of them is well tilted."""
    rng = np.random.default_rng(0)
    views = [
        facing(
            *rng.uniform([-0.12, -0.08, 0.3], [0.12, 0.08, 0.5]), (25 + rng.uniform(-2, 2), rng.uniform(-2, 2)), 30.0 * index
        )
        for index in range(15)
    ]
    codes = found(calibrated(views))
    assert codes["one_orientation"][0] == "poor"
    assert "fronto_parallel" not in codes


def test_one_tilt_axis_is_a_note():
    """Boards tilted about the vertical axis only, -40° to 40°."""
    views = [facing(0.1 * np.sin(index), 0.05 * np.cos(index), 0.35, (0, tilt)) for index, tilt in enumerate(range(-40, 41, 8))]
    level, text = found(calibrated(views))["one_orientation"]
    assert level == "note"
    assert "about the same axis" in text


def test_one_distance_and_small_boards_are_notes():
    """Boards at 0.8 m, give or take 2 %: 0.2 m seen with a focal length of 900 px span 225 of 1280 px."""
    rng = np.random.default_rng(1)
    views = [facing(*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.784, 0.816), tuple(rng.uniform(-20, 20, 2))) for _ in range(15)]
    codes = found(calibrated(views))
    assert codes["one_distance"][0] == "note"
    assert codes["small_boards"][0] == "note"


def test_repeated_views_count_once():
    """Six views, and each of them again with the corners a third of a pixel off: six distinct ones, the others are named."""
    six = detections(poses(6, 1), noise_px=NOISE_PX)
    again = [replace(seen, source=f"{seen.source}_again", corners_px=seen.corners_px + 0.3) for seen in six]
    calibration = solve([*six, *again], BOARD.object_points)
    level, text = found(calibration)["repeated_views"]
    assert level == "usable"
    assert text.startswith("6 of 12 views")
    assert text.endswith("6 distinct views are left")
    assert "view_000_again" in text


def test_one_pose_only_is_rejected():
    """One pose photographed twelve times, with noise, besides one other: two distinct views determine no camera."""
    one, other = poses(2, 3)
    views = detections([one] * 12 + [other], noise_px=NOISE_PX)
    calibration = replace(calibrated(poses(13, 3)), poses=(*[one] * 12, other), detections=tuple(views))
    level, text = found(calibration)["repeated_views"]
    assert level == "rejected"
    assert text.endswith("2 distinct views are left")


def test_exact_copies_are_counted():
    """A copied file is left out before the solve; it is counted, though it does no harm."""
    views = detections(poses(10, 1), noise_px=NOISE_PX)
    calibration = solve([*views, replace(views[0], source="view_copy")], BOARD.object_points)
    level, text = found(calibration)["repeated_views"]
    assert level == "note"
    assert text.startswith("1 of 11 views")


@pytest.mark.parametrize(("count", "level"), [(3, "poor"), (4, "usable"), (5, "usable"), (6, None)])
def test_few_views(count, level):
    """Three views leave nothing to check against, four and five little."""
    few = found(calibrated(poses(count, 5))).get("few_views")
    assert (few and few[0]) == level


def test_blurred_views_are_named():
    """The note of the detection is what counts; two of twenty are a note, eight of twenty make the capture usable."""
    calibration = calibrated(poses(20, 0))

    def blurred(which: range):
        views = [
            replace(seen, notes=("blurred: its edges are 5.0 pixels wide",)) if index in which else seen
            for index, seen in enumerate(calibration.detections)
        ]
        return found(replace(calibration, detections=tuple(views)))["blurred_views"]

    assert blurred(range(7, 9)) == ("note", "2 of 20 views are blurred (view_007, view_008)")
    assert blurred(range(8))[0] == "usable"


def test_misfit_view_is_named():
    """A view whose corners are all some 10 px off is left out by the solve, and named with how badly it fits."""
    views = detections(poses(12, 2), noise_px=NOISE_PX)
    views[4] = replace(views[4], corners_px=views[4].corners_px + 10 * np.random.default_rng(0).normal(size=(54, 2)))
    level, text = found(solve(views, BOARD.object_points))["bad_view"]
    assert level == "usable"
    assert text.startswith("view_004 does not fit the other views (RMS")


@pytest.mark.parametrize(("dropped", "level"), [(0.02, None), (0.05, "usable"), (0.12, "poor")])
def test_share_of_outliers(dropped, level):
    """More than 3 % raise a question, more than 10 % a doubt; those of views that are out as a whole do not count."""
    calibration = calibrated(poses(10, 0))
    count = round(dropped * 540 / (1 - dropped))
    corner = Outlier("view_003", 0, (1.0, 1.0), float("nan"), (9.0, 9.0), "far")
    elsewhere = [replace(corner, source="view_out", id=index) for index in range(54)]
    outliers = (*[replace(corner, id=index) for index in range(count)], *elsewhere)
    codes = found(replace(calibration, outliers=outliers, rejected=(Rejected("view_out", "does not fit the other views"),)))
    assert (codes.get("outliers") or (None,))[0] == level
    assert "bad_view" in codes


def test_cropped_images_are_off_centre():
    """256 of 1280 columns cut off on the right move the middle by 128 px, an eighth of the new width."""
    cropped = Camera((1024, 960), CAMERA.K, CAMERA.lens)
    level, text = found(calibrated(poses(20, 0, camera=cropped), camera=cropped))["off_centre"]
    assert level == "usable"
    assert "right of the image's middle (13 % of its width)" in text


def test_principal_point_that_is_not_known_is_not_off_centre():
    """The same offset says nothing if it is within five standard deviations."""
    cropped = Camera((1024, 960), CAMERA.K, CAMERA.lens)
    calibration = calibrated(poses(20, 0, camera=cropped), camera=cropped)
    wide = np.array(calibration.joint_covariance)
    wide[2, 2] = 40.0**2
    assert "off_centre" not in found(replace(calibration, joint_covariance=wide))


def test_fold_beyond_the_corners():
    """The radius where the lens turns back is the root of d(r (1 + k1 r²))/dr, where the corners end is measured: usable."""
    camera = Camera((1280, 960), [[700, 0, 640], [0, 700, 480], [0, 0, 1]], [-0.22])
    calibration = solve(
        detections(poses(20, 0, camera=camera, reach=(0.4, 0.3)), noise_px=0.01, camera=camera),
        BOARD.object_points,
        distortion=("k1",),
    )
    fx, fy, k1 = calibration.camera.K[0, 0], calibration.camera.K[1, 1], calibration.camera.dist[0]
    root = np.sqrt(-1 / (3 * k1))
    radius = min(fx, fy) * root * (1 + k1 * root**2)
    corners = np.concatenate([seen.corners_px for seen in calibration.detections])
    farthest = np.hypot(*(corners - calibration.camera.K[:2, 2]).T).max()
    level, text = found(calibration)["fold_in_image"]
    assert farthest < radius < 640
    assert level == "usable"
    assert f"turns back {radius:.0f} px" in text
    assert f"at {farthest:.0f} px" in text


def test_view_behind_the_camera_repeats_nothing():
    """A board that lies partly behind the camera plane has no place in the image; that raises no warning and no finding."""
    calibration = calibrated(poses(8, 0))
    behind = Pose(np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), np.array([0.0, 0.0, 0.1]))
    shifted = replace(calibration, poses=(*calibration.poses[:-1], behind))
    assert not {finding.code for finding in view_findings(shifted, BOARD)} & {"repeated_views", "few_views"}


def test_detection_without_notes_is_not_blurred():
    """Other notes say nothing about blur."""
    calibration = calibrated(poses(8, 0))
    first: Detection = replace(calibration.detections[0], notes=("corners as detected: only 3 of 54 could be refined",))
    assert "blurred_views" not in found(replace(calibration, detections=(first, *calibration.detections[1:])))


@pytest.mark.parametrize(
    ("folder", "pattern", "spec", "expected"),
    [
        ("opencv_left", "*.jpg", "checkerboard:9x6:25mm", set()),
        ("udacity_wide", "GOPR*.jpg", "checkerboard:8x6:1m", {"fold_in_image"}),
        ("swat_calib", "*.JPG", "checkerboard:7x5:30mm", {"central_only", "fold_in_image", "blurred_views"}),
    ],
)
def test_photographs(photos, folder, pattern, spec, expected):
    """Real boards are neither flat nor perfect, which may be said; nothing is beyond usable, and nothing of several cameras."""
    board = parse_board(spec)
    with single_threaded():
        seen = [
            detect_board(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION), board, file.name)
            for file in sorted((photos / folder).glob(pattern))
        ]
    views = [view for view in flag_blurred(seen) if isinstance(view, Detection)]
    calibration = solve(views, board.object_points)
    checks = (coverage_findings, view_findings, board_findings, structure_findings, consistency)
    findings = [finding for check in checks for finding in check(calibration, board)]
    assert {finding.level for finding in findings} <= {"usable", "note"}
    assert (
        expected
        <= {finding.code for finding in findings}
        <= expected | {"structured_residuals", "bent_board", "stretched_print"}
    )
