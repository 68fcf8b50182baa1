"""`camcal.undistort`: points in CSV files, both ways."""

from __future__ import annotations

import csv
import logging
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from undistort_files import CAMERA, FOLDED, SIZE, make_images, tree

import camcal
from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.corners_file import load_corners
from camcal.records import Intrinsics


def write_points(path: Path, points: np.ndarray, header: str = "name,x,y,note") -> Path:
    """Write points among other columns."""
    lines = [header, *(f"p{i},{x!r},{y!r},{i} of all" for i, (x, y) in enumerate(points.tolist()))]
    path.write_text("\n".join(lines) + "\n")
    return path


def read_points(path: Path) -> np.ndarray:
    """Read x and y back."""
    with path.open(newline="") as file:
        return np.array([[float(row[key] or "nan") for key in "xy"] for row in csv.DictReader(file)])


def test_points_there_and_back(camera_file, tmp_path):
    """Points equal OpenCV's, other columns stay, and the way back is exact to 1e-9 px."""
    points = np.random.default_rng(0).uniform(-0.5, np.array(SIZE) - 0.5, (200, 2))
    source = write_points(tmp_path / "points.csv", points)
    done = camcal.undistort(source, camera_file, tmp_path / "flat", alpha=0.3)
    flat = read_points(tmp_path / "flat/points.csv")
    expected = cv2.undistortPoints(points[:, None], CAMERA.K, CAMERA.dist, P=done.target.K, criteria=(3, 500, 1e-14))
    assert np.abs(flat - expected.reshape(-1, 2)).max() < 1e-8
    assert tree(tmp_path / "flat") == ["camera.yaml", "points.csv"]
    with (tmp_path / "flat/points.csv").open(newline="") as file:
        assert [row["note"] for row in csv.DictReader(file)] == [f"{i} of all" for i in range(200)]
    for number, options in enumerate(({"alpha": 0.3}, {"target": tmp_path / "flat"})):
        back = tmp_path / f"{number}.csv"
        camcal.undistort(tmp_path / "flat/points.csv", camera_file, back, distort=True, **options)
        assert np.abs(read_points(back) - points).max() < 1e-9
        assert load_intrinsics(tmp_path / f"{number}.camera.yaml").camera.intrinsics.tolist() == CAMERA.intrinsics.tolist()


def test_corners_of_a_calibration(dataset, tmp_path):
    """Our own corners file is one of points: it stays loadable, at the size of the new image."""
    camcal.undistort(dataset / "corners.csv", dataset, tmp_path / "flat.csv", scale=1.5)
    camera = load_intrinsics(dataset).camera
    before, after = load_corners(dataset / "corners.csv"), load_corners(tmp_path / "flat.csv")
    target = load_intrinsics(tmp_path / "flat.camera.yaml").camera
    for old, new in zip(before, after, strict=True):
        assert (new.source, new.size, new.ids.tolist()) == (old.source, (960, 720), old.ids.tolist())
        rays = camera.unproject(old.corners_px)
        np.testing.assert_array_equal(new.corners_px, target.project(rays))
    other = tmp_path / "other.yaml"
    save_intrinsics(other, replace(load_intrinsics(dataset), camera=camera.scaled((320, 240))))
    with pytest.raises(InputError, match=r"corners\.csv:2: width: not the camera's \(got '640', expected 320\)"):
        camcal.undistort(dataset / "corners.csv", other, tmp_path / "o.csv")


def test_points_past_the_fold(tmp_path, caplog):
    """They have no place: empty cells and one warning that names the first; cells that are empty stay so."""
    save_intrinsics(tmp_path / "c.yaml", Intrinsics(FOLDED))
    source = write_points(tmp_path / "p.csv", np.array([[31.5, 23.5], [63.0, 0.0], [float("nan"), 3.0]]))
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(source, tmp_path / "c.yaml", tmp_path / "o.csv", alpha=1)
    assert np.isnan(read_points(tmp_path / "o.csv")).all(axis=1).tolist() == [False, True, True]
    assert done.warnings == (f"{source}: 1 point lies past the fold of a lens (empty cells, first on line 3).",)
    assert [record.message for record in caplog.records] == list(done.warnings)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "empty file"),
        ("x,y\n", "no points"),
        ("x,z\n1,2\n", r"p\.csv:1: y: missing column"),
        ("x;y\n1;2\n", "columns not separated by commas"),
        ("x,y,x\n1,2,3\n", r"p\.csv:1: x: column given twice"),
        ("x,y\n1,2\n1\n", r"p\.csv:3: wrong number of cells \(got 1, expected 2\)"),
        ("x,y\n1,two\n", r"p\.csv:2: y: not a number \(got 'two'\)"),
        ("x,y\n1,inf\n", r"p\.csv:2: y: not finite"),
        ('x,y\n1,"2\n', "not valid CSV"),
    ],
)
def test_points_that_are_none(camera_file, tmp_path, text, match):
    """Each defect with its line, and nothing is written."""
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=match):
        camcal.undistort(tmp_path / "p.csv", camera_file, tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_points_stand_alone(camera_file, tmp_path):
    """Beside images, over themselves, or with options of images: refused. A dry run writes nothing."""
    source = write_points(tmp_path / "p.csv", np.array([[1.0, 2.0]]))
    make_images(tmp_path, "a.png")
    with pytest.raises(InputError, match="stands alone"):
        camcal.undistort([source, tmp_path / "a.png"], camera_file, tmp_path / "o")
    with pytest.raises(InputError, match="replace its own input"):
        camcal.undistort(source, camera_file, source, force=True)
    for options in ({"quality": 90}, {"mask": True}, {"resume": True}, {"frames": "0:1"}, {"rescale": True}):
        with pytest.raises(InputError, match="not for points"):
            camcal.undistort(source, camera_file, tmp_path / "o", **options)
    plan = camcal.undistort(source, camera_file, tmp_path / "o", dry_run=True)
    assert [job.target for job in plan.outputs] == [tmp_path / "o/p.csv"]
    assert not (tmp_path / "o").exists()
