"""The accuracy suite: it passes against its own baseline, and fails when accuracy is lost."""

from __future__ import annotations

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from messages import one_line

from camcal.cli import main
from camcal.formats.junit_file import claim_junit, save_junit
from camcal.workflows import observe
from camcal.workflows.regress import FIGURES, worse_figures

SCENE = """\
name: {name}
seed: 5
camera: {{size: [640, 480], fx: 520.0, fy: 523.0, cx: 322.0, cy: 236.0, distortion: {{k1: -0.18, k2: 0.06}}}}
board: "checkerboard:7x6:20mm"
views: {{count: 6, tilt_deg: [10, 40], fill: [0.5, 0.8]}}
"""


@pytest.fixture(scope="module")
def suite(tmp_path_factory):
    """A folder with a small scenario and the baseline of its own run."""
    folder = tmp_path_factory.mktemp("suite")
    (folder / "small.yaml").write_text(SCENE.format(name="small"))
    assert main(["regress", str(folder / "small.yaml"), "--baseline", str(folder / "b.json"), "--update-baseline"]) == 0
    return folder


def test_unchanged_accuracy_passes(suite, run, tmp_path):
    """Against its own baseline nothing is worse; every figure is in the JSON, and JUnit counts one passed case."""
    junit = tmp_path / "junit.xml"
    code, out, _ = run("regress", suite / "small.yaml", "--baseline", suite / "b.json", "--json", "--junit", junit)
    assert code == 0
    result = json.loads(out)["scenarios"]["small"]
    assert set(result["figures"]) == {figure.name for figure in FIGURES}
    assert result["problems"] == []
    root = ElementTree.parse(junit).getroot()
    assert (root.get("tests"), root.get("failures")) == ("1", "0")


def test_corners_are_near_the_bound(suite):
    """At noise 2 and blur 0.7 the corners are within 15 % of the Cramér-Rao bound, and none is an outlier at 5 sigma."""
    figures = json.loads((suite / "b.json").read_text())["scenarios"]["small"]
    assert figures["corner_rms_over_bound"] <= 1.15
    assert figures["corner_max_over_bound"] <= 5
    assert figures["detected_share"] == 1


@pytest.mark.parametrize("refine", ["saddle", "opencv"])
def test_a_refinement_stage_switched_off_fails(suite, run, tmp_path, refine):
    """Without the warped fit, or without both, the corners are worse: exit 5 naming scenario and figure, one failure."""
    junit = tmp_path / "junit.xml"
    code, out, err = run("regress", suite / "small.yaml", "--baseline", suite / "b.json", "--refine", refine, "--junit", junit)
    assert code == 5
    assert "RMS, px" in out
    assert "small: corner_rms_px is " in err
    failure = ElementTree.parse(junit).getroot().find("testcase/failure")
    assert failure is not None
    assert "corner_rms_px" in failure.get("message", "")


def test_one_corner_shifted_by_a_fiftieth_of_a_pixel_fails(suite, run, monkeypatch):
    """A single corner of a single view, off by 0.02 px, is seen."""
    honest = observe.refine_warped

    def shifted(gray, ids, corners_px, board, **known):
        fit = honest(gray, ids, corners_px, board, **known)
        if known["T_cam_board"].t.tobytes() != first[0]:
            return fit
        moved = fit.corners_px.copy()
        moved[20] += np.array([0.02, 0.0])
        return replace(fit, corners_px=moved)

    first: list[bytes] = []
    solve = observe.observe_again

    def again(calibration, *rest, **how):
        first[:] = [calibration.poses[0].t.tobytes()]
        return solve(calibration, *rest, **how)

    monkeypatch.setattr(observe, "refine_warped", shifted)
    monkeypatch.setattr("camcal.workflows.solving.observe_again", again)
    code, _, err = run("regress", suite / "small.yaml", "--baseline", suite / "b.json")
    assert code == 5
    assert "small: corner_max_over_bound is " in err


def test_lost_views_fail():
    """One view less than the baseline has no slack."""
    reference = {"views": 20.0, "corner_rms_px": 0.004}
    assert worse_figures({"views": 20.0, "corner_rms_px": 0.0041}, reference) == ()
    (problem,) = worse_figures({"views": 19.0, "corner_rms_px": 0.004}, reference)
    assert problem == "views is 19 (expected at least 20; baseline 20)"


def test_slack_by_hand():
    """Corner RMS may be 5 % worse: 0.0042 for 0.004; a figure that is not a number is worse than any."""
    reference = {"corner_rms_px": 0.004}
    assert worse_figures({"corner_rms_px": 0.00419}, reference) == ()
    assert worse_figures({"corner_rms_px": 0.00421}, reference) != ()
    assert worse_figures({"corner_rms_px": float("nan")}, reference) != ()


def test_update_keeps_other_scenarios(suite, run, tmp_path):
    """A baseline may hold scenarios that a run does not have; updating one leaves the others."""
    path = tmp_path / "b.json"
    path.write_text('{"scenarios": {"other": {"views": 3}}}')
    assert run("regress", suite / "small.yaml", "--baseline", path, "--update-baseline")[0] == 0
    assert set(json.loads(path.read_text())["scenarios"]) == {"other", "small"}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not a baseline"),
        ("[]", "scenarios: missing"),
        ('{"scenarios": {"small": 3}}', "small: not a mapping"),
        ('{"scenarios": {"small": {"views": "x"}}}', "views: not a finite number"),
        ('{"scenarios": {"other": {}}}', "no figures for small"),
    ],
)
def test_unusable_baselines_are_exit_2(suite, run, tmp_path, content, message):
    """Broken, foreign or incomplete baselines are one line, before any rendering."""
    path = tmp_path / "b.json"
    path.write_text(content)
    code, _, err = run("regress", suite / "small.yaml", "--baseline", path)
    assert code == 2
    assert message in err


def test_unusable_options_are_exit_2(suite, run, tmp_path):
    """No baseline to update, a missing one, two scenarios of one name, an unknown way to refine."""
    (tmp_path / "twin.yaml").write_text(SCENE.format(name="small"))
    small = suite / "small.yaml"
    assert run("regress", small, "--update-baseline")[0] == 2
    assert run("regress", small, "--baseline", tmp_path / "missing.json")[0] == 2
    assert run("regress", small, tmp_path / "twin.yaml")[0] == 2
    assert run("regress", small, "--refine", "magic")[0] == 2


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--html", "mine"), "mine: output file exists and is not a page that camcal wrote."),
        (("--junit", "mine"), "mine: output file exists and is not a JUnit file."),
        (
            ("--baseline", "mine", "--update-baseline"),
            "mine: not a baseline (Expecting value: line 1 column 1 (char 0)). It is left",
        ),
    ],
)
def test_outputs_never_replace_something_else(suite, run, tmp_path, monkeypatch, options, told):
    """What the suite would write over and is not its own is refused in one line, before any rendering, and stays."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("camcal.workflows.regress.measure", pytest.fail)
    content = "<html>about a <testsuite/></html>"
    (tmp_path / "mine").write_text(content)
    code, out, err = run("regress", suite / "small.yaml", *options)
    assert (code, out) == (2, "")
    assert told in one_line(err)
    assert "--update-baseline" not in err
    assert (tmp_path / "mine").read_text() == content


@pytest.mark.parametrize(
    "earlier",
    [
        '<?xml version="1.0" encoding="utf-8"?>\n<!-- of another tool -->\n<testsuites>\n</testsuites>\n',
        "\N{BYTE ORDER MARK}<testsuite name='a'/>",
    ],
)
def test_junit_of_an_earlier_run_is_replaced(tmp_path, earlier):
    """CI writes it again and again: camcal's own, and that of any other tool, make room."""
    path = tmp_path / "junit.xml"
    path.write_text(earlier, encoding="utf-8")
    for _ in range(2):
        save_junit(claim_junit(path), [("small", 1.0, ())])
    assert ElementTree.parse(path).getroot().get("name") == "camcal regress"
