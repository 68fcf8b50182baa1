"""Captures from several cameras, one that changes, one that is not as it is said to be, or a lens that has another model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from broken_captures import ANY_WORD, COUNT, WIDE, Capture, Case, case, renumbered
from capture_scenes import CAMERA, Equidistant, ordinary_poses, placed_poses, see

from camcal.geometry.camera import Camera
from camcal.observations import Detection

WIDTH, HEIGHT = CAMERA.size
CASES: dict[str, Case] = {}


def scaled(camera: Camera, factor: float, *, principal: tuple[float, float] | None = None) -> Camera:
    """The camera with another focal length, and maybe another principal point."""
    K = camera.K.copy()
    K[0, 0] *= factor
    K[1, 1] *= factor
    K[:2, 2] = K[:2, 2] if principal is None else principal
    return Camera(camera.size, K, camera.lens)


@case(CASES, "mixed_cameras")
def two_cameras_mixed(seed: int) -> Capture:
    """Every other view is from a camera of 6 % more focal length, whose principal point lies elsewhere."""
    other = scaled(CAMERA, 1.06, principal=(631.0, 489.0))
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: other if index % 2 else CAMERA))


@case(CASES, "mixed_cameras", "drift")
def two_cameras_one_after_the_other(seed: int) -> Capture:
    """The first half is from one camera, the second from another: in the order of the names."""
    other = scaled(CAMERA, 1.06, principal=(631.0, 489.0))
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: other if index >= COUNT // 2 else CAMERA))


@case(CASES, "drift", "mixed_cameras")
def refocused_midway(seed: int) -> Capture:
    """From the ninth view on the focal length is 1.5 % longer."""
    other = scaled(CAMERA, 1.015)
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: other if index >= COUNT // 2 else CAMERA))


@case(CASES, "drift")
def creeping_zoom(seed: int) -> Capture:
    """The focal length grows by 1.5 % in even steps from the first view to the last."""
    return Capture(see(ordinary_poses(COUNT, seed), seed, lambda index: scaled(CAMERA, 1 + 0.015 * index / (COUNT - 1))))


@case(CASES, "mixed_cameras")
def some_views_rescaled_and_padded(seed: int) -> Capture:
    """Every third image was reduced to 80 % and padded to the size of the others."""
    views = see(ordinary_poses(COUNT, seed), seed)
    smaller = [replace(view, corners_px=(view.corners_px + 0.5) * 0.8 - 0.5) for view in views]
    return Capture([smaller[index] if index % 3 == 0 else views[index] for index in range(COUNT)])


@case(CASES, "mixed_cameras")
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


@case(CASES, refused="another image size")
def every_image_of_another_size(seed: int) -> Capture:
    """Eight views, two of each of four image sizes."""
    views = see(ordinary_poses(8, seed), seed)
    sizes = [(1280, 960), (1280, 961), (1280, 962), (1280, 963)]
    return Capture([replace(view, size=sizes[index // 2]) for index, view in enumerate(views)])


@case(CASES, "odd_aspect")
def pixels_far_from_square(seed: int) -> Capture:
    """An anamorphic camera whose pixels are twice as high as wide, without --anamorphic."""
    camera = Camera(CAMERA.size, [[1810, 0, 652.7], [0, 906.3, 471.9], [0, 0, 1]], CAMERA.lens)
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(CASES, "odd_aspect")
def stretched_images(seed: int) -> Capture:
    """Every image was made 1.5 times as wide."""
    views = see(ordinary_poses(COUNT, seed), seed)
    stretched = [(view.corners_px + 0.5) * [1.5, 1] - 0.5 for view in views]
    return Capture([replace(v, size=(1920, 960), corners_px=c) for v, c in zip(views, stretched, strict=True)])


@case(CASES, "off_centre", words=ANY_WORD)
def cropped_images(seed: int) -> Capture:
    """Two fifths of every image were cut off on the right."""
    camera = Camera((768, 960), CAMERA.K, CAMERA.lens)
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(CASES, "bad_view", "inconsistent", "structured_residuals", "mixed_cameras")
def some_views_sheared(seed: int) -> Capture:
    """The camera moved while a rolling shutter read every third image: it is sheared by 1 %."""
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([sheared(view, 0.01) if index % 3 == 0 else view for index, view in enumerate(views)])


def sheared(view: Detection, share: float) -> Detection:
    """Rows shifted in proportion to their distance from the middle one."""
    corners = view.corners_px + (view.corners_px[:, 1:] - HEIGHT / 2) * [share, 0]
    return replace(view, corners_px=np.clip(corners, 0, np.array(view.size) - 1))


@case(CASES, "inconsistent", "structured_residuals", "bad_view")
def every_view_sheared(seed: int) -> Capture:
    """A rolling shutter and a hand that never rests: each image is sheared by some tenths of a percent."""
    shares = 0.004 * np.random.default_rng((seed, 5)).normal(size=COUNT)
    views = see(ordinary_poses(COUNT, seed), seed)
    return Capture([sheared(view, share) for view, share in zip(views, shares, strict=True)])


@case(CASES, "fisheye", refused="fisheye")
def fisheye(seed: int) -> Capture:
    """An equidistant lens of 160 degrees, boards out to 80 degrees from the axis."""
    eye = Equidistant(CAMERA.size, 420.0, (640.0, 480.0))
    return Capture(see(placed_poses(12, seed, eye, distance_m=(0.12, 0.3)), seed, eye))


@case(CASES, "lens_too_simple")
def wide_lens_without_k2(seed: int) -> Capture:
    """A wide lens, and only k1 to describe it."""
    return Capture(see(ordinary_poses(COUNT, seed, WIDE), seed, WIDE), options={"distortion": "k1"})


@case(CASES, "lens_too_simple")
def no_distortion_at_all(seed: int) -> Capture:
    """An ordinary lens solved as a pinhole."""
    return Capture(see(ordinary_poses(COUNT, seed), seed), options={"distortion": "none"})


@case(CASES, "lens_too_simple")
def decentred_lens(seed: int) -> Capture:
    """Tangential distortion of .004 and -.003, and k1..k3 alone to describe the lens."""
    camera = Camera(CAMERA.size, CAMERA.K, [-0.21, 0.07, 0.004, -0.003, -0.011])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(CASES, "unsupported_coefficient", words=ANY_WORD)
def k3_of_a_long_lens(seed: int) -> Capture:
    """A lens of 30 degrees with hardly any distortion: nothing tells k3."""
    camera = Camera(CAMERA.size, [[3000, 0, 642], [0, 3001, 476], [0, 0, 1]], [-0.08])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera))


@case(CASES, "unsupported_coefficient", refused="fewer coefficients", words=ANY_WORD)
def all_of_the_rational_model(seed: int) -> Capture:
    """k1 to k6 are free for a lens that k1 and k2 describe."""
    camera = Camera(CAMERA.size, CAMERA.K, [-0.21, 0.07])
    return Capture(see(ordinary_poses(COUNT, seed, camera), seed, camera), options={"distortion": "k1,k2,k3,k4,k5,k6"})
