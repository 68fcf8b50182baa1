"""What a command is to work on: images in files or in memory, or views that have been detected already."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from camcal.errors import InputError
from camcal.formats.images import ImageFile, find_images
from camcal.observations import Detection, Image, Rejected
from camcal.workflows.reporting import Reporter

_NAMED_AT_ONCE = 4

Inputs = str | Path | Sequence[str | Path]
"""One path or several: files, folders or patterns."""

Images = Inputs | Sequence[Image] | Mapping[str, Image]
"""Images in files; or in memory as arrays of shape (height, width) or (height, width, channels in the order BGR), by name."""

Seen = Sequence[Detection | Rejected]
"""Views in which the board has been looked for already."""

_PIXELS = ("uint8", "uint16", "float32")
_CHANNELS = (1, 3, 4)


def images_to_work_on(inputs: Images, reporter: Reporter) -> tuple[ImageFile, ...]:
    """Find the images of files, folders and patterns; other files in the folders are counted in one warning.

    Images in memory without names are called `image_0000` and so on.

    Raises
    ------
    InputError
        If a named file or an array cannot be used, or there is no image at all.
    """
    held = _in_memory(inputs)
    if held is not None:
        return tuple(sorted((_held_image(name, pixels) for name, pixels in held), key=lambda image: image.name))
    found = find_images(as_paths(inputs))
    if found.passed_over:
        count = len(found.passed_over)
        reporter.warn(f"{count} other {'file' if count == 1 else 'files'} passed over (first: {found.passed_over[0].name}).")
    return found.images


def as_paths(inputs: Images | Seen) -> list[str | Path]:
    """Return the paths among the inputs as a list, also where there is only one.

    Raises
    ------
    InputError
        If the inputs are nothing that could be images.
    """
    if isinstance(inputs, (str, Path)):
        return [inputs]
    if not isinstance(inputs, Iterable):
        raise _no_image("images", inputs)
    return [given for given in inputs if isinstance(given, (str, Path))] if not isinstance(inputs, Mapping) else []


def views_seen(inputs: Images | Seen) -> tuple[list[Detection], list[Rejected]] | None:
    """Return the views that were detected and rejected before; None if the inputs are images.

    Raises
    ------
    InputError
        If two views have one name, or there is something else among them.
    """
    if isinstance(inputs, (str, Path, Mapping)) or not any(isinstance(given, (Detection, Rejected)) for given in inputs):
        return None
    detections = [given for given in inputs if isinstance(given, Detection)]
    rejected = [given for given in inputs if isinstance(given, Rejected)]
    if len(detections) + len(rejected) < len(inputs):
        raise InputError("images: views and something else among them (got a mixture). Pass one kind.")
    name, count = Counter([view.source for view in detections] + [view.source for view in rejected]).most_common(1)[0]
    if count > 1:
        raise InputError(f"images: {count} views of one name (got {name!r}). Give each view a name of its own.")
    return detections, rejected


def _in_memory(inputs: Images) -> list[tuple[str, Image]] | None:
    """Return the images that are in memory with their names; None if they are in files."""
    if isinstance(inputs, Mapping):
        return [(str(name), pixels) for name, pixels in inputs.items()]
    if isinstance(inputs, (str, Path)) or all(isinstance(given, (str, Path)) for given in inputs):
        return None
    _refuse_one_image(inputs)
    held = [(f"image_{index:04d}", given) for index, given in enumerate(inputs) if not isinstance(given, (str, Path))]
    for name, pixels in held:
        check_image(name, pixels)
    if len(held) < len(inputs):
        raise InputError("images: arrays and paths among them (got a mixture). Pass one kind.")
    return held


def _refuse_one_image(inputs: object) -> None:
    """Refuse an array that is one image instead of a stack of several, each row of which would pass for an image."""
    if isinstance(inputs, np.ndarray) and (inputs.ndim < 3 or (inputs.ndim == 3 and inputs.shape[2] in _CHANNELS)):
        raise InputError(
            f"images: one array (got {inputs.dtype} of shape {inputs.shape}, expected several images). "
            "Pass a list of arrays, or a dict of them by name."
        )


def check_image(name: str, pixels: object, channels: Sequence[int] = _CHANNELS) -> None:
    """Check that an array is an image.

    Parameters
    ----------
    name : str
        What it is called, for the message.
    pixels : ndarray of shape (height, width) or (height, width, channels)
    channels : sequence of int
        How many it may have.

    Raises
    ------
    InputError
        If it is none, such as what `cv2.imread` returns for a file that it cannot read.
    """
    if not isinstance(pixels, np.ndarray):
        raise _no_image(name, pixels)
    count = pixels.shape[2] if pixels.ndim == 3 else 1
    known = pixels.dtype.name in _PIXELS and pixels.dtype.isnative
    if not known or pixels.ndim not in (2, 3) or count not in channels or not pixels.size:
        raise InputError(
            f"{name}: not an image (got {pixels.dtype} of shape {pixels.shape}, expected {', '.join(_PIXELS)} of shape "
            "(height, width) or (height, width, 3), blue first)."
        )


def _no_image(name: str, got: object) -> InputError:
    """Build the error for something that is not even an array."""
    if got is None:
        return InputError(f"{name}: no image (got None); cv2.imread returns None for a file that it cannot read.")
    return InputError(f"{name}: not an image (got {type(got).__name__}, expected an array).")


def _held_image(name: str, pixels: Image) -> ImageFile:
    """Take an array for a file."""
    check_image(name, pixels)
    return ImageFile(Path(name), name, named=True, pixels=pixels)


def warn_of_each(texts_by_source: Iterable[tuple[str, str]], reporter: Reporter) -> None:
    """Pass on what is to be said of images, one line for each text, naming the first few images it holds for."""
    sources: dict[str, list[str]] = {}
    for source, text in texts_by_source:
        sources.setdefault(text, []).append(source)
    for text, named in sources.items():
        more = f" and {len(named) - _NAMED_AT_ONCE} more" if len(named) > _NAMED_AT_ONCE else ""
        reporter.warn(f"{', '.join(named[:_NAMED_AT_ONCE])}{more}: {text}")
