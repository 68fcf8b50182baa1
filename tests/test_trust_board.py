"""Whether the board is what its SPEC says, and whether residuals are noise: what is wrong is found, measured and named."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scenes import BOARD, CAMERA, detections, poses

from camcal.boards.aprilgrid import AprilGrid
from camcal.calibration.board_shape import BOW, SHAPE_NAMES, shape_basis
from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.trust.board_tests import board_deviations, board_findings, spacing_basis
from camcal.trust.structure import board_error_m, structure_findings, structures

NOISE_PX = 0.1
GRID = AprilGrid(5, 4, tag_m=0.03, gap_m=0.009)


class Printed:
    """A board as it really is: some other features under the same ids."""

    def __init__(self, object_points: np.ndarray) -> None:
        self.object_points = object_points


def shaped(*, bow_x: float = 0.0, bow_y: float = 0.0, stretch: float = 0.0) -> Printed:
    """The scene's board with a bow in metres along each axis and a stretch of y."""
    return Printed(BOARD.object_points + shape_basis(BOARD.object_points) @ [bow_x, bow_y, stretch])


def captured(board, *, count: int = 20, seed: int = 0, noise_px: float = NOISE_PX, pose_seed: int = 0, camera: Camera = CAMERA):
    """Views of a board as it is, in the poses of one seed."""
    return detections(poses(count, pose_seed), noise_px=noise_px, seed=seed, board=board, camera=camera)


def deviations(calibration, board=BOARD) -> dict:
    """By the first name of their parameters."""
    return {deviation.names[0]: deviation for deviation in board_deviations(calibration, board)}


def findings(calibration, board=BOARD) -> dict:
    """By code."""
    return {finding.code: finding for finding in board_findings(calibration, board)}


@pytest.mark.parametrize("count", [4, 8, 20])
def test_true_board_is_no_alarm(count):
    """Clean views: no deviation beyond four standard deviations in any of eight captures (by chance: one in a thousand)."""
    for seed in range(8):
        calibration = solve(captured(BOARD, count=count, seed=seed, pose_seed=seed + 50), BOARD.object_points)
        assert all(deviation.length_sigmas < 4 for deviation in board_deviations(calibration, BOARD))
        assert findings(calibration) == {}


@pytest.mark.parametrize("names", BOW)
def test_bow_is_found_and_measured(names):
    """A bow of 0.15 mm on a board of 200 mm in 20 views: found for every noise, its size right to four standard deviations."""
    for seed in range(5):
        bent = shaped(**{names: 1.5e-4})
        calibration = solve(captured(bent, seed=seed, pose_seed=seed, noise_px=(0.05, 0.2)[seed % 2]), BOARD.object_points)
        bow = deviations(calibration)["bow_x"]
        true = np.array([1.5e-4, 0.0]) if names == "bow_x" else np.array([0.0, 1.5e-4])
        assert bow.length_sigmas > 4
        assert (np.abs(bow.values - true) < 4 * bow.sigmas).all()
        found = findings(calibration)["bent_board"]
        assert found.level == "usable"
        assert f"mm along {names[-1]}" in found.text
        told = re.search(r"bowed by ([\d.]+) ± ([\d.]+) mm", found.text)
        assert abs(float(told[1]) - 0.15) < 4 * float(told[2]) + 0.005  # told to two digits


def test_bias_of_a_bow_is_removed():
    """In the mean over eight noisy captures, fx is off by more than 4 sigma without the bow, by less than 1 with it."""
    errors: dict[tuple[str, ...], list[float]] = {(): [], BOW: []}
    for seed in range(8):
        views = captured(shaped(bow_x=1.5e-4), seed=seed)
        for shape, off in errors.items():
            calibration = solve(views, BOARD.object_points, shape=shape)
            off.append((calibration.camera.K[0, 0] - 900) / np.sqrt(calibration.covariance[0, 0]))
    assert abs(np.mean(errors[()])) > 4
    assert abs(np.mean(errors[BOW])) < 1


def test_what_is_solved_for_is_not_tested():
    """With the bow free only the stretch is left to be tested, with everything free nothing."""
    views = captured(shaped(bow_x=5e-4))
    assert list(deviations(solve(views, BOARD.object_points, shape=BOW))) == ["stretch"]
    assert findings(solve(views, BOARD.object_points, shape=BOW)) == {}
    assert deviations(solve(views, BOARD.object_points, shape=SHAPE_NAMES)) == {}


def test_stretched_print():
    """A print 0.4 % longer along y: found, right to four standard deviations, and not taken for a bow."""
    for seed in range(3):
        calibration = solve(captured(shaped(stretch=4e-3), seed=seed, pose_seed=seed), BOARD.object_points)
        stretch = deviations(calibration)["stretch"]
        assert abs(stretch.values[0] - 4e-3) < 4 * stretch.sigmas[0]
        found = findings(calibration)
        assert list(found) == ["stretched_print"]
        assert re.search(r"0\.(3|4)\d* ± 0\.0\d+ % longer along y", found["stretched_print"].text)


def test_shrunk_print_with_a_bow():
    """Both at once are told apart: 0.5 mm along x and 0.4 % shorter."""
    calibration = solve(captured(shaped(bow_x=5e-4, stretch=-4e-3)), BOARD.object_points)
    found = findings(calibration)
    assert set(found) == {"bent_board", "stretched_print"}
    assert "% shorter along y" in found["stretched_print"].text
    assert "along y" not in found["bent_board"].text


def test_stretch_of_upright_boards_is_not_known():
    """Boards that are never turned in their plane and face the camera tell a stretch from fy : fx hardly at all."""
    rng = np.random.default_rng(0)
    centre = BOARD.object_points.mean(axis=0)
    upright = []
    for _ in range(15):
        R = Pose.from_rvec([*rng.uniform(-0.35, 0.35, 2), 0.0], np.zeros(3)).R
        upright.append(Pose(R, rng.uniform([-0.1, -0.08, 0.3], [0.1, 0.08, 0.45]) - R @ centre))
    views = detections(upright, noise_px=NOISE_PX)
    turned = captured(BOARD, count=15)
    known = [deviations(solve(each, BOARD.object_points))["stretch"] for each in (views, turned)]
    assert known[0].sigmas[0] > 5 * known[1].sigmas[0]
    assert known[0].length_sigmas < 4


def test_harmless_bow_is_a_note():
    """Corners exact to a hundredth of a pixel show 5 micrometres of bow, which move the projection by less than 0.1 px."""
    calibration = solve(captured(shaped(bow_x=5e-6), noise_px=0.005), BOARD.object_points)
    assert findings(calibration)["bent_board"].level == "note"


@pytest.mark.parametrize(("real", "named"), [(0.25, 0.3), (0.3, 0.25), (0.3, 0.33)])
def test_wrong_spacing(real, named):
    """The spacing that the corners have is found from those of a SPEC with another one, to three digits."""
    printed, spec = replace(GRID, gap_m=real * GRID.tag_m), replace(GRID, gap_m=named * GRID.tag_m)
    views = detections(poses(12, 3, board=printed), noise_px=NOISE_PX, board=printed)
    found = findings(solve(views, spec.object_points), spec)["wrong_spacing"]
    told = float(re.search(r"fit a spacing of ([\d.]+)", found.text)[1])
    assert abs(told - real) < 5e-4
    assert found.level == "rejected"
    assert f"(the SPEC says {named})" in found.text


def test_true_spacing_is_no_alarm():
    """The same grid with its own SPEC."""
    views = detections(poses(12, 3, board=GRID), noise_px=NOISE_PX, board=GRID)
    calibration = solve(views, GRID.object_points)
    assert findings(calibration, GRID) == {}
    assert set(deviations(calibration, GRID)) == {"bow_x", "stretch", "spacing"}


@pytest.mark.parametrize("first", ["bottom-left", "top-left"])
def test_spacing_basis(first):
    """Moving along the basis by 2 mm gives exactly the features of the grid whose gap is 2 mm wider."""
    grid = replace(GRID, first=first)
    wider = replace(grid, gap_m=grid.gap_m + 0.002)
    assert grid.object_points + 0.002 * spacing_basis(grid)[..., 0] == pytest.approx(wider.object_points, abs=1e-15)


def test_spacing_of_a_checkerboard():
    """A checkerboard has none."""
    with pytest.raises(TypeError, match="only an AprilGrid"):
        spacing_basis(BOARD)


def test_views_that_differ_widen_the_sigmas():
    """Views that are each bent differently, by 0.3 mm and none on average, are no bent board: their scatter is in the sigma."""
    rng = np.random.default_rng(3)
    views = []
    for index, pose in enumerate(poses(16, 2)):
        bent = shaped(bow_x=3e-4 * rng.normal(), bow_y=3e-4 * rng.normal())
        (view,) = detections([pose], noise_px=NOISE_PX, seed=index, board=bent)
        views.append(replace(view, source=f"view_{index:03d}"))
    bow = deviations(solve(views, BOARD.object_points))["bow_x"]
    flat = deviations(solve(captured(BOARD, count=16), BOARD.object_points))["bow_x"]
    assert (bow.sigmas > 3 * flat.sigmas).all()
    assert bow.length_sigmas < 4


def test_noise_has_no_structure():
    """Clean views in every number: nothing beyond five standard deviations, and no finding."""
    for count in (4, 8, 20):
        for seed in range(5):
            calibration = solve(captured(BOARD, count=count, seed=seed, pose_seed=seed), BOARD.object_points)
            assert all(structure.sigmas < 5 for structure in structures(calibration, BOARD))
            assert structure_findings(calibration, BOARD) == ()


def told(calibration) -> tuple[str, str]:
    """Level and text of the only finding on structure."""
    (finding,) = structure_findings(calibration, BOARD)
    return finding.level, finding.text


def test_lens_too_simple_shows_in_rings():
    """A wide lens with k1 alone leaves residuals that go with the radius."""
    wide = Camera(CAMERA.size, CAMERA.K, [-0.3, 0.12, 0, 0, -0.014])
    views = detections(poses(20, 1, camera=wide), noise_px=NOISE_PX, camera=wide)
    level, text = told(solve(views, BOARD.object_points, distortion=("k1",)))
    assert level == "usable"
    assert "distance from the principal point" in text


def test_no_lens_at_all_shows_in_rings():
    """Without any coefficient residuals go with everything; the rings tell what it is, and no bent board is seen in it."""
    calibration = solve(captured(BOARD, pose_seed=1), BOARD.object_points, distortion=())
    assert calibration.rms_px > 1
    assert "distance from the principal point" in told(calibration)[1]
    assert findings(calibration) == {}


def test_bent_board_shows_in_features():
    """A bow of 0.5 mm is the same in every view, and in no ring."""
    assert "the same features are off" in told(solve(captured(shaped(bow_x=5e-4)), BOARD.object_points))[1]


def test_decentred_lens_shows_in_places():
    """Tangential distortion without p1, p2 leaves residuals that go with the place in the image, not with the radius."""
    decentred = Camera(CAMERA.size, CAMERA.K, [-0.25, 0.08, 0.002, -0.003, -0.01])
    views = detections(poses(20, 1, camera=decentred), noise_px=NOISE_PX, camera=decentred)
    _, text = told(solve(views, BOARD.object_points))
    assert "place in the image" in text


@pytest.mark.parametrize("solved", [False, True])
def test_advice_is_not_what_was_done(solved):
    """Neither --warp nor coefficients are advised where they are solved for already."""
    rng = np.random.default_rng(0)
    off = rng.normal(size=(54, 3)) * [1e-4, 1e-4, 0]
    bad = solve(captured(Printed(BOARD.object_points + off)), BOARD.object_points, shape=BOW if solved else ())
    (finding,) = structure_findings(bad, BOARD)
    assert ("--warp" in finding.advice) != solved
    views = captured(BOARD)
    middle = np.array([CAMERA.K[0, 2], CAMERA.K[1, 2]])
    radius = [np.linalg.norm(view.corners_px - middle, axis=1, keepdims=True) for view in views]
    ringed = [
        replace(view, corners_px=view.corners_px + 0.2 * np.sin(r / 12) * (view.corners_px - middle) / r)
        for view, r in zip(views, radius, strict=True)
    ]
    names = ("k1", "k2", "k3", "p1", "p2") if solved else ("k1", "k2", "k3")
    (finding,) = structure_findings(solve(ringed, BOARD.object_points, distortion=names), BOARD)
    assert "principal point" in finding.text
    assert ("--distortion" in finding.advice) != solved
    assert "heck that the lens is no fisheye." in finding.advice


def test_bad_print_shows_in_features():
    """Features off by 0.1 mm along each axis at random: the same in every view, and as far as no pose or camera hides it."""
    rng = np.random.default_rng(0)
    off = rng.normal(size=(54, 3)) * [1e-4, 1e-4, 0]
    calibration = solve(captured(Printed(BOARD.object_points + off)), BOARD.object_points)
    level, text = told(calibration)
    assert level == "usable"
    assert "the same features are off in every view" in text
    # Poses and the lens hide what a cubic map of the board hides, at most.
    x, y = BOARD.object_points[:, :2].T / 0.1
    maps = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
    left = off[:, :2] - maps @ np.linalg.lstsq(maps, off[:, :2], rcond=None)[0]
    least, most = np.sqrt((left**2).sum(axis=1).mean()), np.sqrt((off**2).sum(axis=1).mean())
    assert least < board_error_m(calibration, BOARD) < most


def test_shaken_views_show_between_neighbours():
    """Waves of 0.2 px down each image, each with a phase of its own: neighbours are off alike, and nothing else is."""
    rng = np.random.default_rng(0)
    views = [
        replace(view, corners_px=view.corners_px + 0.2 * np.sin(view.corners_px[:, 1:] / 60 + rng.uniform(0, 6, 2)))
        for view in captured(BOARD)
    ]
    _, text = told(solve(views, BOARD.object_points))
    assert text.startswith("neighbouring corners are off alike")


def test_perfect_corners_have_no_structure():
    """Residuals of 1e-10 px are last bits."""
    calibration = solve(captured(BOARD, noise_px=0.0), BOARD.object_points)
    assert structure_findings(calibration, BOARD) == ()
    assert board_findings(calibration, BOARD) == ()
