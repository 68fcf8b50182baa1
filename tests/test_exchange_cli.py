"""`camcal export` and `camcal import`, and the other commands with cameras of other tools."""

from __future__ import annotations

import io
import json
import os
import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest
from exchange_cameras import CAMERAS, same, saved
from loaded_modules import loaded_by
from messages import one_line

from camcal.cli.export import FORMATS as NAMES
from camcal.formats.camera_file import load_intrinsics
from camcal.formats.exchange.table import FORMATS
from camcal.workflows.export import export_camera


def test_the_command_line_knows_every_format():
    """Its list, which is there before the formats are imported, is theirs."""
    assert sorted(NAMES) == sorted(FORMATS)
    for name, kind in FORMATS.items():
        assert kind.profile.name == name
        assert kind.profile.suffixes


@pytest.mark.parametrize("name", NAMES)
def test_export_to_standard_output(run, tmp_path, name):
    """Without -o the file goes to standard output, and is the same; nothing else is written."""
    source = saved(tmp_path, "one focal")
    code, out, err = run("export", source, "--to", name)
    assert (code, err) == (0, "")
    assert out == export_camera(source, name).content
    assert [path.name for path in tmp_path.iterdir()] == [source.name]


def test_the_help_of_export_tells_formats_apart(run):
    """Which are of cameras, which of boards, which of corners."""
    _, out, _ = run("export", "-h")
    text = " ".join(out.split())
    assert f"Of cameras: {', '.join(NAMES)}; of boards: kalibr, camcal; of corners: csv, vnl, matlab." in text


def test_there_and_back(run, tmp_path):
    """A file for another tool, and the camera file that comes back."""
    source = saved(tmp_path, "webcam")
    code, out, _ = run("export", source, "--to", "colmap", "-o", tmp_path / "new/cameras.txt")
    assert (code, "the same camera" in " ".join(out.split())) == (0, True)
    code, out, _ = run("import", tmp_path / "new/cameras.txt", "-o", tmp_path / "back.yaml", "--name", "front")
    assert (code, "Camera(1280x720, fx=900.125" in " ".join(out.split())) == (0, True)
    back = load_intrinsics(tmp_path / "back.yaml")
    same(CAMERAS["webcam"], back.camera, 2)
    assert back.name == "front"


def piped(content: str | bytes) -> Path:
    """A pipe that holds a file, as a shell's `<(...)` names it; it can be read only once."""
    reading, writing = os.pipe()
    os.write(writing, content.encode() if isinstance(content, str) else content)
    os.close(writing)
    return Path(f"/dev/fd/{reading}")


needs_pipes = pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="no names for pipes on this system")


@needs_pipes
@pytest.mark.parametrize("name", [*(name for name in NAMES if name != "lensfun"), "camcal"])
def test_cameras_come_from_pipes(run, tmp_path, name):
    """A pipe is read only once, whatever the format, and gives what the file gives."""
    source = saved(tmp_path, "radtan")
    content = source.read_text() if name == "camcal" else export_camera(source, name).content
    code, out, err = run("verify", piped(content), "--truth", source, "--max-diff", "1e-6", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["projection_difference_px"]["max"] < 1e-9
    assert run("import", piped(content), "-o", tmp_path / "back.yaml")[0] == 0
    same(CAMERAS["radtan"], load_intrinsics(tmp_path / "back.yaml").camera, 2)


@needs_pipes
def test_a_pipe_takes_the_place_of_every_camera_file(run, tmp_path):
    """Undistort and export read one too; an endless or an empty one is refused."""
    source = saved(tmp_path, "radtan")
    image = tmp_path / "photo.png"
    cv2.imwrite(str(image), np.random.default_rng(0).integers(0, 255, (720, 1280), dtype=np.uint8))
    for camera, out in ((source, tmp_path / "a"), (piped(export_camera(source, "ros").content), tmp_path / "b")):
        assert run("undistort", image, "--camera", camera, "-o", out)[0] == 0
    assert (tmp_path / "a/photo.png").read_bytes() == (tmp_path / "b/photo.png").read_bytes()
    assert run("export", piped(source.read_text()), "--to", "kalibr")[1] == run("export", source, "--to", "kalibr")[1]
    code, _, err = run("export", piped(""), "--to", "ros")
    assert (code, ": empty file (0 bytes)" in one_line(err)) == (2, True)
    with subprocess.Popen(["yes"], stdout=subprocess.PIPE) as endless:
        code, _, err = run("export", f"/dev/fd/{endless.stdout.fileno()}", "--to", "ros")
        endless.kill()
    assert (code, ": too big (got more than 64000000 bytes" in one_line(err)) == (2, True)


@pytest.mark.parametrize("name", NAMES)
def test_export_is_piped_into_import(run, tmp_path, monkeypatch, name):
    """`camcal export A --to FORMAT | camcal import - -o B`: the camera comes back, and its faults name standard input."""
    source = saved(tmp_path, "one focal")
    _, out, _ = run("export", source, "--to", name)
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(out.encode())))
    options = ("--size", "1280x720", "--max-refit-px", 10) if name == "lensfun" else ()
    code, _, err = run("import", "-", "-o", tmp_path / "back.yaml", *options)
    assert code == 0, err
    back = load_intrinsics(tmp_path / "back.yaml").camera
    assert back.size == CAMERAS["one focal"].size
    if name != "lensfun":
        same(CAMERAS["one focal"], back, 2)


def test_what_is_wrong_with_standard_input(run, tmp_path, monkeypatch):
    """Nothing, no camera, and a line that is wrong: exit code 2, one line each, which says where."""
    for content, told in (
        (b"", "standard input: empty file"),
        (b"type: checkerboard\n", "standard input:1: not a camera of a known format (got a YAML file with type"),
        (b"image_width: 4\nimage_height: 3\nK: [1, 2]\n", "standard input:3: K: wrong number of values"),
    ):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(content)))
        code, _, err = run("import", "-", "-o", tmp_path / "back.yaml")
        assert (code, told in one_line(err)) == (2, True), err
    monkeypatch.setattr("sys.stdin", None)
    code, _, err = run("import", "-", "-o", tmp_path / "back.yaml")
    assert (code, "standard input: closed" in one_line(err)) == (2, True)
    assert list(tmp_path.iterdir()) == []


def test_exit_codes(run, tmp_path):
    """2 for what cannot be used, 5 for what would not be the same camera; nothing is left behind by either."""
    source = saved(tmp_path, "webcam")
    out = tmp_path / "out.yaml"
    for arguments, code, message in (
        (("export", source, "--to", "kalbir"), 2, "Did you mean 'kalibr'?"),
        (("export", source, "--to", "camcal"), 2, "camcal is a format of boards (got a camera, expected colmap, json, kalibr,"),
        (("export", source, "--to", "camcal"), 2, "camcal's own is what camcal import -o camera.yaml writes."),
        (("export", source, "--to", "csv"), 2, "--to: csv is a format of corners (got a camera, expected colmap,"),
        (("export", tmp_path / "none.yaml", "--to", "ros", "-o", out), 2, "no such file"),
        (("export", source, "--to", "kalibr", "-o", out, "--no-refit"), 5, "cannot hold k3: refitted, it differs by up to 1."),
        (("export", source, "--to", "kalibr", "-o", out, "--max-refit-px", 0.1), 5, "more than --max-refit-px 0.1"),
        (("export", source, "--to", "lensfun", "--crop-factor", 0), 2, "--crop-factor: out of range"),
        (("export", source, "--to", "opencv", "-o", tmp_path / "o.txt"), 2, "expected .yaml or .yml or .xml or .json"),
        (("export", source, "--to", "colmap", "-o", tmp_path / "o"), 2, "expected .txt or .bin"),
        (("export", source, "--to", "ros", "-o", source), 2, "output file exists"),
        (("import", source, "-o", source), 2, "output file exists"),
        (("import", source, "-o", out, "--from", "kalibr"), 2, "no camera (expected entries such as cam0"),
        (("import", source, "-o", out, "--from", "mrcl"), 2, "Did you mean 'mrcal'?"),
        (("import", source, "-o", out, "--size", "12"), 2, "is not WIDTHxHEIGHT"),
        (("import", source, "-o", out, "--camera", "cam7"), 2, "no camera 'cam7' (got webcam)"),
    ):
        got, _, err = run(*arguments)
        assert got == code, err
        assert message in err, err
    assert [path.name for path in tmp_path.iterdir()] == [source.name]


def test_a_refit_warns_and_is_done(run, tmp_path):
    """Exit code 0, the difference on standard error, the file on standard output fit to be piped."""
    code, out, err = run("export", saved(tmp_path, "webcam"), "--to", "kalibr")
    assert code == 0
    assert "warning: Kalibr's camchain cannot hold k3: refitted, it differs by up to" in err
    assert out.startswith("# Camera webcam")


def test_an_interrupted_write_leaves_nothing(run, tmp_path, monkeypatch):
    """The output appears whole or not at all."""
    source = saved(tmp_path, "webcam")

    def full(*_: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    code, _, err = run("export", source, "--to", "ros", "-o", tmp_path / "out.yaml")
    assert (code, "no space left on device" in err) == (2, True)
    assert [path.name for path in tmp_path.iterdir()] == [source.name]


def test_import_asks_for_what_is_open(run, tmp_path):
    """Which of several cameras, and an image size."""
    chain = tmp_path / "chain.yaml"
    entry = "{camera_model: pinhole, intrinsics: [5.0, 6.0, 2.0, 1.0], distortion_model: none, resolution: [4, 3]}"
    chain.write_text(f"cam0: {entry}\ncam1: {entry}\n")
    code, _, err = run("import", chain, "-o", tmp_path / "c.yaml")
    assert (code, "several cameras (got cam0, cam1, expected one). Choose one with --camera NAME." in err) == (2, True)
    assert run("import", chain, "--camera", "cam1", "-o", tmp_path / "c.yaml")[0] == 0
    assert run("import", f"{chain}#cam0", "-o", tmp_path / "c.yaml", "--force")[0] == 0
    bare = tmp_path / "bare.json"
    bare.write_text('{"K": [[5, 0, 2], [0, 5, 1], [0, 0, 1]]}')
    code, _, err = run("import", bare, "-o", tmp_path / "d.yaml")
    assert (code, "--size WxH" in err) == (2, True)
    assert run("import", bare, "--size", "4x3", "-o", tmp_path / "d.yaml")[0] == 0
    assert load_intrinsics(tmp_path / "d.yaml").camera.size == (4, 3)


@pytest.mark.parametrize("kind", [name for name in NAMES if name != "lensfun"])
def test_every_command_takes_them(run, tmp_path, kind):
    """Undistort, verify and export take each format as it stands, and give what they give for our own file."""
    source = saved(tmp_path, "radtan")
    suffix = FORMATS[kind].profile.suffixes[0]
    other = tmp_path / f"other{suffix}"
    export_camera(source, kind, other)
    image = tmp_path / "photo.png"
    cv2.imwrite(str(image), np.random.default_rng(0).integers(0, 255, (720, 1280), dtype=np.uint8))
    for camera, out in ((source, tmp_path / "a"), (other, tmp_path / "b")):
        assert run("undistort", image, "--camera", camera, "-o", out)[0] == 0
    assert (tmp_path / "a/photo.png").read_bytes() == (tmp_path / "b/photo.png").read_bytes()
    code, out, _ = run("verify", other, "--truth", source, "--max-diff", "1e-6", "--json")
    assert code == 0
    assert json.loads(out)["projection_difference_px"]["max"] < 1e-9
    assert run("export", other, "--to", "json")[0] == 0


def test_a_camera_of_several_in_other_commands(run, tmp_path):
    """`FILE#NAME` stands wherever a camera does."""
    source = saved(tmp_path, "radtan")
    chain = tmp_path / "chain.yaml"
    export_camera(source, "kalibr", chain)
    text = chain.read_text()
    chain.write_text(text + text.replace("cam0:", "cam1:").replace("900.125", "910.125"))
    assert run("verify", f"{chain}#cam0", "--truth", source, "--max-diff", "1e-6")[0] == 0
    code, _, err = run("verify", f"{chain}#cam1", "--truth", source, "--max-diff", "1e-6")
    assert (code, "projection differs by up to" in err) == (5, True)
    code, _, err = run("verify", chain, "--truth", source)
    assert (code, f"Name one: {chain}#NAME" in err) == (2, True)


def test_a_huge_file_is_refused_at_once(run, tmp_path):
    """Before it is read."""
    huge = tmp_path / "huge.yaml"
    with huge.open("wb") as file:
        os.truncate(file.fileno(), 1 << 34)
    code, _, err = run("export", huge, "--to", "ros")
    assert (code, "too big" in err) == (2, True)


def test_our_own_file_does_not_wait_for_the_others(tmp_path):
    """A camera file of ours is read without loading what other formats need."""
    source = saved(tmp_path, "webcam")
    loaded = loaded_by("from camcal.formats.camera_file import load_intrinsics; load_intrinsics(sys.argv[1])", source)
    assert [name for name in loaded if "exchange" in name or name in ("pydantic", "yaml", "xml")] == []


@pytest.mark.parametrize(
    ("given", "arguments", "told"),
    [
        ("camera.yaml", ("--to", "ros", "--only-used"), "--only-used: only for corners (got cameras)."),
        ("corners.csv", ("--to", "vnl", "--no-refit"), "--no-refit: only for cameras (got corners)."),
        ("corners.csv", ("--to", "vnl", "--max-refit-px", "3"), "--max-refit-px: only for cameras (got corners)."),
        ("checkerboard:9x6:25mm", ("--to", "camcal", "--size", "640x480"), "--size: only for corners (got boards)."),
        ("camera.yaml", ("--to", "ros", "--lens-name", "Zoom"), "--lens-name: only for lensfun (got --to ros)."),
        ("camera.yaml", ("--to", "colmap", "--crop-factor", "2"), "--crop-factor: only for lensfun (got --to colmap)."),
    ],
)
def test_options_that_mean_nothing_here_are_refused(run, tmp_path, monkeypatch, given, arguments, told):
    """An option for other kinds of files, or for another format, is exit code 2, even at its default; nothing is written."""
    monkeypatch.chdir(tmp_path)
    saved(tmp_path, "one focal").rename("camera.yaml")
    Path("corners.csv").touch()
    code, out, err = run("export", given, *arguments, "-o", "new/file")
    assert (code, out) == (2, "")
    assert told in err
    assert not Path("new").exists()
