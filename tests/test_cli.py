"""The command line as a whole: its list of commands, its help, and arguments that no command takes."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from every_command import COMMANDS
from loaded_modules import loaded_by
from messages import one_line

import camcal.cli
from camcal import __version__
from camcal.cli import main


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
    loaded = loaded_by("from camcal.cli import main; main(['--help'])")
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
