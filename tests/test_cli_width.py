"""Everything that commands print fits 80 columns, with the largest values and the longest names; no number is cut."""

from __future__ import annotations

import re
import shlex
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from every_command import COMMANDS

from camcal.cli import main
from camcal.cli.console import fitted, print_facts, print_table, say_wrapped
from camcal.cli.regress import print_regression
from camcal.cli.summary import print_calibration
from camcal.cli.twin_table import print_twin
from camcal.cli.verify import print_verification
from camcal.cli.width import WIDTH, shortened, wrapped, wrapped_command
from camcal.compare.parameters import ParameterError
from camcal.compare.projection import ProjectionDifference
from camcal.compare.twins import TwinErrors, TwinParameter, TwinProjection
from camcal.compare.views import ViewErrors
from camcal.geometry.camera import Camera
from camcal.records import BoardShape, ImageSigma, Intrinsics, Uncertainty
from camcal.resources import config_names
from camcal.verdict import Finding, Verdict
from camcal.workflows.regress import FIGURES, Regression, ScenarioResult
from camcal.workflows.twin import Twin
from camcal.workflows.verify import Verification

# A medium-format back with every coefficient free.
CAMERA = Camera(
    (14204, 10652),
    [[-1 / 3 + 123456, 0, 7101.123456789], [0, 123456.123456789, 5325.987654321], [0, 0, 1]],
    [-12.3456789012, 123.456789012, -0.00123456789, -0.00123456789, -1234.56789012, -12.3, 123.4, -1234.5],
)
FREE = tuple(name for name in CAMERA.intrinsic_names if name != "skew")
SPREADS = {"tiny": 1e-13, "usual": 1.2e-4, "absurd": 1.2e7, "unknown": float("nan")}
LONG = "IMG_20260731_142233_front_left_camera_"


def printed(capsys) -> str:
    """What was printed; each line fits."""
    out = capsys.readouterr().out
    assert out.strip()
    assert [line for line in out.splitlines() if len(line) > WIDTH] == []
    return out


def known(sigma: float) -> Intrinsics:
    """An estimate with every parameter known to the same standard deviation."""
    shape = BoardShape(("bow_x", "bow_y", "stretch"), np.array([-0.0123456, 0.0123456, -0.0123456]), np.diag([1e-9] * 3))
    return Intrinsics(
        CAMERA,
        name="hasselblad back, left",
        free=FREE,
        covariance=np.diag([sigma**2] * len(FREE)),
        rms_px=123456.789,
        views=1234,
        corners=1234567,
        shape=shape,
        cross_validation=12345.6,
    )


def verdict(level: str, count: int) -> Verdict:
    """Findings that are sentences of many words, one of them a long path."""
    text = f"the boards reach 12.3 % of the image in {LONG}.png and 1234.56 px of it are not seen"
    return Verdict(
        tuple(Finding(f"code{i}", level, 1.0, text, "Tilt the board by 30 to 45 degrees. " * 3) for i in range(count))
    )


@pytest.mark.parametrize(("sigma", "level"), list(product(SPREADS.values(), ("rejected", "note"))))
def test_calibrate(sigma, level, capsys):
    """The summary of a calibration."""
    view = ImageSigma(1234.5, (1234.5,) * 4, (123456.7,) * 4, (0.0, 0.123, 1.0))
    names = [f"{LONG}{index:06d}.png" for index in range(4)]
    run = SimpleNamespace(
        intrinsics=known(sigma),
        calibration=SimpleNamespace(
            rejected=names, view_rms_px=[1234.5, 1234.5, 0.1, 0.1], detections=[SimpleNamespace(source=name) for name in names]
        ),
        assessment=SimpleNamespace(uncertainty=Uncertainty(12345.678, view, view)),
        folder=Path("/calibrations/of/the/whole/fleet/calib"),
        verdict=verdict(level, 5),
        twin=None,
    )
    print_calibration(run, ["/photographs/of/the/front/camera/2026"], undistorted=sigma < 1, report=True)
    out = printed(capsys)
    for number in ("123456", "1234567 corners", "1234 of 1238 used, 4 rejected"):
        assert number in out
    for name in (*FREE, names[0]):
        assert name in out
    assert out.count(f"- {level}: ") == 3


@pytest.mark.parametrize("sigma", SPREADS.values(), ids=SPREADS)
def test_verify(sigma, capsys):
    """Parameters, projection and views; six digits where no standard deviation says how many matter."""
    values = CAMERA.intrinsics.tolist()
    errors = [ParameterError(n, v, v * 1.0123456, sigma) for n, v in zip(CAMERA.intrinsic_names, values, strict=True) if v]
    difference = ProjectionDifference(np.zeros((2, 2)), np.array([[123456.7, 0], [0, 0]]), np.zeros(3), 0.0)
    views = ViewErrors(1234, 1234567, 12345.678, (-1234.5678, 1234.5678), 123456.78, 179.999, 1234.5678)
    print_verification(Verification(difference, tuple(errors), views, ()))
    out = printed(capsys)
    for error in errors:
        assert re.search(rf"^ {error.name} ", out, flags=re.MULTILINE)
    assert "1.23e+05" in out


def test_twin(capsys):
    """Errors, their sentences, lost views and failures."""
    names = [f"{LONG}{index}.png" for index in range(3)]
    lost = dict.fromkeys(names, "3 of 3: only 5 of 54 corners were found, 6 are needed for a pose")
    parameters = tuple(TwinParameter(name, 123456.7, 1.234567e-5, 0.0, 0.0) for name in FREE)
    places = tuple(TwinProjection(place, 1234.5, 123456.7, 0.0) for place in ("centre", "edges", "corners", "image"))
    errors = TwinErrors(100, parameters, places, 0.6345)
    failures = ("solve: the views do not determine the camera (condition 1e16, expected at most 1e12). Tilt the board more.",)
    print_twin(Twin(100, errors, failures, 1234.5, 1234.5, 1234567.0, 1234567, lost))
    out = printed(capsys)
    assert all(name in out for name in (*FREE, "image, px", names[0], names[1], "and 1 more"))


def test_regress(capsys):
    """The shipped scenarios with figures that are as long as they get."""
    pixels = [figure.name for figure in FIGURES if figure.name.endswith("_px")]
    figures = dict.fromkeys((figure.name for figure in FIGURES), 123.456) | dict.fromkeys(pixels, 1.23456e-5)
    figures |= {"views": 123.0, "detected_share": 0.99987}
    print_regression(Regression(tuple(ScenarioResult(name, figures, 12345.6, ()) for name in config_names()), None))
    out = printed(capsys)
    assert all(out.count(f" {name} ") == 2 for name in config_names())
    assert out.count("1.23e-05") == len(pixels) * len(config_names())


def test_lines_of_synth_board_demo_and_undistort(monkeypatch, capsys):
    """Sentences and facts that name a place; in a pipe a sentence is one line."""
    say_wrapped("word " * 50 + "end")
    assert len(capsys.readouterr().out.splitlines()) == 1
    monkeypatch.setattr("camcal.cli.style.is_terminal", lambda _: True)
    spec = "aprilgrid:10x10:123.45mm:0.3:family=tag36h10:first=top-left:border=1:squares=no"
    say_wrapped(f"Print at 100 %, measure the ruler, and calibrate with --board {spec}")
    say_wrapped(
        "/data/of/the/fleet: 12345 undistorted images and 123 undistorted videos (12345 done before) and their camera.yaml."
    )
    print_facts({"rendered images and truth": "/a/folder/of/a/name/that/is/far/longer/than/others", "nothing": ""})
    out = printed(capsys)
    assert spec in out
    assert "nothing" not in out


def test_a_table_that_is_too_wide_goes_on_below(capsys):
    """12 columns of 8 beside names of 12: as many as fit each time, the names again, every cell there once."""
    rows = [(f"scenario {row:03d}", *(f"{row}.{column:06d}" for column in range(12))) for row in range(3)]
    print_table("Wide", ("", *(f"c{column}" for column in range(12))), rows)
    out = printed(capsys)
    for name, *cells in rows:
        assert out.count(name) == 2
        assert all(out.count(cell) == 1 for cell in cells)


def test_a_name_is_shortened_on_a_terminal_only(monkeypatch):
    """In its middle, so that beginning and end can be told; in a pipe, where it may be searched for, it stays whole."""
    assert fitted(f"{LONG}1.png", 20) == f"{LONG}1.png"
    monkeypatch.setattr("camcal.cli.style.is_terminal", lambda _: True)
    assert fitted(f"{LONG}1.png", 20) == "IMG_202607…era_1.png"
    assert [len(shortened("x" * 99, room)) for room in range(1, 9)] == list(range(1, 9))


@pytest.mark.parametrize("indent", [0, 7, 30])
def test_a_broken_command_is_the_same_command(indent):
    """Lines that fit, whose backslashes a shell takes out again; a path with blanks and one that is too long stay whole."""
    path = "/a/" + "long/" * 20
    parts = ["camcal calibrate 'my photos'", f"--board {path}", *(f"--option-{i} value-{i}" for i in range(9)), "-o calib"]
    lines = wrapped_command(parts, indent).splitlines()
    assert all(line.endswith(" \\") for line in lines[:-1])
    assert max(len(line) + (indent if not at else 0) for at, line in enumerate(lines) if path not in line) <= WIDTH
    assert shlex.split(" ".join(line.removesuffix("\\") for line in lines)) == shlex.split(" ".join(parts))


def test_wrapping_keeps_long_words_and_hyphens():
    """A path is never broken, not even at a hyphen."""
    path = "/data/" + "front-left-camera/" * 6
    lines = wrapped(f"the images of {path} were left alone", "- ", "  ").splitlines()
    assert lines == ["- the images of", f"  {path}", "  were left alone"]


@pytest.mark.parametrize("name", ["", *sorted(COMMANDS)])
def test_help(name, monkeypatch, capsys):
    """On a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")
    assert main([*([name] if name else []), "--help"]) == 0
    printed(capsys)
