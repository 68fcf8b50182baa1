"""The ideal image of a board: what a noise-free sensor of unlimited depth would see."""

from __future__ import annotations

import numpy as np

from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.synthesis.coverage import area_coverage, gaussian_coverage, gaussian_reach
from camcal.synthesis.edges import Reach, Scene, Segments, board_segments
from camcal.synthesis.psf import disc_blur, disc_margin, gaussian_blur, gaussian_margin

_CHORD_PX = 1e-4
# Longest segment in units of sigma, for two Gauss-Legendre nodes.
_SEGMENT_SIGMAS = 0.8
# A wider Gaussian is done in two steps: the outlines are spread by one of this width and the image is blurred by the
# rest, sampled. That is exact, because nothing of the pattern is then left beyond the pixel grid's Nyquist frequency.
_SPREAD_SIGMA_PX = 1.0
_WIDE_SIGMA_PX = 1.5
# A Gaussian narrower than this is none: it would not change a pixel by a hundredth of the contrast.
_SHARP_SIGMA_PX = 0.02
# A disc is applied on a grid so fine that its radius has this many steps, within reason.
_DISC_STEPS = 8
_DISC_FINEST = 8
# It is done band by band, so that a large image needs no more memory than this many fine pixels do.
_BAND_PIXELS = 16_000_000


def scene_light(camera: Camera, scene: Scene, *, blur_sigma_px: float = 0.0, defocus_radius_px: float = 0.0) -> FloatArray:
    """Average the blurred scene over the area of every pixel, before any uneven lighting.

    Parameters
    ----------
    camera : Camera
    scene : Scene
        The board must be wholly in front of the camera, its print towards it.
    blur_sigma_px : float
        Standard deviation of the Gaussian blur of the continuous image; 0 (or below 0.02) for none.
    defocus_radius_px : float
        Radius of the uniform disc that the continuous image is blurred by (as well); 0 for none.

    Returns
    -------
    ndarray of shape (height, width)
        Linear light as a share of full scale, float64; 0 where the lens lets nothing through.

    Raises
    ------
    InputError
        If the board is not wholly in front of the camera, or turns its back to it.
    """
    if defocus_radius_px <= 0:
        return _focused(camera, scene, blur_sigma_px)
    width, height = camera.size
    fine = int(np.clip(np.ceil(_DISC_STEPS / defocus_radius_px), 1, _DISC_FINEST))
    rows = max(1, _BAND_PIXELS // (width * fine**2))
    bands = [window(camera, 0, top, width, min(rows, height - top)) for top in range(0, height, rows)]
    return np.concatenate([_defocused(band, scene, blur_sigma_px, defocus_radius_px, fine) for band in bands])


def window(camera: Camera, left: int, top: int, width: int, height: int) -> Camera:
    """Return the camera of a part of the image, or of more than the image: the pixels from (left, top) on."""
    K = camera.K.copy()
    K[:2, 2] -= left, top
    return Camera((width, height), K, camera.lens)


def _defocused(camera: Camera, scene: Scene, sigma_px: float, radius_px: float, fine: int) -> FloatArray:
    """Light of the scene blurred by a disc (and a Gaussian), by way of a grid `fine` times finer."""
    width, height = camera.size
    margin = -(-disc_margin(fine * radius_px) // fine)
    wide = window(camera, -margin, -margin, width + 2 * margin, height + 2 * margin)
    scaled = wide.scaled((fine * wide.size[0], fine * wide.size[1]))
    blurred = disc_blur(_focused(scaled, scene, fine * sigma_px), fine * radius_px)
    mean: FloatArray = blurred.reshape(wide.size[1], fine, wide.size[0], fine).mean(axis=(1, 3))
    return mean[margin:-margin, margin:-margin]


def _focused(camera: Camera, scene: Scene, sigma_px: float) -> FloatArray:
    """Light of the scene blurred by a Gaussian alone."""
    if sigma_px > _WIDE_SIGMA_PX:
        rest = float(np.sqrt(sigma_px**2 - _SPREAD_SIGMA_PX**2))
        margin = gaussian_margin(rest)
        width, height = camera.size
        wide = window(camera, -margin, -margin, width + 2 * margin, height + 2 * margin)
        spread = _focused(wide, scene, _SPREAD_SIGMA_PX)
        return gaussian_blur(spread, rest)[margin:-margin, margin:-margin]
    reach = Reach.of(camera, margin_px=gaussian_reach(sigma_px) + 1.0)
    sharp = sigma_px < _SHARP_SIGMA_PX
    length = np.inf if sharp else _SEGMENT_SIGMAS * sigma_px
    segments = board_segments(camera, scene, reach, chord_px=_CHORD_PX, length_px=length)
    base = scene.light.background
    if reach.folds:
        segments = Segments.joined(segments, reach.outline(camera, scene.light.background, length))
        base = 0.0
    shape = camera.size[1], camera.size[0]
    marks = area_coverage(segments, shape) if sharp else gaussian_coverage(segments, shape, sigma_px)
    marks += base
    return marks
