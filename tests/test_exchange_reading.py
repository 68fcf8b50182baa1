"""Cameras out of files as other tools write them: recognised by content, in our conventions, bit for bit."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from exchange_cameras import CAMERAS, K, same, saved
from exchange_samples import FILES, OST, ROS_MESSAGE, SAMPLES, write
from messages import Listener
from undistort_files import make_images

from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics
from camcal.formats.exchange.table import FORMATS
from camcal.verdict import Finding, Verdict
from camcal.workflows.arrays import load_camera
from camcal.workflows.export import export_camera
from camcal.workflows.import_ import import_camera
from camcal.workflows.verify import verify

# These move the principal point by half a pixel or a whole one: the last bit of it may be lost each way.
MOVED = {"colmap": 2, "nerfstudio": 2, "matlab": 2}
HELD = [
    (kind, file, name)
    for kind, files in FILES.items()
    for name, camera in CAMERAS.items()
    if not FORMATS[kind].profile.missing(camera)
    for file in files
]


@pytest.mark.parametrize(("kind", "file", "name"), HELD)
def test_what_is_written_is_read_again(tmp_path, kind, file, name):
    """Whatever a format holds comes back bit for bit, recognised under a name that says nothing."""
    export_camera(saved(tmp_path, name), kind, tmp_path / file)
    nameless = (tmp_path / file).rename(tmp_path / "file")
    size = CAMERAS[name].size if kind == "lensfun" else None
    found = import_camera(nameless, size=size).camera
    if kind == "lensfun":
        # Two divisions and two products.
        np.testing.assert_allclose(found.intrinsics, CAMERAS[name].intrinsics, rtol=8 * 2.0**-53, atol=0)
    else:
        same(CAMERAS[name], found, MOVED.get(kind, 0))
        same(found, load_intrinsics(nameless).camera)


def test_all_that_is_known_goes_through_json(tmp_path, calibrated):
    """A calibration through our JSON and back is the same file, byte for byte."""
    export_camera(calibrated, "json", tmp_path / "camera.json")
    import_camera(tmp_path / "camera.json", tmp_path / "camera.yaml")
    assert (tmp_path / "camera.yaml").read_bytes() == (calibrated / "camera.yaml").read_bytes()


def test_our_own_file_is_imported_as_it_is(tmp_path, calibrated):
    """Nothing is lost either, from the file or its folder."""
    import_camera(calibrated, tmp_path / "camera.yaml")
    assert (tmp_path / "camera.yaml").read_bytes() == (calibrated / "camera.yaml").read_bytes()


@pytest.mark.parametrize("name", SAMPLES)
def test_files_of_other_tools(tmp_path, name):
    """Hand-made files in each tool's layout; the pixel conventions are subtracted by hand."""
    text, size, pinhole, dist = SAMPLES[name]
    camera = load_intrinsics(write(tmp_path, "camera", text)).camera
    assert camera.size == size
    np.testing.assert_allclose(camera.intrinsics[:5], [*pinhole, 0][:5], rtol=0, atol=np.spacing(1000.0))
    assert camera.dist.tolist() == [*dist, *[0] * (8 - len(dist))]


def test_a_file_without_size(tmp_path):
    """It is asked for; a size that contradicts the file is refused."""
    path = write(tmp_path, "k.json", '{"mtx": [[500, 0, 320], [0, 501, 240], [0, 0, 1]], "dist": [0.1, 0, 0, 0]}')
    with pytest.raises(InputError, match=r"no image size in this file. Tell it: camcal import .* --size WxH"):
        load_intrinsics(path)
    with pytest.raises(InputError, match="Tell it with --size WxH"):
        import_camera(path)
    assert import_camera(path, size=(640, 480)).camera.size == (640, 480)
    sized = write(tmp_path, "sized", SAMPLES["numpy"][0])
    with pytest.raises(InputError, match=r"--size: not the size .*\(got 64x48, expected 640x480\)"):
        import_camera(sized, size=(64, 48))


def test_mrcal_writes_what_is_read(mrcal_python, tmp_path):
    """A model that mrcal itself has written, comments and all."""
    code = (
        "import mrcal, numpy, sys; mrcal.cameramodel(intrinsics=('LENSMODEL_OPENCV4', "
        "numpy.array([500.25, 501.5, 320.75, 240, .1, .2, .001, .002])), imagersize=numpy.array([640, 480])).write(sys.argv[1])"
    )
    path = tmp_path / "m.cameramodel"
    subprocess.run([mrcal_python, "-c", code, path], check=True, capture_output=True)
    camera = load_intrinsics(path).camera
    assert camera.intrinsics[:9].tolist() == [500.25, 501.5, 320.75, 240, 0, 0.1, 0.2, 0.001, 0.002]


def test_pycolmap_writes_what_is_read(tmp_path):
    """Lists of cameras that COLMAP itself has written, text and binary, one of them a fisheye."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    reconstruction = pycolmap.Reconstruction()
    for number, (model, values) in enumerate(
        [("OPENCV", [500, 501, 320, 240, 0.1, 0.2, 0.01, 0.02]), ("OPENCV_FISHEYE", [500, 501, 320, 240, 0, 0, 0, 0])], 1
    ):
        camera = pycolmap.Camera(model=model, width=640, height=480, params=values)
        camera.camera_id = number
        reconstruction.add_camera(camera)
    reconstruction.write_text(tmp_path)
    reconstruction.write_binary(tmp_path)
    for file in ("cameras.txt", "cameras.bin"):
        found = load_intrinsics(f"{tmp_path / file}#1").camera
        assert found.intrinsics[:9].tolist() == [500, 501, 319.5, 239.5, 0, 0.1, 0.2, 0.01, 0.02]
        with pytest.raises(InputError, match=r"camera 2: unsupported lens model \(got 'OPENCV_FISHEYE'"):
            load_intrinsics(f"{tmp_path / file}#2")


def test_mat_files(tmp_path):
    """A struct as toStruct makes it, in a MAT file of version 7; 7.3 and files without one are refused with what to do."""
    io = pytest.importorskip("scipy.io", reason="scipy is not installed")
    struct_ = {
        "K": np.array(K),
        "RadialDistortion": [[0.1, 0.2]],
        "TangentialDistortion": [[0.0, 0.0]],
        "ImageSize": [[720, 1280]],
    }
    io.savemat(tmp_path / "c.mat", {"params": struct_, "other": 3})
    camera = load_intrinsics(tmp_path / "c.mat").camera
    assert (camera.size, camera.dist[:2].tolist()) == ((1280, 720), [0.1, 0.2])
    np.testing.assert_allclose(camera.K[:2, 2], [639.3, 351.7], rtol=0, atol=np.spacing(640.0))
    io.savemat(tmp_path / "d.mat", {"other": 3})
    with pytest.raises(InputError, match=r"no camera struct \(got other\)"):
        load_intrinsics(tmp_path / "d.mat")
    (tmp_path / "e.mat").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64" + bytes(500))
    with pytest.raises(InputError, match=r"version 7\.3 .*'-v7'"):
        load_intrinsics(tmp_path / "e.mat")
    (tmp_path / "f.mat").write_bytes((tmp_path / "c.mat").read_bytes()[:300])
    with pytest.raises(InputError, match="not a whole MAT file"):
        load_intrinsics(tmp_path / "f.mat")


def test_what_is_not_to_be_trusted_stays_so(tmp_path):
    """A rejected calibration says so in the file and on the way."""
    verdict = Verdict((Finding("large_rms", "rejected", 1.0, "RMS 9 px", "Look."),))
    reporter = Listener()
    done = export_camera(saved(tmp_path, "webcam", verdict=verdict), "opencv", reporter=reporter)
    assert "# NOT TO BE TRUSTED: RMS 9 px" in str(done.content)
    assert "RMS 9 px" in reporter.warnings[0]
    assert "# NOT TO BE TRUSTED: RMS 9 px" in str(export_camera(tmp_path / "webcam.yaml", "kalibr", reporter=reporter).content)


BINNED = "binning_x: images of this camera are binned 2x1, which is not applied: it is read as the camera of full images. "
CUT_OUT = (
    "roi: images of this camera are its window of 320x240 pixels at (100, 50), "
    "which is not applied: it is read as the camera of full images. "
)


@pytest.mark.parametrize("sample", [ROS_MESSAGE, OST], ids=["message", "file"])
@pytest.mark.parametrize(
    ("more", "told"),
    [
        ("binning_x: 2\nbinning_y: 0\n", [BINNED]),
        ("roi: {x_offset: 100, y_offset: 50, height: 240, width: 320, do_rectify: false}\n", [CUT_OUT]),
        (
            "binning_x: 2\nroi: {x_offset: 0, y_offset: 0, height: 240, width: 320}\n",
            [BINNED, "roi: images of this camera are its window of 320x240 pixels at (0, 0)"],
        ),
        ("binning_x: 0\nbinning_y: 1\nroi: {x_offset: 0, y_offset: 0, height: 0, width: 0}\n", []),
        ("roi: {x_offset: 0, y_offset: 0, height: 480, width: 640}\n", []),
        ("binning_x: [1]\nbinning_y: true\nroi: {x_offset: a, width: -3}\n", []),
        ("roi: none\n", []),
    ],
)
def test_binned_and_cut_out_images_of_ros_are_told(run, tmp_path, sample, more, told):
    """K belongs to images of full resolution: who has others is told so by every command; full ones are silent."""
    path = tmp_path / "info.yaml"
    path.write_text(sample + more)
    reporter = Listener()
    import_camera(path, tmp_path / "camera.yaml", reporter=reporter)
    load_camera(path, reporter=reporter)
    export_camera(path, "colmap", reporter=reporter)
    verify(path, tmp_path / "camera.yaml", reporter=reporter)
    assert len(reporter.warnings) == 4 * len(told), reporter.warnings
    lines = [f"{path}:{sample.count(chr(10)) + 1 + index}: {start}" for index, start in enumerate(told)]
    for warned, start in zip(reporter.warnings, 4 * lines, strict=True):
        assert warned.startswith(start), warned
    photo = make_images(tmp_path, "photo.png", size=(640, 480)) / "photo.png"
    for command, times in (
        (("verify", path, "--truth", path), 2),
        (("import", path, "-o", tmp_path / "again.yaml"), 1),
        (("undistort", photo, "--camera", path, "-o", tmp_path / "flat"), 1),
        (("undistort", photo, "--camera", path, "--target", path, "-o", tmp_path / "same"), 2),
        (("undistort", photo, "--camera", path, "-o", tmp_path / "silent", "-qq"), 0),
    ):
        code, _, err = run(*command)
        assert (code, err.count("camcal: warning: ")) == (0, times * len(told)), err
    assert "cautions" not in (tmp_path / "camera.yaml").read_text()
