"""The baseline of the accuracy suite: every scenario's figures, as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from camcal.errors import InputError
from camcal.formats.output import claim_file, write_atomically
from camcal.formats.text import read_text

_LONGEST_FILE_BYTES = 10_000_000
_DIGITS = 5
_WRITE_ONE = " Write a baseline with --update-baseline."


@dataclass(frozen=True, slots=True)
class Baseline:
    """Figures to hold a run against.

    Attributes
    ----------
    figures : dict of str to dict of str to float
        By scenario and figure.
    source : str
        Where they were read from.
    """

    figures: Mapping[str, Mapping[str, float]]
    source: str = ""

    def check_holds(self, names: Sequence[str]) -> None:
        """Raise InputError if a scenario is missing."""
        missing = [name for name in names if name not in self.figures]
        if missing:
            raise InputError(
                f"{self.source}: no figures for {', '.join(missing)} (it has {', '.join(self.figures) or 'none'}). "
                "Run again with --update-baseline."
            )


def load_baseline(path: str | Path) -> Baseline:
    """Read a baseline.

    Raises
    ------
    InputError
        If the file is missing or is not what `save_baseline` writes.
    """
    try:
        content = json.loads(read_text(path, _LONGEST_FILE_BYTES))
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not a baseline ({error}).{_WRITE_ONE}") from None
    scenarios = content.get("scenarios") if isinstance(content, dict) else None
    if not isinstance(scenarios, dict):
        raise InputError(f"{path}: scenarios: missing mapping.{_WRITE_ONE}")
    for name, figures in scenarios.items():
        if not isinstance(figures, dict):
            raise InputError(f"{path}: {name}: not a mapping of figures.{_WRITE_ONE}")
        for figure, value in figures.items():
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
                raise InputError(f"{path}: {name}: {figure}: not a finite number (got {value!r}).")
    return Baseline(scenarios, str(path))


def claim_baseline(path: str | Path) -> Path:
    """Make sure that a baseline may be written or updated, before any work is done.

    Raises
    ------
    InputError
        If the file cannot be written, or exists and is no baseline.
    """
    if Path(path).is_file():
        try:
            load_baseline(path)
        except InputError as error:
            problem = str(error).removesuffix(_WRITE_ONE)
            raise InputError(f"{problem} It is left as it is: choose another name, or remove it.") from None
    return claim_file(path, force=True)


def save_baseline(path: str | Path, baseline: Baseline) -> None:
    """Write a baseline, figures to five significant digits; scenarios that the file has besides are kept.

    Raises
    ------
    InputError
        If the file cannot be written, or exists and is no baseline.
    """
    known = dict(load_baseline(path).figures) if Path(path).exists() else {}
    for name, figures in baseline.figures.items():
        known[name] = {figure: float(f"{value:.{_DIGITS}g}") for figure, value in figures.items()}
    write_atomically(path, json.dumps({"scenarios": dict(sorted(known.items()))}, indent=2) + "\n")
