"""`camcal synth`: images and their truth, the same bytes however it is run, and the scenarios that are shipped."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from every_command import COMMANDS
from messages import one_line

from camcal.resources import config_names


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


@pytest.mark.parametrize(
    ("name", "make"), [("camera.yaml", Path.mkdir), ("images", Path.touch), ("images/view_0000.png", None)]
)
def test_synth_does_not_stumble_over_folders_and_files(run, scene_file, tmp_path, name, make):
    """A folder where a file should be, or a file where a folder should, is exit code 2 and one line, with --force too."""
    odd = tmp_path / "data" / name
    odd.parent.mkdir(parents=True)
    (make or Path.mkdir)(odd)
    code, _, err = run("synth", scene_file, "-o", tmp_path / "data", "--force")
    assert code == 2
    assert f"{odd}: a f" in one_line(err)
    assert odd.exists()
