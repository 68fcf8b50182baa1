"""The images that a command is to work on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from camcal.formats.images import ImageFile, find_images
from camcal.workflows.reporting import Reporter

_NAMED_AT_ONCE = 4

Inputs = str | Path | Sequence[str | Path]
"""One path or several: files, folders or patterns."""


def images_to_work_on(inputs: Inputs, reporter: Reporter) -> tuple[ImageFile, ...]:
    """Find the images of files, folders and patterns; other files in the folders are counted in one warning.

    Raises
    ------
    InputError
        If a named file cannot be used or there is no image at all.
    """
    found = find_images(as_paths(inputs))
    if found.passed_over:
        count = len(found.passed_over)
        reporter.warn(f"{count} other {'file' if count == 1 else 'files'} passed over (first: {found.passed_over[0].name}).")
    return found.images


def as_paths(inputs: Inputs) -> list[str | Path]:
    """Return the inputs as a list, also where there is only one."""
    return [inputs] if isinstance(inputs, (str, Path)) else list(inputs)


def warn_of_each(texts_by_source: Iterable[tuple[str, str]], reporter: Reporter) -> None:
    """Pass on what is to be said of images, one line for each text, naming the first few images it holds for."""
    sources: dict[str, list[str]] = {}
    for source, text in texts_by_source:
        sources.setdefault(text, []).append(source)
    for text, named in sources.items():
        more = f" and {len(named) - _NAMED_AT_ONCE} more" if len(named) > _NAMED_AT_ONCE else ""
        reporter.warn(f"{', '.join(named[:_NAMED_AT_ONCE])}{more}: {text}")
