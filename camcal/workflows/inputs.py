"""The images that a command is to work on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from camcal.formats.images import ImageFile, find_images
from camcal.workflows.reporting import Reporter


def images_to_work_on(inputs: Sequence[str | Path], reporter: Reporter) -> tuple[ImageFile, ...]:
    """Find the images of files, folders and patterns; other files in the folders are counted in one warning.

    Raises
    ------
    InputError
        If a named file cannot be used or there is no image at all.
    """
    found = find_images(inputs)
    if found.passed_over:
        count = len(found.passed_over)
        reporter.warn(f"{count} other {'file' if count == 1 else 'files'} passed over (first: {found.passed_over[0].name}).")
    return found.images
