"""Typing errors anywhere are answered with the nearest match, and what is like nothing is not."""

from __future__ import annotations

import pytest
from messages import one_line

from camcal.boards.spec import parse_board
from camcal.calibration.parameters import parse_distortion
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.corners_file import load_corners
from camcal.formats.scenario_file import load_scenario
from camcal.nearest import did_you_mean, nearest
from camcal.resources import config_path


@pytest.mark.parametrize(
    ("text", "known", "meant"),
    [
        ("kalbir", ("ros", "kalibr", "colmap"), "kalibr"),
        ("ROS", ("ros", "kalibr"), "ros"),
        ("wide", ("webcam_720p", "wide_action"), "wide_action"),
        ("board_9x6", ("board", "board_9x6_25mm"), "board_9x6_25mm"),
        ("k9", ("k1", "p1"), "k1"),
        ("colour", ("ros", "kalibr"), None),
        ("", ("ros",), None),
        ("w", ("wide_action",), None),
        ("ros", (), None),
    ],
)
def test_nearest(text, known, meant):
    """Swapped letters, another case, a beginning, half of a short name; nothing for what is like nothing."""
    assert nearest(text, known) == meant
    assert did_you_mean(text, known) == ("" if meant is None else f" Did you mean '{meant}'?")


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("calibrat", "photos"), "'calibrate'"),
        (("Verify", "a"), "'verify'"),
        (("calibrate", "photos", "--bord", "b"), "'--board'"),
        (("calibrate", "photos", "--board", "b", "-o", "c", "--requrie", "good"), "'--require'"),
        (("calibrate", "photos", "--board", "b", "-o", "c", "--require", "god"), "'good'"),
        (("calibrate", "photos", "--board", "b", "-o", "c", "--refine", "sadle"), "'saddle'"),
        (("calibrate", "photos", "--board", "checkerboard:9x6:25mm", "-o", "c", "--distortion", "k1,k9"), "'k6'"),
        (("calibrate", "photos", "--board", "checkerboard:9x6:25mm", "-o", "c", "--distortion", "atuo"), "'auto'"),
        (("undistort", "photos", "--camera", "c", "-o", "u", "--interpolation", "cubik"), "'cubic'"),
        (("undistort", "photos", "--camera", "c", "-o", "u", "--crop", "vaild"), "'valid'"),
        (("board", "apriltag_6x6", "-o", "b.pdf"), "'aprilgrid_6x6_34mm_a3'"),
        (("board", "checkerboard_9x6", "-o", "b.pdf"), "'checkerboard_9x6_25mm_a4'"),
        (("board", "chekerboard:9x6:25mm", "-o", "b.pdf"), "'checkerboard'"),
        (("board", "aprilgrid:6x6:30mm:0.3:famly=tag36h11", "-o", "b.pdf"), "'family'"),
        (("board", "aprilgrid:6x6:30mm:0.3:family=tag36h12", "-o", "b.pdf"), "'tag36h1"),
        (("board", "checkerboard:9x6:25mm", "-o", "b.pdf", "--paper", "leter"), "'letter'"),
        (("synth", "webcam", "-o", "d"), "'webcam_720p'"),
        (("regress", "phone_12pm"), "'phone_12mp'"),
        (("completion", "bsh"), "'bash'"),
        (("export", "camera.yaml", "--to", "kalbir"), "'kalibr'"),
        (("import", "camera.yaml", "-o", "c.yaml", "--from", "nerfstdio"), "'nerfstudio'"),
    ],
)
def test_the_command_line_names_what_was_meant(run, arguments, meant, tmp_path, monkeypatch):
    """Commands, options, choices, boards, their kinds and options, papers, coefficients, scenarios: exit 2, in one line."""
    monkeypatch.chdir(tmp_path)
    code, _, err = run(*arguments)
    assert code == 2
    assert f"Did you mean {meant}" in one_line(err)
    assert list(tmp_path.iterdir()) == []


def test_keys_of_a_yaml_file(tmp_path):
    """A key, at the top and below, and a word among a few: with file and line."""
    scene = config_path("webcam_720p").read_text()
    path = tmp_path / "scene.yaml"
    for right, wrong, meant in (("seed:", "sed:", "seed"), ("tilt_deg:", "tlit_deg:", "tilt_deg")):
        assert right in scene
        path.write_text(scene.replace(right, wrong))
        with pytest.raises(InputError, match=rf"scene\.yaml:\d+: .*{wrong[:-1]}: unknown key .* Did you mean '{meant}'\?"):
            load_scenario(path)
    for content, meant in (
        ("type: chekerboard\ncolumns: 9\nrows: 6\nsquare_m: 0.025\n", "checkerboard"),
        ("type: checkerboard\ncolumns: 9\nrow: 6\nsquare_m: 0.025\n", "rows"),
    ):
        path.write_text(content)
        with pytest.raises(InputError, match=rf"scene\.yaml:\d: .*Did you mean '{meant}'\?"):
            load_board(str(path))


def test_columns_of_a_corners_file(tmp_path):
    """A needed column that is missing, and one of another name that is near it."""
    path = tmp_path / "corners.csv"
    path.write_text("image,widht,height,id,x,y\na.png,640,480,0,1,2\n")
    with pytest.raises(InputError, match=r"corners\.csv:1: width: missing column .* Did you mean it by 'widht'\?"):
        load_corners(path)


def test_nothing_is_meant_by_what_is_like_nothing():
    """Then the known names are all that helps."""
    for call in (lambda: parse_board("zzz:9x6:25mm"), lambda: parse_distortion("zzz"), lambda: config_path("zzz")):
        with pytest.raises(InputError) as caught:
            call()
        assert "Did you mean" not in str(caught.value)
        assert "expected" in str(caught.value)
