"""Pages as files: which of them are camcal's own, so that the next may take their place."""

from __future__ import annotations

from pathlib import Path

from camcal.formats.output import claim_remade

_MARK = b'<meta name="generator" content="camcal '


def claim_page(path: str | Path) -> Path:
    """Make sure that a page may be written, before any work is done; one that camcal wrote is replaced.

    Raises
    ------
    InputError
        If any other file is there, or it cannot be written.
    """
    return claim_remade(path, lambda start: _MARK in start, "a page that camcal wrote")
