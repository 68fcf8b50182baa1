"""The nearest of some known names to one that was probably mistyped."""

from __future__ import annotations

from collections.abc import Iterable

_SHORTEST_BEGINNING = 3
_SHORT = 2
_LIKENESS = 0.6
"""Share of the letters that two names have in common, in order, from which on one may stand for the other."""
_LIKENESS_OF_SHORT = 0.5
"""The same for names of two letters, such as k9 for k6: half of them."""


def nearest(text: str, known: Iterable[str]) -> str | None:
    """Return the known name that was probably meant, whatever the case of its letters; None if none is near.

    Parameters
    ----------
    text : str
    known : iterable of str

    Examples
    --------
    >>> nearest("Kalbir", ["ros", "kalibr"]), nearest("wide", ["webcam_720p", "wide_action"]), nearest("xyz", ["ros"])
    ('kalibr', 'wide_action', None)
    """
    import difflib  # only for who mistypes

    by_case = {name.casefold(): name for name in known}
    wanted = text.casefold()
    likeness = _LIKENESS_OF_SHORT if len(wanted) <= _SHORT else _LIKENESS
    whole = [name for name in by_case if name.startswith(wanted) and len(wanted) >= _SHORTEST_BEGINNING]
    near = whole or difflib.get_close_matches(wanted, by_case, n=1, cutoff=likeness)
    return by_case[near[0]] if near else None


def did_you_mean(text: str, known: Iterable[str]) -> str:
    """Return ` Did you mean 'NAME'?` to put behind a message; nothing if no known name is near.

    Examples
    --------
    >>> did_you_mean("cubik", ["linear", "cubic", "lanczos"]), did_you_mean("xyz", ["ros"])
    (" Did you mean 'cubic'?", '')
    """
    name = nearest(text, known)
    return f" Did you mean '{name}'?" if name else ""
