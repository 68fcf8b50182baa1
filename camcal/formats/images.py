"""Images found, read as the sensor gave them (no EXIF rotation, depth kept), and written without loss unnoticed."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2

from camcal.errors import InputError
from camcal.formats.imaging.header import MOST_PIXELS
from camcal.formats.imaging.pixels import AS_STORED, check_content, decode, encode
from camcal.formats.output import write_atomically
from camcal.formats.text import read_bytes, unreadable
from camcal.observations import Image

EXTENSIONS = frozenset(
    f".{name}"
    for name in (
        *("png", "jpg", "jpeg", "jpe", "tif", "tiff", "bmp", "dib", "webp", "avif", "gif", "jp2"),
        *("pgm", "ppm", "pbm", "pnm", "pam", "pfm", "sr", "ras", "hdr", "pic"),
    )
)
"""Extensions, in lower case, of the image files that OpenCV's wheel reads."""

_GREY_FLAGS = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True)
class ImageFile:
    """An image to be read.

    Attributes
    ----------
    path : Path
    name : str
        What tells it from all others of the run: its file name, or its path below the folder common to all where two have
        the same file name; always with forward slashes.
    named : bool
        Whether the user named this very file, so that it must be readable; else it was found in a folder or by a pattern.
    pixels : ndarray, optional
        The image itself, if it is in memory and not in a file.
    """

    path: Path
    name: str
    named: bool
    pixels: Image | None = field(default=None, repr=False, compare=False)

    def gray(self) -> Image:
        """Return the image as `read_gray` does.

        Raises
        ------
        InputError
            If it is in a file that cannot be used.
        """
        return read_gray(self.path) if self.pixels is None else _one_channel(self.pixels)


@dataclass(frozen=True, slots=True)
class FoundImages:
    """What `find_images` found.

    Attributes
    ----------
    images : tuple of ImageFile
        Sorted by name, each file once.
    passed_over : tuple of Path
        Other files in the folders, sorted.
    """

    images: tuple[ImageFile, ...]
    passed_over: tuple[Path, ...]


def find_images(inputs: Sequence[str | Path]) -> FoundImages:
    """Find the images that the user asks for.

    Parameters
    ----------
    inputs : sequence of str or Path
        Files, which must be images; folders, whose other files and folders are passed over; and patterns such as `img_*.png`.

    Raises
    ------
    InputError
        If a named file is missing, unreadable or no image, or an input yields no image.
    """
    paths: dict[str, tuple[Path, bool]] = {}
    others: set[Path] = set()
    for given in inputs:
        for path, named in _expand(given):
            if not named and not _looks_like_image(path):
                others.add(path)
                continue
            # The same file may be reached twice; once named, it is named.
            key = os.path.realpath(path)
            first, was_named = paths.get(key, (path, False))
            paths[key] = (first, named or was_named)
    if not paths:
        raise InputError("images: none given. Name image files or a folder that holds some.")
    names = _names([path for path, _ in paths.values()])
    images = [ImageFile(path, name, named) for (path, named), name in zip(paths.values(), names, strict=True)]
    return FoundImages(tuple(sorted(images, key=lambda image: image.name)), tuple(sorted(others)))


def read_image(path: str | Path, most_pixels: int = MOST_PIXELS) -> Image:
    """Read an image as it is stored: no EXIF rotation, depth and channels kept (BGR order).

    Parameters
    ----------
    path : str or Path
    most_pixels : int
        Refuse a bigger image before it is decoded.

    Returns
    -------
    ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32.

    Raises
    ------
    InputError
        If the file is missing, empty, truncated, damaged, no image, too big, or has another kind of pixels.
    """
    return decode(path, read_bytes(path), AS_STORED, most_pixels)


def read_gray(path: str | Path, most_pixels: int = MOST_PIXELS) -> Image:
    """Read an image as one channel: no EXIF rotation, depth kept.

    Parameters
    ----------
    path : str or Path
    most_pixels : int
        Refuse a bigger image before it is decoded.

    Returns
    -------
    ndarray of shape (height, width)
        uint8, uint16 or float32.

    Raises
    ------
    InputError
        As `read_image` does.
    """
    content = read_bytes(path)
    try:
        return decode(path, content, _GREY_FLAGS, most_pixels)
    except InputError:
        # OpenCV does not turn every kind of pixels grey while it decodes.
        image = decode(path, content, AS_STORED, most_pixels)
    return _one_channel(image)


def _one_channel(image: Image) -> Image:
    """Turn colours, in the order BGR, grey."""
    if image.ndim == 2:
        return image
    if image.shape[2] == 1:
        return image[..., 0]
    return cv2.cvtColor(image, cv2.COLOR_BGRA2GRAY if image.shape[2] == 4 else cv2.COLOR_BGR2GRAY)


def write_image(path: str | Path, image: Image) -> None:
    """Write an image, whole or not at all.

    Parameters
    ----------
    path : str or Path
        Its extension decides the format.
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, BGR order.

    Raises
    ------
    InputError
        If the format is not known or cannot hold such pixels as they are, or the file cannot be written.
    """
    write_atomically(path, encode(path, image))


def _expand(given: str | Path) -> list[tuple[Path, bool]]:
    """Every file that one input stands for, and whether it was named."""
    path = Path(given)
    try:
        if path.is_dir():
            files = [entry for entry in sorted(path.iterdir()) if entry.is_file()]
            if not any(map(_looks_like_image, files)):
                raise InputError(f"{path}: no images in this folder ({_hint(path, files)}). Name a folder that holds some.")
            return [(file, False) for file in files]
        if not path.exists() and glob.has_magic(str(given)):
            matches = map(Path, sorted(glob.glob(str(given), recursive=True)))  # noqa: PTH207 - may be absolute
            files = [match for match in matches if match.is_file()]
            if not any(map(_looks_like_image, files)):
                raise InputError(f"{given}: no image matches this pattern ({len(files)} other files do). Check the pattern.")
            return [(file, False) for file in files]
        _check_named(path)
    except OSError as error:
        raise unreadable(path, error) from None
    return [(path, True)]


def _check_named(path: Path) -> None:
    """Refuse a named file that is missing, empty or no image, before any work is done."""
    if path.exists() and path.suffix.lower() not in EXTENSIONS:
        raise InputError(f"{path}: not an image (got '{path.suffix}', expected an extension such as .png, .jpg or .tif)")
    check_content(path, read_bytes(path))


def _looks_like_image(path: Path) -> bool:
    """Whether a file in a folder counts as an image; hidden files are other programs' (thumbnails, resource forks)."""
    return path.suffix.lower() in EXTENSIONS and not path.name.startswith(".")


def _names(paths: Sequence[Path]) -> list[str]:
    """File names, or paths below the common folder where two files have the same name."""
    if len({path.name for path in paths}) == len(paths):
        found = [path.name for path in paths]
    else:
        absolute = [os.path.abspath(path) for path in paths]  # noqa: PTH100 - lexical: links stay as the user named them
        common = os.path.commonpath([os.path.dirname(path) for path in absolute])  # noqa: PTH120
        found = [Path(os.path.relpath(path, common)).as_posix() for path in absolute]
    return [_one_line(name) for name in found]


def _one_line(name: str) -> str:
    """A name that text files can hold: bytes that are not UTF-8 and control characters are written as escapes."""
    text = os.fsencode(name).decode("utf-8", "backslashreplace")
    return "".join(character if character.isprintable() else repr(character)[1:-1] for character in text)


def _hint(folder: Path, files: Sequence[Path]) -> str:
    """What a folder without images holds instead."""
    below = sorted({entry.parent.name for entry in folder.glob("*/*") if _looks_like_image(entry)})
    if below:
        return f"but there are some in {below[0]}/"
    counts = Counter(file.suffix.lower() or "no extension" for file in files)
    return ", ".join(f"{count} of {kind}" for kind, count in counts.most_common(3)) or "it is empty"
