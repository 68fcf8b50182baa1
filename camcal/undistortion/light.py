"""Linear light: pixel values as the amounts of light they stand for, of which averages are what a camera would see.

Source of the sRGB curve: IEC 61966-2-1.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from camcal.errors import InputError

if TYPE_CHECKING:
    from camcal.observations import Image

Floats: TypeAlias = npt.NDArray[np.float32]

_GAMMAS = (0.1, 10.0)


@dataclass(frozen=True, slots=True)
class Curve:
    """How pixel values stand for light.

    Attributes
    ----------
    gamma : float or None
        value = light ** (1 / gamma); None is the curve of sRGB.
    """

    gamma: float | None

    def light(self, values: Image) -> Floats:
        """Light, as a share of full scale, of pixel values: uint8 or uint16, or float32 with full scale 1."""
        if values.dtype == np.float32:
            return self._light(values)
        table = _table(self, values.dtype.str)
        return np.asarray(cv2.LUT(values, table), np.float32) if values.dtype == np.uint8 else table[values]

    def values(self, light: Floats) -> Floats:
        """Pixel values, full scale 1, of light as a share of full scale; below 0 counts as 0. Both float32."""
        light = np.maximum(light, 0)
        if self.gamma is not None:
            return _power(light, 1 / self.gamma)
        bright = np.float32(1.055) * _power(light, 1 / 2.4) - np.float32(0.055)
        values: Floats = np.where(light <= 0.0031308, np.float32(12.92) * light, bright)
        return values

    def _light(self, values: Floats) -> Floats:
        """Light of pixel values with full scale 1."""
        values = np.maximum(values, 0)
        if self.gamma is not None:
            return _power(values, self.gamma)
        bright = _power((values + np.float32(0.055)) / np.float32(1.055), 2.4)
        light: Floats = np.where(values <= 0.04045, values / np.float32(12.92), bright)
        return light


def parse_curve(curve: str | float) -> Curve:
    """Read "srgb" or the exponent of a power law.

    Raises
    ------
    InputError
        If it is neither, or the exponent is not within 0.1 to 10.
    """
    if isinstance(curve, str) and curve.lower() == "srgb":
        return Curve(None)
    try:
        gamma = float(curve)
    except ValueError:
        gamma = float("nan")
    if not _GAMMAS[0] <= gamma <= _GAMMAS[1]:
        raise InputError(
            f"--gamma: not a curve (got {curve}, expected srgb or an exponent within {_GAMMAS[0]} to {_GAMMAS[1]})."
        )
    return Curve(gamma)


def _power(values: Floats, exponent: float) -> Floats:
    """Powers of values that are not negative."""
    return np.asarray(cv2.pow(values, exponent), np.float32)


@lru_cache(maxsize=8)
def _table(curve: Curve, dtype: str) -> Floats:
    """Light of every pixel value of a whole-number dtype."""
    full = int(np.iinfo(dtype).max)
    exact = np.arange(full + 1) / full
    if curve.gamma is not None:
        return (exact**curve.gamma).astype(np.float32)
    light = np.where(exact <= 0.04045, exact / 12.92, ((exact + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)
