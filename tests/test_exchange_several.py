"""Files that hold several cameras: one is taken if it is named, none unasked."""

from __future__ import annotations

import json
import shlex

import pytest
from exchange_cameras import CAMERAS, WEBCAM, K, same
from exchange_samples import CHAIN, write

from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.records import Intrinsics
from camcal.workflows.import_ import import_camera


def test_one_of_several_cameras(tmp_path):
    """Without a choice they are named; a choice may stand in the path; a fisheye among them harms nobody else."""
    path = write(tmp_path, "camchain.yaml", CHAIN)
    with pytest.raises(InputError, match=r"camchain\.yaml: several cameras \(got cam0, cam1, cam2, cam3, expected one\)"):
        load_intrinsics(path)
    assert load_intrinsics(f"{path}#cam0").camera.dist[:4].tolist() == [0.1, -0.2, 0.001, 0.002]
    assert import_camera(path, camera="cam3").camera.intrinsics[:4].tolist() == [510, 511, 321, 241]
    with pytest.raises(InputError, match=r"no camera 'cam9' .*Did you mean 'cam"):
        load_intrinsics(f"{path}#cam9")
    with pytest.raises(
        InputError, match=r"camchain\.yaml:16: cam1\.distortion_model: unsupported lens model \(got 'equidistant'"
    ):
        load_intrinsics(f"{path}#cam1")
    with pytest.raises(InputError, match=r"camchain\.yaml:20: cam2\.camera_model: unsupported lens model \(got 'omni'"):
        import_camera(path, camera="cam2")


def test_what_to_do_about_one_of_several(run, tmp_path):
    """The command that a message advises is about the camera that was named, and works."""
    path = write(
        tmp_path, "intrinsics.yml", "%YAML:1.0\n---\nM1: [5, 0, 3, 0, 6, 2, 0, 0, 1]\nM2: [7, 0, 3, 0, 8, 2, 0, 0, 1]\n"
    )
    with pytest.raises(InputError) as caught:
        load_intrinsics(f"{path}#M2")
    words = shlex.split(str(caught.value).partition("Tell it: ")[2].replace("WxH", "7x5"))
    assert run(*words[1:-1], tmp_path / "camera.yaml")[0] == 0
    assert load_intrinsics(tmp_path / "camera.yaml").camera.K[0, 0] == 7


def test_one_of_matlabs_stereo_pair(tmp_path):
    """Of stereoParameters neither camera is taken unasked."""
    left = {"K": K, "RadialDistortion": [0.1, 0.2], "ImageSize": [480, 640]}
    pair = {"CameraParameters1": left, "CameraParameters2": left | {"RadialDistortion": [0.3, 0.4]}, "RotationOfCamera2": K}
    path = write(tmp_path, "stereo.json", json.dumps(pair))
    with pytest.raises(InputError, match=r"several cameras \(got CameraParameters1, CameraParameters2"):
        load_intrinsics(path)
    assert load_intrinsics(f"{path}#CameraParameters2").camera.dist[:2].tolist() == [0.3, 0.4]


def test_a_file_whose_name_has_the_mark(tmp_path):
    """A file that is called `a#b` is that file."""
    save_intrinsics(tmp_path / "a#b", Intrinsics(WEBCAM))
    save_intrinsics(tmp_path / "a", Intrinsics(CAMERAS["pinhole"]))
    (tmp_path / "a#b").write_text((tmp_path / "a#b").read_text().replace('dt: "d"', "dt: d"))
    same(load_intrinsics(tmp_path / "a#b").camera, WEBCAM)


def test_two_cameras_of_one_name(tmp_path):
    """Which one is meant cannot be known."""
    path = write(tmp_path, "cameras.txt", "1 PINHOLE 640 480 500 500 320 240\n1 PINHOLE 640 480 600 600 320 240\n")
    with pytest.raises(InputError, match=r"2 cameras are called '1'"):
        load_intrinsics(f"{path}#1")
