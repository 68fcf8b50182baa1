"""How well a corner can be located at all: the Cramér-Rao bound of a rendered view."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from camcal.boards.base import Board
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light, Sensor

_LEVELS = 255.0
_SHIFT_PX = 0.05
_BLUR_STEP = 0.05
_PORTION_PIXELS = 500_000


def corner_bound(
    camera: Camera,
    board: Board,
    T_cam_board: Pose,
    light: Light | None = None,
    *,
    blur_sigma_px: float,
    noise_levels: npt.ArrayLike,
    radius_px: npt.ArrayLike,
) -> FloatArray:
    """Smallest standard deviation that any unbiased estimate of each corner can have.

    The unknowns of each patch are the corner's shift, gain, offset, the slope of the illumination and the blur; the shape
    of the edges is known. The information is that of every pixel of a disc around the corner, and the derivatives are
    differences of noise-free renders.

    Parameters
    ----------
    camera : Camera
    board : Board
    T_cam_board : Pose
    light : Light, optional
        The default light if none is given.
    blur_sigma_px : float
        Standard deviation of the Gaussian blur, the pixel's area not included; px.
    noise_levels : float or ndarray of shape (height, width)
        Standard deviation of each pixel's noise in 8-bit levels; not 0.
    radius_px : float or ndarray of shape (N,)
        Radius of the disc around each of the board's N features.

    Returns
    -------
    ndarray of shape (N, 2)
        Standard deviation along x and y in px; NaN for a feature whose disc leaves the image.

    Raises
    ------
    InputError
        If the board is not wholly in front of the camera.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> pose = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])
    >>> board = camcal.parse_board("checkerboard:7x6:20mm")
    >>> bound = camcal.corner_bound(camera, board, pose, blur_sigma_px=0.7, noise_levels=2, radius_px=12)
    >>> bound.shape, round(float(bound.mean()), 3)
    ((42, 2), 0.004)
    """
    corners = camera.project(T_cam_board.apply(board.object_points))
    radius = np.broadcast_to(np.asarray(radius_px, dtype=np.float64), len(corners))
    images = _derivative_images(camera, board, T_cam_board, light, blur_sigma_px)
    last = np.array(camera.size) - 1
    with np.errstate(invalid="ignore"):
        inside = (np.minimum(corners, last - corners) >= radius[:, None] + 1).all(axis=1) & (radius > 0)
    bound = np.full(corners.shape, np.nan)
    if not inside.any():
        return bound
    noise = np.broadcast_to(np.asarray(noise_levels, dtype=np.float64) / _LEVELS, images[0].shape)
    for some in _portions(np.flatnonzero(inside), radius):
        J = _patch_derivatives((*images, noise), corners[some], radius[some])
        bound[some] = np.sqrt(_shift_variance(J))
    return bound


def sensor_noise_levels(signal: FloatArray, sensor: Sensor) -> FloatArray:
    """Standard deviation of a linear sensor's noise, in 8-bit levels, for noise-free light.

    Parameters
    ----------
    signal : ndarray of shape (height, width)
        Linear light as a share of full scale.
    sensor : Sensor
        Its read noise, full well and bits are used.

    Returns
    -------
    ndarray of shape (height, width)
        Read noise, shot noise and rounding together (a rounded value is off by 1/√12 of its step).
    """
    step = _LEVELS / (2**sensor.bits - 1)
    variance = np.full(signal.shape, sensor.read_noise_levels**2 + step**2 / 12)
    if sensor.full_well_electrons > 0:
        variance += _LEVELS**2 * np.maximum(signal, 0) / sensor.full_well_electrons
    deviation: FloatArray = np.sqrt(variance)
    return deviation


def _portions(chosen: IntArray, radius_px: FloatArray) -> Iterator[IntArray]:
    """Split features (C,) into portions whose patches, all as large as the largest of them, hold so many pixels at most."""
    falling = chosen[np.argsort(-radius_px[chosen], kind="stable")]
    start = 0
    while start < falling.size:
        side = 2 * int(np.ceil(radius_px[falling[start]])) + 3
        stop = start + max(_PORTION_PIXELS // side**2, 1)
        yield falling[start:stop]
        start = stop


def _patch_derivatives(images: tuple[FloatArray, ...], corners_px: FloatArray, radius_px: FloatArray) -> FloatArray:
    """Derivatives (C, 7, P) of the pixels of discs by shift, blur, offset, gain and slope, over their noise; 0 outside."""
    height, width = images[0].shape
    centre = np.rint(corners_px).astype(np.int64)
    reach = int(np.ceil(radius_px.max())) + 1
    dy, dx = (offset.ravel() for offset in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    index = np.clip(centre[:, 1:] + dy, 0, height - 1) * width + np.clip(centre[:, :1] + dx, 0, width - 1)
    off = centre[:, None] + np.stack([dx, dy], axis=-1) - corners_px[:, None]
    in_disc = (off**2).sum(axis=-1) <= radius_px[:, None] ** 2
    signal, by_x, by_y, by_blur, noise = (image.ravel()[index] for image in images)
    rows = [by_x, by_y, by_blur, np.ones_like(signal), signal, signal * off[..., 0], signal * off[..., 1]]
    derivatives: FloatArray = np.stack(rows, axis=1) * (in_disc / noise)[:, None]
    return derivatives


def _shift_variance(J: FloatArray) -> FloatArray:
    """Variance of the first two unknowns for whitened pixels: shape (C, 2), from derivatives (C, unknowns, P)."""
    scale = np.sqrt((J**2).sum(axis=2))
    scaled = J / np.maximum(scale, np.finfo(float).tiny)[..., None]
    information = scaled @ scaled.swapaxes(1, 2)
    variance = np.diagonal(np.linalg.pinv(information, rcond=1e-12, hermitian=True), axis1=1, axis2=2)
    shift: FloatArray = variance[:, :2] / scale[:, :2] ** 2
    return shift


def _derivative_images(
    camera: Camera, board: Board, T_cam_board: Pose, light: Light | None, blur_sigma_px: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """The noise-free image and its derivatives by a shift of the scene along x and y and by the blur; (height, width) each.

    A shift of the principal point moves every corner alike, and leaves the uneven illumination where it is.
    """

    def image(shift_x: float, shift_y: float, blur: float) -> FloatArray:
        K = camera.K.copy()
        K[0, 2] += shift_x
        K[1, 2] += shift_y
        return render_ideal(Camera(camera.size, K, camera.lens), board, T_cam_board, light, blur_sigma_px=blur)

    h, s = _SHIFT_PX, blur_sigma_px
    step = _BLUR_STEP * max(s, 0.2)
    return (
        image(0, 0, s),
        (image(h, 0, s) - image(-h, 0, s)) / (2 * h),
        (image(0, h, s) - image(0, -h, s)) / (2 * h),
        (image(0, 0, s + step) - image(0, 0, max(s - step, 0.0))) / (step + min(step, s)),
    )
