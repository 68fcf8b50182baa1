"""The command line: what each command prints and writes, and each documented exit code."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from camcal import __version__
from camcal.cli import main

COMMANDS = ("demo", "board", "synth", "calibrate", "undistort", "verify")


@pytest.fixture
def run(capsys):
    """Run a command in this process: exit code, stdout, stderr."""

    def call(*arguments: object) -> tuple[int, str, str]:
        code = main([str(argument) for argument in arguments])
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


@pytest.mark.parametrize("command", [(), *((name,) for name in COMMANDS)])
@pytest.mark.parametrize("flag", ["-h", "--help"])
def test_help_ends_in_an_example(run, command, flag):
    """Every help text has an example on its last line."""
    code, out, _ = run(*command, flag)
    assert code == 0
    assert out.strip().splitlines()[-1].strip().startswith("Example: camcal ")


@pytest.mark.parametrize(
    "arguments", [("calibrat",), ("calibrate",), ("verify", "--nonsense"), ("synth", "x", "-o", "y", "-j", "0")]
)
def test_usage_errors_are_exit_2(run, arguments):
    """Click's own errors: an unknown command, missing arguments, unknown options, values out of range."""
    code, out, err = run(*arguments)
    assert code == 2
    assert out == ""
    assert "Error" in err


def test_installed_command_and_module():
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
    """An unknown name is answered with those there are."""
    code, _, err = run("synth", "webcam_721p", "-o", tmp_path / "data")
    assert code == 2
    assert "webcam_720p" in one_line(err)


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
    """Rendered pixels to a camera within 4 standard deviations of the truth, four files, and a table."""
    code, out, _ = run("calibrate", dataset / "images", "--board", dataset / "board.yaml", "-o", tmp_path / "calib")
    assert code == 0
    assert "RMS" in out
    assert "8 views" in out
    assert sorted(p.name for p in (tmp_path / "calib").iterdir()) == ["board.yaml", "camera.yaml", "corners.csv", "views.yaml"]
    code, out, _ = run("verify", tmp_path / "calib", "--truth", dataset, "--max-sigma", "4", "--max-diff", "3", "--json")
    assert code == 0
    result = json.loads(out)
    assert result["problems"] == []
    assert result["views"]["corners"] == 336
    assert result["views"]["corner_rms_px"] < 0.1


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
    """Calibrating from the corners.csv of a run gives the same camera.yaml, views.yaml and corners.csv."""
    code, *_ = run("calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "again")
    assert code == 0
    for name in ("camera.yaml", "corners.csv", "board.yaml"):
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
    """Names and sizes are kept, straight grid lines become straight: the board fits a homography."""
    code, out, _ = run("undistort", dataset / "images", "--camera", dataset / "camera.yaml", "-o", tmp_path / "flat")
    assert code == 0
    assert "8 undistorted images" in out
    image = cv2.imread(str(tmp_path / "flat/view_0000.png"), cv2.IMREAD_UNCHANGED)
    assert image.shape == cv2.imread(str(dataset / "images/view_0000.png"), cv2.IMREAD_UNCHANGED).shape
    assert (
        run("calibrate", tmp_path / "flat", "--board", dataset / "board.yaml", "-o", tmp_path / "c", "--distortion", "none")[0]
        == 0
    )
    camera = json.loads(run("verify", tmp_path / "c", "--truth", tmp_path / "flat/camera.yaml", "--json")[1])
    assert camera["projection_difference_px"]["max"] < 1


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


def test_verify_of_camera_files(run, dataset, calibrated):
    """Camera files alone are compared too, without views; another image size is refused."""
    code, out, _ = run("verify", calibrated / "camera.yaml", "--truth", dataset / "camera.yaml", "--json")
    assert code == 0
    assert json.loads(out)["views"] is None


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
        blank = tmp_path / "blank.png"
        cv2.imwrite(str(blank), np.full((480, 640), 128, np.uint8))
        code, err = self.calibrate(run, blank, "--board", self.BOARD, output=tmp_path / "p")
        assert code == 3
        assert "blank.png" in err

    def test_squares_counted_for_inner_corners(self, run, dataset, tmp_path):
        """8x7 squares are 7x6 inner corners: exit 3, and the size that was seen is named."""
        code, err = self.calibrate(run, dataset / "images", "--board", "checkerboard:8x7:20mm", output=tmp_path / "o")
        assert code == 3
        assert "7x6" in err

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
        assert camera["camcal"]["trusted"] is False
        assert "RMS" in camera["camcal"]["problems"][0]

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

    def test_options_that_contradict(self, run, dataset, tmp_path):
        """--undistort without images, --only-used without a corners file, two kinds of input at once."""
        corners, images = dataset / "corners.csv", dataset / "images"
        assert self.calibrate(run, corners, "--undistort", "--board", self.BOARD, output=tmp_path / "o")[0] == 2
        assert self.calibrate(run, images, "--only-used", "--board", self.BOARD, output=tmp_path / "o")[0] == 2
        assert self.calibrate(run, corners, images, "--board", self.BOARD, output=tmp_path / "o")[0] == 2

    def test_ctrl_c(self, tmp_path):
        """Interrupted while rendering: exit code 130, and no temporary or half-written file."""
        process = subprocess.Popen(
            [sys.executable, "-m", "camcal", "synth", "phone_12mp", "-o", str(tmp_path / "data")],
            stderr=subprocess.PIPE,
            text=True,
        )
        images = tmp_path / "data/images"
        deadline = time.monotonic() + 60
        while not list(images.glob("*.png")) and time.monotonic() < deadline:
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
        assert process.returncode == 130
        assert "Traceback" not in err
        for path in (tmp_path / "data").rglob("*"):
            if path.is_file():
                assert path.suffix == ".png"
                assert cv2.imread(str(path)) is not None
