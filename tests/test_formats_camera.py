"""camera.yaml: bit-exact for us, and loaded as it stands by cv2.FileStorage, PyYAML and ROS."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from camcal.errors import InputError
from camcal.formats.camera_file import camera_yaml, load_intrinsics, save_intrinsics
from camcal.geometry.camera import Camera
from camcal.records import BoardShape, ImageSigma, Intrinsics, Uncertainty
from camcal.verdict import LEVELS, Finding, Verdict

FOCAL = st.floats(1e-3, 1e6)
FINITE = st.floats(-1e6, 1e6)
TEXT = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), max_size=40)


@st.composite
def image_sigmas(draw: st.DrawFn) -> ImageSigma:
    """Any standard deviations over an image, also where no ray reaches."""
    sigma = st.floats(0, 1e6) | st.just(math.nan)
    edges, corners = (draw(st.tuples(sigma, sigma, sigma, sigma)) for _ in range(2))
    share = st.floats(0, 1)
    return ImageSigma(draw(sigma), edges, corners, draw(st.tuples(share, share, share)))


FINDINGS = st.builds(Finding, TEXT.filter(bool), st.sampled_from(LEVELS), FINITE, TEXT, TEXT)
VERDICTS = st.lists(FINDINGS, max_size=3).map(Verdict.of)
UNCERTAINTIES = st.builds(Uncertainty, st.floats(1e-3, 1e3), image_sigmas(), image_sigmas())


@st.composite
def intrinsics(draw: st.DrawFn) -> Intrinsics:
    """Any camera with any free parameters and a covariance of full rank."""
    K = [[draw(FOCAL), draw(FINITE), draw(FINITE)], [0, draw(FOCAL), draw(FINITE)], [0, 0, 1]]
    dist = draw(st.lists(st.floats(-10, 10), min_size=0, max_size=8))
    camera = Camera((draw(st.integers(1, 20000)), draw(st.integers(1, 20000))), K, dist)
    free = tuple(name for name in camera.intrinsic_names if draw(st.booleans()))
    factor = np.random.default_rng(draw(st.integers(0, 2**32))).normal(size=(len(free), len(free) + 3))
    return Intrinsics(
        camera=camera,
        name=draw(TEXT),
        board=draw(TEXT),
        free=free,
        covariance=factor @ factor.T,
        rms_px=draw(st.floats(0, 100) | st.just(math.nan)),
        views=draw(st.integers(0, 1000)),
        corners=draw(st.integers(0, 100000)),
        shape=draw(st.sampled_from([BoardShape(), BoardShape(("bow_x", "bow_y"), [1e-4, -2e-5], np.diag([1e-10, 4e-12]))])),
        uncertainty=draw(UNCERTAINTIES),
        cross_validation=draw(st.floats(0, 100) | st.just(math.nan)),
        verdict=draw(st.none() | VERDICTS),
    )


def example(**changes: object) -> Intrinsics:
    """A plain calibrated webcam."""
    values: dict[str, object] = {
        "camera": Camera((1280, 720), [[900.1, 0, 640.3], [0, 901.7, 359.9], [0, 0, 1]], [-0.25, 0.1, 1e-5, -2e-5, 0.01]),
        "name": "webcam",
        "board": "checkerboard:9x6:25mm",
        "free": ("fx", "k1"),
        "covariance": [[4.0, 0.5], [0.5, 0.25]],
        "rms_px": 0.2,
        "views": 20,
        "corners": 1080,
    }
    return Intrinsics(**{**values, **changes})  # type: ignore[arg-type]


@settings(deadline=None)
@given(intrinsics())
def test_round_trip_is_bit_exact(tmp_path_factory: pytest.TempPathFactory, given_: Intrinsics) -> None:
    """Every number comes back bit for bit, but for covariances, which are rebuilt to the last bits."""
    path = tmp_path_factory.mktemp("camera") / "camera.yaml"
    save_intrinsics(path, given_)
    found = load_intrinsics(path)
    assert found.camera.size == given_.camera.size
    assert found.camera.K.tobytes() == given_.camera.K.tobytes()
    assert found.camera.dist.tobytes() == given_.camera.dist.tobytes()
    for name in ("name", "board", "free", "views", "corners", "verdict"):
        assert getattr(found, name) == getattr(given_, name)
    assert found.shape.names == given_.shape.names
    assert found.shape.values.tobytes() == given_.shape.values.tobytes()
    assert found.shape.sigma.tobytes() == given_.shape.sigma.tobytes()
    # NaN is equal to itself only in print.
    assert repr(found.uncertainty) == repr(given_.uncertainty)
    assert repr(found.cross_validation) == repr(given_.cross_validation)
    assert found.rms_px == given_.rms_px or (math.isnan(found.rms_px) and math.isnan(given_.rms_px))
    assert found.sigma == given_.sigma
    # Two products and a quotient, each rounded once.
    np.testing.assert_allclose(found.covariance, given_.covariance, rtol=4 * np.finfo(float).eps, atol=0)


@settings(deadline=None)
@given(intrinsics())
def test_three_loaders_read_the_same_camera(given_: Intrinsics) -> None:
    """cv2.FileStorage and PyYAML give K and the coefficients bit for bit, and ROS finds every key it asks for."""
    text = camera_yaml(given_)
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    assert storage.getNode("camera_matrix").mat().tobytes() == given_.camera.K.tobytes()
    dist = storage.getNode("distortion_coefficients").mat()
    assert dist.dtype == np.float64
    assert dist.ravel().tobytes() == given_.camera.dist[: dist.size].tobytes()
    assert not given_.camera.dist[dist.size :].any()
    assert (storage.getNode("image_width").real(), storage.getNode("image_height").real()) == given_.camera.size
    assert storage.getNode("camera_name").string() == given_.name

    # The keys that ROS's camera_calibration_parsers reads, and their order of rows.
    info = yaml.safe_load(text)
    assert [info["image_width"], info["image_height"]] == list(given_.camera.size)
    assert info["camera_name"] == given_.name
    assert info["distortion_model"] == ("plumb_bob" if dist.size == 5 else "rational_polynomial")
    for key, rows, columns in (("camera_matrix", 3, 3), ("rectification_matrix", 3, 3), ("projection_matrix", 3, 4)):
        assert (info[key]["rows"], info[key]["cols"], len(info[key]["data"])) == (rows, columns, rows * columns)
        assert all(type(value) is float for value in info[key]["data"])
    assert np.array(info["camera_matrix"]["data"]).tobytes() == given_.camera.K.tobytes()
    projection = np.array(info["projection_matrix"]["data"]).reshape(3, 4)
    np.testing.assert_array_equal(projection, np.column_stack([given_.camera.K, np.zeros(3)]))
    assert info["rectification_matrix"]["data"] == [1, 0, 0, 0, 1, 0, 0, 0, 1]


def test_file_on_disk_is_what_file_storage_opens(tmp_path: Path) -> None:
    """The same through a file, whose suffix tells OpenCV the format."""
    save_intrinsics(tmp_path / "camera.yaml", example())
    storage = cv2.FileStorage(str(tmp_path / "camera.yaml"), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), [[900.1, 0, 640.3], [0, 901.7, 359.9], [0, 0, 1]])
    np.testing.assert_array_equal(storage.getNode("distortion_coefficients").mat(), [[-0.25, 0.1, 1e-5, -2e-5, 0.01]])


def test_uncertainty_is_stored_as_standard_deviations_and_correlations() -> None:
    """Variances 4 and 0.25 with covariance 0.5 are standard deviations 2 and 0.5 with correlation 0.5."""
    known = yaml.safe_load(camera_yaml(example()))["camcal"]
    assert known["standard_deviations"] == {"fx": 2.0, "k1": 0.5}
    assert known["correlations"] == [[1.0, 0.5], [0.5, 1.0]]
    assert known["format_version"] == 2
    assert not {"verdict", "findings", "uncertainty", "board_shape"} & known.keys()


@pytest.mark.parametrize("wrong", ["[[1.0, .inf], [.inf, 1.0]]", "[[1.0, .inf], [-.inf, 1.0]]", "[[.inf, 0.5], [0.5, 1.0]]"])
def test_infinite_correlations_are_one_line(tmp_path: Path, wrong: str) -> None:
    """They are refused as any that are none, without a warning of numpy's before it."""
    text = camera_yaml(example())
    assert "[[1.0, 0.5], [0.5, 1.0]]" in text
    (tmp_path / "camera.yaml").write_text(text.replace("[[1.0, 0.5], [0.5, 1.0]]", wrong))
    with pytest.raises(InputError, match=r"camcal.correlations: not correlations \(expected"):
        load_intrinsics(tmp_path)


def test_a_verdict_stands_in_the_file_with_its_findings() -> None:
    """The word for a quick look, and each finding with what to do; the worst level makes the word."""
    notes = [
        Finding("few_views", "usable", 1.0, "4 views", "Take more."),
        Finding("large_rms", "rejected", 1.0, "9 px", "Look."),
    ]
    known = yaml.safe_load(camera_yaml(example(verdict=Verdict.of(notes))))["camcal"]
    assert known["verdict"] == "rejected"
    assert [finding["code"] for finding in known["findings"]] == ["large_rms", "few_views"]
    assert known["findings"][0] == {"code": "large_rms", "level": "rejected", "weight": 1.0, "text": "9 px", "advice": "Look."}


def test_a_truth_has_no_uncertainty(tmp_path: Path) -> None:
    """Nothing is free, the RMS is NaN, and both come back."""
    save_intrinsics(tmp_path / "camera.yaml", Intrinsics(example().camera, "truth"))
    found = load_intrinsics(tmp_path)
    assert (found.free, found.covariance.shape, found.sigma) == ((), (0, 0), {})
    assert math.isnan(found.rms_px)


def test_a_parameter_without_spread_is_correlated_with_nothing(tmp_path: Path) -> None:
    """A zero variance neither divides by zero nor loses the others."""
    save_intrinsics(tmp_path / "camera.yaml", example(covariance=[[4.0, 0.0], [0.0, 0.0]]))
    np.testing.assert_array_equal(load_intrinsics(tmp_path).covariance, [[4.0, 0.0], [0.0, 0.0]])


@pytest.mark.parametrize(
    ("dist", "free", "count"),
    [([0.1, 0, 0, 0, 0.2], (), 5), ([], (), 5), ([0.1] * 8, (), 8), ([0.0] * 7 + [0.1], (), 8), ([], ("k4",), 8)],
)
def test_lens_model_follows_the_coefficients(dist: list[float], free: tuple[str, ...], count: int) -> None:
    """Five coefficients unless k4..k6 are not zero or were free to be."""
    text = camera_yaml(example(camera=Camera((4, 3), np.eye(3), dist), free=free, covariance=np.eye(len(free))))
    info = yaml.safe_load(text)
    assert len(info["distortion_coefficients"]["data"]) == count
    assert info["distortion_model"] == {5: "plumb_bob", 8: "rational_polynomial"}[count]


def test_same_intrinsics_give_the_same_bytes_after_a_round_trip(tmp_path: Path) -> None:
    """Reading and writing again changes nothing."""
    save_intrinsics(
        tmp_path / "a.yaml", example(verdict=Verdict((Finding("large_rms", "rejected", 3.1, "RMS 9 px", "Look."),)))
    )
    save_intrinsics(tmp_path / "b.yaml", load_intrinsics(tmp_path / "a.yaml"))
    assert (tmp_path / "a.yaml").read_bytes() == (tmp_path / "b.yaml").read_bytes()


ROS = """\
image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [500., 0., 320.5, 0., 501., 240.5, 0., 0., 1.]
distortion_model: {model}
distortion_coefficients:
  rows: {rows}
  cols: {cols}
  data: {data}
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [480, 0, 318, 0, 0, 481, 239, 0, 0, 0, 1, 0]
binning_x: 1
"""


@pytest.mark.parametrize(
    ("model", "rows", "cols", "data"),
    [
        ("plumb_bob", 1, 5, [0.1, -0.2, 1e-3, -1e-3, 0.05]),
        ("plumb_bob", 5, 1, [0.1, -0.2, 1e-3, -1e-3, 0.05]),
        ("plumb_bob", 1, 4, [0.1, -0.2, 1e-3, -1e-3]),
        ("rational_polynomial", 1, 8, [0.1, -0.2, 1e-3, -1e-3, 0.05, 0.01, 0.02, 0.03]),
    ],
)
def test_ros_camera_info_is_read(tmp_path: Path, model: str, rows: int, cols: int, data: list[float]) -> None:
    """Without `dt` and `camcal`, with 4, 5 or 8 coefficients in a row or a column, and with keys that are ROS's own."""
    path = tmp_path / "head_camera.yaml"
    path.write_text(ROS.format(model=model, rows=rows, cols=cols, data=data))
    found = load_intrinsics(path)
    assert found.camera.K.tolist() == [[500, 0, 320.5], [0, 501, 240.5], [0, 0, 1]]
    assert found.camera.dist.tolist() == data + [0.0] * (8 - len(data))
    assert (found.camera.size, found.name, found.free, found.verdict) == ((640, 480), "narrow_stereo", (), None)


def test_a_file_rewritten_by_opencv_is_read(tmp_path: Path) -> None:
    """cv2.FileStorage tags its matrices and ends lists its own way; the camera is the same."""
    path = str(tmp_path / "opencv.yaml")
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    camera = example().camera
    storage.write("image_width", 1280)
    storage.write("image_height", 720)
    storage.write("distortion_model", "plumb_bob")
    storage.write("camera_matrix", np.array(camera.K))
    storage.write("distortion_coefficients", camera.dist[:5, None].copy())
    storage.release()
    found = load_intrinsics(path).camera
    assert found.K.tobytes() == camera.K.tobytes()
    assert found.dist.tobytes() == camera.dist.tobytes()


@pytest.mark.parametrize("path", ["missing.yaml", "x" * 5000, "/dev/zero", "a\0b"])
def test_impossible_paths_are_input_errors(path: str) -> None:
    """Missing files, names too long for the system, endless devices and names with a zero in them."""
    with pytest.raises(InputError, match=r"no such file|cannot be read|a device"):
        load_intrinsics(path)


def test_folder_stands_for_its_camera_file(tmp_path: Path) -> None:
    """A folder is read by its camera.yaml; without one, that file is what is missing."""
    with pytest.raises(InputError, match=r"camera\.yaml: no such file"):
        load_intrinsics(tmp_path)
    save_intrinsics(tmp_path / "camera.yaml", example())
    assert load_intrinsics(str(tmp_path)).name == "webcam"
