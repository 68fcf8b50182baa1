"""Rendered light against exact polygon clipping, closed forms and sub-sampling worked out independently."""

from __future__ import annotations

from math import erf

import cv2
import numpy as np
import pytest

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light

# Contrast 180 levels.
LIGHT = Light(white=0.86, black=0.86 - 180 / 255, background=0.35)
BARREL = [-0.33, 0.12, 0, 0, -0.014]
BOARD = Checkerboard(9, 6, 0.025)
TAGS = AprilGrid(2, 2, 0.06, 0.018)
FINE = Checkerboard(24, 18, 0.01)


def standing(board, rvec, centre_m) -> Pose:
    """Pose of a board turned by `rvec` whose features are centred at a point of the camera frame."""
    R = Pose.from_rvec(rvec, np.zeros(3)).R
    return Pose(R, np.asarray(centre_m) - R @ board.object_points.mean(axis=0))


def small_camera(dist=(), focal=70.0) -> Camera:
    """A camera of 120 x 90 pixels with fx != fy and an off-centre principal point."""
    return Camera((120, 90), [[focal, 0, 61.3], [0, 1.01 * focal, 43.2], [0, 0, 1]], dist)


def clip(polygon, axis, limit, sign):
    """Sutherland-Hodgman: the part of a polygon (N, 2) on one side of an axis-parallel line."""
    if len(polygon) == 0:
        return polygon
    depth = sign * (polygon[:, axis] - limit)
    following, depth_next = np.roll(polygon, -1, axis=0), np.roll(depth, -1)
    inside, crosses = depth >= 0, (depth >= 0) != (depth_next >= 0)
    share = depth / np.where(crosses, depth - depth_next, 1)
    cut = polygon + share[:, None] * (following - polygon)
    both = np.stack([polygon, cut], axis=1)
    return both.reshape(-1, 2)[np.stack([inside, crosses], axis=1).ravel()]


def area(polygon) -> float:
    """Signed area of a polygon (N, 2): the shoelace formula."""
    if len(polygon) < 3:
        return 0.0
    x, y = (polygon - polygon.mean(axis=0)).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def outline(camera, pose, xy_m):
    """Project points (N, 2) of a board by OpenCV."""
    points = np.concatenate([xy_m, np.zeros((len(xy_m), 1))], axis=1)
    return cv2.projectPoints(points, pose.rvec, pose.t, camera.K, camera.dist)[0].reshape(-1, 2)


def clipped_image(camera, board, pose, samples=40):
    """Exact area coverage: every cell's outline, clipped to every pixel it may touch."""
    pattern = board.pattern
    width, height = camera.size
    image = np.full((height, width), LIGHT.background)
    t = np.linspace(0, 1, samples, endpoint=False)[:, None]
    for row, column in np.ndindex(pattern.ink.shape):
        (x0, x1), (y0, y1) = pattern.x_edges_m[column : column + 2], pattern.y_edges_m[row : row + 2]
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        cell = outline(
            camera, pose, np.concatenate([a + t * (b - a) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)])
        )
        value = LIGHT.white + pattern.ink[row, column] * (LIGHT.black - LIGHT.white)
        low = np.clip(np.floor(cell.min(axis=0) + 0.5), 0, camera.size).astype(int)
        high = np.clip(np.ceil(cell.max(axis=0) + 0.5), 0, camera.size).astype(int)
        for v in range(low[1], high[1]):
            strip = clip(clip(cell, 1, v - 0.5, 1), 1, v + 0.5, -1)
            for u in range(low[0], high[0]):
                covered = area(clip(clip(strip, 0, u - 0.5, 1), 0, u + 0.5, -1))
                image[v, u] += covered * (value - LIGHT.background)
    return image


def rms_levels(a, b) -> float:
    """RMS difference in 8-bit levels."""
    return 255 * float(np.sqrt(np.mean((a - b) ** 2)))


@pytest.mark.parametrize(
    ("camera", "board", "pose"),
    [
        pytest.param(small_camera(), BOARD, standing(BOARD, [0.2, -0.3, 0.15], [0.01, 0, 0.22]), id="general position"),
        pytest.param(small_camera(), BOARD, standing(BOARD, [0.1, np.radians(60), 0.05], [0, 0, 0.2]), id="60 degrees"),
        pytest.param(small_camera(BARREL, 62), BOARD, standing(BOARD, [0.3, -0.2, 0.4], [0.02, 0.01, 0.13]), id="barrel"),
        pytest.param(small_camera(), FINE, standing(FINE, [0.2, 0.3, 0.3], [0.02, 0.01, 0.9]), id="cells under 1 px"),
        pytest.param(small_camera(BARREL, 62), TAGS, standing(TAGS, [0.3, 0.2, -0.2], [0, 0, 0.13]), id="tags"),
        pytest.param(small_camera(), BOARD, standing(BOARD, [0, 0, 0], [0.0123, 0.0045, 0.2]), id="parallel to the pixels"),
        pytest.param(
            small_camera([-0.2, 0.05, 0.01, -0.008, 0.01, 0.1, 0.02, 0.01]),
            BOARD,
            standing(BOARD, [-0.3, 0.3, 2.5], [0.09, -0.06, 0.2]),
            id="every coefficient, partly outside",
        ),
    ],
)
def test_the_light_of_every_pixel_is_the_exact_area_average(camera, board, pose):
    """RMS to polygon clipping of OpenCV's projection stays within 0.05 of 180 levels, on images that are all edges."""
    rendered = render_ideal(camera, board, pose, LIGHT)
    exact = clipped_image(camera, board, pose)
    assert rms_levels(rendered, exact) <= 0.05
    assert 255 * np.abs(rendered - exact).max() <= 0.5


def test_a_far_board_shows_no_moire():
    """Where cells are a third of a pixel, every inner pixel is the mean of black and white within a few cells' worth."""
    board = Checkerboard(99, 74, 0.01)
    camera = small_camera(focal=100.0)
    image = render_ideal(camera, board, standing(board, [0, 0, 0.35], [0, 0, 3.0]), LIGHT)
    inner = 255 * image[35:52, 50:72]
    # A pixel holds 9 cells. Its sides cut some 12 of them at random, each by at most half a cell's contrast: a standard
    # deviation of sqrt(12) / sqrt(12) / 2 cells of 180 levels. Whatever is coherent between pixels would be moire.
    assert np.abs(inner - 255 * (LIGHT.white + LIGHT.black) / 2).max() < 4 * 180 / 2 / 9
    blocks = inner[:16, :20].reshape(4, 4, 4, 5).mean(axis=(1, 3))
    assert blocks.std() < 180 / 2 / 9 / np.sqrt(20) * 2


def test_skew_shears_the_image():
    """With skew the rendered edge runs where the projection puts it: its light is found left and right of that."""
    camera = Camera((120, 90), [[70, 20, 61.3], [0, 71, 43.2], [0, 0, 1]])
    pose = standing(BOARD, [0, 0, 0], [0, 0, 0.2])
    image = render_ideal(camera, BOARD, pose, LIGHT)
    left = camera.project(pose.apply([[BOARD.pattern.x_edges_m[0], y, 0] for y in (0.0, 0.1)]))
    for u, v in left:
        slope = 20 / 71
        row = round(v)
        edge = u + (row - v) * slope
        covered = (image[row, : int(edge) + 4] - LIGHT.background).sum() / (LIGHT.white - LIGHT.background)
        assert covered == pytest.approx(int(edge) + 3.5 - edge, abs=1e-6)


def test_a_part_of_the_image_is_rendered_as_the_whole():
    """A window rendered on its own equals the same pixels of the whole image: what is outside counts exactly."""
    camera = Camera((300, 200), [[300, 0, 140], [0, 305, 90], [0, 0, 1]], BARREL)
    pose = standing(BOARD, [0.3, -0.4, 0.5], [0.0, 0.0, 0.3])
    part = Camera((90, 70), [[300, 0, 140 - 97], [0, 305, 90 - 55], [0, 0, 1]], BARREL)
    for blur in (0.0, 0.7, 2.0):
        whole = render_ideal(camera, BOARD, pose, LIGHT, blur_sigma_px=blur)[55:125, 97:187]
        # Edges that leave the window may be cut into other chords; each stands off its curve by up to 1e-4 px.
        np.testing.assert_allclose(render_ideal(part, BOARD, pose, LIGHT, blur_sigma_px=blur), whole, atol=2e-4)


def step_of_width(distance, sigma):
    """Gaussian-blurred step at signed distances from a straight edge."""
    return 0.5 * (1 + np.vectorize(erf)(distance / (sigma * np.sqrt(2))))


def disc_step(distance, radius):
    """Disc-blurred step: the share of a disc beyond a chord."""
    t = np.clip(distance / radius, -1, 1)
    return 0.5 + (t * np.sqrt(1 - t * t) + np.arcsin(t)) / np.pi


def averaged_step(shape, point, normal, step, samples=48):
    """Pixel averages of a blurred step by midpoint sampling."""
    offset = (np.arange(samples) + 0.5) / samples - 0.5
    v = (np.arange(shape[0])[:, None] + offset).ravel()[:, None]
    u = (np.arange(shape[1])[:, None] + offset).ravel()
    value = step((u - point[0]) * normal[0] + (v - point[1]) * normal[1])
    return value.reshape(shape[0], samples, shape[1], samples).mean(axis=(1, 3))


def edge_image(turn_rad, **blur):
    """A small image of one long straight edge of paper (white right of it), with a point of the edge and its normal."""
    board = Checkerboard(3, 3, 0.5)
    camera = Camera((40, 24), [[100, 0, 18.37], [0, 100, 11.21], [0, 0, 1]])
    R = Pose.from_rvec([0, 0, turn_rad], np.zeros(3)).R
    left, top, _, bottom = board.pattern.extent_m
    pose = Pose(R, [0, 0, 1.0] - R @ [left, (top + bottom) / 2, 0])
    image = render_ideal(camera, board, pose, LIGHT, **blur)
    share = (image - LIGHT.background) / (LIGHT.white - LIGHT.background)
    return share, (18.37, 11.21), (np.cos(turn_rad), np.sin(turn_rad))


@pytest.mark.parametrize("turn_deg", [0.0, 7.0, 213.0])
@pytest.mark.parametrize("sigma", [0.05, 0.3, 0.4, 0.7, 1.4, 2.0])
def test_gaussian_blur_is_that_of_the_continuous_image(sigma, turn_deg):
    """A blurred edge equals the error function averaged over the pixels, at every width and direction."""
    image, point, normal = edge_image(np.radians(turn_deg), blur_sigma_px=sigma)
    exact = averaged_step(image.shape, point, normal, lambda d: step_of_width(d, sigma))
    # Midpoint sampling is off by at most 1 / (48² 24) of the second derivative, 0.24 / sigma², at the narrowest .05: 0.002.
    assert 180 * np.sqrt(np.mean((image - exact) ** 2)) <= 0.05


@pytest.mark.parametrize("turn_deg", [0.0, 33.0])
@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0, 3.3, 6.0])
def test_defocus_is_a_uniform_disc(radius, turn_deg):
    """A defocused edge equals the share of the disc beyond it averaged over the pixels."""
    image, point, normal = edge_image(np.radians(turn_deg), defocus_radius_px=radius)
    exact = averaged_step(image.shape, point, normal, lambda d: disc_step(d, radius))
    # The disc is sampled at steps h of 1/8 of its radius: an edge along the grid is off by h² / 12 x the change of the disc's
    # profile, at most 2 / (pi R) per pixel.
    h = 1 / min(8, np.ceil(8 / radius))
    assert np.abs(image - exact).max() <= h * h / 12 * 2 / (np.pi * radius) + 2e-4


def test_disc_and_gaussian_add_up():
    """Both blurs at once spread an edge by the sum of their variances, sigma² + R² / 4, and the pixel's 1/12."""
    sigma, radius = 0.8, 2.0
    image, (u0, _), _ = edge_image(0.0, blur_sigma_px=sigma, defocus_radius_px=radius)
    profile = np.diff(image[12])
    at = np.arange(profile.size) + 0.5 - u0
    mean = profile @ at
    assert profile.sum() == pytest.approx(1, abs=1e-5)
    # The difference of neighbouring pixels is one more box, with another 1/12.
    assert profile @ (at - mean) ** 2 == pytest.approx(sigma**2 + radius**2 / 4 + 2 / 12, abs=2e-3)


def test_a_corner_stands_where_it_is_projected():
    """Edges fitted in an 8x enlargement cross within 0.005 px of the projected corner."""
    small = Camera((320, 240), [[300, 0, 164.3], [0, 304, 117.1], [0, 0, 1]], [-0.3, 0.1, 0, 0, -0.01])
    large = small.scaled((2560, 1920))
    pose = standing(BOARD, [0.35, -0.5, 0.1], [0.01, 0.0, 0.27])
    image = render_ideal(large, BOARD, pose, LIGHT, blur_sigma_px=2.0)
    truth = small.project(pose.apply(BOARD.object_points))
    found = [crossing(image, *np.rint((corner + 0.5) * 8 - 0.5).astype(int)) for corner in truth]
    error = (np.array(found) + 0.5) / 8 - 0.5 - truth
    assert np.abs(error).max() <= 0.005


def crossing(image, column, row, *, reach=70, gap=34, half=60):
    """Where the two edges through a corner cross: parabolas through the edge of each row and of each column."""
    along = np.concatenate([np.arange(-reach, -gap), np.arange(gap + 1, reach + 1)])
    x_of_y = np.polyfit(along, edges(image[row + along, column - half : column + half + 1]) - half, 2)
    y_of_x = np.polyfit(along, edges(image[row - half : row + half + 1, column + along].T) - half, 2)
    x = y = 0.0
    for _ in range(20):
        x, y = np.polyval(x_of_y, y), np.polyval(y_of_x, x)
    return column + x, row + y


def edges(profiles):
    """Position of the one step in each profile (N, L), from the light it holds."""
    left, right = profiles[:, 0], profiles[:, -1]
    return ((profiles - right[:, None]) / (left - right)[:, None]).sum(axis=1) - 0.5


def test_what_the_lens_cannot_reach_is_dark():
    """A lens that turns back inside the image lights exactly the pixels within its fold."""
    camera = Camera((320, 240), [[200, 0, 162], [0, 200, 117], [0, 0, 1]], [-0.5, 0.0])
    pose = standing(BOARD, [0.2, -0.6, 0.1], [0.05, 0, 0.15])
    # d (r - r³ / 2) / dr = 0 at r = sqrt(2 / 3), where the distorted radius is sqrt(2 / 3) 2 / 3.
    fold_px = 200 * np.sqrt(2 / 3) * 2 / 3
    v, u = np.mgrid[:240, :320]
    radius = np.hypot(u - 162, v - 117)
    image = render_ideal(camera, BOARD, pose, LIGHT)
    assert np.abs(image[radius > fold_px + 0.71]).max() <= 1e-12
    assert image[radius < fold_px - 0.71].min() >= LIGHT.black - 1e-12
    lit = np.where(radius <= fold_px, 1.0, 0.0).sum()
    plain = render_ideal(camera, BOARD, pose, Light(0.5, 0.5, 0.5))
    # Uniform light: the sum is the disc's area; counting pixel centres is off by about the square root of its outline.
    assert plain.sum() / 0.5 == pytest.approx(np.pi * fold_px**2, rel=1e-6)
    assert plain.sum() / 0.5 == pytest.approx(lit, abs=4 * np.sqrt(2 * np.pi * fold_px))


def test_light_is_shaded():
    """Vignetting takes its share at the image corner, and the gradient its share over half the diagonal."""
    camera = Camera((61, 41), [[50, 0, 30], [0, 50, 20], [0, 0, 1]])
    far = standing(BOARD, [0, 0, 0], [0, 0, 1000.0])
    half_diagonal = np.hypot(61, 41) / 2
    corner = np.hypot(30, 20) / half_diagonal
    dark = render_ideal(camera, BOARD, far, Light(background=0.5, vignetting=0.4))
    assert dark[20, 30] == pytest.approx(0.5, abs=1e-4)
    assert dark[0, 0] == pytest.approx(0.5 * (1 - 0.4 * corner**2), abs=1e-12)
    down = render_ideal(camera, BOARD, far, Light(background=0.5, gradient=0.2, gradient_direction_deg=90.0))
    assert down[40, 0] == pytest.approx(0.5 * (1 + 0.2 * 20 / half_diagonal), abs=1e-12)
    assert down[0, 0] == pytest.approx(0.5 * (1 - 0.2 * 20 / half_diagonal), abs=1e-12)


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (Pose.from_rvec([0, np.radians(80), 0], [0, 0, 0.05]), "behind the camera"),
        (Pose.from_rvec([0, np.pi, 0], [0.1, 0, 1.0]), "back of the board"),
    ],
)
def test_boards_that_cannot_be_seen_are_refused(pose, message):
    """A board that reaches behind the camera, or turns its back to it, is an error."""
    with pytest.raises(InputError, match=message):
        render_ideal(small_camera(), BOARD, pose)
