"""Boards that are not found: each reason names the cause and what to do, and the command's one line names the commonest."""

from __future__ import annotations

import re
import time
from dataclasses import replace

import cv2
import numpy as np
import pytest
from board_images import errors_px, pose_of, shoot

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.spec import parse_board
from camcal.calibration.views import too_few_views
from camcal.cli import main
from camcal.detection.detect import detect_board
from camcal.detection.picture import picture_fault
from camcal.detection.reading import Print, read_tags
from camcal.detection.survey import survey
from camcal.observations import Detection, Rejected
from camcal.threads import single_threaded

BOARD = Checkerboard(9, 6, 0.025)
GRID = AprilGrid(6, 5, tag_m=0.03, gap_m=0.009)
FAMILIES = ("tag36h11", "tag36h10", "tag25h9", "tag16h5")
# Several ways to hold a board: tilt, turn, share of the image's width.
HELD = ((20, 0, 0.6), (35, 30, 0.5), (5, 90, 0.55), (25, 200, 0.45))

TRANSFORMS = {
    "mirrored": lambda gray: np.ascontiguousarray(gray[:, ::-1]),
    "upside down mirrored": lambda gray: np.ascontiguousarray(gray[::-1]),
    "turned": lambda gray: np.ascontiguousarray(np.rot90(gray)),
    "inverted": lambda gray: 255 - gray,
    "dark": lambda gray: (gray * 0.03).astype(np.uint8),
    "black": np.zeros_like,
    "overexposed": lambda gray: np.clip(gray * 8.0 + 60, 0, 255).astype(np.uint8),
    "faint": lambda gray: (100 + gray * 0.05).astype(np.uint8),
    "blurred": lambda gray: cv2.GaussianBlur(gray, (0, 0), 6),
    "shaken": lambda gray: cv2.blur(gray, (25, 1)),
}


def scaled(gray, factor: float):
    """The image at another size, averaged where it shrinks."""
    interpolation = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    return cv2.resize(gray, None, fx=factor, fy=factor, interpolation=interpolation)


def views_of(board):
    """A few rendered images of a board, each with its truth."""
    return [
        shoot(board, pose_of(board, tilt_deg=tilt, turn_deg=turn, fill=fill), seed=n)
        for n, (tilt, turn, fill) in enumerate(HELD)
    ]


def reason(image, board) -> str:
    """Why a board is rejected; one clause, with something to do or a guess after its finding."""
    with single_threaded():
        found = detect_board(image, board, "view.png")
    assert isinstance(found, Rejected)
    assert "\n" not in found.reason
    assert found.reason[0].islower()
    assert ": " in re.sub(r"\([^()]*\)", "", found.reason), found.reason
    return found.reason


@pytest.mark.parametrize(("asked", "fitting"), [((10, 7), "9x6"), ((7, 10), "6x9")])
def test_squares_counted(asked, fitting):
    """10x7 squares are 9x6 inner corners: the reason gives the SPEC that fits, side included, however it is held."""
    for image, _ in views_of(BOARD):
        told = reason(image, Checkerboard(*asked, 0.025))
        assert "were squares counted instead of inner corners?" in told
        assert told.endswith(f"checkerboard:{fitting}:25mm")


@pytest.mark.parametrize("asked", [(8, 6), (9, 5), (7, 6), (9, 7), (11, 8)])
def test_other_size_is_named_with_its_spec(asked):
    """Smaller and larger boards than the one that is there: the SPEC that fits is the guess."""
    image, _ = views_of(BOARD)[0]
    told = reason(image, Checkerboard(*asked, 0.025))
    assert "9x6 inner corners" in told
    assert told.endswith("is it checkerboard:9x6:25mm?")


def test_part_that_is_seen_unclearly_is_no_guess():
    """A board whose last columns are hidden is asked about; a size is guessed only if all of the rest is clear."""
    image, truth = shoot(BOARD, pose_of(BOARD, turn_deg=0, tilt_deg=0, fill=0.6))
    image[:, int(truth.corners_px[5, 0]) :] = 128
    told = reason(image, BOARD)
    assert "is part of the board hidden or in glare" in told


@pytest.mark.parametrize("asked", FAMILIES)
@pytest.mark.parametrize("printed", FAMILIES)
@pytest.mark.parametrize("border", [1, 2])
def test_other_family_is_named(printed, border, asked):
    """Tags of any family for any other: both are named, and what to set, with the border where that differs too."""
    if printed == asked:
        return
    image, _ = shoot(replace(GRID, family=printed, border_bits=border), pose_of(GRID))
    told = reason(image, replace(GRID, family=asked))
    assert told.startswith(f"tags of {printed} were seen, {asked} was asked for: set family={printed}")
    assert told.endswith(" and border=1") is (border == 1)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("flip", ["mirrored", "upside down mirrored"])
def test_mirrored_image_is_named(flip, family):
    """Tags that can be read only in the mirror image: the image is mirrored, however the board is held."""
    board = replace(GRID, family=family)
    for image, _ in views_of(board):
        assert reason(TRANSFORMS[flip](image), board).startswith("the image is mirrored: ")


def test_mirrored_image_of_another_family():
    """Two causes at once are both told."""
    told = reason(TRANSFORMS["mirrored"](views_of(GRID)[0][0]), replace(GRID, family="tag36h10"))
    assert "tags of tag36h11 were seen, tag36h10 was asked for" in told
    assert "the image is mirrored" in told


@pytest.mark.parametrize("squares", [True, False])
def test_inverted_tags_are_named(squares):
    """White tags on black: said as such, with and without corner squares."""
    board = replace(GRID, squares=squares)
    for image, _ in views_of(board):
        assert reason(TRANSFORMS["inverted"](image), board).startswith("the tags are white on black: ")


def test_checkerboard_for_an_aprilgrid():
    """A checkerboard where tags are looked for: its inner corners are counted in the guess."""
    for image, _ in views_of(BOARD):
        assert reason(image, GRID).endswith("(checkerboard:9x6:SIDE)?")


@pytest.mark.parametrize(
    ("change", "options"), [({}, ""), ({"border_bits": 1}, ":border=1"), ({"family": "tag25h9"}, ":family=tag25h9")]
)
def test_aprilgrid_for_a_checkerboard(change, options):
    """Tags where a checkerboard is looked for: the guess has their family and border as a SPEC spells them."""
    image, _ = shoot(replace(GRID, **change), pose_of(GRID))
    assert reason(image, BOARD).endswith(f"(aprilgrid:COLUMNSxROWS:TAG:SPACING{options})?")


def test_other_markers_for_either_board():
    """Squares of an ArUco dictionary are no AprilTags and no checkerboard: a guess for both."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    image = np.full((480, 640), 220, np.uint8)
    for n in range(20):
        row, column = divmod(n, 5)
        image[40 + 100 * row :, 60 + 100 * column :][:70, :70] = cv2.aruco.generateImageMarker(dictionary, n, 70)
    assert "is it a ChArUco board, or a grid of markers?" in reason(image, BOARD)
    assert reason(image, GRID).endswith("or other markers?")


def test_tags_beyond_the_board_are_named():
    """A board of 2x2 asked for where only the tags 12 to 29 are seen: the ids say so."""
    image, truth = shoot(GRID, pose_of(GRID))
    for tag in range(12):
        cv2.fillConvexPoly(image, np.round(truth.corners_px[truth.ids // 4 == tag]).astype(np.int32), 90)
    told = reason(image, replace(GRID, columns=2, rows=2))
    assert "its tags are not on the board (ids 12 to 29, expected 0 to 3)" in told


@pytest.mark.parametrize("board", [BOARD, GRID], ids=["checkerboard", "aprilgrid"])
def test_turned_and_enlarged_images_are_fine(board):
    """A quarter turn and four times the size hide nothing: every corner that the original shows is found."""
    image, truth = views_of(board)[0]
    for changed in (TRANSFORMS["turned"](image), scaled(image, 4)):
        found = detect_board(changed, board, "view.png")
        assert isinstance(found, Detection)
        assert len(found) >= 0.95 * len(truth)


@pytest.mark.parametrize("factor", [1 / 6, 1 / 8])
def test_small_squares_are_measured(factor):
    """Images shrunk until squares are 4 to 7 pixels wide: the reason gives their width, right to a tenth of it."""
    image, truth = shoot(BOARD, pose_of(BOARD, tilt_deg=0, turn_deg=0, fill=0.48))
    spacing = np.linalg.norm(truth.corners_px[1] - truth.corners_px[0]) * factor
    assert spacing < 7
    told = reason(scaled(image, factor), BOARD)
    width = float(re.search(r"its squares are only ([\d.]+) pixels wide, expected at least 7\)", told)[1])
    assert width == pytest.approx(spacing, rel=0.1)


def test_small_tags_are_measured():
    """Tags 11 pixels wide, with gaps of 3, are read but not used; tags of 7 pixels cannot be read. Both widths are told."""
    image, truth = shoot(GRID, pose_of(GRID, tilt_deg=0, fill=0.6))
    side = np.linalg.norm(truth.corners_px[1] - truth.corners_px[0])
    told = reason(scaled(image, 11.5 / side), GRID)
    # Half of the gap, .15 of the tag, must be 2 pixels: 13.3 pixels, rounded up.
    width = float(re.search(r"its tags are only ([\d.]+) pixels wide, expected at least 14\)", told)[1])
    assert width == pytest.approx(11.5, rel=0.1)
    told = reason(scaled(image, 7.5 / side), GRID)
    width = float(re.search(r"too small to be read as tags \((\d+) pixels wide, expected at least 22\)", told)[1])
    assert width == pytest.approx(7.5, abs=1.5)


@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("dark", "the image is almost black (grey levels"),
        ("black", "the image is almost black (grey levels 0 to 0 of 255)"),
        ("overexposed", "the image is almost white (grey levels"),
        ("faint", "the image has next to no contrast (grey levels 1"),
        ("blurred", "the image is blurred ("),
        ("shaken", "the image is blurred"),
    ],
)
def test_spoilt_pictures_are_named(fault, told):
    """Pictures too dark, too light, too flat, out of focus or shaken to show tags: each is told with its figures."""
    for image, _ in views_of(GRID):
        assert reason(TRANSFORMS[fault](image), GRID).startswith(told)


@pytest.mark.parametrize("fault", ["dark", "black", "overexposed"])
def test_spoilt_pictures_of_checkerboards(fault):
    """Checkerboards stand more than tags do, but not everything."""
    told = {
        "dark": "the image is almost black",
        "black": "the image is almost black",
        "overexposed": "the image is almost white",
    }
    assert reason(TRANSFORMS[fault](views_of(BOARD)[0][0]), BOARD).startswith(told[fault])


def test_sharp_pictures_have_no_fault():
    """Rendered views, shrunk, enlarged, moderately blurred (σ 2) or at a tenth of full scale less, have no fault."""
    for board in (BOARD, GRID):
        for image, _ in views_of(board):
            for changed in (
                image,
                scaled(image, 0.5),
                scaled(image, 4),
                cv2.GaussianBlur(image, (0, 0), 2),
                image - image // 10,
            ):
                assert picture_fault(changed) == ""


def crossing_edges():
    """Ideal edges along both axes of the image, 200 levels high and far from each other."""
    image = np.zeros((480, 640), np.uint8)
    image[:, 200:440] = 200
    image[120:360] = 200 - image[120:360]
    return image


@pytest.mark.parametrize("sigma", [4, 6, 8])
def test_width_of_blurred_edges(sigma):
    """An ideal edge blurred by σ is √(2π) σ wide at its steepest; the sharpest 2 % may seem up to a fifth narrower."""
    told = picture_fault(cv2.GaussianBlur(crossing_edges(), (0, 0), sigma))
    width = float(re.search(r"sharpest edges are at least (\d+) pixels wide", told)[1])
    assert 0.8 <= width / (np.sqrt(2 * np.pi) * sigma) <= 1.1


def test_motion_is_told_from_defocus():
    """Smeared over 19 pixels along x: edges across the motion are that wide, those along it stay sharp (4 pixels at most).

    At the end of a ramp of 19 pixels a reach of 12 sees 13 of them at least.
    """
    told = picture_fault(cv2.blur(crossing_edges(), (19, 1)))
    across, others = re.search(
        r"by motion \(edges across the motion are at least (\d+) pixels wide, others (\d+)\)", told
    ).groups()
    assert 13 <= int(across) <= 19
    assert int(others) <= 4


@pytest.mark.parametrize("printed", [Print(family, border) for family in FAMILIES for border in (1, 2)], ids=str)
def test_tags_are_read_with_their_corners(printed):
    """Every family and border is told from half of the tags at least, and corners BL, BR, TR, TL are true to a cell's width."""
    board = replace(GRID, family=printed.family, border_bits=printed.border_bits)
    for image, truth in views_of(board):
        reading = read_tags(image)
        assert reading.printed == printed
        assert len(reading.tags) >= 0.5 * board.tag_count
        corners = truth.corners_px.reshape(-1, 4, 2)[reading.tags.ids]
        cell = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1).min() / 10
        assert np.abs(reading.tags.corners_px - corners).max() < cell


def test_nothing_is_read_into_other_pictures():
    """Checkerboards, noise and blank images hold no tags; squares of a checkerboard have nothing in them."""
    for image, _ in views_of(BOARD):
        reading = read_tags(image)
        assert reading.printed is None
        assert reading.plain >= 20
        assert reading.marked_px.size <= 2
    noise = np.random.default_rng(3).integers(0, 256, (480, 640)).astype(np.uint8)
    for image in (noise, cv2.GaussianBlur(noise, (0, 0), 3), np.full((480, 640), 90, np.uint8), np.zeros((2, 3), np.uint8)):
        assert read_tags(image).printed is None


def test_blurred_tags_that_are_read_are_used():
    """Tags of 18 pixels with one-bit borders, which OpenCV does not decode, are used, each id at its own corner."""
    board = replace(GRID, border_bits=1)
    image, truth = shoot(board, pose_of(board, fill=0.6))
    found = detect_board(scaled(image, 0.4), board, "view.png")
    assert isinstance(found, Detection)
    halved = replace(truth, corners_px=(truth.corners_px + 0.5) * 0.4 - 0.5)
    assert np.abs(errors_px(found, halved)).max() < 1


def test_survey_sees_small_boards():
    """A board with squares of 4 pixels in an image of 80x60 is counted right."""
    image, _ = shoot(BOARD, pose_of(BOARD, tilt_deg=0, turn_deg=0, fill=0.45))
    seen = survey(scaled(image, 1 / 8))
    assert seen.sides == (6, 9)
    assert seen.size((9, 6)) == (9, 6)
    assert seen.size((6, 9)) == (6, 9)


def test_causes_cost_little():
    """Looking for causes in a picture without a board adds less than half of what the search costs (0.25 s, CPU)."""
    rng = np.random.default_rng(1)
    street = cv2.GaussianBlur(rng.integers(0, 256, (800, 1280)).astype(np.uint8), (0, 0), 5)
    street = cv2.normalize(street, None, 0, 255, cv2.NORM_MINMAX)
    with single_threaded():
        start = time.thread_time()
        read_tags(street)
        picture_fault(street)
        causes = time.thread_time() - start
        start = time.thread_time()
        detect_board(street, BOARD, "street.png")
        whole = time.thread_time() - start
    assert causes < 0.5 * (whole - causes)


def rejections(*reasons: str) -> list[Rejected]:
    """Rejected views a.png, b.png ... with these reasons."""
    return [Rejected(f"{chr(97 + n)}.png", text) for n, text in enumerate(reasons)]


def test_the_commonest_reason_is_told():
    """The line names the commonest reason, how many images of how many have it, and the first of them."""
    told = too_few_views(1, rejections("no board: look", "the image is mirrored: flip", "the image is mirrored: flip"))
    assert told == (
        "calibrate: too few usable views (got 1, expected at least 3). "
        "2 of 3 rejected images (first: b.png): the image is mirrored: flip."
    )


def test_figures_of_one_image_do_not_divide_a_reason():
    """Reasons count as one if only parentheses differ; a question keeps its mark and gets no full stop."""
    told = too_few_views(0, rejections("no board: look", "too small (4 pixels): near?", "too small (5 pixels): near?"))
    assert told.endswith("2 of 3 rejected images (first: b.png): too small (4 pixels): near?")


@pytest.mark.parametrize(
    ("rejected", "ending"),
    [
        ([], "(got 2, expected at least 3). Take more photographs that show the whole board."),
        (["the same view as c.png"], " a.png: the same view as c.png. Take more photographs that show the whole board."),
        (["the file is damaged: copy it again."], " a.png: the file is damaged: copy it again."),
    ],
)
def test_advice_is_given_once(rejected, ending):
    """A reason that says what to do needs no more advice, one that does not gets some, and no line ends in two stops."""
    assert too_few_views(2, rejections(*rejected)).endswith(ending)


@pytest.mark.parametrize(
    ("printed", "asked", "change", "told"),
    [
        (
            BOARD,
            "checkerboard:10x7:25mm",
            "",
            "were squares counted instead of inner corners? Then it is checkerboard:9x6:25mm.",
        ),
        (BOARD, "aprilgrid:6x5:30mm:0.3", "", "is the board a checkerboard (checkerboard:9x6:SIDE)?"),
        (GRID, "aprilgrid:6x5:30mm:0.3:family=tag36h10", "", "set family=tag36h11."),
        (GRID, "aprilgrid:6x5:30mm:0.3", "mirrored", "the image is mirrored: turn off"),
        (GRID, "aprilgrid:6x5:30mm:0.3", "blurred", "the image is blurred ("),
        (GRID, "checkerboard:9x6:25mm", "", "is the board an AprilGrid (aprilgrid:COLUMNSxROWS:TAG:SPACING)?"),
    ],
)
def test_command_ends_in_the_cause(tmp_path, capsys, printed, asked, change, told):
    """`camcal calibrate` leaves with 3, and its last line on stderr counts the images and names the cause."""
    for n, (image, _) in enumerate(views_of(printed)[:3]):
        cv2.imwrite(str(tmp_path / f"{n}.png"), TRANSFORMS[change](image) if change else image)
    blank = np.full((480, 640), 90, np.uint8)
    cv2.imwrite(str(tmp_path / "blank.png"), blank)
    assert main(["calibrate", str(tmp_path), "--board", asked, "-o", str(tmp_path / "out")]) == 3
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert "3 of 4 rejected images (first: 0.png): " in line
    assert told in line


def gray(path):
    """A photograph as it was stored, in gray."""
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)


MOMS = "aprilgrid:5x4:20mm:0.25:family=tag36h10:first=top-left"


@pytest.mark.parametrize(
    ("change", "spec", "told"),
    [
        ("mirrored", MOMS, "the image is mirrored"),
        ("upside down mirrored", MOMS, "the image is mirrored"),
        ("inverted", MOMS, "the tags are white on black"),
        (
            "",
            MOMS.replace("36h10", "36h11"),
            "tags of tag36h10 were seen, tag36h11 was asked for: set family=tag36h10 and border=1",
        ),
        (
            "",
            MOMS.replace("36h10", "16h5") + ":border=1",
            "tags of tag36h10 were seen, tag16h5 was asked for: set family=tag36h10",
        ),
        ("", "checkerboard:6x5:25mm", "tags of tag36h10 were seen and no checkerboard"),
    ],
)
def test_photographs_of_tags(photos, change, spec, told):
    """All twelve photographs of an AprilGrid name the cause, even the one that shows few readable tags."""
    files = sorted((photos / "moms_left").glob("*.png"))
    assert len(files) == 12
    # A checkerboard is searched for thoroughly, which takes a second an image.
    for file in files[::4] if spec.startswith("checkerboard") else files:
        image = gray(file)
        assert reason(TRANSFORMS[change](image) if change else image, parse_board(spec)).startswith(told), file.name


def test_photographs_of_checkerboards_for_an_aprilgrid(photos):
    """All thirteen photographs of a checkerboard say so when tags are looked for, with its size."""
    for file in sorted((photos / "opencv_left").glob("left*.jpg")):
        assert reason(gray(file), GRID).endswith("(checkerboard:9x6:SIDE)?"), file.name


@pytest.mark.parametrize(
    ("folder", "pattern", "tags"),
    [
        ("opencv_left", "left*.jpg", None),
        ("swat_calib", "*.JPG", None),
        ("udacity_wide", "GOPR*.jpg", None),
        ("kalibr", "*.jpg", None),
        ("caliscope_charuco_cam0", "*.jpg", None),
        ("fisheye_plane", "*.png", None),
        ("moms_left", "*.png", Print("tag36h10", 1)),
    ],
)
def test_photographs_have_no_fault_and_only_their_own_tags(photos, folder, pattern, tags):
    """No fault is found in photographs as they were taken, no tags where there are none, and the right ones where there are."""
    files = sorted((photos / folder).glob(pattern))
    assert files
    for file in files[::2]:
        image = gray(file)
        assert picture_fault(image) == "", file.name
        assert read_tags(image).printed == tags, file.name
