"""Numbers out of files that nobody promised a layout for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from camcal.formats.yaml_io import Document, KeyPath, describe


def numbers(document: Document, path: KeyPath, counts: Sequence[int]) -> list[float]:
    """Read finite numbers: a list, nested lists, one number, or a matrix as OpenCV writes it.

    Parameters
    ----------
    document : Document
    path : tuple
        Key path; it must be there.
    counts : sequence of int
        How many there may be.

    Raises
    ------
    InputError
        If they are not that; says `file:line: key`.
    """
    part = at(document, path)
    if isinstance(part, dict) and "data" in part:
        path = (*path, "data")
        part = part["data"]
    found = _flat(part)
    for value in found:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise document.error(path, f"wrong type (got {describe(value)}, expected a number)")
        if not math.isfinite(value) or abs(value) > 1e300:
            raise document.error(path, f"not finite (got {describe(value)}, expected a finite number)")
    if len(found) not in counts:
        expected = " or ".join(str(count) for count in counts if count)
        raise document.error(path, f"wrong number of values (got {len(found)}, expected {expected})")
    return [float(value) for value in found]


def whole(document: Document, path: KeyPath) -> int:
    """Read a whole number, also one that is written with a point.

    Raises
    ------
    InputError
        If it is none.
    """
    value = at(document, path)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value) or value != int(value):
        raise document.error(path, f"wrong type (got {describe(value)}, expected a whole number)")
    return int(value)


def at(document: Document, path: KeyPath) -> Any:
    """Return what stands at a key path that is there."""
    part: Any = document.data
    for step in path:
        part = part[step]
    return part


def _flat(part: Any) -> list[Any]:
    """Take lists within lists apart."""
    if isinstance(part, list):
        return [value for item in part for value in _flat(item)]
    return [part]
