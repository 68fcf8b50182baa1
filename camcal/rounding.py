"""Numbers written with as many digits as they are known to."""

from __future__ import annotations

import math
from collections.abc import Sequence

_MOST_DECIMALS = 9
"""More decimals than this are unreadable in a column; such numbers are written with 12 significant digits."""
_DIGITS_OF_UNKNOWN = 6
"""Significant digits of a number whose standard deviation is not known."""
_LONGEST_GIVEN = 9
"""Significant digits of a number that a person may have chosen; longer ones are computed."""


def decimals(sigma: float) -> int | None:
    """Return how many decimals show two significant digits of a standard deviation; None if that makes no sense.

    Examples
    --------
    >>> decimals(0.0516), decimals(0.0996), decimals(12.3), decimals(4567.0), decimals(float("nan"))
    (3, 2, 0, 0, None)
    """
    if not (math.isfinite(sigma) and sigma > 0):
        return None
    # The exponent after rounding: 0.0996 is written 0.10.
    exponent = int(f"{sigma:.1e}".partition("e")[2])
    count = max(0, 1 - exponent)
    return count if count <= _MOST_DECIMALS else None


def rounded(value: float, sigma: float, sign: str = "") -> str:
    """Write a value to the precision that its standard deviation supports.

    Parameters
    ----------
    value : float
    sigma : float
        NaN if it is not known.
    sign : str
        "+" to write the sign of a positive number too.

    Examples
    --------
    >>> rounded(912.3686, 0.0516), rounded(0.060937308, 0.000165), rounded(-0.0314, 0.0516, "+")
    ('912.369', '0.06094', '-0.031')
    >>> rounded(912.36861234, float("nan"))
    '912.369'
    """
    count = decimals(sigma)
    if count is not None:
        return format(value, f"{sign}.{count}f")
    known = math.isfinite(sigma) and sigma > 0
    return format(value, f"{sign}.{12 if known else _DIGITS_OF_UNKNOWN}g")


def as_given(value: float, sigma: float) -> str:
    """Write a truth: in full if somebody wrote it down in few digits, else as an estimate of that standard deviation.

    Examples
    --------
    >>> as_given(0.0612, 1.5), as_given(912.3686123456789, 0.0516)
    ('0.0612', '912.369')
    """
    text = f"{value:.{_LONGEST_GIVEN}g}"
    return text if float(text) == value else rounded(value, sigma)


def spread(sigma: float) -> str:
    """Write a standard deviation with two significant digits; a dash if it is not known.

    Examples
    --------
    >>> spread(0.0516), spread(0.0996), spread(0.04), spread(float("nan"))
    ('0.052', '0.10', '0.040', '-')
    """
    if math.isnan(sigma):
        return "-"
    count = decimals(sigma)
    return format(sigma, ".2g" if count is None else f".{count}f")


def plus_minus(pairs: Sequence[tuple[float, float]]) -> list[str]:
    """Write values with their standard deviations, one above the other with the ± signs in line.

    Examples
    --------
    >>> plus_minus([(912.3686, 0.0516), (-0.1715, 0.00072)])
    ['912.369   ± 0.052  ', ' -0.17150 ± 0.00072']
    """
    values = point_in_line([rounded(value, sigma) for value, sigma in pairs])
    spreads = point_in_line([spread(sigma) for _, sigma in pairs])
    return [f"{value} ± {sigma}" for value, sigma in zip(values, spreads, strict=True)]


def point_in_line(texts: Sequence[str]) -> list[str]:
    """Pad numbers so that their decimal points stand below each other."""
    parts = [text.partition(".") for text in texts]
    before = max((len(whole) for whole, _, _ in parts), default=0)
    after = max((len(point + rest) for _, point, rest in parts), default=0)
    return [whole.rjust(before) + (point + rest).ljust(after) for whole, point, rest in parts]
