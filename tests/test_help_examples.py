"""Every command's help ends in an example, and every example runs exactly as it is printed."""

from __future__ import annotations

import shlex
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from every_command import COMMANDS

from camcal.cli import cli, main
from camcal.workflows.calibrate import calibrate
from camcal.workflows.synth import synth

SCENE = """\
name: examples
seed: 6
camera: {size: [640, 480], fx: 520.0, fy: 523.0, cx: 322.0, cy: 236.0, distortion: {k1: -0.18, k2: 0.06}}
board: "checkerboard:9x6:25mm"
views: {count: 8, tilt_deg: [10, 40], fill: [0.5, 0.8]}
"""

KALIBR = """\
cam0:
  camera_model: pinhole
  intrinsics: [520.0, 523.0, 322.0, 236.0]
  distortion_model: radtan
  distortion_coeffs: [-0.18, 0.06, 0.0, 0.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
"""


@dataclass(frozen=True)
class Made:
    """What is made once, for all examples."""

    data: Path
    calib: Path


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Made:
    """Images of the board that the examples name, with their truth, and their calibration."""
    folder = tmp_path_factory.mktemp("examples")
    (folder / "scene.yaml").write_text(SCENE)
    synth(folder / "scene.yaml", folder / "data")
    calibrate([folder / "data/images"], "checkerboard:9x6:25mm", folder / "calib", report=False)
    return Made(folder / "data", folder / "calib")


# What an example may find where it runs, by the beginning of what it names.
FOUND: dict[str, Callable[[Made], object]] = {
    "photos": lambda made: shutil.copytree(made.data / "images", "photos"),
    "data": lambda made: shutil.copytree(made.data, "data"),
    "calib": lambda made: shutil.copytree(made.calib, "calib"),
    "camera.yaml": lambda made: shutil.copy(made.calib / "camera.yaml", "camera.yaml"),
    "corners.csv": lambda made: shutil.copy(made.calib / "corners.csv", "corners.csv"),
    "camchain.yaml": lambda _: Path("camchain.yaml").write_text(KALIBR),
}

# Exit codes other than 0, with the reason.
DOCUMENTED: dict[str, int] = {}


def last_line(text: str) -> str:
    """The example at the end of a help text, as a shell would read it."""
    _, _, example = text.rpartition("Example:")
    return " ".join(example.replace("\\\n", "").split())


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize("name", ["", *sorted(COMMANDS)])
def test_help_ends_in_its_example(name, flag, capsys):
    """Both ways to ask for help, for camcal and for each command: it ends in the example, which names the command."""
    assert main([*([name] if name else []), flag]) == 0
    example = last_line(capsys.readouterr().out)
    assert example.startswith(f"camcal {name}".strip())
    assert example == (COMMANDS[name] if name else cli).epilog.removeprefix("Example: ")


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_example_runs(name, made, tmp_path, monkeypatch, capsys):
    """In a folder that holds what the example names, and not what it writes."""
    monkeypatch.chdir(tmp_path)
    program, *arguments = shlex.split((COMMANDS[name].epilog or "").removeprefix("Example: "))
    assert (program, arguments[0]) == ("camcal", name)
    written = {arguments[at + 1] for at, flag in enumerate(arguments[:-1]) if flag in {"-o", "--output"}}
    for start, make in FOUND.items():
        if any(word == start or word.startswith(f"{start}/") for word in arguments if word not in written):
            make(made)
    code = main(arguments)
    captured = capsys.readouterr()
    assert code == DOCUMENTED.get(name, 0), captured.err
    for output in written:
        assert Path(output).exists()
