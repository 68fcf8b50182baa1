"""The parts of a board's one-liner: lengths, counts and names; exact both ways, checked with a clear text."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable
from decimal import Decimal
from fractions import Fraction

from camcal.nearest import did_you_mean

UNITS_M = {"mm": Fraction(1, 1000), "cm": Fraction(1, 100), "m": Fraction(1), "in": Fraction(254, 10000)}
"""Metres of each unit of length that a one-liner may use."""

_LENGTH_LIMITS_M = (1e-5, 10.0)
_MOST_ALONG_A_SIDE = 100
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)")
_RATIO_DECIMALS = 4


def parse_length(text: str, name: str) -> Fraction:
    """Read a length with its unit, e.g. `24.5mm`, as the exact number of metres.

    Raises
    ------
    ValueError
        If there is no number, no unit, or one that is not known.
    """
    match = _NUMBER.match(text)
    units = ", ".join(UNITS_M)
    if match is None:
        raise ValueError(f"{name}: not a length (got '{text}', expected a number with its unit such as 25mm)")
    number, unit = match.group(), text[match.end() :].strip()
    if not unit:
        raise ValueError(f"{name}: no unit (got '{text}', expected one of {units}). Write {number}mm if it is millimetres.")
    if unit not in UNITS_M:
        raise ValueError(f"{name}: unknown unit (got '{unit}' in '{text}', expected one of {units})")
    return Fraction(number) * UNITS_M[unit]


def parse_spacing(text: str, side_m: Fraction) -> Fraction:
    """Read a spacing: a bare number is a ratio of the side, a number with a unit is a length; exact metres.

    Raises
    ------
    ValueError
        If the text is neither.
    """
    if _NUMBER.fullmatch(text):
        return Fraction(text) * side_m
    return parse_length(text, "spacing")


def parse_grid(text: str, what: str) -> tuple[int, int]:
    """Read `COLUMNSxROWS` as two whole numbers; `what` says what is counted.

    Raises
    ------
    ValueError
        If the text is anything else.
    """
    match = re.fullmatch(r"(-?\d+)[xX×](-?\d+)", text, re.ASCII)
    if match is None:
        raise ValueError(f"size: not COLUMNSxROWS in whole numbers (got '{text}', expected {what} such as 9x6)")
    return int(match.group(1)), int(match.group(2))


def parse_choice(text: str, choices: Iterable[str], name: str) -> str:
    """Return `text` if it is one of `choices`.

    Raises
    ------
    ValueError
        If it is not; names the nearest choice.
    """
    known = tuple(choices)
    if text in known:
        return text
    raise ValueError(f"{name}: unknown (got {text!r}, expected one of {', '.join(known)}).{did_you_mean(text, known)}")


def format_length(length_m: float) -> str:
    """Write metres as millimetres (from 1 m on as metres), the shortest text that `parse_length` turns into the same float.

    Examples
    --------
    >>> format_length(0.025), format_length(0.0245), float(parse_length("24.5mm", "square"))
    ('25mm', '24.5mm', 0.0245)
    """
    length = Decimal(repr(length_m))
    return f"{_plain(length)}m" if length_m >= 1 else f"{_plain(length.scaleb(3))}mm"


def format_spacing(gap_m: float, side_m: float) -> str:
    """Write a gap as a ratio of the side where that is short and exact, else as a length.

    Examples
    --------
    >>> format_spacing(0.0264, 0.088), format_spacing(0.01, 0.03)
    ('0.3', '10mm')
    """
    ratio = Fraction(repr(gap_m)) / Fraction(repr(side_m))
    scaled = ratio * 10**_RATIO_DECIMALS
    if scaled.denominator != 1:
        return format_length(gap_m)
    return _plain(Decimal(scaled.numerator).scaleb(-_RATIO_DECIMALS))


def checked_count(value: int, least: int, name: str) -> int:
    """Return a count along one side of a board as a plain int.

    Raises
    ------
    ValueError
        If it is not a whole number, below `least`, or more than any board has.
    """
    try:
        count = operator.index(value)
    except TypeError:
        raise ValueError(f"{name}: not a whole number (got {value!r})") from None
    if count < least:
        raise ValueError(f"{name}: too few (got {count}, expected at least {least})")
    if count > _MOST_ALONG_A_SIDE:
        raise ValueError(f"{name}: too many (got {count}, expected at most {_MOST_ALONG_A_SIDE})")
    return count


def checked_length(value: float, name: str) -> float:
    """Return a length in metres as a plain float.

    Raises
    ------
    ValueError
        If it is not positive, not finite, or of a size that no board has.
    """
    length_m = float(value)
    low, high = _LENGTH_LIMITS_M
    if not length_m > 0:
        raise ValueError(f"{name}: must be positive (got {length_m:g} m)")
    if not low <= length_m <= high:
        raise ValueError(f"{name}: absurd size (got {length_m:g} m, expected {low * 1e3:g} mm to {high:g} m). Check the unit.")
    return length_m


def _plain(number: Decimal) -> str:
    """Decimal digits without exponent and without zeros at the end."""
    text = format(number, "f")
    return text.rstrip("0").rstrip(".") if "." in text else text
