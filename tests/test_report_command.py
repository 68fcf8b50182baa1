"""`camcal report` and the page and plots of `camcal calibrate`: what is written, what is refused, what is loaded."""

from __future__ import annotations

import shutil
from dataclasses import replace

import cv2
import pytest
from loaded_modules import loaded_by
from messages import one_line
from report_pages import noisy_file
from scenes import BOARD, detections, poses

from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.corners_file import save_corners
from camcal.report.figures.catalogue import FIGURES
from camcal.workflows.calibrate import calibrate
from camcal.workflows.report import write_plots
from camcal.workflows.reporting import SilentReporter
from camcal.workflows.restore import restore


def test_no_report_leaves_no_page_behind(run, calibrated, dataset, tmp_path):
    """--no-report writes four files, and takes away the page of an earlier run, which would be about another camera."""
    folder = tmp_path / "calib"
    folder.mkdir()
    (folder / "report.html").write_text("about another camera")
    arguments = ("calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", folder)
    assert run(*arguments, "--no-report", "--force", page=True)[0] == 0
    assert sorted(path.name for path in folder.iterdir()) == ["board.yaml", "camera.yaml", "corners.csv", "views.yaml"]


def test_calibration_without_its_page_loads_no_plotting_library(calibrated, dataset, tmp_path):
    """Matplotlib and jinja2 take their time to import; whoever does without the page does without them."""
    arguments = (
        "calibrate",
        calibrated / "corners.csv",
        "--board",
        dataset / "board.yaml",
        "-o",
        tmp_path / "c",
        "--no-report",
    )
    loaded = loaded_by("from camcal.cli import main; assert main(sys.argv[1:]) == 0", *arguments)
    assert not {"matplotlib", "jinja2"} & loaded


def test_a_page_that_cannot_be_written_does_not_lose_the_calibration(run, calibrated, dataset, tmp_path):
    """A folder stands where the page should be: a warning, exit code 0, and all four files."""
    folder = tmp_path / "calib"
    (folder / "report.html").mkdir(parents=True)
    arguments = ("calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", folder, "--force")
    code, _, err = run(*arguments, page=True)
    assert code == 0
    assert "warning: report not complete" in err
    assert (folder / "camera.yaml").read_bytes() == (calibrated / "camera.yaml").read_bytes()


def test_a_bug_in_the_page_is_not_hidden(calibrated, dataset, tmp_path, monkeypatch):
    """An exception that is no user's fault comes through; the camera is written by then."""

    def fail(*_: object) -> str:
        raise RuntimeError("bug")

    monkeypatch.setattr("camcal.report.calibration_page.calibration_page", fail)
    with pytest.raises(RuntimeError, match="bug"):
        calibrate(calibrated / "corners.csv", str(dataset / "board.yaml"), tmp_path / "calib")
    assert (tmp_path / "calib/camera.yaml").is_file()


@pytest.mark.parametrize("name", ["board.yaml", "corners.csv", "views.yaml", "camera.yaml"])
def test_folder_without_a_file_is_refused(run, calibrated, tmp_path, name):
    """One line that names the missing file, exit code 2, and nothing written."""
    shutil.copytree(calibrated, tmp_path / "calib")
    (tmp_path / "calib" / name).unlink()
    code, _, err = run("report", tmp_path / "calib")
    assert code == 2
    assert f"{name}: no such file" in one_line(err)
    assert not (tmp_path / "calib/report.html").exists()


def test_what_is_no_calibration_is_refused(run, calibrated, dataset, tmp_path):
    """No folder, a file, a rendered dataset's truth, and files of two calibrations put together: each in one line, code 2."""
    noisy_file(tmp_path / "seen.csv")
    calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "one", report=False)
    calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "two", distortion="k1", report=False)
    shutil.copy(tmp_path / "two/camera.yaml", tmp_path / "one/camera.yaml")
    shutil.copytree(calibrated, tmp_path / "three")
    shutil.copy(tmp_path / "two/corners.csv", tmp_path / "three/corners.csv")
    shutil.copytree(calibrated, tmp_path / "four")
    shutil.copy(tmp_path / "two/board.yaml", tmp_path / "three/board.yaml")
    (tmp_path / "four/board.yaml").write_text("type: checkerboard\ncolumns: 3\nrows: 3\nsquare_m: 0.02\n")
    shutil.copytree(calibrated, tmp_path / "five")
    known = load_intrinsics(calibrated)
    save_intrinsics(tmp_path / "five/camera.yaml", replace(known, camera=known.camera.scaled((320, 240))))
    cases = {
        tmp_path / "nowhere": "no such folder",
        calibrated / "camera.yaml": "a file (expected a calibration's folder)",
        dataset: "a camera without its calibration",
        tmp_path / "one": "residuals that camera.yaml and views.yaml do not give",
        tmp_path / "three": "used views without used corners in corners.csv",
        tmp_path / "four": "is not on the board",
        tmp_path / "five": "another image size than camera.yaml's (got 640x480, expected 320x240)",
    }
    for path, said in cases.items():
        code, _, err = run("report", path)
        assert code == 2, path
        assert said in one_line(err)


def test_outputs_are_claimed_before_any_work(run, calibrated, tmp_path):
    """A page and a folder that exist are kept without --force; a folder of photographs must be there; formats are known."""
    shutil.copytree(calibrated, tmp_path / "calib")
    (tmp_path / "page.html").write_text("mine")
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots/mine.txt").write_text("mine")
    for arguments, said in (
        (("-o", tmp_path / "page.html"), "output file exists"),
        (("--plots", tmp_path / "plots"), "output folder is not empty"),
        (("--images", tmp_path / "nowhere"), "no such folder"),
        (("--plots", tmp_path / "new", "--plots-format", "pgn"), "png"),
    ):
        code, _, err = run("report", tmp_path / "calib", *arguments)
        assert code == 2
        assert said in err
    assert (tmp_path / "page.html").read_text() == "mine"
    assert not (tmp_path / "calib/report.html").exists()


def test_the_default_page_replaces_only_a_page(run, reported, tmp_path):
    """Without -o the folder's earlier page makes room; somebody's own file under that name does so only with --force."""
    shutil.copytree(reported, tmp_path / "calib")
    arguments = ("report", tmp_path / "calib", "--images", reported.parent / "photos")
    assert run(*arguments)[0] == 0
    (tmp_path / "calib/report.html").write_text("mine")
    code, _, err = run(*arguments)
    assert code == 2
    assert "report.html: output file exists and is not a page that camcal wrote" in one_line(err)
    assert (tmp_path / "calib/report.html").read_text() == "mine"
    assert run(*arguments, "--force")[0] == 0


def test_calibrate_needs_a_folder_for_its_figures(dataset, tmp_path):
    """From Python figures without an output folder are refused before any work."""
    with pytest.raises(InputError, match="plots: needs an output folder"):
        calibrate(dataset / "images", str(dataset / "board.yaml"), plots=tmp_path / "plots")


def test_calibrate_writes_what_the_command_writes(tmp_path, monkeypatch):
    """From Python an output folder gets the page too, unless it is not wanted; without a folder nothing is written."""
    monkeypatch.chdir(tmp_path)
    save_corners(tmp_path / "seen.csv", detections(poses(3, 4), noise_px=0.1))
    files = {"board.yaml", "camera.yaml", "corners.csv", "views.yaml"}
    for options, expected in (({}, files | {"report.html"}), ({"report": False}, files)):
        folder = tmp_path / f"calib{len(expected)}"
        calibrate(tmp_path / "seen.csv", BOARD.spec, folder, **options)
        assert {path.name for path in folder.iterdir()} == expected
    before = sorted(tmp_path.rglob("*"))
    assert calibrate(tmp_path / "seen.csv", BOARD.spec).folder is None
    assert sorted(tmp_path.rglob("*")) == before


def test_plots_are_written(run, calibrated, dataset, tmp_path):
    """`calibrate --plots` writes every figure of the report in the formats asked for."""
    arguments = ("calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "calib")
    assert run(*arguments, "--plots", tmp_path / "plots", "--plots-format", "png")[0] == 0
    files = sorted(path.relative_to(tmp_path / "plots").as_posix() for path in (tmp_path / "plots").rglob("*.*"))
    views = [f"views/{index:03d}_view_{index:04d}.png" for index in range(8)]
    assert files == sorted([*(f"{kind.name}.png" for kind in FIGURES), *views])
    for file in files:
        assert cv2.imread(str(tmp_path / "plots" / file)).std() > 1, file


def test_plots_have_three_formats_and_are_the_same_each_time(tmp_path, monkeypatch):
    """PNG, SVG and PDF of one figure, each what its name says, and the same bytes again."""
    monkeypatch.setattr("camcal.report.figures.catalogue.FIGURES", FIGURES[-1:])
    save_corners(tmp_path / "seen.csv", detections(poses(3, 4), noise_px=0.1))
    calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "calib", report=False)
    starts = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    contents = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        written = write_plots(restore(tmp_path / "calib"), tmp_path / name, ("png", "svg", "pdf"), SilentReporter())
        assert [path.name for path in written[:3]] == [f"{FIGURES[-1].name}.{kind}" for kind in starts]
        contents.append([path.read_bytes() for path in written])
    assert all(content.startswith(start) for content, start in zip(contents[0][:3], starts.values(), strict=True))
    assert contents[0] == contents[1]
