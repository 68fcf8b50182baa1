"""The verdict on captures that are broken in a known way, through the public API: the right first finding in every one."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from broken_boards import CASES as BROKEN_BOARDS
from broken_boards import curled_paper
from broken_cameras import CASES as BROKEN_CAMERAS
from broken_captures import TRUSTED, Capture, Case
from broken_corners import CASES as BROKEN_CORNERS
from broken_images import CASES as RENDERED
from broken_images import HARMLESS as HARMLESS_IMAGES
from broken_photographs import CASES as PHOTOGRAPHED
from broken_photographs import HARMLESS as HARMLESS_PHOTOGRAPHS
from broken_photographs import TOLD
from broken_stances import CASES as BROKEN_STANCES
from broken_stances import one_side_only
from capture_scenes import BOARD, NOISE_PX, ordinary_poses, see, written
from harmless_captures import CASES as HARMLESS

from camcal.errors import CamcalError
from camcal.formats.images import write_image
from camcal.formats.scenario_file import load_scenario
from camcal.resources import config_names, config_path
from camcal.synthesis.poses import sample_poses
from camcal.synthesis.render import render_view
from camcal.verdict import Verdict
from camcal.workflows.calibrate import calibrate
from camcal.workflows.reporting import SilentReporter

MADE = BROKEN_CORNERS | BROKEN_STANCES | BROKEN_CAMERAS | BROKEN_BOARDS
SEED = 0
CLEAN_SEEDS = range(4)
CLEAN_VIEWS = 8
LARGEST_WIDTH = 1500


def judged(capture: Capture, folder: Path) -> Verdict | CamcalError:
    """Calibrate as a user would: the verdict, or the error that took its place."""
    images = capture.images or written(capture.views, folder)
    try:
        run = calibrate(images, capture.board, reporter=SilentReporter(), jobs=1, **capture.options)
    except CamcalError as error:
        return error
    return run.verdict


def check(case: Case, said: Verdict | CamcalError) -> None:
    """Fail unless the first thing said is the right one."""
    if isinstance(said, CamcalError):
        assert case.refused, f"exit {said.exit_code}: {said}"
        assert said.exit_code in {3, 4}
        assert re.search(case.refused, str(said)), str(said)
        return
    listed = "\n".join(f"{finding.level} {finding.code}: {finding}" for finding in said.findings) or "nothing"
    assert case.codes, f"{said.word}, expected an error that says {case.refused!r}\n{listed}"
    assert said.findings, f"{said.word}, nothing found"
    assert said.findings[0].code in case.codes, listed
    assert said.word in case.words, listed


@pytest.mark.parametrize("name", MADE)
def test_made_corners(name, tmp_path):
    """Corners of a broken capture: the first finding, or the error, names the cause."""
    case = MADE[name]
    check(case, judged(case.make(SEED), tmp_path))


@pytest.mark.parametrize("name", RENDERED)
def test_rendered_images(name, tmp_path):
    """The same from pixels."""
    case = RENDERED[name]
    check(case, judged(case.make(SEED, tmp_path), tmp_path))


@pytest.mark.parametrize("name", PHOTOGRAPHED)
def test_photographs(name, tmp_path, photos):
    """The same of photographs with a defect, or with a wrong SPEC or lens."""
    case = PHOTOGRAPHED[name]
    check(case, judged(case.make(SEED, tmp_path, photos), tmp_path))


@pytest.mark.parametrize("name", TOLD)
def test_what_must_be_told(name, tmp_path, photos):
    """Photographs with a weakness that is not the gravest: it is among the findings, and the word is as it should be."""
    case = TOLD[name]
    said = judged(case.make(SEED, tmp_path, photos), tmp_path)
    assert isinstance(said, Verdict), said
    assert set(case.codes) <= {finding.code for finding in said.findings}
    assert said.word in case.words


def check_trusted(said: Verdict | CamcalError, words: tuple[str, ...] = TRUSTED) -> None:
    """Fail unless there is a camera to be trusted."""
    assert isinstance(said, Verdict), said
    assert said.word in words, "\n".join(f"{finding.level} {finding.code}: {finding}" for finding in said.findings)


@pytest.mark.parametrize("name", HARMLESS)
def test_harmless_corners(name, tmp_path):
    """What only looks broken is good or usable."""
    check_trusted(judged(HARMLESS[name].make(SEED), tmp_path))


@pytest.mark.parametrize("name", HARMLESS_IMAGES)
def test_harmless_images(name, tmp_path):
    """The same from pixels."""
    check_trusted(judged(HARMLESS_IMAGES[name].make(SEED, tmp_path), tmp_path))


@pytest.mark.parametrize("name", HARMLESS_PHOTOGRAPHS)
def test_harmless_photographs(name, tmp_path, photos):
    """The same of photographs, and of photographs as they are."""
    check_trusted(judged(HARMLESS_PHOTOGRAPHS[name].make(SEED, tmp_path, photos), tmp_path))


@pytest.mark.parametrize("name", config_names())
def test_no_false_alarm_on_clean_corners(name, tmp_path):
    """Corners of every shipped scenario, four draws of poses and noise each: good."""
    scenario = load_scenario(config_path(name))
    for seed in CLEAN_SEEDS:
        poses = sample_poses(replace(scenario, seed=1000 + seed))
        views = see(poses, seed, scenario.camera, scenario.board, noise_px=NOISE_PX)
        check_trusted(judged(Capture(views, board=scenario.board.spec), tmp_path), ("good",))


@pytest.mark.parametrize("name", config_names())
def test_no_false_alarm_on_clean_images(name, tmp_path):
    """Eight rendered views of every shipped scenario, large sensors binned, from pixels: good or usable."""
    scenario = load_scenario(config_path(name))
    width, height = scenario.camera.size
    binning = -(-width // LARGEST_WIDTH)
    scenario = replace(scenario, camera=scenario.camera.scaled((width // binning, height // binning)))
    for index in range(CLEAN_VIEWS):
        view = render_view(scenario, index)
        write_image(tmp_path / view.detection.source, view.image)
    check_trusted(judged(Capture(images=str(tmp_path), board=scenario.board.spec), tmp_path))


@pytest.mark.parametrize("noise_px", [0.02, 0.1])
def test_good_at_any_ordinary_noise(noise_px, tmp_path):
    """An ordinary capture is good with little noise and with much."""
    check_trusted(judged(Capture(see(ordinary_poses(16, 5), 5, noise_px=noise_px)), tmp_path), ("good",))


def test_a_rejected_capture_leaves_with_its_code(run, tmp_path):
    """Rejected on the command line: exit code 5, the cause on the screen and inside the camera file."""
    capture = Capture(see(ordinary_poses(16, SEED), SEED, board=BOARD), board="checkerboard:9x6:25mm")
    stretched = [replace(view, size=(1920, 960), corners_px=view.corners_px * [1.5, 1]) for view in capture.views]
    arguments = (written(stretched, tmp_path), "--board", capture.board, "-o", tmp_path / "out")
    code, out, err = run("calibrate", *arguments, page=True)
    assert code == 5
    assert "fx / fy is 1.49" in out + err
    text = (tmp_path / "out/camera.yaml").read_text()
    assert "rejected" in text
    assert "odd_aspect" in text
    assert yaml.safe_load(text)["camcal"]


@pytest.mark.parametrize(("make", "demand", "code"), [(one_side_only, "usable", 0), (one_side_only, "good", 5)])
def test_a_demand_that_is_not_met(run, make, demand, code, tmp_path):
    """--require turns what is usable into a failure where good is demanded."""
    capture = make(SEED)
    path = written(capture.views, tmp_path)
    arguments = (path, "--board", capture.board, "-o", tmp_path / "out", "--require", demand)
    assert run("calibrate", *arguments)[0] == code


def test_a_bent_board_is_mended_by_its_advice(tmp_path):
    """What the finding advises, --warp, takes the finding away and leaves a good capture."""
    capture = curled_paper(SEED)
    assert judged(capture, tmp_path).findings[0].code == "bent_board"
    check_trusted(judged(replace(capture, options={"warp": True}), tmp_path), ("good",))


def test_every_case_says_what_is_wrong():
    """Each function's docstring is the one-line description of its case; there are at least thirty, of every kind."""
    suites = [MADE, RENDERED, PHOTOGRAPHED, TOLD, HARMLESS, HARMLESS_IMAGES, HARMLESS_PHOTOGRAPHS]
    for case in [case for suite in suites for case in suite.values()]:
        assert case.make.__doc__
        assert "\n" not in case.make.__doc__.strip()
    assert len(MADE) + len(RENDERED) + len(PHOTOGRAPHED) >= 30
    assert min(len(RENDERED), len(PHOTOGRAPHED)) >= 5
