"""`camcal calibrate` given what it cannot use: one line on stderr, the documented exit code, and nothing lost."""

from __future__ import annotations

import os
import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from messages import one_line

from camcal.boards.checkerboard import Checkerboard
from camcal.formats.corners_file import save_corners
from camcal.geometry.camera import Camera
from camcal.observations import Detection

BOARD = "checkerboard:7x6:20mm"


def refused(run, *arguments, output: Path):
    """Calibrate and return the exit code and the last line of stderr."""
    code, _, err = run("calibrate", *arguments, "-o", output)
    assert "Traceback" not in err
    return code, err.strip().splitlines()[-1]


def test_missing_folder(run, tmp_path):
    """A path that does not exist."""
    code, err = refused(run, tmp_path / "nowhere", "--board", BOARD, output=tmp_path / "o")
    assert code == 2
    assert "nowhere" in err


def test_empty_folder(run, tmp_path):
    """A folder without images."""
    (tmp_path / "empty").mkdir()
    code, err = refused(run, tmp_path / "empty", "--board", BOARD, output=tmp_path / "o")
    assert code == 2
    assert "no images" in err


@pytest.mark.parametrize("defect", ["zero bytes", "text", "truncated"])
def test_damaged_named_file_is_exit_2(run, dataset, tmp_path, defect):
    """A damaged file that is named stops the run before anything is written."""
    good = (dataset / "images/view_0000.png").read_bytes()
    content = {"zero bytes": b"", "text": b"no image at all", "truncated": good[: len(good) // 2]}[defect]
    bad = tmp_path / "bad.png"
    bad.write_bytes(content)
    images = sorted((dataset / "images").iterdir())
    code, err = refused(run, *images, bad, "--board", BOARD, output=tmp_path / "o")
    assert code == 2
    assert "bad.png" in err
    assert not (tmp_path / "o/camera.yaml").exists()


def test_damaged_file_in_a_folder_is_rejected_by_name(run, dataset, tmp_path):
    """In a folder it is a rejected view with a warning, other files are one counted line, and the run goes on."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    good = (folder / "view_0000.png").read_bytes()
    (folder / "torn.png").write_bytes(good[: len(good) // 2])
    (folder / "notes.txt").write_text("x")
    code, _, err = run("calibrate", folder, "--board", BOARD, "-o", tmp_path / "o")
    assert code == 0
    assert "torn.png: rejected" in err
    assert "1 other file passed over" in err
    views = {v["file"]: v for v in yaml.safe_load((tmp_path / "o/views.yaml").read_text())["views"]}
    assert views["torn.png"]["status"] == "rejected"
    assert views["torn.png"]["reason"]


def test_named_non_image(run, tmp_path):
    """A file that is named must be an image."""
    (tmp_path / "notes.txt").write_text("x")
    code, err = refused(run, tmp_path / "notes.txt", "--board", BOARD, output=tmp_path / "o")
    assert code == 2
    assert "notes.txt" in err


def test_mixed_sizes_solve_the_largest_group(run, dataset, tmp_path):
    """Views of another size are rejected by name; the rest is solved."""
    folder = tmp_path / "images"
    shutil.copytree(dataset / "images", folder)
    image = cv2.imread(str(folder / "view_0000.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(folder / "zoomed.png"), cv2.resize(image, (800, 600)))
    code, _, err = run("calibrate", folder, "--board", BOARD, "-o", tmp_path / "o")
    assert code == 0
    assert "zoomed.png: rejected: another image size (got 800x600, expected 640x480" in err


def test_too_few_views_is_exit_3(run, dataset, tmp_path):
    """Two boards are too few; so are images without any, and the first reason is told."""
    images = sorted((dataset / "images").iterdir())[:2]
    code, err = refused(run, *images, "--board", BOARD, output=tmp_path / "o")
    assert code == 3
    assert "got 2, expected at least 3" in err
    assert f"camcal detect IMAGES --board {BOARD} -o corners.csv --overlay seen" in err
    blank = tmp_path / "blank.png"
    cv2.imwrite(str(blank), np.full((480, 640), 128, np.uint8))
    code, err = refused(run, blank, "--board", BOARD, output=tmp_path / "p")
    assert code == 3
    assert "blank.png" in err
    assert f"camcal detect {shlex.quote(str(blank))} --board" in err


def test_aprilgrid_with_rows_and_columns_swapped(run, tmp_path):
    """4x5 tags for a grid of 5x4: exit 3, and the grid that was seen is named."""
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "name: grid\nseed: 4\ncamera: {size: [640, 480], fx: 520, fy: 520, cx: 320, cy: 240}\n"
        'board: "aprilgrid:5x4:30mm:0.3"\nviews: {count: 3, tilt_deg: [15, 35], fill: [0.7, 0.9]}\n'
    )
    assert run("synth", scene, "-o", tmp_path / "data")[0] == 0
    images = tmp_path / "data/images"
    code, err = refused(run, images, "--board", "aprilgrid:4x5:30mm:0.3", output=tmp_path / "o")
    assert code == 3
    assert "5x4" in err
    assert run("calibrate", images, "--board", "aprilgrid:5x4:30mm:0.3", "-o", tmp_path / "p")[0] == 0


def test_degenerate_geometry_is_exit_4(run, tmp_path):
    """Boards parallel to the image leave the focal length undetermined: exit 4, and no camera is written."""
    board, camera = Checkerboard(7, 6, 0.02), Camera((640, 480), [[520, 0, 320], [0, 520, 240], [0, 0, 1]])
    seen = []
    shifts = np.array([(-0.1, -0.08, 0.3), (-0.02, -0.05, 0.4), (-0.09, -0.01, 0.5), (-0.05, -0.05, 0.25)])
    for index, shift in enumerate(shifts):
        corners = camera.project(board.object_points + shift)
        noise = np.random.default_rng(index).normal(0, 0.1, corners.shape)
        seen.append(Detection(f"{index}.png", camera.size, np.arange(42), corners + noise, np.full(42, np.nan)))
    save_corners(tmp_path / "flat.csv", seen)
    code, err = refused(run, tmp_path / "flat.csv", "--board", BOARD, output=tmp_path / "o")
    assert code == 4
    assert "Tilt the board" in err
    assert not (tmp_path / "o/camera.yaml").exists()


def test_rows_and_columns_swapped_in_images_is_harmless(run, dataset, tmp_path):
    """6x7 for 7x6 is the same board: solved."""
    code, *_ = run("calibrate", dataset / "images", "--board", "checkerboard:6x7:20mm", "-o", tmp_path / "o")
    assert code == 0


def test_rows_and_columns_swapped_in_corners(run, dataset, tmp_path):
    """In a corners file they are wrong: exit 4 or 5, with the board that fits."""
    code, err = refused(run, dataset / "corners.csv", "--board", "checkerboard:6x7:20mm", output=tmp_path / "o")
    assert code in (4, 5)
    assert "checkerboard:7x6:20mm" in err
    assert "swapped" in err


def test_absurd_result_is_written_marked_and_exit_5(run, dataset, tmp_path):
    """Gross errors in the corners leave a large RMS: the files are there and say that they must not be trusted."""
    lines = (dataset / "corners.csv").read_text().splitlines()
    header, rows = lines[0], [line.split(",") for line in lines[1:]]
    rng = np.random.default_rng(0)
    for row in rows:
        row[4] = repr(float(row[4]) + rng.normal(0, 6))
    bad = tmp_path / "bad.csv"
    bad.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")
    code, err = refused(run, bad, "--board", BOARD, output=tmp_path / "o")
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
def test_senseless_board(run, dataset, tmp_path, spec):
    """A board SPEC that makes no sense is exit 2 and creates nothing."""
    code, _ = refused(run, dataset / "images", "--board", spec, output=tmp_path / "o")
    assert code == 2
    assert not (tmp_path / "o").exists()


def test_ids_that_are_not_on_the_board(run, dataset, tmp_path):
    """A corners file of a larger board."""
    code, err = refused(run, dataset / "corners.csv", "--board", "checkerboard:5x4:20mm", output=tmp_path / "o")
    assert code == 2
    assert "not on the board" in err


def test_existing_output_needs_force(run, dataset, tmp_path):
    """A folder with something in it is refused without --force, and its files stay with it."""
    output = tmp_path / "o"
    output.mkdir()
    (output / "mine.txt").write_text("keep")
    code, err = refused(run, dataset / "images", "--board", BOARD, output=output)
    assert code == 2
    assert "--force" in err
    assert run("calibrate", dataset / "images", "--board", BOARD, "-o", output, "--force")[0] == 0
    assert (output / "mine.txt").read_text() == "keep"


@pytest.mark.parametrize("name", ["board.yaml", "camera.yaml", "corners.csv", "views.yaml"])
def test_a_folder_where_a_result_should_be(run, calibrated, tmp_path, name):
    """Exit code 2 and one line that names it, with --force too; it stays, and there is no camera that would claim success."""
    odd = tmp_path / "o" / name
    odd.mkdir(parents=True)
    code, _, err = run("calibrate", calibrated / "corners.csv", "--board", BOARD, "-o", tmp_path / "o", "--force")
    assert code == 2
    assert f"{odd}: " in one_line(err)
    assert odd.is_dir()
    assert not (tmp_path / "o/camera.yaml").is_file()


def test_output_that_cannot_be_written(run, dataset, tmp_path):
    """A file stands where the folder should be."""
    (tmp_path / "file").write_text("x")
    code, _ = refused(run, dataset / "images", "--board", BOARD, output=tmp_path / "file/below")
    assert code == 2


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_output_without_permission(run, dataset, tmp_path):
    """A folder that may not be written into."""
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    code, err = refused(run, dataset / "images", "--board", BOARD, output=locked / "o")
    assert code == 2
    assert "permission denied" in err


def test_options_that_contradict(run, dataset, tmp_path):
    """--undistort without images, --only-used without a corners file, two kinds of input at once."""
    corners, images = dataset / "corners.csv", dataset / "images"
    assert refused(run, corners, "--undistort", "--board", BOARD, output=tmp_path / "o")[0] == 2
    assert refused(run, images, "--only-used", "--board", BOARD, output=tmp_path / "o")[0] == 2
    assert refused(run, corners, images, "--board", BOARD, output=tmp_path / "o")[0] == 2
