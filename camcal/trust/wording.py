"""How findings name views and round figures."""

from __future__ import annotations

from collections.abc import Sequence

_MOST_NAMED = 3


def named(sources: Sequence[str]) -> str:
    """Name a few views and count the rest.

    Examples
    --------
    >>> named(["a.png", "b.png"]), named(["a", "b", "c", "d", "e"])
    ('a.png, b.png', 'a, b, c and 2 more')
    """
    if len(sources) <= _MOST_NAMED + 1:
        return ", ".join(sources)
    return f"{', '.join(sources[:_MOST_NAMED])} and {len(sources) - _MOST_NAMED} more"


def rounded(value: float) -> str:
    """Round to two digits, or to a whole number where that says more; never in powers of ten.

    Examples
    --------
    >>> rounded(0.01234), rounded(1.26), rounded(234.5)
    ('0.012', '1.3', '234')
    """
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


def listed(names: Sequence[str]) -> str:
    """Join names as a sentence does.

    Examples
    --------
    >>> listed(["left"]), listed(["left", "top", "right"])
    ('left', 'left, top and right')
    """
    return " and ".join([", ".join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]
