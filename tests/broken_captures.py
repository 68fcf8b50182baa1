"""Captures that are broken in one known way each: how each is made, and what must be said of it first.

Each is a function of a seed (and of a folder to write images in, and of the photographs, where it needs them) whose docstring
says what is wrong. `MADE` are corners from the forward model, `RENDERED` small images, `PHOTOGRAPHED` defects applied to
photographs; the `HARMLESS` ones look broken but are not, and of those `TOLD` something must be said, first or not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from capture_scenes import (
    BOARD,
    CAMERA,
    GRID,
    Equidistant,
    grid_of,
    ordinary_poses,
    placed_poses,
    see,
)

from camcal.boards.checkerboard import Checkerboard
from camcal.detection.grid import right_handed
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection
from camcal.synthesis.render import render_view
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor

COUNT = 16
WIDTH, HEIGHT = CAMERA.size


@dataclass(frozen=True)
class Capture:
    """What somebody hands over.

    Attributes
    ----------
    views : sequence of Detection
        Corners; empty if there are images.
    images : str
        Folder or pattern of images.
    board : str
        SPEC, as they believe it to be.
    options : dict
        Further arguments of `calibrate`.
    """

    views: Sequence[Detection] = ()
    images: str = ""
    board: str = BOARD.spec
    options: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """A broken capture and what must be said of it.

    Attributes
    ----------
    make : function
    codes : tuple of str
        The first finding has one of these codes (the first is the best; the others name the same cause less exactly).
    refused : str
        Or no camera comes out, and the error matches this pattern; empty if there must be one.
    words : tuple of str
        The word of the verdict is one of these.
    """

    make: Callable[..., Capture]
    codes: tuple[str, ...] = ()
    refused: str = ""
    words: tuple[str, ...] = ("rejected", "poor", "usable")


MADE: dict[str, Case] = {}
RENDERED: dict[str, Case] = {}
PHOTOGRAPHED: dict[str, Case] = {}
HARMLESS: dict[str, Case] = {}
HARMLESS_IMAGES: dict[str, Case] = {}
HARMLESS_PHOTOGRAPHS: dict[str, Case] = {}
TOLD: dict[str, Case] = {}

ANY_WORD = ("rejected", "poor", "usable", "good")
TRUSTED = ("usable", "good")


def case(suite: dict[str, Case], *codes: str, refused: str = "", words: tuple[str, ...] = Case.words) -> Callable[[Any], Any]:
    """Add a capture to a suite under its function's name."""

    def add(make: Callable[..., Capture]) -> Callable[..., Capture]:
        suite[make.__name__] = Case(make, codes, refused, words)
        return make

    return add


# Which corner is which


SWAPPED = "rows and columns are swapped"


@case(MADE, "rows_columns_swapped", refused=SWAPPED)
def rows_for_columns(seed: int) -> Capture:
    """Corners of a 6x9 board, numbered along its rows of 6, are given as those of a 9x6 board."""
    other = Checkerboard(6, 9, BOARD.square_m)
    return Capture(see(ordinary_poses(10, seed, board=other), seed, board=other))


@case(MADE, "rows_columns_swapped", refused=SWAPPED)
def rows_for_columns_of_an_aprilgrid(seed: int) -> Capture:
    """A corner file of a grid of 6x5 tags is solved as one of 5x6."""
    return Capture(see(ordinary_poses(8, seed, board=GRID), seed, board=GRID), board=replace(GRID, columns=5, rows=6).spec)


@case(MADE, "large_rms", refused=r"SPEC")
def squares_for_corners_in_a_corner_file(seed: int) -> Capture:
    """54 corners of a 9x6 board are numbered through, and the SPEC counts its 10x7 squares."""
    return Capture(see(ordinary_poses(10, seed), seed), board="checkerboard:10x7:25mm")


@case(MADE, refused="mirrored")
def numbered_from_the_wrong_side(seed: int) -> Capture:
    """All rows of all views are numbered from right to left: the board is seen from behind."""
    return Capture([renumbered(view, np.s_[:, ::-1]) for view in see(ordinary_poses(COUNT, seed), seed)])


def renumbered(view: Detection, order: Any) -> Detection:
    """The same corners in another order of rows and columns."""
    return replace(view, corners_px=grid_of(view)[order].reshape(-1, 2))


@case(MADE, "seen_from_behind", "bad_view")
def one_view_mirrored(seed: int) -> Capture:
    """The rows of a single view are numbered from right to left."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([*views[:4], renumbered(views[4], np.s_[:, ::-1]), *views[5:]])


@case(MADE, "bad_view")
def one_view_shifted(seed: int) -> Capture:
    """In one view the detector missed the first four corners, and every other has the id of the one before."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([*views[:6], shifted(views[6], 4), *views[7:]])


def shifted(view: Detection, by: int) -> Detection:
    """Every corner under the id of the one so many places before it."""
    return replace(view.take(view.ids >= by), ids=view.ids[:-by])


@case(MADE, "bad_view")
def one_view_of_another_board(seed: int) -> Capture:
    """One view shows a board of the same size whose rectangles are not square."""
    views = see(ordinary_poses(COUNT, seed), seed)
    other = BOARD.object_points * [1.0, 1.2, 1.0]
    return Capture([*views[:9], see(ordinary_poses(COUNT, seed), seed, points=other)[9], *views[10:]])


@case(MADE, "outliers")
def a_tenth_of_the_corners_wrong(seed: int) -> Capture:
    """One corner in ten lies 1 to 50 pixels from its place."""
    return Capture(with_gross_errors(see(ordinary_poses(COUNT, seed), seed), seed, share=0.1, low_px=1.0, high_px=50.0)[0])


def with_gross_errors(
    views: Sequence[Detection], seed: int, *, share: float, low_px: float, high_px: float
) -> tuple[list[Detection], set[tuple[str, int]]]:
    """Move a share of the corners in any direction, by distances spread evenly on a logarithmic scale; tell which."""
    rng = np.random.default_rng((seed, 99))
    starts = np.cumsum([0, *(len(view) for view in views)])
    chosen = rng.choice(starts[-1], max(1, round(share * starts[-1])), replace=False)
    moved, wrong = [], set()
    for view, start in zip(views, starts, strict=False):
        corners = view.corners_px.copy()
        for row in np.sort(chosen[(chosen >= start) & (chosen < start + len(view))] - start):
            angle, length = rng.uniform(0, 2 * np.pi), np.exp(rng.uniform(np.log(low_px), np.log(high_px)))
            offset = length * np.array([np.cos(angle), np.sin(angle)])
            inside = ((corners[row] + offset >= 0) & (corners[row] + offset <= np.array(view.size) - 1)).all()
            corners[row] = np.clip(corners[row] + (offset if inside else -offset), 0, np.array(view.size) - 1)
            wrong.add((view.source, int(view.ids[row])))
        moved.append(replace(view, corners_px=corners))
    return moved, wrong


# Where the boards were held


@case(MADE, "central_only")
def boards_in_the_middle_only(seed: int) -> Capture:
    """No board leaves the middle third of the image's width and height."""
    return Capture(see(placed_poses(COUNT, seed, x=(0.3, 0.7), y=(0.3, 0.7), distance_m=(0.5, 1.0)), seed))


@case(MADE, refused="Tilt the board")
def fronto_parallel(seed: int) -> Capture:
    """No board is tilted at all."""
    return Capture(see(placed_poses(COUNT, seed, tilt_deg=(0, 0)), seed))


@case(MADE, "fronto_parallel", refused="Tilt the board")
def hardly_tilted(seed: int) -> Capture:
    """Every board is within 4 degrees of fronto-parallel."""
    return Capture(see(placed_poses(COUNT, seed, tilt_deg=(0, 4)), seed))


@case(MADE, "one_orientation", refused="in different directions")
def all_tilted_alike(seed: int) -> Capture:
    """The board stands still, tilted by 30 degrees, while the camera slides: every view has the same orientation."""
    rng = np.random.default_rng((seed, 5))
    turn = Pose.from_rvec([np.radians(30), 0, 0], [0, 0, 0])
    centre = BOARD.object_points.mean(axis=0)
    shifts = rng.uniform([-0.1, -0.07, 0.32], [0.1, 0.07, 0.45], (COUNT, 3))
    return Capture(see([Pose(turn.R, shift - turn.R @ centre) for shift in shifts], seed))


@case(MADE, "uncovered")
def one_side_only(seed: int) -> Capture:
    """Every board is in the left half of the image."""
    return Capture(see(placed_poses(COUNT, seed, x=(0.0, 0.5), distance_m=(0.35, 0.6)), seed))


@case(MADE, "uncovered")
def never_at_the_bottom(seed: int) -> Capture:
    """No board reaches the lower 45 % of the image."""
    return Capture(see(placed_poses(COUNT, seed, y=(0.0, 0.55), distance_m=(0.3, 0.6)), seed))


@case(MADE, "small_boards", "uncertain")
def far_away_and_small(seed: int) -> Capture:
    """Boards of 60 pixels, two in each of twenty parts of the image."""
    parts = [((column / 5, (column + 1) / 5), (row / 4, (row + 1) / 4)) for row in range(4) for column in range(5)]
    placed = [placed_poses(2, seed + part, x=x, y=y, distance_m=(2.5, 3.5)) for part, (x, y) in enumerate(parts)]
    return Capture(see([pose for pair in placed for pose in pair], seed))


@case(MADE, "one_distance", words=ANY_WORD)
def one_distance(seed: int) -> Capture:
    """Every board is 0.40 m away, within 2 mm."""
    return Capture(see(placed_poses(2 * COUNT, seed, distance_m=(0.40, 0.402)), seed))


@case(MADE, refused="too few usable views .got 2")
def two_views(seed: int) -> Capture:
    """Two views."""
    return Capture(see(ordinary_poses(2, seed), seed))


@case(MADE, "few_views")
def three_views(seed: int) -> Capture:
    """Three views."""
    return Capture(see(ordinary_poses(3, seed), seed))


@case(MADE, "few_views")
def four_views(seed: int) -> Capture:
    """Four views."""
    return Capture(see(ordinary_poses(4, seed), seed))


@case(MADE, refused="the same view as")
def copies_of_two_views(seed: int) -> Capture:
    """Two views, each stored eight times under other names."""
    views = see(ordinary_poses(2, seed), seed)
    return Capture([replace(views[index % 2], source=f"copy_{index:02d}.png") for index in range(COUNT)])


@case(MADE, "repeated_views", refused="same|alike|repeat")
def one_view_again_and_again(seed: int) -> Capture:
    """Sixteen photographs of a board and a camera that stand still: nothing but the noise changes."""
    return Capture(see(ordinary_poses(1, seed) * COUNT, seed))


@case(MADE, "repeated_views", refused="same|alike|repeat")
def a_video_of_a_board_held_still(seed: int) -> Capture:
    """Thirty frames in which a hand trembles by half a millimetre and a tenth of a degree."""
    (pose,) = ordinary_poses(1, seed)
    rng = np.random.default_rng((seed, 5))
    tremble = [Pose.from_rvec(rng.normal(size=3) * 0.0017, rng.normal(size=3) * 0.0005) for _ in range(30)]
    return Capture(see([motion @ pose for motion in tremble], seed))


@case(MADE, "repeated_views", "few_views")
def three_views_again_and_again(seed: int) -> Capture:
    """Three places of the board, five photographs of each."""
    return Capture(see(ordinary_poses(3, seed) * 5, seed))


# Which camera took the pictures


def scaled(camera: Camera, factor: float, *, principal: tuple[float, float] | None = None) -> Camera:
    """The camera with another focal length, and maybe another principal point."""
    K = camera.K.copy()
    K[0, 0] *= factor
    K[1, 1] *= factor
    K[:2, 2] = K[:2, 2] if principal is None else principal
    return Camera(camera.size, K, camera.lens)


@case(MADE, "mixed_cameras")
def two_cameras_mixed(seed: int) -> Capture:
    """Every other view is from a camera of 6 % more focal length, whose principal point lies elsewhere."""
    other = scaled(CAMERA, 1.06, principal=(631.0, 489.0))
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: other if index % 2 else CAMERA))


@case(MADE, "mixed_cameras", "drift")
def two_cameras_one_after_the_other(seed: int) -> Capture:
    """The first half is from one camera, the second from another: in the order of the names."""
    other = scaled(CAMERA, 1.06, principal=(631.0, 489.0))
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: other if index >= COUNT // 2 else CAMERA))


@case(MADE, "drift", "mixed_cameras")
def refocused_midway(seed: int) -> Capture:
    """From the ninth view on the focal length is 1.5 % longer."""
    other = scaled(CAMERA, 1.015)
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: other if index >= COUNT // 2 else CAMERA))


@case(MADE, "drift")
def creeping_zoom(seed: int) -> Capture:
    """The focal length grows by 1.5 % in even steps from the first view to the last."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: scaled(CAMERA, 1 + 0.015 * index / (COUNT - 1))))


@case(MADE, "mixed_cameras")
def some_views_rescaled_and_padded(seed: int) -> Capture:
    """Every third image was reduced to 80 % and padded to the size of the others."""
    views = see(ordinary_poses(COUNT, seed), seed)
    smaller = [replace(view, corners_px=(view.corners_px + 0.5) * 0.8 - 0.5) for view in views]
    return Capture([smaller[index] if index % 3 == 0 else views[index] for index in range(COUNT)])


@case(MADE, "mixed_cameras")
def some_images_mirrored(seed: int) -> Capture:
    """Every third image is a mirror image: a checkerboard does not show it, but the principal point jumps by 40 px."""
    views = see(ordinary_poses(COUNT, seed, off_axis()), seed, off_axis())
    return Capture([mirrored(view) if index % 3 == 0 else view for index, view in enumerate(views)])


def off_axis() -> Camera:
    """A camera whose principal point lies 20 px right of the image's centre."""
    return scaled(CAMERA, 1.0, principal=(659.5, 471.9))


def mirrored(view: Detection) -> Detection:
    """What a finder makes of the mirror image: right-handed again."""
    flipped = replace(view, corners_px=[WIDTH - 1, 0] + view.corners_px * [-1, 1])
    return renumbered(flipped, np.s_[:, ::-1])


@case(MADE, refused="another image size")
def every_image_of_another_size(seed: int) -> Capture:
    """Eight views, two of each of four image sizes."""
    views = see(ordinary_poses(8, seed), seed)
    sizes = [(1280, 960), (1280, 961), (1280, 962), (1280, 963)]
    return Capture([replace(view, size=sizes[index // 2]) for index, view in enumerate(views)])


@case(MADE, "odd_aspect")
def pixels_far_from_square(seed: int) -> Capture:
    """An anamorphic camera whose pixels are twice as high as wide, without --anamorphic."""
    camera = Camera(CAMERA.size, [[1810, 0, 652.7], [0, 906.3, 471.9], [0, 0, 1]], CAMERA.lens)
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(MADE, "odd_aspect")
def stretched_images(seed: int) -> Capture:
    """Every image was made 1.5 times as wide."""
    views = see(ordinary_poses(COUNT, seed), seed)
    stretched = [(view.corners_px + 0.5) * [1.5, 1] - 0.5 for view in views]
    return Capture([replace(v, size=(1920, 960), corners_px=c) for v, c in zip(views, stretched, strict=True)])


@case(MADE, "off_centre", words=ANY_WORD)
def cropped_images(seed: int) -> Capture:
    """Two fifths of every image were cut off on the right."""
    camera = Camera((768, 960), CAMERA.K, CAMERA.lens)
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(MADE, "bad_view", "inconsistent", "structured_residuals", "mixed_cameras")
def some_views_sheared(seed: int) -> Capture:
    """The camera moved while a rolling shutter read every third image: it is sheared by 1 %."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([sheared(view, 0.01) if index % 3 == 0 else view for index, view in enumerate(views)])


def sheared(view: Detection, share: float) -> Detection:
    """Rows shifted in proportion to their distance from the middle one."""
    corners = view.corners_px + (view.corners_px[:, 1:] - HEIGHT / 2) * [share, 0]
    return replace(view, corners_px=np.clip(corners, 0, np.array(view.size) - 1))


@case(MADE, "inconsistent", "structured_residuals", "bad_view")
def every_view_sheared(seed: int) -> Capture:
    """A rolling shutter and a hand that never rests: each image is sheared by some tenths of a percent."""
    shares = 0.004 * np.random.default_rng((seed, 5)).normal(size=COUNT)
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([sheared(view, share) for view, share in zip(views, shares, strict=True)])


# What the lens does


WIDE = Camera(CAMERA.size, [[600, 0, 651], [0, 601, 489], [0, 0, 1]], [-0.24, 0.08, 0, 0, -0.0085])


@case(MADE, "fisheye", refused="fisheye")
def fisheye(seed: int) -> Capture:
    """An equidistant lens of 160 degrees, boards out to 80 degrees from the axis."""
    eye = Equidistant(CAMERA.size, 420.0, (640.0, 480.0))
    return Capture(see(placed_poses(12, seed, eye, distance_m=(0.12, 0.3)), seed, eye))


@case(MADE, "lens_too_simple")
def wide_lens_without_k2(seed: int) -> Capture:
    """A wide lens, and only k1 to describe it."""
    return Capture(see(ordinary_poses(COUNT, seed, WIDE), seed, WIDE), options={"distortion": "k1"})


@case(MADE, "lens_too_simple")
def no_distortion_at_all(seed: int) -> Capture:
    """An ordinary lens solved as a pinhole."""
    return Capture(see(ordinary_poses(COUNT, seed), seed), options={"distortion": "none"})


@case(MADE, "lens_too_simple")
def decentred_lens(seed: int) -> Capture:
    """Tangential distortion of .004 and -.003, and k1..k3 alone to describe the lens."""
    camera = Camera(CAMERA.size, CAMERA.K, [-0.21, 0.07, 0.004, -0.003, -0.011])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(MADE, "unsupported_coefficient", words=ANY_WORD)
def k3_of_a_long_lens(seed: int) -> Capture:
    """A lens of 30 degrees with hardly any distortion: nothing tells k3."""
    camera = Camera(CAMERA.size, [[3000, 0, 642], [0, 3001, 476], [0, 0, 1]], [-0.08])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(MADE, "unsupported_coefficient", refused="fewer coefficients", words=ANY_WORD)
def all_of_the_rational_model(seed: int) -> Capture:
    """k1 to k6 are free for a lens that k1 and k2 describe."""
    camera = Camera(CAMERA.size, CAMERA.K, [-0.21, 0.07])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera), options={"distortion": "k1,k2,k3,k4,k5,k6"})


# What the board is


def bowed(height_m: float, along: int = 0) -> np.ndarray:
    """Features of the board with a parabola of a given height in the middle, along x (0) or y (1)."""
    points = np.array(BOARD.object_points)
    share = points[:, along] / points[:, along].max()
    points[:, 2] += height_m * 4 * share * (1 - share)
    return points


@case(MADE, "bent_board")
def bent_board(seed: int) -> Capture:
    """A sheet that stands 1 mm off the table in its middle, over 20 cm."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=bowed(0.001)))


@case(MADE, "bent_board")
def slightly_bent_board(seed: int) -> Capture:
    """Half a millimetre, the other way round and along the short side."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=bowed(-0.0005, along=1)))


@case(MADE, "bent_board")
def curled_paper(seed: int) -> Capture:
    """Loose paper that stands up by 4 mm."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=bowed(0.004)))


@case(MADE, "structured_residuals", "inconsistent", "bent_board")
def twisted_board(seed: int) -> Capture:
    """A board whose corners stand 1 mm up and down in turn."""
    u, v = (BOARD.object_points[:, :2] / BOARD.object_points[:, :2].max(axis=0)).T
    twist = np.stack([0 * u, 0 * u, 0.001 * (2 * u - 1) * (2 * v - 1)], axis=1)
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=BOARD.object_points + twist))


@case(MADE, "stretched_print")
def stretched_print(seed: int) -> Capture:
    """A printer that stretches the paper by 0.5 % as it pulls it through."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, points=BOARD.object_points * [1, 1.005, 1]))


@case(MADE, "wrong_spacing")
def wrong_spacing(seed: int) -> Capture:
    """An AprilGrid whose gaps are .25 of a tag is given as one of .3."""
    printed = replace(GRID, gap_m=0.0075)
    return Capture(see(ordinary_poses(COUNT, seed, board=printed), seed, board=printed), board=GRID.spec)


@case(MADE, "wrong_spacing", "structured_residuals")
def slightly_wrong_spacing(seed: int) -> Capture:
    """The gaps were measured as 9 mm and are 9.2 mm."""
    printed = replace(GRID, gap_m=0.0092)
    return Capture(see(ordinary_poses(COUNT, seed, board=printed), seed, board=printed), board=GRID.spec)


@case(MADE, "wrong_spacing", "structured_residuals")
def two_grids_mixed(seed: int) -> Capture:
    """Every other view shows another AprilGrid, with gaps of .4 of a tag instead of .3."""
    other = replace(GRID, gap_m=0.012)
    first, second = (see(ordinary_poses(COUNT, seed, board=board), seed, board=board) for board in (GRID, other))
    return Capture([(first, second)[index % 2][index] for index in range(COUNT)], board=GRID.spec)


# How well the corners were found


@case(MADE, "coarse_corners")
def whole_pixels(seed: int) -> Capture:
    """Somebody rounded the corners to whole pixels."""
    views = see(ordinary_poses(10, seed), seed)
    return Capture([replace(view, corners_px=np.rint(view.corners_px)) for view in views])


@case(MADE, "uncertain", "unsupported_coefficient")
def corners_by_hand(seed: int) -> Capture:
    """Corners clicked with a mouse: a pixel of noise."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, noise_px=1.0))


# Images


SMALL = Camera((640, 480), [[452, 0, 326.3], [0, 453, 236], [0, 0, 1]], [-0.2, 0.06])
BOARDS = {"checkerboard": BOARD, "aprilgrid": GRID}
SHOTS = 12


@lru_cache(maxsize=8)
def shots(
    board: str, seed: int, *, white: float = 0.86, count: int = SHOTS, tilt_deg: tuple[float, float] = (5.0, 45.0)
) -> tuple[np.ndarray, ...]:
    """Small images of a board, rendered."""
    sampling = PoseSampling(count, tilt_deg, (-30.0, 30.0), (0.5, 0.8))
    scenario = Scenario(board, seed, SMALL, BOARDS[board], sampling, Light(white=white), Sensor())
    return tuple(render_view(scenario, index).image for index in range(count))


def stored(images: Sequence[np.ndarray], folder: Path) -> str:
    """Write images as view_00.png and so on."""
    for index, image in enumerate(images):
        cv2.imwrite(str(folder / f"view_{index:02d}.png"), image)
    return str(folder / "*.png")


def shaken(image: np.ndarray, length_px: int, *, down: bool = False) -> np.ndarray:
    """The image blurred by a straight motion."""
    kernel = np.full((length_px, 1) if down else (1, length_px), 1 / length_px)
    return cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REPLICATE)


@case(RENDERED, refused="fit an AprilGrid of 6x5")
def transposed_aprilgrid(seed: int, folder: Path) -> Capture:
    """A grid of 6x5 tags is given as one of 5x6."""
    return Capture(images=stored(shots("aprilgrid", seed)[:4], folder), board=replace(GRID, columns=5, rows=6).spec)


@case(RENDERED, refused="mirror")
def mirrored_aprilgrid(seed: int, folder: Path) -> Capture:
    """Every image is a mirror image, as selfie cameras store them."""
    return Capture(images=stored([image[:, ::-1] for image in shots("aprilgrid", seed)[:4]], folder), board=GRID.spec)


@case(RENDERED, refused="tags of tag36h11 were seen, tag36h10 was asked for")
def wrong_family(seed: int, folder: Path) -> Capture:
    """Tags of tag36h11 are given as tag36h10."""
    return Capture(images=stored(shots("aprilgrid", seed)[:4], folder), board=replace(GRID, family="tag36h10").spec)


@case(RENDERED, refused="were squares counted instead of inner corners")
def squares_for_corners(seed: int, folder: Path) -> Capture:
    """The SPEC counts the board's 10x7 squares."""
    return Capture(images=stored(shots("checkerboard", seed)[:4], folder), board="checkerboard:10x7:25mm")


@case(RENDERED, refused="5x4 inner corners was seen|9x6 inner corners was seen|another kind of board|no tag36h11 tags")
def another_kind_of_board(seed: int, folder: Path) -> Capture:
    """A checkerboard is given as an AprilGrid."""
    return Capture(images=stored(shots("checkerboard", seed)[:4], folder), board=GRID.spec)


@case(RENDERED, "blurred_views", words=ANY_WORD)
def some_views_shaken(seed: int, folder: Path) -> Capture:
    """A third of the images are blurred by a motion of 9 pixels."""
    images = shots("checkerboard", seed)
    return Capture(images=stored([shaken(image, 9) if i % 3 == 0 else image for i, image in enumerate(images)], folder))


@case(RENDERED, "blurred_views", words=ANY_WORD)
def every_view_shaken(seed: int, folder: Path) -> Capture:
    """Every image is blurred by a motion of 9 pixels, across or down."""
    images = shots("checkerboard", seed)
    return Capture(images=stored([shaken(image, 9, down=i % 2 == 0) for i, image in enumerate(images)], folder))


@case(RENDERED, "inconsistent", "structured_residuals", "outliers")
def corners_biased_by_the_finder(seed: int, folder: Path) -> Capture:  # noqa: ARG001
    """Corners of tilted boards as cv2.findChessboardCornersSB leaves them, off by a tenth of a pixel."""
    views = []
    for index, image in enumerate(shots("checkerboard", seed, count=COUNT, tilt_deg=(30.0, 50.0))):
        found, corners = cv2.findChessboardCornersSB(image, (9, 6))
        if found:
            grid = right_handed(np.asarray(corners, dtype=np.float64).reshape(6, 9, 2))
            views.append(Detection(f"{index:02d}.png", SMALL.size, np.arange(54), grid.reshape(-1, 2), np.full(54, np.nan)))
    return Capture(views, options={"distortion": "k1,k2"})


# Photographs


LEFT, LEFT_BOARD = "opencv_left", "checkerboard:9x6:25mm"
MOMS = "aprilgrid:5x4:20mm:0.25:family=tag36h10:first=top-left"


def lefts(photos: Path) -> list[np.ndarray]:
    """The thirteen photographs of opencv_left, gray."""
    return [cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted((photos / LEFT).glob("left*.jpg"))]


@case(PHOTOGRAPHED, refused="the same view as")
def copied_photographs(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Two photographs, each four times under other names."""
    return Capture(images=stored(lefts(photos)[:2] * 4, folder), board=LEFT_BOARD)


@case(PHOTOGRAPHED, "mixed_cameras")
def some_photographs_mirrored(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every other photograph is a mirror image: the principal point jumps by 45 px."""
    images = [image[:, ::-1] if index % 2 else image for index, image in enumerate(lefts(photos))]
    return Capture(images=stored(images, folder), board=LEFT_BOARD)


@case(PHOTOGRAPHED, "mixed_cameras")
def some_photographs_upside_down(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every other photograph was turned by 180 degrees."""
    images = [image[::-1, ::-1] if index % 2 else image for index, image in enumerate(lefts(photos))]
    return Capture(images=stored(images, folder), board=LEFT_BOARD)


@case(PHOTOGRAPHED, "odd_aspect")
def photographs_of_twice_the_width(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every photograph was made twice as wide."""
    images = [cv2.resize(image, (1280, 480), interpolation=cv2.INTER_CUBIC) for image in lefts(photos)]
    return Capture(images=stored(images, folder), board=LEFT_BOARD)


@case(PHOTOGRAPHED, "lens_too_simple")
def udacity_with_k1_alone(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """A wide lens and no k2."""
    images = str(photos / "udacity_wide/GOPR00[3-4]*.jpg")
    return Capture(images=images, board="checkerboard:8x6:1m", options={"refine": "saddle", "distortion": "k1"})


@case(PHOTOGRAPHED, "wrong_spacing")
def moms_with_wrong_spacing(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Gaps of .25 of a tag are given as .3."""
    board = "aprilgrid:5x4:20mm:0.3:family=tag36h10:first=top-left"
    return Capture(images=str(photos / "moms_left"), board=board, options={"refine": "saddle"})


@case(PHOTOGRAPHED, refused="tags of tag36h10 were seen, tag36h11 was asked for")
def moms_of_another_family(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Kalibr's family, which is the default."""
    return Capture(images=str(photos / "moms_left"), board="aprilgrid:5x4:20mm:0.25:first=top-left")


@case(PHOTOGRAPHED, refused="fit an AprilGrid of 5x4")
def moms_transposed(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Columns given as rows."""
    board = "aprilgrid:4x5:20mm:0.25:family=tag36h10:first=top-left"
    return Capture(images=str(photos / "moms_left"), board=board)


@case(PHOTOGRAPHED, refused="first tag at the top-left")
def moms_counted_from_below(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """The wrong end for tag 0, which is the default."""
    return Capture(images=str(photos / "moms_left"), board="aprilgrid:5x4:20mm:0.25:family=tag36h10")


@case(PHOTOGRAPHED, "fisheye", refused="fisheye")
def fisheye_plane(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Eight photographs through a lens of 180 degrees, with their reference corners."""
    board = Checkerboard(22, 22, 0.04)
    return Capture([orpc(path, board) for path in sorted((photos / "fisheye_plane").glob("*.orpc"))], board=board.spec)


def orpc(path: Path, board: Checkerboard) -> Detection:
    """Read a file of reference corners: lines of board, id, flag, x, y."""
    rows = np.array([line.split(",") for line in path.read_text().splitlines()[5:]], dtype=np.float64)
    rows = rows[np.argsort(rows[:, 1])]
    ids = rows[:, 1].astype(np.int64)
    assert ids.max() < board.feature_count
    return Detection(path.stem, (1280, 800), ids, rows[:, 3:5], np.full(ids.size, np.nan))


# What looks broken and is not


@case(HARMLESS, words=TRUSTED)
def half_turns(seed: int) -> Capture:
    """Every other view is numbered from the opposite corner: the same board, held upside down."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([renumbered(view, np.s_[::-1, ::-1]) if index % 2 else view for index, view in enumerate(views)])


@case(HARMLESS, words=TRUSTED)
def two_sizes_of_squares(seed: int) -> Capture:
    """Every other view shows a board with squares of 30 mm instead of 25: farther away, but the same camera."""
    large = BOARD.object_points * 1.2
    first, second = (see(ordinary_poses(COUNT, seed), seed, points=points) for points in (None, large))
    return Capture([(first, second)[index % 2][index] for index in range(COUNT)])


@case(HARMLESS, words=TRUSTED)
def a_hundredth_of_the_corners_wrong(seed: int) -> Capture:
    """One corner in a hundred lies half a pixel to 100 pixels from its place."""
    return Capture(with_gross_errors(see(ordinary_poses(COUNT, seed), seed), seed, share=0.01, low_px=0.5, high_px=100)[0])


@case(HARMLESS, words=TRUSTED)
def a_few_noisier_views(seed: int) -> Capture:
    """Three views have four times the noise of the others."""
    poses = ordinary_poses(COUNT, seed)
    return Capture([*see(poses, seed)[:-3], *see(poses, seed, noise_px=0.2)[-3:]])


@case(HARMLESS, words=TRUSTED)
def one_copy(seed: int) -> Capture:
    """One view is there twice."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([*views, replace(views[3], source="copy.png")])


@case(HARMLESS, words=TRUSTED)
def announced_anamorphic(seed: int) -> Capture:
    """Pixels twice as high as wide, with --anamorphic."""
    return replace(pixels_far_from_square(seed), options={"anamorphic": True})


@case(HARMLESS, words=TRUSTED)
def decentred_lens_with_p1_p2(seed: int) -> Capture:
    """A decentred lens, and the coefficients to describe it."""
    return replace(decentred_lens(seed), options={"distortion": "k1,k2,p1,p2,k3"})


@case(HARMLESS, words=TRUSTED)
def a_lens_of_two_coefficients(seed: int) -> Capture:
    """k1 and k2 for a lens that they describe."""
    camera = Camera(CAMERA.size, CAMERA.K, [-0.21, 0.07])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera), options={"distortion": "k1,k2"})


@case(HARMLESS, words=TRUSTED)
def a_wide_lens(seed: int) -> Capture:
    """A lens of 113 degrees with k1..k3."""
    return Capture(see(ordinary_poses(20, seed, WIDE), seed, WIDE))


@case(HARMLESS, words=TRUSTED)
def an_aprilgrid_seen_in_parts(seed: int) -> Capture:
    """A grid so near that parts of it leave the frame in every view."""
    poses = ordinary_poses(COUNT, seed, board=GRID, partial=True, fill=(0.8, 1.4), tilt_deg=(0.0, 45.0))
    return Capture(see(poses, seed, board=GRID), board=GRID.spec)


@case(HARMLESS, words=TRUSTED)
def eight_careful_views(seed: int) -> Capture:
    """Few views, but well chosen."""
    return Capture(see(ordinary_poses(8, seed), seed))


@case(HARMLESS_IMAGES, words=TRUSTED)
def other_border(seed: int, folder: Path) -> Capture:
    """Tags with a 2-bit border are given as tags with the official 1-bit one: they are found all the same, with a note."""
    return Capture(images=stored(shots("aprilgrid", seed), folder), board=replace(GRID, border_bits=1).spec)


@case(HARMLESS_IMAGES, words=TRUSTED)
def saturated(seed: int, folder: Path) -> Capture:
    """A third of the images are so bright that the paper is at the end of the scale."""
    usual, bright = shots("checkerboard", seed), shots("checkerboard", seed, white=1.25)
    return Capture(images=stored([(bright if i % 3 == 0 else usual)[i] for i in range(SHOTS)], folder))


@case(HARMLESS_IMAGES, words=TRUSTED)
def dim(seed: int, folder: Path) -> Capture:
    """Every image is so dark that white paper is at 45 of 255 levels."""
    images = [np.rint(image * 0.2).astype(np.uint8) for image in shots("checkerboard", seed)]
    return Capture(images=stored(images, folder))


@case(HARMLESS_PHOTOGRAPHS, words=TRUSTED)
def plain_left(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """OpenCV's own sample."""
    return Capture(images=str(photos / LEFT), board=LEFT_BOARD)


@case(HARMLESS_PHOTOGRAPHS, words=TRUSTED)
def plain_udacity(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """A wide action camera; one board is cut by the frame."""
    return Capture(images=str(photos / "udacity_wide/GOPR*.jpg"), board="checkerboard:8x6:1m")


@case(HARMLESS_PHOTOGRAPHS, words=TRUSTED)
def turned_photographs(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """Every photograph was turned by 90 degrees: another camera, as good."""
    return Capture(images=stored([np.rot90(image) for image in lefts(photos)], folder), board=LEFT_BOARD)


# What must be told, whatever else is said first


@case(TOLD, "unsupported_coefficient", words=TRUSTED)
def swat_with_k3(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """A phone's lens and boards that leave the image's corners empty: k3 comes out as -11, or as anything else."""
    return Capture(images=str(photos / "swat_calib"), board="checkerboard:7x5:30mm")


@case(TOLD, "off_centre", words=TRUSTED)
def cropped_photographs(seed: int, folder: Path, photos: Path) -> Capture:  # noqa: ARG001
    """150 pixels were cut off on the left of every photograph."""
    return Capture(images=stored([image[:, 150:] for image in lefts(photos)], folder), board=LEFT_BOARD)
