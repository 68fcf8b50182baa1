"""Twins of a capture: rendered with its look, calibrated as it was, and the table of their errors."""

from __future__ import annotations

import json
from dataclasses import replace
from math import sqrt

import numpy as np
import pytest
from corner_scenes import LOOK

from camcal.cli.twin_table import print_twin
from camcal.errors import InputError, SolveError
from camcal.formats.board_file import load_board
from camcal.formats.images import find_images, read_gray, write_image
from camcal.geometry.pose import Pose
from camcal.workflows.calibrate import calibrate
from camcal.workflows.looks import measured_looks
from camcal.workflows.reporting import SilentReporter
from camcal.workflows.twin import Twin, render_look, run_twins


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
