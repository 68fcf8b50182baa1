"""The Python API: every public name is typed and documented, and does to arrays what the commands do to files."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import logging
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from every_command import COMMANDS

import camcal
from camcal.formats.images import read_image
from camcal.observations import Detection, Rejected
from camcal.records import Intrinsics
from camcal.verdict import Finding, Verdict

TRUTH = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06, 0.001, -0.002])
BOARD = camcal.load_board("checkerboard:7x6:20mm")
POSE = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])

ALWAYS_ANSWER = {"dense_map", "distort_points", "projection_sigma", "undistort_points", "valid_mask"}
"""Functions that fail on no input of the right shape: what has no answer is NaN, or marked."""

SHOWN_IN_THE_README = {"demo", "regress"}
"""Whole chains, which take seconds: the README shows them, and its test runs them."""

FUNCTIONS = sorted(name for name in camcal.__all__ if inspect.isfunction(getattr(camcal, name)))
CLASSES = sorted(name for name in camcal.__all__ if inspect.isclass(getattr(camcal, name)))


def sections(docstring: str) -> dict[str, str]:
    """Text of each underlined section of a numpydoc docstring, by its title."""
    parts = re.split(r"^([A-Z][a-z]+)\n-{3,}\n", inspect.cleandoc(docstring), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def named_in(section: str) -> set[str]:
    """Names that a section describes: those at the margin before a colon, separated by commas, or alone."""
    lines = [line.partition(" : ")[0] for line in section.splitlines() if line and not line[0].isspace()]
    return {name.strip() for line in lines for name in line.split(",")}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_typed_and_documented(name):
    """Every parameter has a type and a description, every result too; what is raised is told."""
    function = getattr(camcal, name)
    signature = inspect.signature(function)
    assert all(p.annotation is not p.empty for p in signature.parameters.values())
    assert signature.return_annotation is not signature.empty
    found = sections(function.__doc__)
    if signature.parameters:
        assert named_in(found["Parameters"]) == set(signature.parameters)
    assert ("Returns" in found) == (signature.return_annotation != "None")
    assert ("Raises" in found) != (name in ALWAYS_ANSWER)


@pytest.mark.parametrize("name", CLASSES)
def test_classes_are_documented(name):
    """Every class says what it is; its fields, or attributes, are described and so is each of its methods and properties."""
    kind = getattr(camcal, name)
    found = sections(kind.__doc__)
    if dataclasses.is_dataclass(kind):
        assert named_in(found["Attributes"]) == {field.name for field in dataclasses.fields(kind)}
    for member, value in vars(kind).items():
        if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
            assert inspect.getdoc(value), member


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name not in SHOWN_IN_THE_README])
def test_functions_have_an_example(name):
    """Every function shows how it is called, those that save where the same is loaded; `test_docstring_examples` runs it."""
    found = sections(getattr(camcal, name.replace("save_", "load_")).__doc__)
    assert f"{name}(" in found.get("Examples", ""), name


def test_type_checkers_see_what_python_sees():
    """The imports for type checkers, the lazy table and the list of public names say the same."""
    tree = ast.parse(Path(camcal.__file__).read_text(encoding="utf-8"))
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    homes = {alias.asname or alias.name: node.module for node in guarded.body for alias in node.names}
    assert homes == camcal._HOMES
    assert set(camcal.__all__) == {*homes, "__version__"}


def test_every_command_is_a_function():
    """What the command line does can be done from Python, under the same name unless Python has it already."""
    other = {"export": "export_camera", "import": "import_camera", "report": "make_report"}
    of_the_shell = {"completion"}
    for name in set(COMMANDS) - of_the_shell:
        assert other.get(name, name) in FUNCTIONS, name


def test_no_function_has_the_name_of_a_part_of_the_package():
    """Importing a submodule sets an attribute on the package, which would replace a function of that name."""
    parts = {path.stem for path in Path(camcal.__file__).parent.iterdir()}
    assert not parts & set(camcal.__all__)


def test_load_camera_works_with_cv2(tmp_path):
    """K and dist go into cv2 as they are: the same projections, to float64 rounding, and undistortion runs."""
    camcal.save_intrinsics(tmp_path / "camera.yaml", Intrinsics(TRUTH))
    camera = camcal.load_camera(tmp_path)
    assert camera.size == (640, 480)
    assert (camera.K.dtype, camera.K.shape) == (np.float64, (3, 3))
    assert (camera.dist.dtype, camera.dist.shape) == (np.float64, (8,))
    points = np.random.default_rng(0).uniform([-0.4, -0.3, 1], [0.4, 0.3, 2], (50, 3))
    seen, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.K, camera.dist)
    np.testing.assert_allclose(camera.project(points), seen.reshape(-1, 2), atol=1e-9)
    image = camcal.render(camera, BOARD, POSE)
    assert cv2.undistort(image, camera.K, camera.dist).shape == image.shape


def test_load_camera_warns_of_a_camera_that_was_rejected(tmp_path, caplog):
    """What must not be trusted is never handed over silently."""
    finding = Finding("large_rms", "rejected", 1.0, "RMS reprojection error is 9 px", "Look at the photographs.")
    camcal.save_intrinsics(tmp_path / "camera.yaml", Intrinsics(TRUTH, verdict=Verdict((finding,))))
    with caplog.at_level(logging.WARNING, "camcal"):
        camcal.load_camera(tmp_path / "camera.yaml")
    assert "not to be trusted" in caplog.text
    assert "9 px" in caplog.text


def test_render_shows_ink_and_paper_where_they_are():
    """The middle of a black square and of a white one have the light of ink and paper; the same seed, the same bytes."""
    image = camcal.render(TRUTH, BOARD, POSE, sensor=camcal.Sensor(read_noise_levels=0))
    # The square up-left of feature 0 is black, the one to its right white.
    middles = TRUTH.project(POSE.apply([[-0.01, -0.01, 0], [0.01, -0.01, 0]]))
    (ink_x, ink_y), (paper_x, paper_y) = np.rint(middles).astype(int)
    light = camcal.Light()
    assert image[ink_y, ink_x] == round(255 * light.black)
    assert image[paper_y, paper_x] == round(255 * light.white)
    first, again, other = (camcal.render(TRUTH, "checkerboard:7x6:20mm", POSE, seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    assert camcal.render(TRUTH, BOARD, POSE, sensor=camcal.Sensor(bits=16)).dtype == np.uint16


@pytest.mark.parametrize("colour", [False, True])
def test_detect_corners_finds_what_was_rendered(colour):
    """Every corner within five times the bound of its patch; grey or in colour."""
    image = camcal.render(TRUTH, BOARD, POSE)
    seen = camcal.detect_corners(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR) if colour else image, BOARD, name="left")
    assert isinstance(seen, Detection)
    assert (seen.source, len(seen)) == ("left", 42)
    bound = camcal.corner_bound(TRUTH, BOARD, POSE, blur_sigma_px=0.7, noise_levels=2.0, radius_px=8.0)
    error = seen.corners_px - TRUTH.project(POSE.apply(BOARD.object_points))
    assert (np.abs(error) < 5 * bound).all()


def test_detect_corners_says_why_not():
    """No board: a reason, not an exception; no image or an unknown refinement: an error that names it."""
    nothing = camcal.detect_corners(np.full((480, 640), 90, np.uint8), BOARD)
    assert isinstance(nothing, Rejected)
    assert nothing.reason
    with pytest.raises(camcal.InputError, match=r"int64 of shape \(2, 2\)"):
        camcal.detect_corners(np.eye(2, dtype=np.int64), BOARD)
    with pytest.raises(camcal.InputError, match="warped"):
        camcal.detect_corners(np.zeros((480, 640), np.uint8), BOARD, refine="warped")


def test_undistort_image_agrees_with_cv2():
    """Where OpenCV's own remap with the same cameras has an answer, grey values differ by its rounding at most."""
    image = camcal.render(TRUTH, BOARD, POSE, sensor=camcal.Sensor(blur_sigma_px=1.5, read_noise_levels=0))
    target = camcal.target_camera(TRUTH)
    # OpenCV rounds positions to 1/32 of a pixel for bytes; edges of this blur change by less than 60 levels a pixel.
    maps = cv2.initUndistortRectifyMap(TRUTH.K, TRUTH.dist, np.eye(3), target.K, target.size, cv2.CV_32FC1)
    expected = cv2.remap(image, *maps, cv2.INTER_LINEAR)
    difference = np.abs(camcal.undistort_image(image, TRUTH).astype(int) - expected)
    assert difference.max() <= 2
    np.testing.assert_array_equal(camcal.undistort_image(image, TRUTH, target), camcal.undistort_image(image, TRUTH))


def test_undistort_image_adds_a_lens_too():
    """From an image without the lens to one with it: the same as a render with the lens, but for interpolation."""
    soft = camcal.Sensor(blur_sigma_px=2.0, read_noise_levels=0)
    ideal = camcal.Camera(TRUTH.size, TRUTH.K)
    added = camcal.undistort_image(camcal.render(ideal, BOARD, POSE, sensor=soft), ideal, TRUTH)
    middle = (slice(100, 380), slice(150, 490))
    difference = added[middle].astype(int) - camcal.render(TRUTH, BOARD, POSE, sensor=soft)[middle]
    assert np.abs(difference).mean() < 1.5


def test_undistort_takes_cameras(dataset, tmp_path):
    """A camera in memory gives the same bytes as its file, also as the target; nothing of it has to be on disk."""
    known = camcal.load_intrinsics(dataset)
    camcal.undistort(dataset / "images", dataset, tmp_path / "file")
    target = camcal.load_camera(tmp_path / "file")
    camcal.undistort(dataset / "images", known, tmp_path / "known")
    camcal.undistort(dataset / "images", known.camera, tmp_path / "to", target=target)
    for name in [path.name for path in (dataset / "images").iterdir()]:
        first = (tmp_path / "file" / name).read_bytes()
        assert first == (tmp_path / "known" / name).read_bytes()
        assert first == (tmp_path / "to" / name).read_bytes()


def test_verify_takes_cameras(calibrated, dataset):
    """Cameras in memory differ by what their files do; views need folders; a rejected one is no better for being in memory."""
    estimate, truth = camcal.load_intrinsics(calibrated), camcal.load_camera(dataset)
    of_files, of_cameras = camcal.verify(calibrated, dataset), camcal.verify(estimate, truth)
    assert of_cameras.projection.max_px == of_files.projection.max_px
    assert of_cameras.parameters == of_files.parameters
    assert (of_files.views is None, of_cameras.views) == (False, None)
    with pytest.raises(camcal.InputError, match="no standard deviations known of this camera"):
        camcal.verify(estimate.camera, truth, max_sigma=4)
    finding = Finding("large_rms", "rejected", 1.0, "RMS reprojection error is 9 px", "Look at the photographs.")
    rejected = dataclasses.replace(estimate, verdict=Verdict((finding,)))
    assert "not to be trusted" in camcal.verify(rejected, truth).problems[0]


def test_calibrate_takes_arrays_and_gives_what_files_give(dataset, calibrated):
    """The same pixels in memory give the same camera to the last bit."""
    paths = sorted((dataset / "images").glob("*.png"))
    run = camcal.calibrate({path.name: read_image(path) for path in paths}, str(dataset / "board.yaml"))
    expected = camcal.load_intrinsics(calibrated)
    assert run.folder is None
    np.testing.assert_array_equal(run.intrinsics.camera.intrinsics, expected.camera.intrinsics)
    assert run.verdict == expected.verdict


def test_calibrate_names_arrays_without_names(dataset):
    """A list of arrays is called image_0000 and on; a stack is a list; the board may be an object."""
    stack = np.stack([read_image(path) for path in sorted((dataset / "images").glob("*.png"))])
    board = camcal.load_board(str(dataset / "board.yaml"))
    run = camcal.calibrate(list(stack), board, refine="opencv")
    assert [seen.source for seen in run.calibration.detections] == [f"image_{index:04d}" for index in range(len(stack))]
    again = camcal.calibrate(stack, board, refine="opencv")
    np.testing.assert_array_equal(again.intrinsics.camera.intrinsics, run.intrinsics.camera.intrinsics)


def test_calibrate_takes_views_from_any_detector(dataset):
    """Corners of `detect_corners` give what `calibrate` with the same refinement gives; a rejected view is kept by name."""
    board = camcal.load_board(str(dataset / "board.yaml"))
    images = {path.name: read_image(path) for path in sorted((dataset / "images").glob("*.png"))}
    seen = [camcal.detect_corners(image, board, name=name) for name, image in images.items()]
    blank = camcal.detect_corners(np.full((480, 640), 90, np.uint8), board, name="blank")
    run = camcal.calibrate([*seen, blank], board)
    np.testing.assert_array_equal(
        run.intrinsics.camera.intrinsics, camcal.calibrate(images, board, refine="saddle").intrinsics.camera.intrinsics
    )
    assert [rejected.source for rejected in run.calibration.rejected] == ["blank"]


def test_calibrate_refuses_what_cannot_be_meant():
    """Mixtures, doubled names, another board's ids and options for files are refused by name."""
    image = np.zeros((480, 640), np.uint8)
    view = Detection("left", (640, 480), np.arange(42), np.zeros((42, 2)), np.full(42, np.nan))
    for images, options, problem in (
        ([image, "left.png"], {}, "mixture"),
        ([view, "left.png"], {}, "mixture"),
        ([view, view], {}, "'left'"),
        ([np.zeros((4, 4, 2), np.uint8)], {}, r"shape \(4, 4, 2\)"),
        ([image], {"undistort": True, "output": "x"}, "--undistort"),
        ([view], {"twin": 1}, "--twin"),
        ([view], {"only_used": True}, "--only-used"),
        ([], {}, "none given"),
    ):
        with pytest.raises(camcal.InputError, match=problem):
            camcal.calibrate(images, BOARD, **options)
    with pytest.raises(camcal.InputError, match="id 41 is not on the board"):
        camcal.calibrate([view], "checkerboard:5x4:20mm")


NO_IMAGE = r"no image \(got None\); cv2.imread returns None for a file that it cannot read\."
IMAGE = np.zeros((480, 640), np.uint8)


@pytest.mark.parametrize(
    ("images", "told"),
    [
        (None, f"^images: {NO_IMAGE}$"),
        (3, r"^images: not an image \(got int, expected an array\)\.$"),
        ([IMAGE, None, IMAGE], f"^image_0001: {NO_IMAGE}$"),
        ([None], f"^image_0000: {NO_IMAGE}$"),
        (["left.png", None], f"^image_0001: {NO_IMAGE}$"),
        ({"left.png": None}, f"^left.png: {NO_IMAGE}$"),
        ([IMAGE.tolist()], r"^image_0000: not an image \(got list, expected an array\)\.$"),
        (IMAGE, r"^images: one array \(got uint8 of shape \(480, 640\), expected several images\)\. Pass a list of arrays"),
        (np.zeros((480, 640, 3), np.uint8), r"^images: one array \(got uint8 of shape \(480, 640, 3\), expected several"),
    ],
)
def test_calibrate_says_which_image_is_none(images, told):
    """What `cv2.imread` could not read is named by its place or its name; one image is not taken for a stack of rows."""
    with pytest.raises(camcal.InputError, match=told):
        camcal.calibrate(images, BOARD)


@pytest.mark.parametrize("kind", ["bool", "int16", "float64", ">u2"])
def test_functions_of_arrays_refuse_other_pixels(kind):
    """Pixels of a kind that cameras do not give are one line that names the kind and those that are taken."""
    image = np.zeros((480, 640), kind)
    told = rf"^image: not an image \(got {image.dtype} of shape \(480, 640\), expected uint8, uint16, float32 of shape "
    for call in (lambda: camcal.detect_corners(image, BOARD), lambda: camcal.undistort_image(image, TRUTH)):
        with pytest.raises(camcal.InputError, match=told):
            call()
    with pytest.raises(camcal.InputError, match=told.replace("image:", "image_0000:")):
        camcal.calibrate([image], BOARD)


def test_functions_of_arrays_refuse_what_is_no_image():
    """None, a list, another size than the camera's, five channels, a matrix for a pose, 12 bits: an InputError of one line."""
    no_depth = camcal.Sensor(bits=12)
    for call, told in (
        (lambda: camcal.detect_corners(None, BOARD, name="left.png"), f"^left.png: {NO_IMAGE}$"),
        (lambda: camcal.undistort_image(None, TRUTH), f"^image: {NO_IMAGE}$"),
        (lambda: camcal.undistort_image([[1]], TRUTH), r"^image: not an image \(got list, expected an array\)\.$"),
        (
            lambda: camcal.undistort_image(IMAGE[:240], TRUTH),
            r"^image: not of the camera's size \(got 640x240, expected 640x480\)",
        ),
        (lambda: camcal.undistort_image(np.zeros((480, 640, 5), np.uint8), TRUTH), r"got uint8 of shape \(480, 640, 5\)"),
        (lambda: camcal.render(TRUTH, BOARD, np.eye(4)), r"^T_cam_board: not a pose \(got ndarray\)\."),
        (
            lambda: camcal.render(TRUTH, BOARD, POSE, sensor=no_depth),
            r"^sensor.bits: not a depth we write \(got 12, expected 8",
        ),
    ):
        with pytest.raises(camcal.InputError, match=told):
            call()
    assert camcal.undistort_image(np.zeros((480, 640, 2), np.uint8), TRUTH).shape == (480, 640, 2)


def test_projection_sigma_of_a_run_is_what_its_file_tells(dataset):
    """At the image's middle and at the boards' range it is the figure that camera.yaml holds."""
    run = camcal.calibrate(dataset / "images", str(dataset / "board.yaml"), refine="opencv")
    known = run.intrinsics.uncertainty
    middle = (np.array(run.intrinsics.camera.size) - 1) / 2
    sigma = camcal.projection_sigma(run.calibration, [middle], known.range_m)
    np.testing.assert_allclose(sigma, [known.at_range.centre_px], rtol=1e-12)


def test_corners_of_another_detector_need_no_deviations():
    """Without them they are unknown; one number stands for every corner."""
    corners = np.zeros((3, 2))
    assert np.isnan(camcal.Detection("a", (640, 480), np.arange(3), corners).sigma_px).tolist() == [True] * 3
    assert camcal.Detection("a", (640, 480), np.arange(3), corners, sigma_px=0.1).sigma_px.tolist() == [0.1] * 3
    with pytest.raises(ValueError, match="sigma_px"):
        camcal.Detection("a", (640, 480), np.arange(3), corners, sigma_px=np.zeros(2))


def test_a_camera_in_memory_is_exported():
    """The same file as from the camera's own file, and a camera that is marked so in the warning."""
    made = camcal.export_camera(TRUTH, "colmap")
    assert made.content.splitlines()[-1] == "1 OPENCV 640 480 520.0 523.0 322.5 236.5 -0.18 0.06 0.001 -0.002"
    assert camcal.export_camera(camcal.Intrinsics(TRUTH, name="left"), "colmap").content.startswith("# Camera left, 640x480")
