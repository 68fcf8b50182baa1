"""The command line: what each command prints and writes, and each documented exit code."""

from __future__ import annotations

import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from every_command import COMMANDS

import camcal.cli
from camcal import __version__
from camcal.boards.checkerboard import Checkerboard
from camcal.cli import main
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.corners_file import save_corners
from camcal.geometry.camera import Camera
from camcal.observations import Detection
from camcal.records import Intrinsics
from camcal.resources import config_names
from camcal.verdict import Finding, Verdict
from camcal.workflows.observe import REFINEMENTS


@pytest.fixture
def run(capsys):
    """Run a command in this process: exit code, stdout, stderr. Calibrations go without their page, which takes its time."""

    def call(*arguments: object) -> tuple[int, str, str]:
        no_page = ["--no-report"] if arguments[:1] == ("calibrate",) else []
        code = main([*(str(argument) for argument in arguments), *no_page])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call


def one_line(err: str) -> str:
    """Return the single line that stderr must consist of."""
    lines = err.strip().splitlines()
    assert len(lines) == 1, err
    return lines[0]


def test_version(run):
    """--version prints the package's version."""
    assert run("--version") == (0, f"camcal {__version__}\n", "")


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("calibrat",), ["'calibrat'", "Did you mean 'calibrate'?", "See 'camcal --help'."]),
        (("xyz",), ["'xyz'", *COMMANDS, "See 'camcal --help'."]),
        (("--nonsense",), ["'--nonsense'", "See 'camcal --help'."]),
        (("calibrate",), ["IMAGES", "See 'camcal calibrate --help'."]),
        (("calibrate", "x", "--bord", "y"), ["'--bord'", "Did you mean '--board'?", "See 'camcal calibrate --help'."]),
        (("verify", "x"), ["--truth", "See 'camcal verify --help'."]),
        (("verify", "x", "--truth", "y", "--max-diff", "much"), ["--max-diff", "much"]),
        (("synth", "x", "-o", "y", "-j", "0"), ["--jobs", "0", "See 'camcal synth --help'."]),
        (("undistort", "x", "--camera", "y", "-o", "z", "--alpha", "2"), ["--alpha", "2"]),
        (("calibrate", "x\n\x1by", "--bo\nrd", "y"), ["camcal calibrate"]),
    ],
)
def test_usage_errors_are_one_line_and_exit_2(run, arguments, told):
    """Unknown commands and options with the nearest match, missing arguments, values out of range; with the help to see."""
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    line = one_line(err)
    assert line.startswith("camcal: ")
    assert line.isprintable()
    for words in told:
        assert words in line


def test_no_command_shows_the_help(run):
    """`camcal` alone is a usage error, but the help says more than one line could."""
    code, out, err = run()
    assert code == 2
    assert out == ""
    for name in COMMANDS:
        assert f"  {name} " in err


@pytest.mark.parametrize(
    ("arguments", "label"),
    [
        (("demo", "-o", ""), "--output"),
        (("board", "", "-o", "b.pdf"), "SPEC"),
        (("board", "checkerboard:9x6:25mm", "-o", ""), "--output"),
        (("synth", "", "-o", "d"), "CONFIG"),
        (("synth", "webcam_720p", "-o", ""), "--output"),
        (("calibrate", "", "--board", "checkerboard:9x6:25mm", "-o", "c"), "IMAGES"),
        (("calibrate", "images", "", "--board", "checkerboard:9x6:25mm", "-o", "c"), "IMAGES"),
        (("calibrate", "images", "--board", "", "-o", "c"), "--board"),
        (("calibrate", "images", "--board", "checkerboard:9x6:25mm", "-o", ""), "--output"),
        (("calibrate", "images", "--board", "checkerboard:9x6:25mm", "-o", "c", "--name", ""), "--name"),
        (("undistort", "", "--camera", "camera.yaml", "-o", "u"), "INPUTS"),
        (("undistort", "images", "--camera", "", "-o", "u"), "--camera"),
        (("undistort", "images", "--camera", "camera.yaml", "-o", ""), "--output"),
        (("verify", "", "--truth", "t"), "ESTIMATE"),
        (("verify", "e", "--truth", ""), "--truth"),
    ],
)
def test_empty_arguments_are_not_the_current_folder(run, tmp_path, monkeypatch, dataset, arguments, label):
    """Empty text where a path is meant is exit 2, even where the current folder would do; nothing is written."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(dataset / "images", tmp_path / "images")
    shutil.copy(dataset / "camera.yaml", tmp_path)
    code, _, err = run(*arguments)
    assert code == 2
    assert f"{label}: empty" in one_line(err)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["camera.yaml", "images"]


def test_help_imports_nothing_heavy():
    """The list of commands is shown without any of them, and without numpy, OpenCV, YAML, pydantic, rich and compressors."""
    script = "import sys; from camcal.cli import main; main(['--help']); print(*sys.modules, file=sys.stderr)"
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loaded = set(finished.stderr.split())
    assert not {"numpy", "cv2", "yaml", "pydantic", "rich", "skimage", "shutil", "difflib", "subprocess"} & loaded
    assert not {command.callback.__module__ for command in COMMANDS.values()} & loaded


def test_the_list_of_commands_is_that_of_their_own_help(capsys):
    """Each module that defines a command is in the list, with the first sentence of the command's help."""
    named = {path.stem for path in Path(camcal.cli.__file__).parent.glob("*.py") if "@click.command(" in path.read_text()}
    assert {command.callback.__module__.rpartition(".")[2] for command in COMMANDS.values()} == named
    assert main(["--help"]) == 0
    shown = " ".join(capsys.readouterr().out.partition("Commands:")[2].split())
    for name, command in COMMANDS.items():
        assert command.name == name
        assert f"{name} {command.get_short_help_str(500)}" in shown


def test_module_as_a_command():
    """`python -m camcal` leaves with the exit code of the command."""
    finished = subprocess.run(
        [sys.executable, "-m", "camcal", "verify", "missing", "--truth", "missing"], capture_output=True, text=True, check=False
    )
    assert finished.returncode == 2
    assert "Traceback" not in finished.stderr


def test_synth_writes_images_and_truth(run, scene_file, tmp_path):
    """Images, and the truth in the four files that calibrate writes."""
    code, out, err = run("synth", scene_file, "-o", tmp_path / "data")
    assert (code, err) == (0, "")
    assert "8 views of checkerboard:7x6:20mm, 336 corners" in out
    assert sorted(p.name for p in (tmp_path / "data").iterdir()) == [
        "board.yaml",
        "camera.yaml",
        "corners.csv",
        "images",
        "views.yaml",
    ]
    assert sorted(p.name for p in (tmp_path / "data/images").iterdir()) == [f"view_{i:04d}.png" for i in range(8)]


def test_synth_is_the_same_on_any_number_of_threads(run, scene_file, dataset, tmp_path):
    """One thread or two: the same bytes in every file."""
    run("synth", scene_file, "-o", tmp_path / "data", "--jobs", "1")
    for path in sorted(p for p in dataset.rglob("*") if p.is_file()):
        assert (tmp_path / "data" / path.relative_to(dataset)).read_bytes() == path.read_bytes(), path.name


def test_synth_takes_the_name_of_a_shipped_scenario(run, tmp_path):
    """A shipped name renders that scenario; an unknown name is answered with those there are."""
    code, out, _ = run("synth", "webcam_720p", "-o", tmp_path / "data")
    assert code == 0
    assert "20 views of checkerboard:9x6:25mm, 1080 corners" in out
    camera = yaml.safe_load((tmp_path / "data/camera.yaml").read_text())
    assert camera["camera_name"] == "webcam_720p"
    assert camera["camera_matrix"]["data"][0] == 912.4
    code, _, err = run("synth", "webcam_721p", "-o", tmp_path / "other")
    assert code == 2
    assert "webcam_720p" in one_line(err)


def test_synth_help_names_the_shipped_scenarios():
    """The names in the help, written there so that it need not look for files, are those that are shipped."""
    named = re.search(r"shipped one \((.*?)\)", " ".join((COMMANDS["synth"].help or "").split()))
    assert named is not None
    assert sorted(named.group(1).split(", ")) == sorted(config_names())


def test_synth_force_leaves_no_view_of_an_earlier_dataset(run, scene_file, tmp_path):
    """A shorter dataset written over a longer one has only its own views; other files stay."""
    folder = tmp_path / "data"
    run("synth", scene_file, "-o", folder)
    (folder / "images/mine.txt").write_text("keep")
    shorter = tmp_path / "shorter.yaml"
    shorter.write_text(scene_file.read_text().replace("count: 8", "count: 3"))
    assert run("synth", shorter, "-o", folder)[0] == 2
    assert run("synth", shorter, "-o", folder, "--force")[0] == 0
    assert sorted(p.name for p in (folder / "images").iterdir()) == ["mine.txt", *(f"view_{i:04d}.png" for i in range(3))]


def test_calibrate_finds_the_truth(run, dataset, tmp_path):
    """Rendered pixels to a camera within 4 standard deviations of the truth, four files, and a table.

    What the corners are off by shows in the residuals, less what the 7 + 6 x 8 parameters take up; 4 standard deviations of
    that share allow for chance.
    """
    code, out, _ = run("calibrate", dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "calib")
    assert code == 0
    assert "RMS" in out
    assert "8 of 8 used" in out
    assert sorted(p.name for p in (tmp_path / "calib").iterdir()) == ["board.yaml", "camera.yaml", "corners.csv", "views.yaml"]
    code, out, _ = run("verify", tmp_path / "calib", "--truth", dataset, "--max-sigma", "4", "--json")
    assert code == 0
    result = json.loads(out)
    assert result["problems"] == []
    assert result["views"]["corners"] == 336
    values, parameters = 2 * 336, 7 + 6 * 8
    residual_px = load_intrinsics(tmp_path / "calib").rms_px / math.sqrt(2)
    expected_px = residual_px / math.sqrt(1 - parameters / values)
    assert result["views"]["corner_rms_px"] == pytest.approx(expected_px, rel=4 / math.sqrt(2 * values))


def test_calibrate_json(run, dataset, tmp_path):
    """--json prints one document and nothing else on stdout."""
    code, out, _ = run(
        "calibrate",
        dataset / "images",
        "--board",
        "checkerboard:7x6:20mm",
        "-o",
        tmp_path / "calib",
        "--json",
        "--distortion",
        "k1",
    )
    assert code == 0
    result = json.loads(out)
    assert list(result["standard_deviations"]) == ["fx", "fy", "cx", "cy", "k1"]
    assert result["views"] == 8


def test_calibrate_replays_its_corners_bit_for_bit(run, dataset, calibrated, tmp_path):
    """Calibrating from the corners.csv of a run, in which no view was rejected, gives the same four files."""
    code, *_ = run("calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "again")
    assert code == 0
    for name in ("camera.yaml", "views.yaml", "corners.csv", "board.yaml"):
        assert (tmp_path / "again" / name).read_bytes() == (calibrated / name).read_bytes(), name


def test_calibrate_is_the_same_on_any_number_of_threads(run, dataset, calibrated, tmp_path):
    """One thread or two, images named in any order: the same bytes."""
    images = sorted((dataset / "images").iterdir(), reverse=True)
    assert run("calibrate", *images, "--board", dataset / "board.yaml", "-o", tmp_path / "again", "-j", "1")[0] == 0
    for name in ("camera.yaml", "corners.csv", "views.yaml", "board.yaml"):
        assert (tmp_path / "again" / name).read_bytes() == (calibrated / name).read_bytes(), name


def test_calibrate_from_exact_corners_is_exact(run, dataset, tmp_path):
    """The truth's corners.csv gives the truth back: f and c within 1e-6 px, k1 and k2 within 1e-9, k3 within 1e-8."""
    assert run("calibrate", dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "calib")[0] == 0
    _, out, _ = run("verify", tmp_path / "calib", "--truth", dataset, "--json")
    errors = {p["name"]: abs(p["error"]) for p in json.loads(out)["parameters"]}
    assert max(errors[name] for name in ("fx", "fy", "cx", "cy")) < 1e-6
    assert max(errors["k1"], errors["k2"]) < 1e-9
    assert errors["k3"] < 1e-8


def test_calibrate_with_undistort(run, dataset, tmp_path):
    """--undistort writes the undistorted images and the camera that belongs to them."""
    code, *_ = run("calibrate", dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "calib", "--undistort")
    assert code == 0
    written = sorted(p.name for p in (tmp_path / "calib/undistorted").iterdir())
    assert written == ["camera.yaml", *(f"view_{i:04d}.png" for i in range(8))]
    camera = yaml.safe_load((tmp_path / "calib/undistorted/camera.yaml").read_text())
    assert camera["distortion_coefficients"]["data"] == [0] * 5


def test_undistort(run, dataset, tmp_path):
    """Names and sizes are kept, and no lens is left.

    A calibration of the undistorted images with k1..k3 free finds the camera written beside them, and 0 for each coefficient,
    within 4 standard deviations.
    """
    code, out, _ = run("undistort", dataset / "images", "--camera", dataset / "camera.yaml", "-o", tmp_path / "flat")
    assert code == 0
    assert "8 undistorted images" in out
    image = cv2.imread(str(tmp_path / "flat/view_0000.png"), cv2.IMREAD_UNCHANGED)
    assert image.shape == cv2.imread(str(dataset / "images/view_0000.png"), cv2.IMREAD_UNCHANGED).shape
    assert run("calibrate", tmp_path / "flat", "--board", dataset / "board.yaml", "-o", tmp_path / "c")[0] == 0
    code, out, _ = run("verify", tmp_path / "c", "--truth", tmp_path / "flat/camera.yaml", "--max-sigma", "4", "--json")
    assert code == 0
    assert [p["truth"] for p in json.loads(out)["parameters"] if p["name"].startswith("k")] == [0, 0, 0]


def test_undistort_alpha(run, dataset, tmp_path):
    """Alpha 1 keeps every pixel of the source in the picture; alpha 0 leaves no pixel that sees nothing of it."""
    source = load_intrinsics(dataset).camera
    targets = {}
    for alpha in ("0", "1"):
        out = tmp_path / alpha
        arguments = (dataset / "images/view_0000.png", "--camera", dataset, "-o", out, "--alpha", alpha)
        assert run("undistort", *arguments)[0] == 0
        targets[alpha] = load_intrinsics(out).camera
    edge = np.array([[0, 0], [639, 0], [0, 479], [639, 479], [320, 0], [320, 479], [0, 240], [639, 240]])
    # Both ends of every ray are at pixel centres; a thousandth of a pixel is far above rounding.
    assert targets["1"].contains(targets["1"].project(source.unproject(edge)), -0.501).all()
    assert not targets["0"].contains(targets["0"].project(source.unproject(edge))).all()
    assert source.contains(source.project(targets["0"].unproject(edge)), -0.501).all()
    assert not source.contains(source.project(targets["1"].unproject(edge))).all()


def test_undistort_with_an_untrusted_camera_warns(run, dataset, calibrated, tmp_path):
    """A camera marked as not to be trusted is used, with its first problem as a warning."""
    marked = tmp_path / "camera.yaml"
    verdict = Verdict((Finding("large_rms", "rejected", 1.0, "RMS is 7 px", "Look."),))
    save_intrinsics(marked, replace(load_intrinsics(calibrated), verdict=verdict))
    code, _, err = run("undistort", dataset / "images/view_0000.png", "--camera", marked, "-o", tmp_path / "flat")
    assert code == 0
    assert one_line(err).startswith("camcal: warning: ")
    assert "not to be trusted: RMS is 7 px." in err


def test_board_landscape(run, tmp_path):
    """--landscape turns A4 onto its long side."""
    for flags, size, name in (((), "210 x 297 mm", "p.svg"), (("--landscape",), "297 x 210 mm", "l.svg")):
        code, out, _ = run("board", "checkerboard:5x4:25mm", "-o", tmp_path / name, "--paper", "a4", *flags)
        assert code == 0
        assert size in out
        width, height = size.split(" mm")[0].split(" x ")
        page = (tmp_path / name).read_text()
        assert f'width="{width}mm"' in page
        assert f'height="{height}mm"' in page


def test_calibrate_only_used(run, dataset, tmp_path):
    """--only-used solves what the rows marked as used alone would give; without it every row is a candidate."""
    header, *rows = (dataset / "corners.csv").read_text().splitlines()
    kept = [row for index, row in enumerate(rows) if index % 7]
    marked = [row if index % 7 else row.removesuffix("1") + "0" for index, row in enumerate(rows)]
    for name, lines in (("marked", marked), ("kept", kept)):
        (tmp_path / f"{name}.csv").write_text("\n".join([header, *lines]) + "\n")
    counts = {}
    for name, source, flags in (("all", "marked", ()), ("used", "marked", ("--only-used",)), ("kept", "kept", ())):
        arguments = (tmp_path / f"{source}.csv", "--board", dataset / "board.yaml", "-o", tmp_path / name, *flags)
        assert run("calibrate", *arguments)[0] == 0
        counts[name] = load_intrinsics(tmp_path / name).corners
    assert counts == {"all": 336, "used": 288, "kept": 288}
    assert (tmp_path / "used/camera.yaml").read_bytes() == (tmp_path / "kept/camera.yaml").read_bytes()


def test_calibrate_anamorphic(run, dataset, tmp_path):
    """Images twice as wide: written and marked with exit 5 but for --anamorphic, which gives twice the fx."""
    header, *rows = (dataset / "corners.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    for row in cells:
        row[1] = str(2 * int(row[1]))
        # Pixel centres are whole numbers.
        row[4] = repr(2 * (float(row[4]) + 0.5) - 0.5)
    wide = tmp_path / "wide.csv"
    wide.write_text("\n".join([header, *(",".join(row) for row in cells)]) + "\n")
    code, _, err = run("calibrate", wide, "--board", dataset / "board.yaml", "-o", tmp_path / "a")
    assert code == 5
    assert "--anamorphic" in err
    code, _, _ = run("calibrate", wide, "--board", dataset / "board.yaml", "-o", tmp_path / "b", "--anamorphic")
    assert code == 0
    K, true = load_intrinsics(tmp_path / "b").camera.K, load_intrinsics(dataset).camera.K
    # The bound that exact corners are solved to (1e-6 px), twice for the stretched axis.
    assert K[0, 0] == pytest.approx(2 * true[0, 0], abs=2e-6)
    assert K[1, 1] == pytest.approx(true[1, 1], abs=1e-6)


def test_calibrate_name(run, dataset, tmp_path):
    """--name is the camera's name in the file, umlauts and spaces included."""
    arguments = (dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "c")
    assert run("calibrate", *arguments, "--name", "Türkamera 2")[0] == 0
    assert load_intrinsics(tmp_path / "c").name == "Türkamera 2"


@pytest.mark.parametrize("name", ["bytes \udcff", "line\nbreak", "escape \x1b[31m", "x" * 1001])
def test_calibrate_refuses_a_name_that_no_file_can_hold(run, dataset, tmp_path, name):
    """Bytes that are not UTF-8, control characters and endless names are exit 2 before anything is written."""
    arguments = (dataset / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "c")
    code, _, err = run("calibrate", *arguments, "--name", name)
    assert code == 2
    assert "--name" in one_line(err)
    assert one_line(err).isprintable()
    assert not (tmp_path / "c").exists()


def test_calibrate_refine(run, dataset, tmp_path):
    """--refine chooses between the ways that its help names, each with an answer of its own; another one is exit 2."""
    option = next(p for p in COMMANDS["calibrate"].params if p.name == "refine")
    assert tuple(option.type.choices) == REFINEMENTS
    cameras = set()
    for way in REFINEMENTS:
        arguments = (dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / way, "--refine", way)
        assert run("calibrate", *arguments)[0] == 0
        cameras.add(tuple(load_intrinsics(tmp_path / way).camera.intrinsics))
    assert len(cameras) == len(REFINEMENTS)
    arguments = (dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "x", "--refine", "warp")
    code, _, err = run("calibrate", *arguments)
    assert code == 2
    assert "--refine" in one_line(err)


def test_calibrate_warns_of_a_blurred_view(run, dataset, tmp_path):
    """A view blurred by 2.5 pixels (edges 6 pixels wide) is used, and named in one warning."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    path = str(folder / "view_0003.png")
    cv2.imwrite(path, cv2.GaussianBlur(cv2.imread(path, cv2.IMREAD_UNCHANGED), (0, 0), 2.5))
    code, out, err = run("calibrate", folder, "--board", dataset / "board.yaml", "-o", tmp_path / "c", "--json")
    assert code == 0
    assert re.search(r"^camcal: warning: view_0003\.png: blurred", err, flags=re.MULTILINE)
    assert json.loads(out)["views"] == 8


def test_board_pages(run, tmp_path):
    """A page in each format; an existing file needs --force; a board too big for the paper names one that fits."""
    for suffix in ("pdf", "svg", "png"):
        code, out, _ = run("board", "checkerboard:9x6:25mm", "-o", tmp_path / f"b.{suffix}", "--dpi", "72")
        assert code == 0
        assert "--board checkerboard:9x6:25mm" in out
        assert (tmp_path / f"b.{suffix}").stat().st_size > 500
    assert "--force" in one_line(run("board", "checkerboard:9x6:25mm", "-o", tmp_path / "b.pdf")[2])
    assert run("board", "checkerboard:9x6:25mm", "-o", tmp_path / "b.pdf", "--force")[0] == 0
    code, _, err = run("board", "aprilgrid:6x6:30mm:0.3", "-o", tmp_path / "c.pdf", "--paper", "a4")
    assert code == 2
    assert "a3" in one_line(err)
    assert not (tmp_path / "c.pdf").exists()
    assert run("board", "checkerboard:9x6:25mm", "-o", tmp_path / "b.doc")[0] == 2


def test_verify_gates(run, dataset, calibrated):
    """A gate that fails is exit 5 and says by how much; the table still goes to stdout."""
    code, out, err = run("verify", calibrated, "--truth", dataset, "--max-diff", "1e-6")
    assert code == 5
    assert "projection difference" in out
    assert "--max-diff" in one_line(err)
    code, _, err = run("verify", calibrated, "--truth", dataset, "--max-sigma", "1e-6")
    assert code == 5
    assert "--max-sigma" in one_line(err)
    assert run("verify", calibrated, "--truth", dataset, "--max-diff", "-1")[0] == 2
    assert run("verify", dataset, "--truth", calibrated, "--max-sigma", "4")[0] == 2


def test_verify_of_camera_files(run, dataset, calibrated, tmp_path):
    """Camera files alone are compared too, without views; another image size is refused with both sizes."""
    code, out, _ = run("verify", calibrated / "camera.yaml", "--truth", dataset / "camera.yaml", "--json")
    assert code == 0
    assert json.loads(out)["views"] is None
    scaled = tmp_path / "scaled.yaml"
    save_intrinsics(scaled, Intrinsics(load_intrinsics(dataset).camera.scaled((320, 240))))
    code, _, err = run("verify", calibrated / "camera.yaml", "--truth", scaled)
    assert code == 2
    assert "640x480" in one_line(err)
    assert "320x240" in one_line(err)


class TestBadInput:
    """Each is one line on stderr, the documented exit code, and nothing lost."""

    BOARD = "checkerboard:7x6:20mm"

    def calibrate(self, run, *arguments, output: Path):
        """Run calibrate and return exit code and its last line on stderr."""
        code, _, err = run("calibrate", *arguments, "-o", output)
        assert "Traceback" not in err
        return code, err.strip().splitlines()[-1]

    def test_missing_folder(self, run, tmp_path):
        """A path that does not exist."""
        code, err = self.calibrate(run, tmp_path / "nowhere", "--board", self.BOARD, output=tmp_path / "o")
        assert code == 2
        assert "nowhere" in err

    def test_empty_folder(self, run, tmp_path):
        """A folder without images."""
        (tmp_path / "empty").mkdir()
        code, err = self.calibrate(run, tmp_path / "empty", "--board", self.BOARD, output=tmp_path / "o")
        assert code == 2
        assert "no images" in err

    @pytest.mark.parametrize("defect", ["zero bytes", "text", "truncated"])
    def test_damaged_named_file_is_exit_2(self, run, dataset, tmp_path, defect):
        """A damaged file that is named stops the run before anything is written."""
        good = (dataset / "images/view_0000.png").read_bytes()
        content = {"zero bytes": b"", "text": b"no image at all", "truncated": good[: len(good) // 2]}[defect]
        bad = tmp_path / "bad.png"
        bad.write_bytes(content)
        images = sorted((dataset / "images").iterdir())
        code, err = self.calibrate(run, *images, bad, "--board", self.BOARD, output=tmp_path / "o")
        assert code == 2
        assert "bad.png" in err
        assert not (tmp_path / "o/camera.yaml").exists()

    def test_damaged_file_in_a_folder_is_rejected_by_name(self, run, dataset, tmp_path):
        """In a folder it is a rejected view with a warning, other files are one counted line, and the run goes on."""
        folder = tmp_path / "images"
        shutil.copytree(dataset / "images", folder)
        good = (folder / "view_0000.png").read_bytes()
        (folder / "torn.png").write_bytes(good[: len(good) // 2])
        (folder / "notes.txt").write_text("x")
        code, _, err = run("calibrate", folder, "--board", self.BOARD, "-o", tmp_path / "o")
        assert code == 0
        assert "torn.png: rejected" in err
        assert "1 other file passed over" in err
        views = {v["file"]: v for v in yaml.safe_load((tmp_path / "o/views.yaml").read_text())["views"]}
        assert views["torn.png"]["status"] == "rejected"
        assert views["torn.png"]["reason"]

    def test_named_non_image(self, run, tmp_path):
        """A file that is named must be an image."""
        (tmp_path / "notes.txt").write_text("x")
        code, err = self.calibrate(run, tmp_path / "notes.txt", "--board", self.BOARD, output=tmp_path / "o")
        assert code == 2
        assert "notes.txt" in err

    def test_mixed_sizes_solve_the_largest_group(self, run, dataset, tmp_path):
        """Views of another size are rejected by name; the rest is solved."""
        folder = tmp_path / "images"
        shutil.copytree(dataset / "images", folder)
        image = cv2.imread(str(folder / "view_0000.png"), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(folder / "zoomed.png"), cv2.resize(image, (800, 600)))
        code, _, err = run("calibrate", folder, "--board", self.BOARD, "-o", tmp_path / "o")
        assert code == 0
        assert "zoomed.png: rejected: another image size (got 800x600, expected 640x480" in err

    def test_too_few_views_is_exit_3(self, run, dataset, tmp_path):
        """Two boards are too few; so are images without any, and the first reason is told."""
        images = sorted((dataset / "images").iterdir())[:2]
        code, err = self.calibrate(run, *images, "--board", self.BOARD, output=tmp_path / "o")
        assert code == 3
        assert "got 2, expected at least 3" in err
        assert f"camcal detect IMAGES --board {self.BOARD} -o corners.csv --overlay seen" in err
        blank = tmp_path / "blank.png"
        cv2.imwrite(str(blank), np.full((480, 640), 128, np.uint8))
        code, err = self.calibrate(run, blank, "--board", self.BOARD, output=tmp_path / "p")
        assert code == 3
        assert "blank.png" in err
        assert f"camcal detect {shlex.quote(str(blank))} --board" in err

    def test_squares_counted_for_inner_corners(self, run, dataset, tmp_path):
        """8x7 squares are 7x6 inner corners: exit 3, and the size that was seen is named."""
        code, err = self.calibrate(run, dataset / "images", "--board", "checkerboard:8x7:20mm", output=tmp_path / "o")
        assert code == 3
        assert "7x6" in err

    def test_aprilgrid_with_rows_and_columns_swapped(self, run, tmp_path):
        """4x5 tags for a grid of 5x4: exit 3, and the grid that was seen is named."""
        scene = tmp_path / "scene.yaml"
        scene.write_text(
            "name: grid\nseed: 4\ncamera: {size: [640, 480], fx: 520, fy: 520, cx: 320, cy: 240}\n"
            'board: "aprilgrid:5x4:30mm:0.3"\nviews: {count: 3, tilt_deg: [15, 35], fill: [0.7, 0.9]}\n'
        )
        assert run("synth", scene, "-o", tmp_path / "data")[0] == 0
        images = tmp_path / "data/images"
        code, err = self.calibrate(run, images, "--board", "aprilgrid:4x5:30mm:0.3", output=tmp_path / "o")
        assert code == 3
        assert "5x4" in err
        assert run("calibrate", images, "--board", "aprilgrid:5x4:30mm:0.3", "-o", tmp_path / "p")[0] == 0

    def test_degenerate_geometry_is_exit_4(self, run, tmp_path):
        """Boards parallel to the image leave the focal length undetermined: exit 4, and no camera is written."""
        board, camera = Checkerboard(7, 6, 0.02), Camera((640, 480), [[520, 0, 320], [0, 520, 240], [0, 0, 1]])
        seen = []
        shifts = np.array([(-0.1, -0.08, 0.3), (-0.02, -0.05, 0.4), (-0.09, -0.01, 0.5), (-0.05, -0.05, 0.25)])
        for index, shift in enumerate(shifts):
            corners = camera.project(board.object_points + shift)
            noise = np.random.default_rng(index).normal(0, 0.1, corners.shape)
            seen.append(Detection(f"{index}.png", camera.size, np.arange(42), corners + noise, np.full(42, np.nan)))
        save_corners(tmp_path / "flat.csv", seen)
        code, err = self.calibrate(run, tmp_path / "flat.csv", "--board", self.BOARD, output=tmp_path / "o")
        assert code == 4
        assert "Tilt the board" in err
        assert not (tmp_path / "o/camera.yaml").exists()

    def test_rows_and_columns_swapped_in_images_is_harmless(self, run, dataset, tmp_path):
        """6x7 for 7x6 is the same board: solved."""
        code, *_ = run("calibrate", dataset / "images", "--board", "checkerboard:6x7:20mm", "-o", tmp_path / "o")
        assert code == 0

    def test_rows_and_columns_swapped_in_corners(self, run, dataset, tmp_path):
        """In a corners file they are wrong: exit 4 or 5, with the board that fits."""
        code, err = self.calibrate(run, dataset / "corners.csv", "--board", "checkerboard:6x7:20mm", output=tmp_path / "o")
        assert code in (4, 5)
        assert "checkerboard:7x6:20mm" in err
        assert "swapped" in err

    def test_absurd_result_is_written_marked_and_exit_5(self, run, dataset, tmp_path):
        """Gross errors in the corners leave a large RMS: the files are there and say that they must not be trusted."""
        lines = (dataset / "corners.csv").read_text().splitlines()
        header, rows = lines[0], [line.split(",") for line in lines[1:]]
        rng = np.random.default_rng(0)
        for row in rows:
            row[4] = repr(float(row[4]) + rng.normal(0, 6))
        bad = tmp_path / "bad.csv"
        bad.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")
        code, err = self.calibrate(run, bad, "--board", self.BOARD, output=tmp_path / "o")
        assert code == 5
        assert "RMS" in err
        camera = yaml.safe_load((tmp_path / "o/camera.yaml").read_text())
        assert camera["camcal"]["verdict"] == "rejected"
        assert "RMS" in camera["camcal"]["findings"][0]["text"]

    @pytest.mark.parametrize(
        "spec",
        [
            "checkerboard",
            "checkerboard:9x6",
            "checkerboard:9x6:25",
            "checkerbord:9x6:25mm",
            "checkerboard:1x6:25mm",
            "nowhere.yaml",
        ],
    )
    def test_senseless_board(self, run, dataset, tmp_path, spec):
        """A board SPEC that makes no sense is exit 2 and creates nothing."""
        code, _ = self.calibrate(run, dataset / "images", "--board", spec, output=tmp_path / "o")
        assert code == 2
        assert not (tmp_path / "o").exists()

    def test_ids_that_are_not_on_the_board(self, run, dataset, tmp_path):
        """A corners file of a larger board."""
        code, err = self.calibrate(run, dataset / "corners.csv", "--board", "checkerboard:5x4:20mm", output=tmp_path / "o")
        assert code == 2
        assert "not on the board" in err

    def test_wrong_size_of_images_to_undistort(self, run, dataset, tmp_path):
        """A camera of another size than the images."""
        small = tmp_path / "small.png"
        cv2.imwrite(str(small), np.zeros((240, 320), np.uint8))
        code, _, err = run("undistort", small, "--camera", dataset / "camera.yaml", "-o", tmp_path / "o")
        assert code == 2
        assert "got 320x240, expected 640x480" in one_line(err)

    def test_output_over_its_input(self, run, dataset, tmp_path):
        """Undistorting a folder into itself is refused, and the images stay."""
        folder = tmp_path / "images"
        shutil.copytree(dataset / "images", folder)
        before = (folder / "view_0000.png").read_bytes()
        code, _, err = run("undistort", folder, "--camera", dataset / "camera.yaml", "-o", folder, "--force")
        assert code == 2
        assert "replace its own input" in one_line(err)
        assert (folder / "view_0000.png").read_bytes() == before

    def test_existing_output_needs_force(self, run, dataset, tmp_path):
        """A folder with something in it is refused without --force, and its files stay with it."""
        output = tmp_path / "o"
        output.mkdir()
        (output / "mine.txt").write_text("keep")
        code, err = self.calibrate(run, dataset / "images", "--board", self.BOARD, output=output)
        assert code == 2
        assert "--force" in err
        assert run("calibrate", dataset / "images", "--board", self.BOARD, "-o", output, "--force")[0] == 0
        assert (output / "mine.txt").read_text() == "keep"

    def test_output_that_cannot_be_written(self, run, dataset, tmp_path):
        """A file stands where the folder should be."""
        (tmp_path / "file").write_text("x")
        code, _ = self.calibrate(run, dataset / "images", "--board", self.BOARD, output=tmp_path / "file/below")
        assert code == 2

    @pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
    def test_output_without_permission(self, run, dataset, tmp_path):
        """A folder that may not be written into."""
        locked = tmp_path / "locked"
        locked.mkdir(mode=0o500)
        code, err = self.calibrate(run, dataset / "images", "--board", self.BOARD, output=locked / "o")
        assert code == 2
        assert "permission denied" in err

    def test_options_that_contradict(self, run, dataset, tmp_path):
        """--undistort without images, --only-used without a corners file, two kinds of input at once."""
        corners, images = dataset / "corners.csv", dataset / "images"
        assert self.calibrate(run, corners, "--undistort", "--board", self.BOARD, output=tmp_path / "o")[0] == 2
        assert self.calibrate(run, images, "--only-used", "--board", self.BOARD, output=tmp_path / "o")[0] == 2
        assert self.calibrate(run, corners, images, "--board", self.BOARD, output=tmp_path / "o")[0] == 2
