"""`camcal.undistort`: the camera beside the results, sizes, directions and options."""

from __future__ import annotations

import logging
import re

import cv2
import numpy as np
import pytest
import tifffile
from undistort_files import CAMERA, FOLDED, SIZE, make_images, picture, tree

import camcal
from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.images import read_image
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.verdict import Finding, Verdict


@pytest.mark.parametrize("options", [{}, {"alpha": 1.0}, {"fov_deg": 50.0, "scale": 2}, {"crop": "valid", "alpha": 0.7}])
def test_the_new_camera_projects_the_same_rays(camera_file, tmp_path, options):
    """Every pixel of the result has the value that the source has where OpenCV, given only the new camera file, sees its ray.

    The source is a Gaussian dot whose steepest slope is 9100 levels a pixel: 2e-4 pixels are 2 levels. A cubic spline is off by
    at most 1/384 of the fourth derivatives (700 levels per axis): 4 levels. Each rounding adds half a level.
    """
    at, sigma, peak = np.array([40.0, 15.0]), 4.0, 60000

    def dot(xy: np.ndarray) -> np.ndarray:
        return peak * np.exp(-((xy - at) ** 2).sum(axis=-1) / 2 / sigma**2)

    grid = lambda width, height: np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)  # noqa: E731
    cv2.imwrite(str(tmp_path / "dot.png"), dot(grid(*SIZE)).round().astype(np.uint16))
    camcal.undistort(tmp_path / "dot.png", camera_file, tmp_path / "flat", interpolation="cubic", **options)
    result = read_image(tmp_path / "flat/dot.png").astype(float)
    read = cv2.FileStorage(str(tmp_path / "flat/camera.yaml"), cv2.FILE_STORAGE_READ)
    (fx, _, cx), (_, fy, cy), _ = np.reshape(
        [read.getNode("camera_matrix").getNode("data").at(i).real() for i in range(9)], (3, 3)
    )
    assert result.shape[::-1] == (read.getNode("image_width").real(), read.getNode("image_height").real())
    assert [read.getNode("distortion_coefficients").getNode("data").at(i).real() for i in range(5)] == [0] * 5
    rays = np.insert((grid(*result.shape[::-1]) - (cx, cy)) / (fx, fy), 2, 1, axis=-1)
    seen = cv2.projectPoints(rays.reshape(-1, 3), np.zeros(3), np.zeros(3), CAMERA.K, CAMERA.dist)[0].reshape(*result.shape, 2)
    inside = ((seen > 4) & (seen < np.array(SIZE) - 5)).all(axis=-1)
    assert inside.mean() > 0.3
    assert np.abs(result - dot(seen))[inside].max() <= 2 + 4 + 1


def test_the_verdict_goes_on(tmp_path):
    """The camera of the results has the name and the verdict of the calibration, and nothing of its uncertainty."""
    verdict = Verdict((Finding("few_views", "usable", 1.0, "7 views", "Take more."),))
    known = Intrinsics(CAMERA, "front", "checkerboard:9x6:25mm", ("fx",), np.ones((1, 1)), 0.3, 7, 300, verdict=verdict)
    save_intrinsics(tmp_path / "c.yaml", known)
    make_images(tmp_path, "a.png")
    done = camcal.undistort(tmp_path / "a.png", tmp_path / "c.yaml", tmp_path / "flat")
    made = load_intrinsics(tmp_path / "flat")
    assert done.camera_file == tmp_path / "flat/camera.yaml"
    assert (made.name, made.verdict, made.free) == ("front", verdict, ())
    assert made.camera.intrinsics.tolist() == done.target.intrinsics.tolist()


def test_a_single_result_has_its_camera_beside_it(camera_file, tmp_path):
    """With a file as the output, camera, mask and maps have its name in front, and nothing else is written."""
    make_images(tmp_path, "a.png")
    done = camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "new/b.tif", mask=True, maps=True)
    assert tree(tmp_path / "new") == ["b.camera.yaml", "b.maps.npz", "b.maps.tiff", "b.mask.png", "b.tif"]
    assert [job.target for job in done.outputs] == [tmp_path / "new/b.tif"]
    assert load_intrinsics(tmp_path / "new/b.camera.yaml").camera.intrinsics.tolist() == done.target.intrinsics.tolist()


def test_an_explicit_target(camera_file, tmp_path):
    """The results are seen by the camera of another file, with a lens if it has one."""
    other = Camera((80, 60), [[60, 0, 40], [0, 60, 30], [0, 0, 1]], [0.01, 0])
    save_intrinsics(tmp_path / "other.yaml", Intrinsics(other))
    make_images(tmp_path, "a.png")
    done = camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", target=tmp_path / "other.yaml")
    assert done.target.intrinsics.tolist() == other.intrinsics.tolist()
    assert read_image(tmp_path / "o/a.png").shape == (60, 80, 3)


@pytest.mark.parametrize("other", [{"alpha": 0.5}, {"fov_deg": 60}, {"size": (10, 10)}, {"scale": 2}, {"crop": "valid"}])
def test_an_explicit_target_leaves_nothing_to_choose(camera_file, tmp_path, other):
    """Every other option that chooses the camera of the results contradicts it."""
    make_images(tmp_path, "a.png")
    with pytest.raises(InputError, match="--target and --"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", target=camera_file, **other)
    assert not (tmp_path / "o").exists()


def test_maps_are_what_was_done(camera_file, tmp_path):
    """cv2.remap with the exported maps gives the same image; the TIFF, read by another library, has the same numbers."""
    make_images(tmp_path, "a.png")
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", alpha=1, maps=True, mask=True, fill=9)
    maps = np.load(tmp_path / "o/maps.npz")
    assert maps["map_x"].dtype == np.float32
    remapped = cv2.remap(picture(), maps["map_x"], maps["map_y"], cv2.INTER_LINEAR, borderValue=(9, 9, 9))
    # The last digit may differ where a value is rounded.
    assert np.abs(remapped.astype(int) - read_image(tmp_path / "o/a.png")).max() <= 1
    pair = tifffile.imread(tmp_path / "o/maps.tiff")
    np.testing.assert_array_equal(pair, np.stack([maps["map_x"], maps["map_y"]], axis=-1))
    inside = (maps["map_x"] > -1) & (maps["map_y"] > -1)
    np.testing.assert_array_equal(read_image(tmp_path / "o/mask.png"), np.where(inside, 255, 0))
    assert 0 < inside.mean() < 1


def test_exact_positions(camera_file, tmp_path):
    """With `exact` the maps are the cameras' own answer, rounded to float32; without it they are within 2e-4 px."""
    make_images(tmp_path, "a.png")
    found = {}
    for exact in (True, False):
        done = camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / f"{exact}", alpha=1, exact=exact, maps=True)
        maps = np.load(tmp_path / f"{exact}/maps.npz")
        found[exact] = np.stack([maps["map_x"], maps["map_y"]], axis=-1)
    pixels = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), axis=-1)
    truth = CAMERA.project(done.target.unproject(pixels))
    seen = found[True][..., 0] > -1
    assert seen.any()
    # float32 holds numbers below 64 to 4e-6; two roundings (of the position in its tile, of the sum).
    assert np.abs(found[True] - truth)[seen].max() <= 8e-6
    assert np.abs(found[False] - truth)[seen].max() <= 2e-4


def test_rescale(camera_file, tmp_path):
    """Images twice as large are undistorted by the camera scaled to them: OpenCV's answer with a K scaled by hand."""
    make_images(tmp_path, "a.png", size=(128, 96))
    with pytest.raises(InputError, match=r"got 128x96, expected 64x48.*--rescale"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o")
    done = camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", rescale=True)
    assert done.target.size == (128, 96)
    K = np.array([[100, 0, 61.1], [0, 102, 49.9], [0, 0, 1]])  # (30.3 + 0.5) 2 - 0.5, (24.7 + 0.5) 2 - 0.5
    maps = cv2.initUndistortRectifyMap(K, CAMERA.dist, None, done.target.K, (128, 96), cv2.CV_32FC1)
    expected = cv2.remap(picture(size=(128, 96)), *maps, cv2.INTER_LINEAR)
    # The last digit may differ where a value is rounded.
    assert np.abs(expected.astype(int) - read_image(tmp_path / "o/a.png")).max() <= 1


def test_rescale_of_another_aspect_ratio(camera_file, tmp_path):
    """Cropped or turned images are refused by name; in a folder, those that differ from the first one are rejected."""
    make_images(tmp_path, "wide.png", size=(128, 72))
    with pytest.raises(InputError, match=r"wide\.png: --rescale: the aspect ratio differs"):
        camcal.undistort(tmp_path / "wide.png", camera_file, tmp_path / "o", rescale=True)
    photos = make_images(tmp_path / "photos", "a.png", size=(128, 96))
    make_images(photos, "b.png")
    done = camcal.undistort(photos, camera_file, tmp_path / "p", rescale=True)
    assert done.images == ("a.png",)
    assert "got 64x48, expected 128x96" in done.rejected[0].reason


def test_a_fold_is_not_passed_over_in_silence(tmp_path, caplog):
    """Who wants to see all of the image hears how much of it the lens model cannot place; who wants the middle need not."""
    save_intrinsics(tmp_path / "c.yaml", Intrinsics(FOLDED))
    photos = make_images(tmp_path / "photos", "a.png")
    # 1 - 1.8 r² + 0.5 r⁴ = 0 at r = 0.8327; r (1 - 0.6 r² + 0.1 r⁴) there is 0.5264: 26.3 px of the 39.3 to the corners.
    u, v = np.meshgrid(np.arange(64) - 31.5, np.arange(48) - 23.5)
    past = float((np.hypot(u, v) > 50 * 0.5264).mean())
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.undistort(photos, tmp_path / "c.yaml", tmp_path / "o")
        assert not caplog.records
        camcal.undistort(photos, tmp_path / "c.yaml", tmp_path / "p", alpha=1)
    told = re.search(r"folds 26 px from the principal point; what lies farther out, ([\d.]+)% of the image", caplog.text)
    assert told is not None
    # Both grids, of pixels and of nodes, count a ring of about 165 px with an error of a share of its length.
    assert float(told[1]) / 100 == pytest.approx(past, abs=0.02)


def test_results_that_see_next_to_nothing_are_told_of(camera_file, tmp_path, caplog):
    """The number, where most of each result is going to be empty: 170 degrees for a lens that sees 67."""
    photos = make_images(tmp_path / "photos", "a.png")
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.undistort(photos, camera_file, tmp_path / "o", alpha=1)
        camcal.undistort(photos, camera_file, tmp_path / "p", fov_deg=80)
        assert not caplog.records
        camcal.undistort(photos, camera_file, tmp_path / "q", fov_deg=170, mask=True)
    told = re.search(r"q: ([\d.]+)% of each result sees nothing of its source\. Show less", caplog.text)
    assert told is not None
    assert float(told[1]) / 100 == pytest.approx((read_image(tmp_path / "q/mask.png") == 0).mean(), abs=0.01)


def test_distort_undoes_undistort(tmp_path):
    """There and back again: the same picture but for two resamplings, and the camera beside it is the calibrated one."""
    known = Intrinsics(CAMERA, "front", "checkerboard:9x6:25mm", ("fx",), np.ones((1, 1)), 0.3, 7, 300)
    save_intrinsics(tmp_path / "c.yaml", known)
    smooth = cv2.GaussianBlur(picture(), (0, 0), 3)
    cv2.imwrite(str(tmp_path / "a.png"), smooth)
    camcal.undistort(tmp_path / "a.png", tmp_path / "c.yaml", tmp_path / "flat", alpha=1, scale=2, interpolation="cubic")
    for number, options in enumerate(({"alpha": 1, "scale": 2}, {"target": tmp_path / "flat"})):
        back = tmp_path / f"back{number}"
        done = camcal.undistort(
            tmp_path / "flat/a.png", tmp_path / "c.yaml", back, distort=True, interpolation="cubic", **options
        )
        assert done.target.intrinsics.tolist() == CAMERA.intrinsics.tolist()
        assert (back / "camera.yaml").read_bytes() == (tmp_path / "c.yaml").read_bytes()
        # Both splines together blur a picture of this smoothness by less than a level, away from the border.
        assert np.abs(read_image(back / "a.png").astype(int) - smooth)[3:-3, 3:-3].max() <= 2


def test_formats_and_quality(camera_file, tmp_path):
    """The format is that of the extension asked for, and quality makes a smaller file."""
    make_images(tmp_path, "a.png")
    sizes = {}
    for quality in (20, 95):
        out = tmp_path / str(quality)
        done = camcal.undistort(tmp_path / "a.png", camera_file, out, file_format="JPG", quality=quality)
        assert done.images == ("a.jpg",)
        content = (out / "a.jpg").read_bytes()
        assert content.startswith(b"\xff\xd8\xff")
        sizes[quality] = len(content)
    assert sizes[20] < sizes[95]


def test_fill_is_red_green_blue(camera_file, tmp_path):
    """What sees nothing has the colour that was asked for, in the order in which people say it."""
    make_images(tmp_path, "a.png")
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", alpha=1, mask=True, fill=(200, 100, 50))
    nothing = read_image(tmp_path / "o/mask.png") == 0
    assert nothing.any()
    assert (cv2.imread(str(tmp_path / "o/a.png"))[nothing] == (50, 100, 200)).all()


@pytest.mark.parametrize(
    ("fill", "got"), [(256, "256"), (-1, "-1"), (0.5, "0.5"), ((1, 2, 300), "300"), ((1, 2, 3, 4), "4 numbers")]
)
def test_fill_that_is_no_pixel(camera_file, tmp_path, fill, got):
    """What does not fit is said as it was given, with what would."""
    make_images(tmp_path, "a.png")
    expected = rf"^a\.png: --fill: no value of such pixels \(got {got}, expected one whole number from 0 to 255, or 3 of them\)"
    with pytest.raises(InputError, match=expected):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", fill=fill)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"alpha": 1.5}, "--alpha"),
        ({"fov_deg": 60, "alpha": 0.5}, "--fov and --alpha"),
        ({"size": (32, 24), "scale": 2}, "--size and --scale"),
        ({"crop": "all"}, "--crop"),
        ({"interpolation": "nearest"}, "--interpolation"),
        ({"gamma": "none"}, "--gamma"),
        ({"quality": 101}, "--quality"),
        ({"file_format": "heic"}, "--format: not a format to write .*expected one of jpg"),
        ({"file_format": "pgn"}, r"--format: not a format to write \(got 'pgn'\)\. Did you mean 'p[ng]"),
        ({"file_format": "mp4"}, "--format: mp4 is for a video"),
        ({"codec": "h264"}, "--codec: only for videos"),
        ({"frames": "0:3"}, "--frames: only for videos"),
        ({"most_pixels": 0}, "--most-pixels"),
    ],
)
def test_options_that_cannot_be(camera_file, tmp_path, options, match):
    """Out of range, unknown, contradictory or without meaning here: an error before anything is written."""
    make_images(tmp_path, "a.png")
    with pytest.raises(InputError, match=match):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", **options)
    assert not (tmp_path / "o").exists()


def test_camera_files_of_others_and_of_none(tmp_path):
    """ROS's camera_info is taken; a file that holds no camera is refused with its line."""
    make_images(tmp_path, "a.png")
    (tmp_path / "ros.yaml").write_text(
        "image_width: 64\nimage_height: 48\ncamera_name: ros\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
        "  data: [50, 0, 30.3, 0, 51, 24.7, 0, 0, 1]\ndistortion_model: plumb_bob\n"
        "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.2, 0.05, 0.001, -0.002, 0]\n"
    )
    done = camcal.undistort(tmp_path / "a.png", tmp_path / "ros.yaml", tmp_path / "o")
    assert load_intrinsics(done.camera_file).name == "ros"
    (tmp_path / "board.yaml").write_text("type: checkerboard\ncolumns: 9\n")
    with pytest.raises(InputError, match=r"board\.yaml:1: "):
        camcal.undistort(tmp_path / "a.png", tmp_path / "board.yaml", tmp_path / "p")
