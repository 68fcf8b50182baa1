"""Files that are no cameras, are broken, or hold what camcal has no lens for: one line each, whatever is in them."""

from __future__ import annotations

import io
import random
import struct

import pytest
from exchange_cameras import saved
from exchange_samples import CHAIN, FILES, LENS, ROS_MESSAGE, SAMPLES, write

from camcal.errors import CamcalError, InputError
from camcal.formats.camera_file import load_intrinsics
from camcal.workflows.export import export_camera
from camcal.workflows.import_ import import_camera


def fault(name: str, text: str | bytes, message: str) -> pytest.param:
    """A file and the start of what is said of it after its path."""
    return pytest.param(text, message, id=name)


FAULTS = [
    fault("text", "hello world", ":1: not a mapping"),
    fault("binary", b"\x89PNG\r\n\x1a\n\0\0" * 50, ":1: not a camera of a known format (got a binary file"),
    fault("empty", "", ": empty file"),
    fault("latin", b"K: \xff", ":1: not UTF-8"),
    fault("board", "type: checkerboard\ncolumns: 9\n", ":1: not a camera of a known format (got a YAML file with type"),
    fault("html", "<html><body/></html>", ":1: not a camera of a known format (got an XML file"),
    fault("json cut", '{"K": [1, 2', ":1: not valid JSON"),
    fault("json twice", '{"K": 1,\n"K": 2}', ":1: K: duplicate key"),
    fault("json deep", '{"K": ' + "[" * 100000, ":1: not valid JSON (nested too deeply"),
    fault("json nan", '{"fl_x": 1,\n"k1": NaN}', ":2: not valid JSON (got NaN"),
    fault("xml cut", "<a>\n<b></a>", ":2: not valid XML (mismatched tag)"),
    fault("xml entity", '<!DOCTYPE a [<!ENTITY b "c">]><opencv_storage>&b;</opencv_storage>', ":1: defines an entity"),
    fault("xml deep", "<a>" * 1000, ":1: nested too deeply"),
    fault("opencv short", "image_width: 4\nimage_height: 3\nK: [1, 2]\n", ":3: K: wrong number of values (got 2, expected 9)"),
    fault("opencv text", '{"K": [1, 0, 0, 0,\n"x", 0, 0, 0, 1]}', ":1: K: wrong type (got 'x', expected a number)"),
    fault("opencv infinite", "K: [1, 0, .inf, 0, 1, 0, 0, 0, 1]\n", ":1: K: not finite"),
    fault("opencv transposed", "K: [1, 0, 0, 0, 1, 0, 2, 2, 1]\n", ":1: K: not an intrinsic matrix"),
    fault("opencv behind", "K: [-1, 0, 0, 0, 1, 0, 0, 0, 1]\n", ":1: K: not an intrinsic matrix"),
    fault("opencv size", "width: 0\nheight: 3\nK: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n", ":3: K: not an image size (got 0x3"),
    fault("opencv six", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nD: [0, 0, 0, 0, 0, 0]\n", ":2: D: wrong number of values (got 6"),
    fault("opencv other name", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\ndistorsion: [0.1, 0]\n", ":2: distorsion: unknown name"),
    fault("ros old fisheye", "camera_model: equidistant\nK: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n",
          ":1: camera_model: unsupported lens model"),
    fault("ros uncalibrated", f"K: {[0.0] * 9}\nwidth: 4\nheight: 3\n", ":1: K: all zeros"),
    fault("ros twice", f"{ROS_MESSAGE}---\n{ROS_MESSAGE}---\n", ":10: a second document"),
    fault("thin prism", f"K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nD: {[0.0] * 11 + [0.1]}\n", ":2: D: thin-prism coefficients"),
    fault("tilt", f"K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nD: {[0.0] * 12 + [0.1, 0]}\n", ":2: D: tilt coefficients"),
    fault("opencv fisheye", "fisheye_model: 1\nK: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n", ":1: fisheye_model: unsupported lens model"),
    fault("ros fisheye", ROS_MESSAGE.replace("plumb_bob", "equidistant"), ":5: distortion_model: unsupported lens model"),
    fault("kalibr short", CHAIN.replace("501.0, 320.0, ", ""), ":3: cam0.intrinsics: wrong length (got a list of 2"),
    fault("kalibr missing", "cam0:\n  camera_model: pinhole\n", ":1: cam0.intrinsics: missing"),
    fault("kalibr count", "cam0: {camera_model: pinhole, intrinsics: [1.0, 1.0, 0, 0], distortion_model: radtan, "
          "distortion_coeffs: [0, 0], resolution: [4, 3]}\n", ":1: cam0.distortion_coeffs: wrong number of coefficients"),
    fault("colmap words", "1 PINHOLE 4 3 1 1 x 0\n", ":1: not a number"),
    fault("colmap count", "\n# c\n1 PINHOLE 4 3 1 1 0\n", ":3: camera 1: wrong number of values for PINHOLE (got 3"),
    fault("colmap nan", "1 PINHOLE 4 3 1 1 nan 0\n", ":1: camera 1: not finite"),
    fault("colmap torn", struct.pack("<QIiQQ3d", 1, 1, 1, 4, 3, 1, 1, 0), ": not a whole cameras.bin (got 56 bytes)"),
    fault("colmap number", struct.pack("<QIiQQ4dIiQQ", 2, 1, 1, 4, 3, 1, 1, 0, 0, 2, 99, 4, 3), ": camera 2 has an"),
    fault("mrcal code", "{ 'lensmodel': print(1), 'intrinsics': [], 'imagersize': [] }", ":1: not a dict of plain values"),
    fault("mrcal cut", "{ 'lensmodel': 'LENSMODEL_PINHOLE',\n", ":1: not a Python dict ('{' was never closed)"),
    fault("mrcal splined", "{ 'lensmodel': 'LENSMODEL_SPLINED_x',\n'intrinsics': [1.0], 'imagersize': [4, 3] }",
          ":1: lensmodel: unsupported lens model"),
    fault("mrcal count", "{ 'lensmodel': 'LENSMODEL_OPENCV4',\n'intrinsics': [1.0], 'imagersize': [4, 3] }",
          ":2: intrinsics: wrong number of values for LENSMODEL_OPENCV4 (got 1, expected 8)"),
    fault("nerfstudio missing", '{"frames": []}', ":1: fl_x: missing"),
    fault("nerfstudio fisheye", '{"fl_x": 1, "cx": 0, "cy": 0, "w": 4, "h": 3,\n"camera_model": "OPENCV_FISHEYE"}',
          ":2: camera_model: unsupported lens model"),
    fault("instant-ngp fisheye", '{"fl_x": 1, "cx": 0, "cy": 0, "w": 4, "h": 3,\n"is_fisheye": true}',
          ":2: is_fisheye: unsupported lens model"),
    fault("nerfstudio frames", '{"w": 4, "h": 3, "frames": [{"file_path": "a", "fl_x": 1, "cx": 0, "cy": 0}, '
          '{"file_path": "b", "fl_x": 2, "cx": 0, "cy": 0}]}', ": several cameras (got a, b, expected one)"),
    fault("matlab fisheye", '{"MappingCoefficients": [1, 2]}', ":1: MappingCoefficients: unsupported lens model"),
    fault("matlab short", "% x\ncameraIntrinsics([1 1], [0], [3 4])", ":2: PrincipalPoint: wrong number of values"),
    fault("matlab elsewhere", "K = [1 0 1; 0 1 1; 0 0 1];\ncameraParameters('K', K, 'RadialDistortion', other.radial)",
          ":2: RadialDistortion: not numbers"),
    fault("matlab unknown", "cameraIntrinsics([1 1], centre, [3 4])", ":1: centre: not numbers"),
    fault("lensfun empty", "<lensdatabase/>", ":1: no lens with a distortion"),
    fault("lensfun acm", LENS.format(model="unknown", terms="", extra=""), ":5: distortion: unsupported lens model"),
    fault("lensfun number", LENS.format(model="poly3", terms='k1="x"', extra=""), ": no image size in this file"),
    fault("json version", '{"format": "camcal camera",\n"format_version": 2}', ":2: format_version: unknown (got 2"),
    fault("json typo", '{"format": "camcal camera", "format_version": 1, "image_width": 4, "image_height": 3, "fx": 1, '
          '"fy": 1, "cx": 0, "cy": 0,\n"skw": 0}', ":2: skw: unknown key"),
]  # fmt: skip


@pytest.mark.parametrize(("content", "message"), FAULTS)
def test_faults_are_told_in_one_line(tmp_path, content, message):
    """The file, its line and key where it has them, and what was expected."""
    path = tmp_path / "file"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        load_intrinsics(path)
    told = str(caught.value)
    assert told.startswith(f"{path}{message}"), told
    assert "\n" not in told
    assert len(told) < 500 + len(str(path)) * 2


@pytest.mark.parametrize("name", ["ost.txt", "results-cam.txt", "Calib_Results.m"])
def test_text_that_is_no_camera(tmp_path, name):
    """A text that does not claim to be YAML is not blamed for being none."""
    path = write(tmp_path, name, "# made by x\n[image]\n\nwidth\n640\n %: [\n")
    with pytest.raises(InputError, match=r":1: not a camera of a known format \(got a text file"):
        load_intrinsics(path)


def test_a_lens_with_broken_numbers(tmp_path):
    """Numbers that lensfun's file should have are looked at once its size is known."""
    for terms, message in (
        ('k1="x"', r"lens\.xml:5: k1: wrong value \(got 'x'"),
        ('real-focal="0"', "real-focal: wrong value"),
    ):
        path = write(tmp_path, "lens.xml", LENS.format(model="poly3", terms=terms, extra=""))
        with pytest.raises(InputError, match=message):
            import_camera(path, size=(640, 480))
    path = write(tmp_path, "lens.xml", LENS.format(model="poly3", terms="", extra="<aspect-ratio>3:0</aspect-ratio>"))
    with pytest.raises(InputError, match="aspect-ratio: not one"):
        import_camera(path, size=(640, 480))


JUNK = (
    b"1e999",
    b"-1",
    b"null",
    b"[]",
    b"{}",
    b"nan",
    b"true",
    b'"x"',
    b"0",
    b"99999999999999999999",
    b"\n",
    b"inf",
    b"'",
    b"{",
    b"\0",
)


def mat_file() -> bytes:
    """A MAT file with a struct, if there is something to write one."""
    scipy_io = pytest.importorskip("scipy.io", reason="scipy is not installed")
    buffer = io.BytesIO()
    scipy_io.savemat(buffer, {"p": {"K": [[9.0, 0, 1], [0, 9, 1], [0, 0, 1]], "RadialDistortion": [[0.1, 0.2]]}})
    return buffer.getvalue()


def damaged(content: bytes, rng: random.Random) -> bytes:
    """A file with a piece missing, put in, or overwritten."""
    place = rng.randrange(len(content))
    junk = rng.choice(JUNK)
    return {
        "cut": content[:place],
        "gap": content[:place] + content[place + rng.randint(1, 20) :],
        "put": content[:place] + junk + content[place:],
        "over": content[:place] + junk + content[place + len(junk) :],
    }[rng.choice(("cut", "gap", "put", "over"))]


@pytest.mark.parametrize("kind", [*FILES, "samples", "mat"])
def test_damaged_files_are_read_or_refused(tmp_path, kind):
    """Whatever has happened to a file, it gives a camera or one line."""
    if kind == "samples":
        contents = [text.encode() for text, *_ in SAMPLES.values()] + [CHAIN.encode()]
    elif kind == "mat":
        contents = [mat_file()]
    else:
        source = saved(tmp_path, "one focal")
        contents = [content_of(export_camera(source, kind, tmp_path / file).content) for file in FILES[kind]]
    rng = random.Random(kind)
    path = tmp_path / "damaged"
    told = []
    for _ in range(60):
        path.write_bytes(damaged(rng.choice(contents), rng))
        try:
            import_camera(path, size=(1280, 720) if kind == "lensfun" else None)
        except CamcalError as error:
            told.append(str(error))
    assert told
    assert not any("\n" in line for line in told)


def content_of(content: str | bytes) -> bytes:
    """The bytes of a file."""
    return content.encode() if isinstance(content, str) else content
