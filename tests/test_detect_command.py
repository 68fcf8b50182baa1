"""`camcal detect`: the corners it writes are those that calibrate works with, and its pictures show what was seen."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import click
import cv2
import numpy as np
import pytest
from messages import one_line

from camcal.errors import InputError
from camcal.formats.corners_file import load_corners
from camcal.formats.images import read_image
from camcal.workflows.detect import detect
from camcal.workflows.reporting import SilentReporter

BOARD = "checkerboard:7x6:20mm"
SILENT = SilentReporter()
# What the overlay draws with, blue, green, red.
RED, GREEN, ORANGE = (60, 60, 255), (60, 220, 60), (0, 165, 255)
GROUND, REJECTED_GROUND = (45, 40, 40), (40, 30, 120)


@pytest.fixture(scope="module")
def seen(dataset, tmp_path_factory) -> Path:
    """Corners and pictures of the rendered dataset. Not to be written into."""
    folder = tmp_path_factory.mktemp("seen")
    detect(dataset / "images", BOARD, folder / "corners.csv", overlay=folder / "pictures", reporter=SILENT)
    return folder


def share_near(picture: np.ndarray, colour: tuple[int, int, int]) -> float:
    """Share of the pixels whose three values are within 40 levels of a colour."""
    return float((np.abs(picture.astype(int) - colour).max(axis=2) <= 40).mean())


def drawn_at(picture: np.ndarray, points: np.ndarray, colour: tuple[int, int, int], reach: int = 3) -> np.ndarray:
    """Which points (N, 2) of a picture have a colour within some pixels: lines run between corners found, not true ones."""
    same = (np.abs(picture.astype(int) - colour).max(axis=2) <= 40).astype(np.uint8)
    columns, rows = np.rint(points).astype(int).T
    return cv2.dilate(same, np.ones((2 * reach + 1,) * 2, np.uint8))[rows, columns] > 0


def test_its_corners_solve_to_the_same_bytes_as_the_images(run, dataset, seen, tmp_path):
    """camera.yaml and corners.csv are the same files, whether the corners were found on the way or before."""
    options = ("--board", BOARD, "--refine", "saddle", "-o")
    assert run("calibrate", dataset / "images", *options, tmp_path / "images")[0] == 0
    assert run("calibrate", seen / "corners.csv", *options, tmp_path / "corners")[0] == 0
    for name in ("camera.yaml", "corners.csv", "board.yaml"):
        assert (tmp_path / "images" / name).read_bytes() == (tmp_path / "corners" / name).read_bytes()


def test_its_corners_are_where_the_truth_is(dataset, seen):
    """Every corner of every view, none beyond six of its own standard deviations per axis, or the renderer's rounding."""
    truth = {view.source: view for view in load_corners(dataset / "corners.csv")}
    found = load_corners(seen / "corners.csv")
    assert {view.source for view in found} == truth.keys()
    for view in found:
        assert view.ids.tolist() == list(range(42))
        off = np.abs(view.corners_px - truth[view.source].corners_px)
        # Noise of two levels; what 8 bits and the blur leave beyond it is below a hundredth of a pixel.
        assert (off < 6 * view.sigma_px[:, None] + 0.01).all()


def test_threads_change_no_byte(dataset, seen, tmp_path):
    """One image at a time or several: the same corners and the same pictures."""
    detect(dataset / "images", BOARD, tmp_path / "corners.csv", overlay=tmp_path / "pictures", jobs=1, reporter=SILENT)
    assert (tmp_path / "corners.csv").read_bytes() == (seen / "corners.csv").read_bytes()
    for picture in (seen / "pictures").iterdir():
        assert picture.read_bytes() == (tmp_path / "pictures" / picture.name).read_bytes()


def test_a_picture_shows_the_image_with_axes_and_a_strip_below(dataset, seen):
    """Whole pixels of the image away from the board; red along x and green along y from the first corner; a dark strip."""
    pictures = sorted((seen / "pictures").iterdir())
    images = sorted((dataset / "images").iterdir())
    assert [picture.name for picture in pictures] == [image.name for image in images]
    truth = {view.source: view.corners_px for view in load_corners(dataset / "corners.csv")}
    for file, source in zip(pictures, images, strict=True):
        picture, image = read_image(file), read_image(source)
        # The longer side of 640 pixels becomes 1280: the first whole factor that reaches 1200.
        height, width = (2 * side for side in image.shape[:2])
        assert picture.shape[1:] == (width, 3)
        assert picture.shape[0] > height
        assert share_near(picture[height:], GROUND) > 0.6
        corners = 2 * truth[source.name] + 0.5
        apart = np.linalg.norm(
            np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=2) - corners.mean(axis=0), axis=2
        )
        reach = np.linalg.norm(corners - corners.mean(axis=0), axis=1).max() + 60
        shown = np.repeat(np.repeat(image, 2, axis=0), 2, axis=1)
        far = apart > reach
        assert (picture[:height][far] == shown[far][:, None]).all()
        for end, colour in ((1, RED), (7, GREEN)):
            x, y = np.rint(0.4 * corners[0] + 0.6 * corners[end]).astype(int)
            assert np.abs(picture[y, x].astype(int) - colour).max() <= 40


def test_an_image_without_the_board_shows_what_was_half_seen(run, dataset, tmp_path):
    """Asked for 6x5: no corners, exit code 3, and the 7x6 that are there drawn in orange over a red strip with the reason."""
    image = sorted((dataset / "images").iterdir())[0]
    options = ("--board", "checkerboard:6x5:20mm", "-o", tmp_path / "corners.csv", "--overlay", tmp_path / "seen")
    code, out, err = run("detect", image, *options)
    assert code == 3
    assert "checkerboard:7x6:20mm" in " ".join(out.split())
    assert f"Look at the pictures in {tmp_path / 'seen'}" in err
    assert not (tmp_path / "corners.csv").exists()
    picture = read_image(tmp_path / "seen" / image.name)
    height = 2 * read_image(image).shape[0]
    assert share_near(picture[height:], REJECTED_GROUND) > 0.6
    corners = {view.source: view.corners_px for view in load_corners(dataset / "corners.csv")}[image.name]
    middles = (corners.reshape(6, 7, 2)[:, :-1] + corners.reshape(6, 7, 2)[:, 1:]).reshape(-1, 2) / 2
    assert drawn_at(picture, 2 * middles + 0.5, ORANGE).all()


def test_tags_of_another_family_are_shown(tmp_path):
    """An AprilGrid asked for in a family that it is not: all of its tags are outlined."""
    from camcal.boards.spec import parse_board
    from camcal.geometry.camera import Camera
    from camcal.geometry.pose import Pose
    from camcal.synthesis.render import render_ideal
    from camcal.synthesis.scenario import Light

    camera = Camera((800, 600), [[800, 0, 400], [0, 800, 300], [0, 0, 1]])
    board = parse_board("aprilgrid:4x3:30mm:0.3")
    pose = Pose(np.eye(3), np.array([-0.07, -0.05, 0.25]))
    image = np.rint(255 * render_ideal(camera, board, pose, Light(), blur_sigma_px=0.7)).astype(np.uint8)
    result = detect({"view": image}, "aprilgrid:4x3:30mm:0.3:family=tag25h9", overlay=tmp_path / "seen", reporter=SILENT)
    assert not result.detections
    assert result.overlays == (tmp_path / "seen" / "view.png",)
    picture = read_image(result.overlays[0])
    corners = camera.project(pose.apply(board.object_points)).reshape(-1, 4, 2)
    sides = (corners + np.roll(corners, 1, axis=1)).reshape(-1, 2) / 2
    # Tags are outlined as they were read, a pixel or two off, which the picture doubles.
    assert drawn_at(picture, 2 * sides + 0.5, ORANGE, reach=5).all()


def test_damaged_and_empty_images_have_pictures_too(run, dataset, tmp_path):
    """A truncated file in a folder and a grey one: named in the table with their reasons, each with its picture."""
    folder = tmp_path / "photos"
    folder.mkdir()
    good = sorted((dataset / "images").iterdir())[0]
    shutil.copy(good, folder)
    (folder / "cut.png").write_bytes(good.read_bytes()[:2000])
    cv2.imwrite(str(folder / "grey.jpg"), np.full((300, 400), 128, np.uint8))
    code, out, _ = run("detect", folder, "--board", BOARD, "-o", tmp_path / "one.csv", "--overlay", tmp_path / "seen")
    assert code == 0
    assert "camcal calibrate" not in out, "one view is too few to calibrate with"
    assert {path.name for path in (tmp_path / "seen").iterdir()} == {good.name, "cut.png", "grey.jpg"}
    assert out.count("rejected:") == 2
    assert "next to no contrast" in out
    assert "in 1 of 3 images, 42 corners" in out
    assert all(read_image(path).shape[2] == 3 for path in (tmp_path / "seen").iterdir())


@pytest.mark.parametrize(("side", "dtype"), [(64, np.uint16), (64, np.float32), (3000, np.uint16)])
def test_pictures_of_any_size_and_depth(side, dtype, tmp_path):
    """From 64 to 3000 pixels, whatever the pixels: at least 1024 wide, and letters at least 12 and about a 60th of it high."""
    image = np.zeros((side // 2, side), dtype=dtype)
    image[:, side // 2 :] = 1000
    result = detect({"flat": image}, BOARD, overlay=tmp_path / "seen", reporter=SILENT)
    picture = read_image(result.overlays[0])
    height, width = (round(edge * picture.shape[1] / side) for edge in image.shape)
    assert width == picture.shape[1] >= 1024
    strip = picture[height:]
    bright_rows = np.flatnonzero((strip.min(axis=2) > 180).any(axis=1))
    # The first line of white letters: "flat: rejected" has ascenders and a descender.
    first = np.split(bright_rows, np.flatnonzero(np.diff(bright_rows) > 2) + 1)[0]
    assert 12 <= first.size <= width / 30
    assert np.ptp(picture[: height // 2, : width // 4]) <= 1 or dtype is np.float32


def test_pictures_never_replace_images(run, dataset, tmp_path):
    """The folder of the images themselves is refused, with --force too; so is one with files in it, without."""
    folder = tmp_path / "photos"
    folder.mkdir()
    image = Path(shutil.copy(sorted((dataset / "images").iterdir())[0], folder))
    before = image.read_bytes()
    for force in ((), ("--force",)):
        code, _, err = run("detect", folder, "--board", BOARD, "--overlay", folder, *force)
        assert (code, err.count("\n")) == (2, 1)
    assert "would replace the image itself" in err
    assert image.read_bytes() == before
    (tmp_path / "seen").mkdir()
    (tmp_path / "seen" / "mine.txt").touch()
    assert run("detect", folder, "--board", BOARD, "--overlay", tmp_path / "seen")[0] == 2
    assert run("detect", folder, "--board", BOARD, "--overlay", tmp_path / "seen", "--force")[0] == 0
    assert (tmp_path / "seen" / "mine.txt").exists()


def test_two_images_never_share_a_picture(dataset, tmp_path):
    """a.png and a.tif, which would both become a.png: the second is named for what it is."""
    folder = tmp_path / "photos"
    folder.mkdir()
    image = sorted((dataset / "images").iterdir())[0]
    shutil.copy(image, folder / "a.png")
    cv2.imwrite(str(folder / "a.tif"), cv2.imread(str(image)))
    cv2.imwrite(str(folder / "b.tif"), cv2.imread(str(image)))
    result = detect(folder, BOARD, overlay=tmp_path / "seen", reporter=SILENT)
    assert sorted(path.name for path in result.overlays) == ["a.png", "a.tif.png", "b.png"]
    assert all(path.is_file() for path in result.overlays)


def test_an_existing_file_is_kept(run, dataset, tmp_path):
    """Refused before any work, and replaced with --force."""
    file = tmp_path / "corners.csv"
    file.write_text("mine")
    assert run("detect", dataset / "images", "--board", BOARD, "-o", file)[0] == 2
    assert file.read_text() == "mine"
    assert run("detect", dataset / "images", "--board", BOARD, "-o", file, "--force")[0] == 0
    assert len(load_corners(file)) == 8


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--board", BOARD, "--refine", "sadle"), "Did you mean 'saddle'?"),
        (("--board", BOARD, "-o", "corners.xml"), "not a file for corners (got '.xml', expected .csv or .vnl)"),
        (("--board", "aprilgrid:4x3:30mm:0.3", "-o", "corners.vnl"), "expected a checkerboard). Use CSV."),
        (("--board", "chekerboard:7x6:20mm"), "Did you mean 'checkerboard'?"),
    ],
)
def test_what_makes_no_sense_is_refused(run, dataset, tmp_path, monkeypatch, arguments, told):
    """Exit code 2 and one line, before anything is written."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run("detect", dataset / "images", *arguments)
    assert (code, out) == (2, "")
    assert told in err
    assert list(tmp_path.iterdir()) == []


def test_warped_needs_a_calibration(dataset):
    """The refinement that calibrate has and detect cannot have is refused with the reason."""
    with pytest.raises(InputError, match="warped needs a first calibration"):
        detect(dataset / "images", BOARD, refine="warped", reporter=SILENT)


def test_the_table_fits_80_columns(run, dataset, tmp_path):
    """Also with a long reason and a long note; numbers stand in one column."""
    image = sorted((dataset / "images").iterdir())[0]
    folder = tmp_path / "photos"
    folder.mkdir()
    shutil.copy(image, folder / "a.png")
    cv2.imwrite(str(folder / "b.png"), cv2.GaussianBlur(cv2.imread(str(image)), (0, 0), 2.5))
    cv2.imwrite(str(folder / "c.png"), np.full((300, 400), 128, np.uint8))
    code, out, _ = run("detect", folder, "--board", BOARD, "-o", tmp_path / "corners.csv")
    assert code == 0
    assert max(map(len, out.splitlines())) <= 80 + len(str(tmp_path))
    assert "    blurred: its edges are" in out
    heads = [line for line in out.splitlines() if line.startswith(("image", "a.png", "b.png", "c.png"))]
    assert len({len(line) for line in heads}) == 1


@pytest.mark.parametrize("terminal", [False, True])
def test_columns_stand_below_each_other_for_long_names(run, dataset, tmp_path, monkeypatch, terminal):
    """In a pipe names stay whole and the columns move over together; on a terminal names are cut and the table fits."""
    image = sorted((dataset / "images").iterdir())[0]
    names = ["a.png", f"{'left_front_' * 6}0.png"]
    for name in names:
        shutil.copy(image, tmp_path / name)
    monkeypatch.setattr("camcal.cli.style.is_terminal", lambda stream: terminal and stream is sys.stdout)
    code, out, _ = run("detect", *(tmp_path / name for name in names), "--board", BOARD)
    table = [click.unstyle(line) for line in out.split("\n\n")[0].splitlines()]
    assert (code, len(table)) == (0, 3)
    assert len({len(line) for line in table}) == 1
    assert (len(table[0]) <= 80) == terminal
    assert (names[1] in table[2]) != terminal


def test_json_tells_the_same(run, dataset, tmp_path):
    """Every image with its corners or its reason; the numbers are those of the file."""
    code, out, _ = run("detect", dataset / "images", "--board", BOARD, "-o", tmp_path / "corners.csv", "--json")
    told = json.loads(out)
    assert (code, told["board"], told["features"], told["found"]) == (0, BOARD, 42, 8)
    assert told["output"] == str(tmp_path / "corners.csv")
    for view in load_corners(tmp_path / "corners.csv"):
        entry = told["images"][view.source]
        assert entry["corners"] == len(view)
        assert entry["size"] == [640, 480]
        assert entry["sigma_px"] == pytest.approx(np.median(view.sigma_px))


def test_photographs(photos, tmp_path):
    """opencv_left: 13 views of 54 corners; udacity's close-up, cut by the frame on every side, is rejected and says so."""
    left = detect(photos / "opencv_left", "checkerboard:9x6:25mm", reporter=SILENT)
    assert [len(view) for view in left.detections] == [54] * 13
    close = detect(photos / "udacity_wide" / "test_image.jpg", "checkerboard:8x6:1m", overlay=tmp_path, reporter=SILENT)
    (rejected,) = close.rejected
    assert "cut by the frame" in rejected.reason
    assert share_near(read_image(close.overlays[0])[-40:], REJECTED_GROUND) > 0.6


def test_a_file_where_a_folder_of_pictures_should_be(run, dataset, tmp_path):
    """Exit code 2 and one line before anything is looked for; the file stays."""
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        shutil.copy(dataset / "images/view_0000.png", tmp_path / name)
    odd = tmp_path / "seen/left"
    odd.parent.mkdir()
    odd.touch()
    code, out, err = run(
        "detect", tmp_path / "left", tmp_path / "right", "--board", BOARD, "--overlay", tmp_path / "seen", "--force"
    )
    assert (code, out) == (2, "")
    assert f"{odd}: a file stands where the output folder should be" in one_line(err)
    assert odd.is_file()
