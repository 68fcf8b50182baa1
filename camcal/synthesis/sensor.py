"""From light to numbers: uneven lighting, noise, clipping, gamma and quantisation."""

from __future__ import annotations

import numpy as np

from camcal.geometry.arrays import FloatArray
from camcal.observations import Image
from camcal.synthesis.scenario import Light, Sensor

_LEVELS = 255
# Past this many electrons at full scale the Poisson distribution is as good as normal, which is drawn far faster.
_MANY_ELECTRONS = 2000.0


def shading(size: tuple[int, int], light: Light) -> FloatArray:
    """Factor by which vignetting and the illumination gradient change the light of each pixel.

    Parameters
    ----------
    size : tuple of int
        Image (width, height).
    light : Light

    Returns
    -------
    ndarray of shape (height, width)
        1 at the image centre; never below 0.
    """
    width, height = size
    half_diagonal = np.hypot(width, height) / 2
    x = (np.arange(width) - (width - 1) / 2) / half_diagonal
    y = (np.arange(height)[:, None] - (height - 1) / 2) / half_diagonal
    direction = np.radians(light.gradient_direction_deg)
    fall = 1 - light.vignetting * (x * x + y * y)
    slope = 1 + light.gradient * (np.cos(direction) * x + np.sin(direction) * y)
    factor: FloatArray = np.maximum(fall * slope, 0)
    return factor


def expose(signal: FloatArray, sensor: Sensor, rng: np.random.Generator) -> Image:
    """Record an image: shot noise, read noise, clipping at full scale, gamma, quantisation, in that order.

    Parameters
    ----------
    signal : ndarray of shape (height, width)
        Linear light as a share of full scale; above 1 it saturates.
    sensor : Sensor
        Its noise, gamma and bits are used.
    rng : numpy.random.Generator
        The only source of randomness.

    Returns
    -------
    ndarray of shape (height, width)
        uint8 or uint16.

    Raises
    ------
    ValueError
        If the bits are neither 8 nor 16.
    """
    if sensor.bits not in (8, 16):
        raise ValueError(f"sensor.bits: not a depth we write (got {sensor.bits}, expected 8 or 16)")
    linear = signal
    if sensor.full_well_electrons > 0:
        linear = _shot_noise(linear, sensor.full_well_electrons, rng)
    if sensor.read_noise_levels > 0:
        noise = rng.standard_normal(linear.shape, dtype=np.float32)
        noise *= sensor.read_noise_levels / _LEVELS
        linear = linear + noise
    stored = np.clip(linear, 0, 1)
    if sensor.gamma != 1:
        np.power(stored, 1 / sensor.gamma, out=stored)
    stored *= 2**sensor.bits - 1
    return np.rint(stored, out=stored).astype(np.uint8 if sensor.bits == 8 else np.uint16)


def _shot_noise(linear: FloatArray, full_well: float, rng: np.random.Generator) -> FloatArray:
    """Count whole electrons where there are few, else add normal noise of the same variance: mean / full well."""
    light = np.maximum(linear, 0)
    if full_well < _MANY_ELECTRONS:
        return rng.poisson(light * full_well) / full_well
    noise = np.sqrt(light / full_well)
    noise *= rng.standard_normal(light.shape, dtype=np.float32)
    noise += light
    return noise
