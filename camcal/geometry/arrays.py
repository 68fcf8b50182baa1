"""How arrays enter the frozen types: validated, copied, float64 and read-only."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]


def frozen_floats(values: npt.ArrayLike, shape: tuple[int | None, ...], name: str, *, finite: bool = True) -> FloatArray:
    """Copy `values` into a read-only float64 array of the given shape.

    Parameters
    ----------
    values : array_like
        Anything numpy turns into floats.
    shape : tuple of int or None
        The expected shape; None leaves an axis free.
    name : str
        How the error message calls the array.
    finite : bool
        Whether NaN and infinity are refused.

    Raises
    ------
    ValueError
        If the shape does not match or a value is not finite although it must be.
    """
    array = np.array(values, dtype=np.float64)
    fits = array.ndim == len(shape) and all(want is None or have == want for have, want in zip(array.shape, shape, strict=True))
    if not fits:
        expected = "(" + ", ".join("N" if n is None else str(n) for n in shape) + ")"
        raise ValueError(f"{name}: wrong shape (got {array.shape}, expected {expected})")
    if finite and not np.isfinite(array).all():
        raise ValueError(f"{name}: every value must be finite")
    array.flags.writeable = False
    return array


def frozen_ints(values: npt.ArrayLike, shape: tuple[int | None, ...], name: str) -> IntArray:
    """Copy `values` into a read-only int64 array of the given shape (None leaves an axis free).

    Raises
    ------
    ValueError
        If the shape does not match or a value is not a whole number.
    """
    array = frozen_floats(values, shape, name)
    whole = array.astype(np.int64)
    if not np.array_equal(whole, array):
        raise ValueError(f"{name}: every value must be a whole number")
    whole.flags.writeable = False
    return whole
