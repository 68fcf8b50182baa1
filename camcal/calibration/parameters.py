"""Which intrinsics are solved for."""

from __future__ import annotations

import numpy as np

from camcal.errors import InputError
from camcal.geometry.arrays import IntArray
from camcal.geometry.camera import Camera
from camcal.geometry.distortion import BrownConrady
from camcal.nearest import did_you_mean

PINHOLE = ("fx", "fy", "cx", "cy")
"""Always free; skew stays 0, because cv2.calibrateCamera cannot start from anything else."""

COEFFICIENTS = BrownConrady(np.zeros(0)).coefficient_names
"""Names of the distortion coefficients in stored order, which is OpenCV's."""

DEFAULT_DISTORTION = ("k1", "k2", "k3")
_LATER = ("k2", "k3", "k4", "k5", "k6")


def parse_distortion(text: str) -> tuple[str, ...]:
    """Read a list of free distortion coefficients such as `k1,k2,k3`, or `none`.

    Parameters
    ----------
    text : str
        Names separated by commas, in any order; p1 and p2 only together.

    Returns
    -------
    tuple of str
        The names in stored order (k1, k2, p1, p2, k3, k4, k5, k6).

    Raises
    ------
    InputError
        For an unknown or repeated name, or only one of p1 and p2.

    Examples
    --------
    >>> parse_distortion("k2,k1")
    ('k1', 'k2')
    """
    names = [name.strip() for name in text.split(",") if name.strip()]
    if names == ["none"]:
        return ()
    for name in names:
        if name not in COEFFICIENTS:
            raise InputError(
                f"--distortion: unknown coefficient (got {name!r}, expected some of {', '.join(COEFFICIENTS)})."
                + did_you_mean(name, (*COEFFICIENTS, "auto", "none"))
            )
    if not names or len(set(names)) != len(names):
        raise InputError(f"--distortion: each coefficient once (got {text!r}, expected e.g. 'k1,k2,k3' or 'none').")
    if ("p1" in names) != ("p2" in names):
        raise InputError(f"--distortion: p1 and p2 go together (got {text!r}). Name both or neither.")
    return tuple(name for name in COEFFICIENTS if name in names)


def free_names(distortion: tuple[str, ...]) -> tuple[str, ...]:
    """Names of all free intrinsics, in the order of `Camera.intrinsic_names`."""
    return PINHOLE + tuple(name for name in COEFFICIENTS if name in distortion)


def distortion_names(free: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the free distortion coefficients among all free intrinsics."""
    return tuple(name for name in free if name not in PINHOLE)


def first_stage(free: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the free intrinsics without the higher coefficients, which run away while the poses are wrong."""
    return tuple(name for name in free if name not in _LATER)


def places(camera: Camera, names: tuple[str, ...]) -> IntArray:
    """Places of named intrinsics in `Camera.intrinsics`, shape (F,)."""
    return np.array([camera.intrinsic_names.index(name) for name in names])
