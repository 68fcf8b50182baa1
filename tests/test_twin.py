"""Tests of the twin: the look of a photograph measured, rendered anew, and the errors of what is calibrated from it."""

from __future__ import annotations

import json
from dataclasses import replace
from math import erf, sqrt

import numpy as np
import pytest
from corner_scenes import BOARD, scene
from scenes import CAMERA

from camcal.cli.twin_table import print_twin
from camcal.compare.projection import predicted_difference_px
from camcal.compare.twins import twin_errors
from camcal.errors import InputError, SolveError
from camcal.formats.board_file import load_board
from camcal.formats.images import find_images, read_gray, write_image
from camcal.geometry.pose import Pose
from camcal.records import Intrinsics
from camcal.refinement.look import Look, completed_looks, flat_noise, measured_look
from camcal.refinement.warped import refine_warped
from camcal.synthesis.psf import sharpened
from camcal.synthesis.scenario import Light, Sensor
from camcal.workflows.calibrate import calibrate
from camcal.workflows.looks import measured_looks
from camcal.workflows.reporting import SilentReporter
from camcal.workflows.twin import Twin, render_look, run_twins

LOOK = Look(
    blur_sigma_px=0.7,
    overshoot=0.0,
    noise=0.008,
    unexplained=0.008,
    ink=0.15,
    paper=0.86,
    background=0.5,
    gradient=0.0,
    gradient_direction_deg=0.0,
    bits=8,
)


def seen_again(folder):
    """Calibrate a folder of the small scenario's twins as `calibrated` was."""
    return calibrate(folder, "checkerboard:7x6:20mm", reporter=SilentReporter()).calibration


@pytest.fixture(scope="module")
def capture(dataset):
    """The small scenario's board, images and calibration."""
    images = dataset / "images"
    return load_board(str(dataset / "board.yaml")), find_images([images]).images, seen_again(images)


@pytest.fixture(scope="module")
def twins(capture) -> Twin:
    """Four twins of it."""
    board, found, calibration = capture
    return run_twins(calibration, board, found, seen_again, 4)


def fitted_look(made):
    """Measure the look of a rendered scene, with the fit that its true camera predicts; the noise is left out."""
    fit = refine_warped(made.image, made.ids, made.corners_px, made.board, camera=made.camera, T_cam_board=made.pose)
    return measured_look(made.image, fit)


class TestLook:
    """What is measured of an image is what it was rendered with."""

    @pytest.mark.parametrize("blur", [0.5, 0.9, 2.0])
    def test_levels_and_blur(self, blur):
        """Blur within 5 %, ink and paper within half a level of 255, a slope of the light within 0.01."""
        light = Light(white=0.8, black=0.1, background=0.6, gradient=0.2, gradient_direction_deg=30.0)
        look = fitted_look(scene(3, light=light, sensor=Sensor(blur_sigma_px=blur)))
        assert look.blur_sigma_px == pytest.approx(blur, rel=0.05)
        assert (look.ink, look.paper) == pytest.approx((0.1, 0.8), abs=0.5 / 255)
        slope = look.gradient * np.exp(1j * np.radians(look.gradient_direction_deg))
        assert abs(slope - 0.2 * np.exp(1j * np.radians(30))) < 0.01
        assert look.bits == 8

    def test_deep_image(self):
        """A 12-bit image stored in 16 bits has small shares of full scale."""
        look = fitted_look(scene(2, light=Light(white=0.8 / 16, black=0.1 / 16), sensor=Sensor(0.7, 0, 2 / 16, bits=16)))
        assert (look.ink, look.paper, look.bits) == (pytest.approx(0.1 / 16, rel=0.05), pytest.approx(0.8 / 16, rel=0.01), 16)

    def test_background_is_bright(self):
        """A dark room behind the board is rendered half-way between ink and paper."""
        look = fitted_look(scene(3, light=Light(background=0.0), fill=(0.35, 0.4)))
        assert look.background == pytest.approx(0.5 * (look.ink + look.paper))

    def test_nothing_accepted(self):
        """Without a corner there is no look."""
        made = scene(1)
        empty = np.full_like(made.image, 128)
        fit = refine_warped(empty, made.ids, made.corners_px, BOARD, camera=CAMERA, T_cam_board=made.pose)
        assert measured_look(empty, fit) is None

    def test_steep_light_stays_positive(self):
        """Light that seems to vanish within the image is rendered no steeper than 0.8 over half the diagonal."""
        made = scene(3, light=Light(gradient=0.95))
        assert fitted_look(made).gradient == pytest.approx(0.8)


class TestFlatNoise:
    """Noise is measured where the image is even."""

    @staticmethod
    def masks(shape):
        """Ink on the left half, paper on the right."""
        left = np.zeros(shape, dtype=bool)
        left[:, : shape[1] // 2] = True
        return left, ~left

    @pytest.mark.parametrize(("ink_levels", "paper_levels"), [(2.0, 2.0), (1.0, 3.0), (0.0, 4.0)])
    def test_mean_variance(self, ink_levels, paper_levels):
        """Independent noise of ink and paper gives the root of their mean variance; a slope of the light changes little.

        A slope of 0.05 levels per pixel adds 2 · 0.05² = 0.005 to the variance in a window of five. 14,400 pixels are 576
        windows of 24 degrees of freedom, whose median variance is known to 1.25 · √(2 / 24 / 576) = 1.5 %, half of that for
        the deviation; windows that overlap do better. Allowed are four times that.
        """
        left, right = self.masks((120, 240))
        rng = np.random.default_rng(1)
        level = np.where(left, 40.0, 200.0) + 0.05 * np.arange(240)
        image = level + rng.normal(size=left.shape) * np.where(left, ink_levels, paper_levels)
        expected = sqrt((ink_levels**2 + paper_levels**2) / 2)
        measured = flat_noise(np.rint(image).astype(np.uint8), left, right)
        assert measured * 255 == pytest.approx(expected, rel=0.035)

    def test_dust(self):
        """Specks on a hundredth of the image do not count: a fifth of the windows hold one, which moves the median a little."""
        left, right = self.masks((120, 240))
        rng = np.random.default_rng(2)
        image = 128 + 2 * rng.normal(size=left.shape)
        image[rng.random(left.shape) < 0.01] = 255
        assert flat_noise(np.rint(image).astype(np.uint8), left, right) * 255 == pytest.approx(2.0, rel=0.15)

    def test_too_little(self):
        """Few even pixels tell nothing; one colour is enough."""
        left, _ = self.masks((120, 240))
        nothing = np.zeros_like(left)
        image = np.full(left.shape, 100, dtype=np.uint8)
        assert np.isnan(flat_noise(image, nothing, nothing))
        assert flat_noise(image, left, nothing) == 0.0

    def test_float_image(self):
        """Pixels that are floats are not rounded, and their largest value is full scale."""
        left, right = self.masks((120, 240))
        image = (1000 + 5 * np.random.default_rng(3).normal(size=left.shape)).astype(np.float32)
        assert flat_noise(image, left, right) * float(image.max()) == pytest.approx(5.0, rel=0.03)


class TestCompletedLooks:
    """What is not known of a view is what is typical of the others."""

    def test_filled(self):
        """A view without a look gets medians and even light; one without noise gets the others' noise."""
        other = replace(LOOK, blur_sigma_px=0.9, gradient=0.3, noise=0.01)
        silent = replace(LOOK, blur_sigma_px=1.1, noise=float("nan"))
        first, second, third, missing = completed_looks([LOOK, other, silent, None])
        assert (first, second) == (LOOK, other)
        assert third.noise == pytest.approx(0.009)
        assert (missing.blur_sigma_px, missing.noise, missing.gradient) == pytest.approx((0.9, 0.009, 0.0))

    def test_no_flat_part_anywhere(self):
        """Without any even part the noise is what the fits leave unexplained."""
        (only,) = completed_looks([replace(LOOK, noise=float("nan"), unexplained=0.02)])
        assert only.noise == 0.02

    def test_nothing_known(self):
        """Nothing comes of nothing."""
        assert completed_looks([None, None]) == ()


class TestSharpened:
    """Sharpening is a fringe on both sides of every edge."""

    @pytest.mark.parametrize("angle_deg", [0.0, 45.0, 20.0])
    def test_edge(self, angle_deg):
        """An edge Φ(a) becomes Φ(a) + o/2 He3(a) φ(a), at any angle.

        A stencil of tenth order is off by 1/16632 of the twelfth derivative. Twice applied to Φ it is off by 2/16632 of the
        fourteenth, at most 0.43 √13! / blur¹⁴ by Cramér's inequality: 0.35 blur⁴ times that is 0.0014 for a blur of 2 px.
        """
        blur, overshoot = 2.0, -0.7
        y, x = np.mgrid[-30:31, -30:31].astype(float)
        a = (np.cos(np.radians(angle_deg)) * x + np.sin(np.radians(angle_deg)) * y) / blur
        edge = 0.5 * (1 + np.vectorize(erf)(a / sqrt(2)))
        expected = edge + overshoot / 2 * (a**3 - 3 * a) * np.exp(-(a**2) / 2) / sqrt(2 * np.pi)
        inside = np.s_[12:-12, 12:-12]
        assert np.abs(sharpened(edge, blur, overshoot) - expected)[inside].max() < 0.0014

    def test_none(self):
        """A disc of defocus, whose overshoot is positive, is not taken for sharpening."""
        image = np.zeros((9, 9))
        assert sharpened(image, 1.0, 0.05) is image

    def test_measured_again(self):
        """A sharpened render measures as such; the stencil falls a little short of its finest detail."""
        made = scene(3)
        image = render_look(
            CAMERA, BOARD, made.pose, replace(LOOK, blur_sigma_px=0.9, overshoot=-0.8), np.random.default_rng(1)
        )
        look = fitted_look(replace(made, image=image))
        assert look.overshoot == pytest.approx(-0.8, abs=0.1)
        assert look.blur_sigma_px == pytest.approx(0.9, rel=0.05)


class TestTwinErrors:
    """What twins got wrong, from cameras that are known to the last digit."""

    SIGMA = np.array([0.05, 0.06, 0.03, 0.02, 1e-4, 2e-4, 1e-4])

    def known(self, camera=CAMERA, factor=1.0) -> Intrinsics:
        """A camera whose parameters are known to some standard deviations, without correlations."""
        free = ("fx", "fy", "cx", "cy", "k1", "k2", "k3")
        return Intrinsics(camera, free=free, covariance=np.diag((factor * self.SIGMA) ** 2))

    def moved(self, steps, factor=1.0) -> Intrinsics:
        """The camera with its free parameters off by some standard deviations."""
        values = CAMERA.intrinsics.copy()
        columns = [CAMERA.intrinsic_names.index(name) for name in self.known().free]
        values[columns] += self.SIGMA * np.asarray(steps)
        return self.known(CAMERA.with_intrinsics(values), factor)

    def test_parameters(self):
        """Errors of +3 and -1 standard deviations have a mean of 1 and a root mean square of √5."""
        errors = twin_errors(self.known(), [self.moved([3] * 7), self.moved([-1] * 7)])
        for parameter, sigma in zip(errors.parameters, self.SIGMA, strict=True):
            assert parameter.predicted == pytest.approx(sigma)
            assert parameter.bias == pytest.approx(sigma)
            assert parameter.actual == pytest.approx(sqrt(5) * sigma)
            assert parameter.claimed == pytest.approx(sigma)
            assert parameter.ratio == pytest.approx(sqrt(5))

    @pytest.mark.parametrize(("made", "claimed"), [(1.0, 1.0), (0.1, 0.2), (4.0, 1.0)])
    def test_ratio(self, made, claimed):
        """Errors drawn from the covariance times a factor give that ratio, within four of its standard deviations.

        The same where it is told from what the twins claim themselves, and in every part of the image. The projection is
        linear in errors this small.
        """
        rng = np.random.default_rng(5)
        errors = twin_errors(self.known(), [self.moved(made * rng.normal(size=7), claimed) for _ in range(60)])
        doubt = 4 / sqrt(2 * 60)
        assert errors.calibrated == 60
        assert errors.ratio_error == pytest.approx(1 / sqrt(120))
        assert errors.ratio == pytest.approx(made, rel=doubt)
        assert errors.honesty == pytest.approx(made / claimed, rel=doubt)
        for part in errors.projection:
            assert part.ratio == pytest.approx(made, rel=doubt)
        assert errors.projection[-1].ratio == errors.ratio
        meaning = {1.0: "as predicted", 0.1: "what limits it is not noise", 4.0: "more than predicted"}
        assert errors.meaning.startswith(meaning[made])

    def test_parts(self):
        """Each part of the image is the prediction there: the grid holds the corners, and the centre but for half a cell."""
        truth = self.known()
        predicted = predicted_difference_px(truth).reshape(48, 64)
        part = {each.place: each.predicted_px for each in twin_errors(truth, [truth]).projection}
        ends = predicted[[0, 0, -1, -1], [0, -1, -1, 0]]
        assert part["corners"] == pytest.approx(sqrt((ends**2).mean()))
        middle = predicted[23:25, 31:33]
        assert middle.min() <= part["centre"] <= middle.max()
        assert part["image"] == pytest.approx(sqrt((predicted**2).mean()))
        assert part["centre"] < part["edges"] < part["corners"]

    def test_no_error(self):
        """Twins that recover the truth exactly make no error."""
        errors = twin_errors(self.known(), [self.known()])
        assert errors.ratio == pytest.approx(0.0, abs=1e-9)
        assert errors.compared_share == 1.0

    def test_fold(self):
        """Where the true lens has no answer nothing is compared, and the corners say so."""
        folding = CAMERA.with_intrinsics([900, 905, 645.3, 470.2, *([0] * (CAMERA.intrinsics.size - 4))])
        values = folding.intrinsics.copy()
        values[folding.intrinsic_names.index("k1")] = -0.6
        truth = self.known(folding.with_intrinsics(values))
        errors = twin_errors(truth, [truth])
        assert 0.3 < errors.compared_share < 1.0
        assert np.isnan(errors.projection[2].actual_px)
        assert np.isfinite(errors.ratio)

    def test_held_coefficient(self):
        """A twin that holds a coefficient at 0 is off by all of it, and claims no standard deviation."""
        values = CAMERA.intrinsics.copy()
        values[CAMERA.intrinsic_names.index("k3")] = 0.0
        held = Intrinsics(CAMERA.with_intrinsics(values), free=self.known().free[:-1], covariance=np.diag(self.SIGMA[:-1] ** 2))
        last = twin_errors(self.known(), [held]).parameters[-1]
        assert (last.name, last.actual) == ("k3", pytest.approx(0.01))
        assert np.isnan(last.claimed)


class TestRunTwins:
    """Twins of a rendered capture, calibrated from their pixels."""

    def test_error_is_the_predicted_one(self, twins):
        """On a clean capture the error made is the predicted one, within four standard deviations of four twins' ratio."""
        assert twins.failures == ()
        assert twins.lost == {}
        for ratio in (twins.errors.ratio, twins.errors.honesty):
            assert abs(ratio - 1) < 4 * twins.errors.ratio_error
        assert twins.errors.compared_share == 1.0

    def test_residuals_are_those_of_the_photographs(self, twins):
        """So are the residuals: 2 x 336 of them have a root mean square known to 1 / √(2 · 672) = 2.7 %."""
        assert twins.rms_px == pytest.approx(twins.photographs_rms_px, rel=4 * 0.027 * sqrt(1 + 1 / 4))
        assert twins.corners == twins.photographs_corners == 336

    def test_look(self, capture):
        """What is measured of the images is what they were rendered with, noise and blur within 5 %."""
        board, found, calibration = capture
        looks = measured_looks(calibration, board, found, None)
        assert len(looks) == 8
        for look in looks:
            assert look.noise * 255 == pytest.approx(2.0, rel=0.05)
            assert look.blur_sigma_px == pytest.approx(0.7, rel=0.05)
            assert (look.ink, look.paper) == pytest.approx((0.15, 0.86), abs=0.5 / 255)

    def test_reproducible(self, capture):
        """Neither parallel work nor their number changes a bit of a twin; every twin, view and seed has its own noise."""
        board, found, calibration = capture

        def pixels(count=1, **options):
            seen = []

            def reading(folder):
                seen.append([read_gray(path).tobytes() for path in sorted(folder.iterdir())])
                raise SolveError("solve: only looking.")

            run_twins(calibration, board, found, reading, count, **options)
            return seen

        first, second = pixels(2, jobs=2)
        assert pixels(jobs=1) == [first]
        assert len({*first, *second, *pixels(seed=1)[0]}) == 24

    def test_one_at_a_time(self, capture, tmp_path, monkeypatch):
        """One twin at a time lies on the disk, in the photographs' order, and nothing stays behind."""
        board, found, calibration = capture
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
        held = []

        def count_images(folder):
            held.append(sorted(path.name for path in tmp_path.rglob("*.pgm")))
            assert read_gray(folder / held[-1][0]).shape == (480, 640)
            raise SolveError("solve: not today.")

        twin = run_twins(calibration, board, found, count_images, 2)
        assert [len(names) for names in held] == [8, 8]
        assert list(tmp_path.iterdir()) == []
        assert twin.failures == ("solve: not today.",) * 2
        assert twin.errors is None
        assert np.isnan(twin.rms_px)

    def test_lost_views(self, capture):
        """A view that a twin loses is named as the photograph is, with how often and why."""
        board, found, calibration = capture

        def blind(folder):
            for path in (folder / "view_000002.pgm", folder / "view_000005.pgm"):
                write_image(path, np.full((480, 640), 128, dtype=np.uint8))
            return seen_again(folder)

        twin = run_twins(calibration, board, found, blind, 1)
        assert set(twin.lost) == {"view_0002.png", "view_0005.png"}
        assert twin.lost["view_0002.png"].startswith("1 of 1: ")
        assert twin.errors.calibrated == 1

    def test_view_that_cannot_be_rendered(self, capture):
        """A pose that shows the back of the board is named; the others are rendered without it."""
        board, found, calibration = capture
        first, *others = calibration.poses
        turned = Pose(first.R @ np.diag([-1.0, 1.0, -1.0]), first.t)
        twin = run_twins(replace(calibration, poses=(turned, *others)), board, found, seen_again, 1)
        assert "back of the board" in twin.lost["view_0000.png"]
        assert twin.corners == 7 * 42

    def test_none_can_be_rendered(self, capture):
        """If that is so of all, each twin has failed."""
        board, found, calibration = capture
        turned = tuple(Pose(pose.R @ np.diag([-1.0, 1.0, -1.0]), pose.t) for pose in calibration.poses)
        twin = run_twins(replace(calibration, poses=turned), board, found, seen_again, 2)
        assert len(twin.failures) == 2
        assert twin.errors is None

    def test_lens_without_a_pixel_in_common(self, capture):
        """A twin whose lens has nothing in common with the true one has failed, too."""
        board, found, calibration = capture
        values = calibration.camera.intrinsics.copy()
        values[calibration.camera.intrinsic_names.index("k1")] = -1e9
        astray = replace(calibration, camera=calibration.camera.with_intrinsics(values))
        twin = run_twins(calibration, board, found, lambda _: astray, 1)
        assert "no valid pixel in common" in twin.failures[0]

    def test_count(self, capture):
        """No twins at all is a mistake in the command."""
        board, found, calibration = capture
        with pytest.raises(InputError, match="--twin"):
            run_twins(calibration, board, found, seen_again, 0)

    def test_deep_image(self, capture):
        """A 16-bit photograph has a 16-bit twin; without noise its ink and paper are exact to 1/10000 of full scale."""
        board, _, calibration = capture
        deep = replace(LOOK, bits=16, noise=0.0)
        image = render_look(calibration.camera, board, calibration.poses[0], deep, np.random.default_rng(1))
        assert image.dtype == np.uint16
        assert (float(image.min()), float(image.max())) == pytest.approx((0.15 * 65535, 0.86 * 65535), abs=6.6)

    def test_json(self, twins):
        """Everything can be written as JSON."""
        plain = json.loads(json.dumps(twins.as_dict()))
        assert plain["count"] == 4
        assert plain["errors"]["ratio"] == twins.errors.ratio
        assert [part["place"] for part in plain["errors"]["projection_px"]] == ["centre", "edges", "corners", "image"]


class TestTable:
    """What a person reads."""

    def test_fits_a_terminal(self, twins, capsys):
        """A row for each parameter and part of the image, the one number with its meaning, in 80 columns."""
        print_twin(twins)
        lines = capsys.readouterr().out.splitlines()
        assert max(map(len, lines)) <= 80
        assert lines[0] == "Twin: this capture rendered 4 times and calibrated from its pixels"
        rows = {line.split()[0] for line in lines if line}
        assert {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "image,", "error", "RMS"} <= rows
        assert not rows & {"lost", "failed"}
        assert "as predicted" in "".join(lines)

    def test_trouble(self, twins, capsys):
        """Views lost and twins that failed are told, the first few by name."""
        lost = {f"{name}.png": "4 of 4: no board" for name in "abc"}
        print_twin(replace(twins, count=5, failures=("solve: no.",), lost=lost))
        printed = capsys.readouterr().out
        assert "a.png in 4 of 4: no board; b.png in 4 of 4: no board; and 1 more" in printed
        assert "failed  1 of 5: solve: no." in printed

    def test_none_solved(self, twins, capsys):
        """Without any twin that could be calibrated there is no table, but the reason."""
        nan = float("nan")
        print_twin(replace(twins, count=2, errors=None, rms_px=nan, corners=nan, failures=("solve: no.", "solve: no.")))
        assert capsys.readouterr().out == "failed  2 of 2: solve: no.\n"


def test_photographs(photos):
    """The twin of photographs loses no view, and its corners are far better than theirs: their board is not flat."""
    spec, images = "checkerboard:9x6:25mm", photos / "opencv_left"
    calibration = calibrate([images], spec, reporter=SilentReporter()).calibration

    def again(folder):
        return calibrate([folder], spec, reporter=SilentReporter()).calibration

    twin = run_twins(calibration, load_board(spec), find_images([images]).images, again, 1)
    assert twin.lost == {}
    assert twin.rms_px < 0.1 * twin.photographs_rms_px
    assert twin.errors.ratio < 0.3
    assert twin.errors.honesty < 1 + 4 * twin.errors.ratio_error
