"""Images found, read as the sensor gave them (no EXIF rotation, depth kept), and written without loss unnoticed."""

from __future__ import annotations

import glob
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from camcal.errors import InputError
from camcal.formats.image_bytes import has_image_signature, image_defect, without_tiff_orientation
from camcal.formats.output import write_atomically
from camcal.formats.text import read_bytes, shown, unreadable
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
_PIXEL_TYPES = ("uint8", "uint16", "float32")
# Pixel types and numbers of channels that a format stores as they are.
_INTEGER_TYPES = ("uint8", "uint16")
_STORES: dict[str, tuple[tuple[str, ...], tuple[int, ...]]] = {
    **dict.fromkeys((".jpg", ".jpeg", ".jpe"), (("uint8",), (1, 3))),
    **dict.fromkeys((".bmp", ".dib"), (("uint8",), (1, 3, 4))),
    ".png": (_INTEGER_TYPES, (1, 3, 4)),
    ".webp": (("uint8",), (3, 4)),
    ".jp2": (_INTEGER_TYPES, (1, 3)),
    **dict.fromkeys((".tif", ".tiff"), (_PIXEL_TYPES, (1, 3, 4))),
    ".pgm": (_INTEGER_TYPES, (1,)),
    ".ppm": (_INTEGER_TYPES, (3,)),
    ".pfm": (("float32",), (1, 3)),
}


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
    """

    path: Path
    name: str
    named: bool


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


def read_image(path: str | Path) -> Image:
    """Read an image as it is stored: no EXIF rotation, depth and channels kept (BGR order).

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32.

    Raises
    ------
    InputError
        If the file is missing, empty, truncated, damaged, no image, or has another kind of pixels.
    """
    return _checked(path, _decode(path, read_bytes(path), cv2.IMREAD_UNCHANGED))


def read_gray(path: str | Path) -> Image:
    """Read an image as one channel: no EXIF rotation, depth kept.

    Parameters
    ----------
    path : str or Path

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
        return _checked(path, _decode(path, content, _GREY_FLAGS))
    except InputError:
        # OpenCV does not turn every kind of pixels grey while it decodes.
        image = _checked(path, _decode(path, content, cv2.IMREAD_UNCHANGED))
    if image.ndim == 2:
        return image
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
    extension = Path(path).suffix.lower()
    if extension not in _STORES:
        raise InputError(f"{path}: not a format to write (got '{extension}', expected one of {', '.join(_STORES)})")
    channels = 1 if image.ndim == 2 else image.shape[2]
    types, counts = _STORES[extension]
    if image.dtype.name not in types or channels not in counts:
        expected = f"{' or '.join(types)} with {' or '.join(map(str, counts))} channels"
        got = f"{image.dtype.name} with {channels}"
        raise InputError(f"{path}: pixels that {extension} cannot hold (got {got}, expected {expected}). Write .tiff instead.")
    with _quiet():
        done, encoded = cv2.imencode(extension, image)
    if not done:
        raise InputError(f"{path}: cannot be encoded (got {image.shape[1]}x{image.shape[0]} pixels). Choose another format.")
    write_atomically(path, encoded.tobytes())


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
    content = read_bytes(path)
    if not has_image_signature(content):
        raise _not_an_image(path, content)
    _refuse_defect(path, content)


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


def _decode(path: str | Path, content: bytes, flags: int) -> Image | None:
    """Decode an encoded image; from memory OpenCV refuses a truncated one, which from a file it would fill up with grey."""
    _refuse_defect(path, content)
    try:
        with _quiet():
            return cv2.imdecode(np.frombuffer(without_tiff_orientation(content), dtype=np.uint8), flags)
    except cv2.error as error:
        raise InputError(f"{path}: cannot be decoded ({' '.join(str(error.err).split())}). Convert or copy it again.") from None


def _checked(path: str | Path, image: Image | None) -> Image:
    """Refuse what could not be decoded and pixels that nothing here computes with."""
    if image is None:
        content = read_bytes(path)
        if not has_image_signature(content):
            raise _not_an_image(path, content)
        raise InputError(f"{path}: truncated or damaged image ({len(content)} bytes). Copy it again.")
    if image.dtype.name not in _PIXEL_TYPES:
        raise InputError(
            f"{path}: unsupported pixels (got {image.dtype.name}, expected {' or '.join(_PIXEL_TYPES)}). Convert it."
        )
    return image


def _refuse_defect(path: str | Path, content: bytes) -> None:
    """Raise for what is seen to be wrong without decoding."""
    defect = image_defect(content)
    if defect:
        raise InputError(f"{path}: {defect}. Copy it again.")


def _not_an_image(path: str | Path, content: bytes) -> InputError:
    return InputError(f"{path}: not an image (its first bytes are {shown(content[:8])}). Convert it to PNG or JPEG.")


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep OpenCV from logging what is raised as an error anyway."""
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)
