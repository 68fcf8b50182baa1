"""`camcal.undistort`: every file has its result or is named, nothing is lost, and the camera beside it is the right one."""

from __future__ import annotations

import csv
import errno
import logging
import os
import re
import shutil
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from videos import make_video, read_video

import camcal
from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.corners_file import load_corners
from camcal.formats.images import read_image
from camcal.formats.ledger_file import LEDGER_NAME
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.verdict import Finding, Verdict
from camcal.workflows.undistort import work as undistort_work

SIZE = (64, 48)
CAMERA = Camera(SIZE, [[50, 0, 30.3], [0, 51, 24.7], [0, 0, 1]], [-0.2, 0.05, 0.001, -0.002, 0])
FOLDED = Camera(SIZE, [[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1]], [-0.6, 0.1])


@pytest.fixture(scope="module")
def camera_file(tmp_path_factory) -> Path:
    """The file of a small camera with a lens."""
    path = tmp_path_factory.mktemp("camera") / "small.yaml"
    save_intrinsics(path, Intrinsics(CAMERA, name="small"))
    return path


def picture(seed: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A smooth colour image, another for each seed."""
    noise = np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    return cv2.GaussianBlur(noise, (0, 0), 2)


def make_images(folder: Path, *names: str, size: tuple[int, int] = SIZE) -> Path:
    """Write images, each another one; return the folder."""
    for index, name in enumerate(names):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(path), picture(index, size))
    return folder


def tree(folder: Path) -> list[str]:
    """Every file of a folder, by its path below it."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if not path.is_dir())


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """Inode and time of every image of a folder: both change when a file is replaced."""
    return {
        name: (status.st_ino, status.st_mtime_ns)
        for name in tree(folder)
        if ".png" in name and (status := (folder / name).stat())
    }


# --- the camera beside the results ------------------------------------------------------------------------------------


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


# --- what is found, and where it goes ---------------------------------------------------------------------------------


def test_folders_within_folders(camera_file, tmp_path):
    """With `recursive` the structure is kept; hidden files and folders, and the output itself, are not looked at."""
    photos = make_images(tmp_path / "photos", "a.png", "day 1/a.png", "day 1/deep/b.jpg", ".thumbs/t.png", ".hidden.png")
    (photos / "day 1/notes.txt").write_text("x")
    for _ in range(2):
        done = camcal.undistort(photos, camera_file, photos / "flat", recursive=True, force=True)
        assert done.images == ("a.png", "day 1/a.png", "day 1/deep/b.jpg")
    assert tree(photos / "flat") == ["a.png", "camera.yaml", "day 1/a.png", "day 1/deep/b.jpg", LEDGER_NAME]
    assert camcal.undistort(photos, camera_file, tmp_path / "top").images == ("a.png",)


def test_linked_folders_are_followed_once(camera_file, tmp_path):
    """A linked folder counts, a link that leads back does not go round for ever, and one file counts once."""
    photos = make_images(tmp_path / "photos", "a.png")
    elsewhere = make_images(tmp_path / "elsewhere", "b.png")
    (photos / "link").symlink_to(elsewhere)
    (photos / "loop").symlink_to(photos)
    (photos / "again.png").symlink_to(photos / "a.png")
    done = camcal.undistort(photos, camera_file, tmp_path / "flat", recursive=True)
    assert done.images == ("a.png", "link/b.png")


def test_the_same_name_twice(camera_file, tmp_path):
    """Two files of one name keep their paths below the folder that they share."""
    make_images(tmp_path, "left/a.png", "right/a.png")
    done = camcal.undistort([tmp_path / "left/a.png", tmp_path / "right/a.png"], camera_file, tmp_path / "flat")
    assert done.images == ("left/a.png", "right/a.png")


def test_two_results_of_one_name(camera_file, tmp_path):
    """Two sources in one folder that a new format would make one file: refused, both named."""
    photos = make_images(tmp_path / "photos", "a.png", "a.jpg")
    with pytest.raises(InputError, match=r"a\.(png|jpg): its result would replace that of .*a\.(png|jpg) \(both a\.tif\)"):
        camcal.undistort(photos, camera_file, tmp_path / "flat", file_format="tif")


def test_patterns_and_lists(camera_file, tmp_path):
    """A pattern names nothing; of a list, what cannot be used is rejected, what is no image is counted."""
    make_images(tmp_path, "img_1.png", "img_2.png", "other.png")
    (tmp_path / "img_3.txt").write_text("x")
    assert camcal.undistort(str(tmp_path / "img_*"), camera_file, tmp_path / "a").images == ("img_1.png", "img_2.png")
    listed = [tmp_path / "img_1.png", tmp_path / "gone.png", tmp_path / "img_3.txt"]
    done = camcal.undistort([], camera_file, tmp_path / "b", listed=listed)
    assert done.images == ("img_1.png",)
    assert [(one.source, one.reason) for one in done.rejected] == [("gone.png", "no such file. Check the path.")]


def test_other_files_are_one_warning(camera_file, tmp_path, caplog):
    """However many: one line with their number; pipes and devices are among them, and nobody waits for one."""
    photos = make_images(tmp_path / "photos", "a.png")
    for name in ("notes.txt", "b.xmp", "z"):
        (photos / name).write_text("x")
    os.mkfifo(photos / "pipe.png")
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.undistort(photos, camera_file, tmp_path / "flat")
    assert [record.message for record in caplog.records] == ["4 other files passed over (first: b.xmp)."]


def test_names_that_are_no_text(camera_file, tmp_path):
    """Bytes that are not UTF-8, and commas, quotes and line breaks, stay as they are, also in the ledger."""
    names = ["caf\udce9.png", 'a "b", c.png', "two\nlines.png"]
    photos = make_images(tmp_path / "photos", "a.png")
    for name in names:
        shutil.copy(photos / "a.png", photos / name)
    assert sorted(camcal.undistort(photos, camera_file, tmp_path / "o").images) == sorted([*names, "a.png"])
    assert all((tmp_path / "o" / name).exists() for name in names)
    assert camcal.undistort(photos, camera_file, tmp_path / "o", resume=True).images == ()


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda _: "gone.png", "gone.png: no such file"),
        (lambda f: (f / "empty").mkdir() or "empty", "empty: no images or videos in this folder"),
        (lambda f: make_images(f, "up/down/a.png") and "up", r"but there are some in down/\). .*--recursive"),
        (lambda _: "*.png", "no image or video matches this pattern"),
        (lambda f: (f / "notes.txt").write_text("x") and "notes.txt", "neither image nor video"),
        (lambda f: (f / "a.png").touch() or "a.png", "empty file"),
        (lambda f: (f / "a.png").write_text("no image") and "a.png", "not an image"),
        (lambda f: os.mkfifo(f / "a.png") or "a.png", "device or pipe"),
        (lambda f: make_images(f, "a.png", size=(48, 64)) and "a.png", "got 48x64, expected 64x48.*turned by 90°"),
        (lambda f: (make_images(f, "a.png") / "a.png").rename(f / "a.gif").name, "no format that an image is"),
    ],
)
def test_a_named_input_of_no_use_is_refused_at_once(camera_file, tmp_path, monkeypatch, make, match):
    """Missing, empty, of another kind or size: an error before anything is written, also beside good inputs."""
    monkeypatch.chdir(tmp_path)
    name = make(tmp_path)
    good = make_images(tmp_path / "good", "good.png")
    with pytest.raises(InputError, match=match):
        camcal.undistort([good / "good.png", name], camera_file, "out")
    assert not Path("out").exists()


def test_one_of_many_is_of_no_use(camera_file, tmp_path, caplog):
    """Torn, of another size, of a format that is not written, too large: each is named, and all others are done."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(9)))
    (photos / "torn.png").write_bytes((photos / "0.png").read_bytes()[:1000])
    make_images(photos, "small.png", size=(10, 10))
    cv2.imwrite(str(photos / "still.gif"), picture())
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(photos, camera_file, tmp_path / "flat", jobs=2)
    assert done.images == tuple(f"{i}.png" for i in range(9))
    assert [one.source for one in done.rejected] == ["small.png", "still.gif", "torn.png"]
    assert "Choose one with --format" in done.rejected[1].reason
    assert all(f"{name}: passed over: " in caplog.text for name in ("small.png", "still.gif", "torn.png"))
    assert (tmp_path / "flat/camera.yaml").exists()


def test_a_limit_for_traps(camera_file, tmp_path):
    """An image with more pixels than allowed is refused by its header."""
    make_images(tmp_path, "a.png")
    with pytest.raises(InputError, match="too many pixels"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", most_pixels=100)


def test_a_folder_that_cannot_be_looked_into(camera_file, tmp_path, monkeypatch):
    """Within a folder it is rejected by name; named, it is an error."""
    photos = make_images(tmp_path / "photos", "a.png", "locked/b.png")
    scan = os.scandir

    def refuse(path):
        if Path(path).name == "locked":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", refuse)
    done = camcal.undistort(photos, camera_file, tmp_path / "o", recursive=True)
    assert done.images == ("a.png",)
    assert [(one.source, one.reason) for one in done.rejected] == [
        (str(photos / "locked"), "cannot be read (permission denied)")
    ]
    with pytest.raises(InputError, match=r"locked: cannot be read \(permission denied\)"):
        camcal.undistort(photos / "locked", camera_file, tmp_path / "p")


def test_results_within_are_not_undistorted_again(camera_file, tmp_path, caplog):
    """A folder of an earlier run's results inside the input is passed over with a word; named, it is worked on."""
    photos = make_images(tmp_path / "photos", "a.png", "sub/b.png")
    camcal.undistort(photos, camera_file, photos / "flat", recursive=True)
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(photos, camera_file, photos / "other", recursive=True)
    assert done.images == ("a.png", "sub/b.png")
    assert f"{photos / 'flat'}: holds results of an earlier run: passed over" in caplog.text
    again = camcal.undistort(photos / "flat", camera_file, tmp_path / "again", recursive=True)
    assert again.images == ("a.png", "sub/b.png")


def test_a_list_of_other_things(camera_file, tmp_path):
    """The error says what there was instead."""
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(InputError, match=r"no images or videos given \(but .*notes\.txt\)"):
        camcal.undistort([], camera_file, tmp_path / "o", listed=[tmp_path / "notes.txt"])


def test_images_of_formats_that_are_not_read(camera_file, tmp_path, caplog):
    """They are images to whoever has them: said so, with what to do first, and never taken for the name of a folder."""
    photos = tmp_path / "photos"
    photos.mkdir()
    for name in ("a.HEIC", "b.nef"):
        (photos / name).write_bytes(b"some")
    with pytest.raises(InputError, match=r"but a\.HEIC, of a format that is not read\)\. Convert to JPEG or TIFF first"):
        camcal.undistort(photos, camera_file, tmp_path / "o")
    with pytest.raises(InputError, match=r"b\.nef: an image of a format that is not read .*\. Develop to TIFF first"):
        camcal.undistort(photos / "b.nef", camera_file, tmp_path / "o")
    make_images(photos, "c.png")
    with pytest.raises(InputError, match=r"c\.heic: not a format to write"):
        camcal.undistort(photos / "c.png", camera_file, tmp_path / "c.heic")
    with caplog.at_level(logging.WARNING, logger="camcal"):
        assert camcal.undistort(photos, camera_file, tmp_path / "o").images == ("c.png",)
    assert "2 images of a format that is not read passed over (first: a.HEIC). Convert to JPEG or TIFF first." in caplog.text


def test_what_is_not_done_has_the_name_that_the_user_gave(camera_file, tmp_path):
    """Not that of the result that there is not, and only once."""
    photos = make_images(tmp_path / "photos", "a.png")
    tifffile.imwrite(photos / "b.tif", np.zeros(SIZE[::-1], np.float32))
    done = camcal.undistort(photos, camera_file, tmp_path / "o", file_format="png")
    assert [(one.source, one.reason.split(" (")[0]) for one in done.rejected] == [("b.tif", "pixels that .png cannot hold")]
    with pytest.raises(InputError, match=r"^b\.tif: pixels that \.png cannot hold .* Write \.tiff instead\.$"):
        camcal.undistort(photos / "b.tif", camera_file, tmp_path / "p", file_format="png")


# --- nothing is lost --------------------------------------------------------------------------------------------------


def test_an_input_is_never_replaced(camera_file, tmp_path):
    """Neither its own input nor another, by whatever path, with force too."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png")
    (tmp_path / "link").symlink_to(photos)
    before = {name: (photos / name).read_bytes() for name in ("a.png", "b.png")}
    for output in (photos, tmp_path / "link", photos / ".", photos / "a.png"):
        with pytest.raises(InputError, match=r"would replace (its own|another) input"):
            camcal.undistort(photos / "a.png", camera_file, output, force=True)
    more = make_images(tmp_path / "more", "photos/a.png")
    with pytest.raises(InputError, match=r"would replace another input, .*photos/a\.png"):
        camcal.undistort([more, photos / "a.png"], camera_file, tmp_path, recursive=True, force=True)
    assert before == {name: (photos / name).read_bytes() for name in before}


def test_camera_files_are_never_replaced(camera_file, tmp_path):
    """Neither a calibration's, nor the one that is in use, nor the one of the target; with force too."""
    make_images(tmp_path, "a.png")
    for name in ("calib", "lone", "single", "chain"):
        (tmp_path / name).mkdir()
    chain = tmp_path / "chain/camera.yaml"
    camcal.export_camera(camera_file, "kalibr", chain)
    shutil.copy(camera_file, tmp_path / "lone/camera.yaml")
    shutil.copy(camera_file, tmp_path / "single/a.camera.yaml")
    (tmp_path / "calib/views.yaml").touch()
    image = tmp_path / "a.png"
    with pytest.raises(InputError, match="holds a calibration"):
        camcal.undistort(image, camera_file, tmp_path / "calib", force=True)
    for options in ({"camera": tmp_path / "lone"}, {"camera": camera_file, "target": tmp_path / "lone/camera.yaml"}):
        with pytest.raises(InputError, match=r"lone.*would be replaced by the camera of the results"):
            camcal.undistort(image, output=tmp_path / "lone", force=True, **options)
    with pytest.raises(InputError, match="would be replaced by the camera of the results"):
        camcal.undistort(image, f"{chain}#cam0", chain.parent, force=True)
    with pytest.raises(InputError, match=r"a\.camera\.yaml: would be replaced"):
        camcal.undistort(image, tmp_path / "single/a.camera.yaml", tmp_path / "single/a.png", force=True)
    assert (tmp_path / "lone/camera.yaml").read_bytes() == camera_file.read_bytes()


def test_what_exists_needs_force(camera_file, tmp_path):
    """A folder with something in it, a file, a camera beside it: refused; replaced with force; a file is no folder."""
    make_images(tmp_path, "a.png", "out/mine.png")
    with pytest.raises(InputError, match=r"output folder is not empty\. Choose another one, or"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "out")
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "out", force=True)
    assert tree(tmp_path / "out") == ["a.png", "camera.yaml", "mine.png", LEDGER_NAME]
    with pytest.raises(InputError, match="Go on with --resume"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "out")
    (tmp_path / "b.camera.yaml").touch()
    with pytest.raises(InputError, match=r"b\.camera\.yaml: output file exists"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "b.png")
    with pytest.raises(InputError, match="a file stands where the output folder should be"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "b.camera.yaml")


def test_a_file_for_several_inputs(camera_file, tmp_path):
    """A file name as the output of two images is refused; so is --resume with one."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png")
    with pytest.raises(InputError, match="a file for 2 inputs"):
        camcal.undistort(photos, camera_file, tmp_path / "one.png")
    with pytest.raises(InputError, match="--resume: needs a folder"):
        camcal.undistort(photos / "a.png", camera_file, tmp_path / "one.png", resume=True)


def test_results_that_are_named_like_companions(camera_file, tmp_path):
    """An image called mask.png has no place beside the mask; without a mask it has."""
    make_images(tmp_path, "mask.png")
    with pytest.raises(InputError, match=r"mask\.png: its result would be replaced"):
        camcal.undistort(tmp_path / "mask.png", camera_file, tmp_path / "o", mask=True)
    assert camcal.undistort(tmp_path / "mask.png", camera_file, tmp_path / "o").images == ("mask.png",)


def test_an_unwritable_folder(camera_file, tmp_path, monkeypatch):
    """The system's own words, before any image is read."""
    make_images(tmp_path, "a.png")

    def refuse(path, *_args, **_kwargs):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match=r"o: cannot be written \(permission denied\)"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o")


@pytest.mark.parametrize("place", ["locked/o", "locked/sub/o", "locked/o.png", f"{'long' * 99}"])
def test_a_place_that_may_not_be_looked_into(camera_file, tmp_path, monkeypatch, place):
    """A folder without permission to search it, or a name that is too long: the system's own words."""
    make_images(tmp_path, "a.png")
    look = Path.stat

    def refuse(path, **options):
        if "locked" in path.parts:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return look(path, **options)

    monkeypatch.setattr(Path, "stat", refuse)
    with pytest.raises(InputError, match=r"cannot be written \((permission denied|file name too long)\)"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / place)


def test_a_full_disk_ends_the_run(camera_file, tmp_path, monkeypatch):
    """Only whole files are left and no camera that would say that all is there; --resume does the rest and only that."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(6)))
    write = Path.write_bytes
    written = []

    def fill_up(path, data):
        if ".tmp" in path.name and len(written) == 3:
            write(path, data[:100])
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(path)
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", fill_up)
    with pytest.raises(InputError, match=r"3\.png: cannot be written \(no space left on device\).* go on .* with --resume"):
        camcal.undistort(photos, camera_file, tmp_path / "o", jobs=1)
    monkeypatch.undo()
    assert tree(tmp_path / "o") == ["0.png", "1.png", "2.png", LEDGER_NAME]
    before = stamps(tmp_path / "o")
    done = camcal.undistort(photos, camera_file, tmp_path / "o", resume=True)
    assert (len(done.already_done), done.images) == (3, ("3.png", "4.png", "5.png"))
    after = stamps(tmp_path / "o")
    assert before == {name: after[name] for name in before}
    assert (tmp_path / "o/camera.yaml").exists()


def test_a_run_that_comes_to_nothing_leaves_nothing(camera_file, tmp_path):
    """Neither ledger nor folders that were made for it; what was there before stays, a table of somebody's of that name too."""
    photos = make_images(tmp_path / "photos", "sub/a.png")
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / LEDGER_NAME).write_text("my,own\n")
    before = sorted(tmp_path.rglob("*"))
    for place in (tmp_path / "new/o", mine):
        with pytest.raises(InputError, match="--fill: no value"):
            camcal.undistort(photos, camera_file, place, fill=999, recursive=True, force=True)
    assert (mine / LEDGER_NAME).read_text().startswith("my,own\n")
    assert [path for path in sorted(tmp_path.rglob("*")) if path not in before] in ([], [mine / "sub"])


# --- going on ---------------------------------------------------------------------------------------------------------


def test_resume_after_a_crash(camera_file, tmp_path, monkeypatch):
    """A run that dies between writing a result and noting it: that one is done again, the noted ones are not."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(5)))

    class Crash(BaseException):
        pass

    def crash(job, read):
        if job.name == "2.png":
            raise Crash
        return note(job, read)

    carry_out, note = undistort_work.carry_out_here, None

    def carry_out_and_crash(jobs, undistorter, noting, *rest):
        nonlocal note
        note = noting
        return carry_out(jobs, undistorter, crash, *rest)

    monkeypatch.setattr("camcal.workflows.undistort.run.carry_out_here", carry_out_and_crash)
    with pytest.raises(Crash):
        camcal.undistort(photos, camera_file, tmp_path / "o", jobs=1)
    monkeypatch.undo()
    (tmp_path / "o/.camcal-0123456789abcdef.tmp").write_bytes(b"half")
    with (tmp_path / "o" / LEDGER_NAME).open("a") as ledger:
        ledger.write("torn,12,3")
    assert "2.png" in tree(tmp_path / "o")
    done = camcal.undistort(photos, camera_file, tmp_path / "o", resume=True)
    assert [job.name for job in done.already_done] == ["0.png", "1.png"]
    assert done.images == ("2.png", "3.png", "4.png")
    assert tree(tmp_path / "o") == [*(f"{i}.png" for i in range(5)), "camera.yaml", LEDGER_NAME]
    assert camcal.undistort(photos, camera_file, tmp_path / "o", resume=True).images == ()


def test_resume_passes_over_only_what_is_the_same(camera_file, tmp_path, caplog):
    """A source or a result that changed, another camera, another option: done again. A larger limit or more threads: not."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png", "c.png")
    run = lambda **options: camcal.undistort(photos, camera_file, tmp_path / "o", **{"resume": True, **options}).images  # noqa: E731
    assert run(resume=False) == ("a.png", "b.png", "c.png")
    assert run() == ()
    assert run(jobs=2, most_pixels=10**6) == ()
    os.utime(photos / "a.png", ns=(1, 1))
    assert run() == ("a.png",)
    cv2.imwrite(str(photos / "b.png"), picture(99))
    assert run() == ("b.png",)
    (tmp_path / "o/c.png").write_bytes(b"touched")
    assert run() == ("c.png",)
    (tmp_path / "o/c.png").unlink()
    assert run() == ("c.png",)
    make_images(photos, "d.png")
    assert run() == ("d.png",)
    assert run(quality=90) == ("a.png", "b.png", "c.png", "d.png")
    assert run(quality=90, alpha=0.1) == ("a.png", "b.png", "c.png", "d.png")
    assert not caplog.records
    (photos / "a.png").unlink()
    with caplog.at_level(logging.WARNING, logger="camcal"):
        assert run() == ("b.png", "c.png", "d.png")
    assert "also holds 1 file of another camera or other options (first: a.png)" in caplog.text


def test_resume_passes_over_any_name(camera_file, tmp_path):
    """A line break, a backslash or a quote in a name: done once, and not again, even behind a torn line."""
    photos = make_images(tmp_path / "photos", "plain.png")
    names = [
        os.fsencode(tmp_path / "photos") + b"/" + name
        for name in (b"two\nlines\n.png", b"back\\n.png", b'quo"te.png', b"\xff\n.png")
    ]
    for name in names:
        shutil.copy(photos / "plain.png", name)
    camcal.undistort(photos, camera_file, tmp_path / "o")
    ledger = tmp_path / "o" / LEDGER_NAME
    ledger.write_bytes(ledger.read_bytes() + b'"torn\n')
    done = camcal.undistort(photos, camera_file, tmp_path / "o", resume=True)
    assert done.images == ()
    assert len(done.already_done) == 1 + len(names)


def test_two_runs_in_one_folder(camera_file, tmp_path, monkeypatch):
    """While one run writes into a folder, another that would is refused, whatever it may overwrite; then it may."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png")
    into = tmp_path / "o"
    real, refusals = undistort_work.undistort_image_file, []

    def meanwhile(*arguments):
        if not refusals:
            command = [sys.executable, "-m", "camcal", "undistort", photos, "--camera", camera_file, "-o", into, "--force"]
            refusals.append(subprocess.run(command, capture_output=True, text=True, check=False))
        return real(*arguments)

    monkeypatch.setattr(undistort_work, "undistort_image_file", meanwhile)
    camcal.undistort(photos, camera_file, into, jobs=1)
    assert (refusals[0].returncode, refusals[0].stdout) == (2, "")
    assert f"{into}: another run is writing into this folder" in refusals[0].stderr
    assert tree(into) == ["a.png", "b.png", "camera.yaml", LEDGER_NAME]
    assert camcal.undistort(photos, camera_file, into, resume=True).images == ()


def test_resume_begins_where_nothing_is(camera_file, tmp_path):
    """The first run may have --resume too; a folder that no run began is not written into."""
    make_images(tmp_path, "a.png")
    assert camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", resume=True).images == ("a.png",)
    make_images(tmp_path, "mine/x.png")
    with pytest.raises(InputError, match="not empty"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "mine", resume=True)


def test_the_ledger_has_one_line_for_each_result(camera_file, tmp_path):
    """Written by many threads: a header, then each result once, with its source and what both files were."""
    photos = make_images(tmp_path / "photos", *(f"{i:02}.png" for i in range(30)))
    camcal.undistort(photos, camera_file, tmp_path / "o", jobs=8)
    with (tmp_path / "o" / LEDGER_NAME).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert sorted(row["output"] for row in rows) == [f"{i:02}.png" for i in range(30)]
    for row in rows:
        source, result = Path(row["input"]).stat(), (tmp_path / "o" / row["output"]).stat()
        assert Path(row["input"]) == photos / row["output"]
        assert (int(row["input_size"]), int(row["input_mtime_ns"])) == (source.st_size, source.st_mtime_ns)
        assert (int(row["output_size"]), int(row["output_mtime_ns"])) == (result.st_size, result.st_mtime_ns)
    assert len({row["settings"] for row in rows}) == 1


def test_a_camera_that_no_longer_belongs_is_withdrawn_first(camera_file, tmp_path, monkeypatch):
    """While results of another camera are being made, no camera says that it belongs to them."""
    make_images(tmp_path, "a.png")
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o")
    seen = []
    do = undistort_work.Undistorter.do

    def look(self, job, advance=None):
        seen.append((tmp_path / "o/camera.yaml").exists())
        return do(self, job, advance)

    monkeypatch.setattr(undistort_work.Undistorter, "do", look)
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", force=True)
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", force=True, alpha=1)
    assert seen == [True, False]


def test_a_dry_run_writes_nothing(camera_file, tmp_path):
    """It says what would be done, of what is left to do, and refuses what would be refused."""
    photos = make_images(tmp_path / "photos", "a.png", "sub/b.png")
    before = tree(tmp_path)
    options = {"recursive": True, "file_format": "jpg", "size": (32, 24), "dry_run": True}
    plan = camcal.undistort(photos, camera_file, tmp_path / "o", **options)
    assert [(job.source, job.target, job.format) for job in plan.outputs] == [
        (photos / "a.png", tmp_path / "o/a.jpg", "jpg"),
        (photos / "sub/b.png", tmp_path / "o/sub/b.jpg", "jpg"),
    ]
    assert plan.target.size == (32, 24)
    assert tree(tmp_path) == before
    assert not (tmp_path / "o").exists()
    camcal.undistort(photos, camera_file, tmp_path / "o")
    before = stamps(tmp_path / "o")
    plan = camcal.undistort(photos, camera_file, tmp_path / "o", recursive=True, resume=True, dry_run=True)
    assert ([job.name for job in plan.already_done], plan.images) == (["a.png"], ("sub/b.png",))
    with pytest.raises(InputError, match="not empty"):
        camcal.undistort(photos, camera_file, tmp_path / "o", dry_run=True)
    assert stamps(tmp_path / "o") == before


# --- sizes and directions ---------------------------------------------------------------------------------------------


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


# --- videos -----------------------------------------------------------------------------------------------------------


def test_a_folder_with_images_and_a_video(camera_file, tmp_path):
    """Both are undistorted, with one camera; on resume the video is left alone too, however many threads there are."""
    photos = make_images(tmp_path / "photos", "a.png")
    make_video(photos / "clip.mkv", codec="ffv1", frames=3)
    done = camcal.undistort(photos, camera_file, tmp_path / "o", codec="ffv1")
    assert [job.name for job in done.outputs] == ["a.png", "clip.mkv"]
    assert done.images == ("a.png",)
    assert len(read_video(tmp_path / "o/clip.mkv").frames) == 3
    again = camcal.undistort(photos, camera_file, tmp_path / "o", codec="ffv1", resume=True, jobs=1)
    assert (again.outputs, len(again.already_done)) == ((), 2)
    other = camcal.undistort(photos, camera_file, tmp_path / "o", codec="ffv1", frames="0:2", resume=True)
    assert [job.name for job in other.outputs] == ["clip.mkv"]


def test_a_video_of_another_container(camera_file, tmp_path):
    """A container that is not written is rejected with the way out, which works; a torn video does not stop the others."""
    folder = tmp_path / "clips"
    folder.mkdir()
    make_video(folder / "good.mkv", codec="ffv1", frames=2)
    (folder / "torn.mp4").write_bytes((folder / "good.mkv").read_bytes()[:300])
    shutil.copy(folder / "good.mkv", folder / "old.mpg")
    done = camcal.undistort(folder, camera_file, tmp_path / "o")
    assert [one.source for one in done.rejected] == ["old.mpg", "torn.mp4"]
    assert "no format that a video is written in (got '.mpg'" in done.rejected[0].reason
    done = camcal.undistort(folder / "old.mpg", camera_file, tmp_path / "p", file_format="mkv")
    assert [job.name for job in done.outputs] == ["old.mkv"]


def test_options_of_images_are_not_for_videos(camera_file, tmp_path):
    """What a video cannot have is refused, not passed over in silence."""
    make_video(tmp_path / "clip.mkv", codec="ffv1", frames=2)
    for options in ({"fill": 5}, {"gamma": "srgb"}):
        with pytest.raises(InputError, match=r"only for images \(got .*clip\.mkv\)"):
            camcal.undistort(tmp_path / "clip.mkv", camera_file, tmp_path / "o", **options)


# --- points -----------------------------------------------------------------------------------------------------------


def write_points(path: Path, points: np.ndarray, header: str = "name,x,y,note") -> Path:
    """Write points among other columns."""
    lines = [header, *(f"p{i},{x!r},{y!r},{i} of all" for i, (x, y) in enumerate(points.tolist()))]
    path.write_text("\n".join(lines) + "\n")
    return path


def read_points(path: Path) -> np.ndarray:
    """Read x and y back."""
    with path.open(newline="") as file:
        return np.array([[float(row[key] or "nan") for key in "xy"] for row in csv.DictReader(file)])


def test_points_there_and_back(camera_file, tmp_path):
    """Points equal OpenCV's, other columns stay, and the way back is exact to 1e-9 px."""
    points = np.random.default_rng(0).uniform(-0.5, np.array(SIZE) - 0.5, (200, 2))
    source = write_points(tmp_path / "points.csv", points)
    done = camcal.undistort(source, camera_file, tmp_path / "flat", alpha=0.3)
    flat = read_points(tmp_path / "flat/points.csv")
    expected = cv2.undistortPoints(points[:, None], CAMERA.K, CAMERA.dist, P=done.target.K, criteria=(3, 500, 1e-14))
    assert np.abs(flat - expected.reshape(-1, 2)).max() < 1e-8
    assert tree(tmp_path / "flat") == ["camera.yaml", "points.csv"]
    with (tmp_path / "flat/points.csv").open(newline="") as file:
        assert [row["note"] for row in csv.DictReader(file)] == [f"{i} of all" for i in range(200)]
    for number, options in enumerate(({"alpha": 0.3}, {"target": tmp_path / "flat"})):
        back = tmp_path / f"{number}.csv"
        camcal.undistort(tmp_path / "flat/points.csv", camera_file, back, distort=True, **options)
        assert np.abs(read_points(back) - points).max() < 1e-9
        assert load_intrinsics(tmp_path / f"{number}.camera.yaml").camera.intrinsics.tolist() == CAMERA.intrinsics.tolist()


def test_corners_of_a_calibration(dataset, tmp_path):
    """Our own corners file is one of points: it stays loadable, at the size of the new image."""
    camcal.undistort(dataset / "corners.csv", dataset, tmp_path / "flat.csv", scale=1.5)
    camera = load_intrinsics(dataset).camera
    before, after = load_corners(dataset / "corners.csv"), load_corners(tmp_path / "flat.csv")
    target = load_intrinsics(tmp_path / "flat.camera.yaml").camera
    for old, new in zip(before, after, strict=True):
        assert (new.source, new.size, new.ids.tolist()) == (old.source, (960, 720), old.ids.tolist())
        rays = camera.unproject(old.corners_px)
        np.testing.assert_array_equal(new.corners_px, target.project(rays))
    other = tmp_path / "other.yaml"
    save_intrinsics(other, replace(load_intrinsics(dataset), camera=camera.scaled((320, 240))))
    with pytest.raises(InputError, match=r"corners\.csv:2: width: not the camera's \(got '640', expected 320\)"):
        camcal.undistort(dataset / "corners.csv", other, tmp_path / "o.csv")


def test_points_past_the_fold(tmp_path, caplog):
    """They have no place: empty cells and one warning that names the first; cells that are empty stay so."""
    save_intrinsics(tmp_path / "c.yaml", Intrinsics(FOLDED))
    source = write_points(tmp_path / "p.csv", np.array([[31.5, 23.5], [63.0, 0.0], [float("nan"), 3.0]]))
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(source, tmp_path / "c.yaml", tmp_path / "o.csv", alpha=1)
    assert np.isnan(read_points(tmp_path / "o.csv")).all(axis=1).tolist() == [False, True, True]
    assert done.warnings == (f"{source}: 1 point lies past the fold of a lens (empty cells, first on line 3).",)
    assert [record.message for record in caplog.records] == list(done.warnings)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "empty file"),
        ("x,y\n", "no points"),
        ("x,z\n1,2\n", r"p\.csv:1: y: missing column"),
        ("x;y\n1;2\n", "columns not separated by commas"),
        ("x,y,x\n1,2,3\n", r"p\.csv:1: x: column given twice"),
        ("x,y\n1,2\n1\n", r"p\.csv:3: wrong number of cells \(got 1, expected 2\)"),
        ("x,y\n1,two\n", r"p\.csv:2: y: not a number \(got 'two'\)"),
        ("x,y\n1,inf\n", r"p\.csv:2: y: not finite"),
        ('x,y\n1,"2\n', "not valid CSV"),
    ],
)
def test_points_that_are_none(camera_file, tmp_path, text, match):
    """Each defect with its line, and nothing is written."""
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=match):
        camcal.undistort(tmp_path / "p.csv", camera_file, tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_points_stand_alone(camera_file, tmp_path):
    """Beside images, over themselves, or with options of images: refused. A dry run writes nothing."""
    source = write_points(tmp_path / "p.csv", np.array([[1.0, 2.0]]))
    make_images(tmp_path, "a.png")
    with pytest.raises(InputError, match="stands alone"):
        camcal.undistort([source, tmp_path / "a.png"], camera_file, tmp_path / "o")
    with pytest.raises(InputError, match="replace its own input"):
        camcal.undistort(source, camera_file, source, force=True)
    for options in ({"quality": 90}, {"mask": True}, {"resume": True}, {"frames": "0:1"}, {"rescale": True}):
        with pytest.raises(InputError, match="not for points"):
            camcal.undistort(source, camera_file, tmp_path / "o", **options)
    plan = camcal.undistort(source, camera_file, tmp_path / "o", dry_run=True)
    assert [job.target for job in plan.outputs] == [tmp_path / "o/p.csv"]
    assert not (tmp_path / "o").exists()


# --- many -------------------------------------------------------------------------------------------------------------


def test_the_map_is_built_once(camera_file, tmp_path, monkeypatch):
    """However many images and threads."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(8)))
    built = []
    build = undistort_work.Cameras.map

    def count(self, *, exact=False):
        built.append(threading.get_ident())
        return build(self, exact=exact)

    monkeypatch.setattr(undistort_work.Cameras, "map", count)
    camcal.undistort(photos, camera_file, tmp_path / "o", jobs=4)
    assert len(built) == 1


def test_threads_change_nothing(camera_file, tmp_path):
    """One thread or several: the same bytes, but for the ledger's order and times."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(6)), "j.jpg")
    for jobs in (1, 4):
        camcal.undistort(photos, camera_file, tmp_path / str(jobs), jobs=jobs)
    for name in set(tree(tmp_path / "1")) - {LEDGER_NAME}:
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "4" / name).read_bytes()
