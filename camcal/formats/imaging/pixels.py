"""Pixels decoded as they are stored and encoded without loss unnoticed, by OpenCV."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from camcal.errors import InputError
from camcal.formats.imaging.header import MOST_PIXELS, image_defect, image_format, refuse_bomb
from camcal.formats.imaging.kinds import damage_refused
from camcal.formats.imaging.opencv_log import quiet
from camcal.formats.text import shown
from camcal.observations import Image

PIXEL_TYPES = ("uint8", "uint16", "float32")
"""Names of the dtypes that images here may have."""

AS_STORED = cv2.IMREAD_UNCHANGED
"""Flags with which OpenCV keeps depth and channels."""

_INTEGER_TYPES = ("uint8", "uint16")
JPEG_EXTENSIONS = (".jpg", ".jpeg", ".jpe")
"""Extensions of JPEG files."""

# Pixel types and numbers of channels that a format stores as they are.
_STORES: dict[str, tuple[tuple[str, ...], tuple[int, ...]]] = {
    **dict.fromkeys(JPEG_EXTENSIONS, (("uint8",), (1, 3))),
    **dict.fromkeys((".bmp", ".dib"), (("uint8",), (1, 3, 4))),
    ".png": (_INTEGER_TYPES, (1, 3, 4)),
    ".webp": (("uint8",), (3, 4)),
    ".jp2": (_INTEGER_TYPES, (1, 3)),
    **dict.fromkeys((".tif", ".tiff"), (PIXEL_TYPES, (1, 3, 4))),
    ".pgm": (_INTEGER_TYPES, (1,)),
    ".ppm": (_INTEGER_TYPES, (3,)),
    ".pfm": (("float32",), (1, 3)),
}
WRITTEN_EXTENSIONS = tuple(_STORES)
"""Extensions of the formats that are written."""

_LOSSLESS_WEBP = 101
_SAMPLINGS = {
    (1, 1): cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444,
    (2, 1): cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422,
    (2, 2): cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420,
    (1, 2): cv2.IMWRITE_JPEG_SAMPLING_FACTOR_440,
    (4, 1): cv2.IMWRITE_JPEG_SAMPLING_FACTOR_411,
}
# Formats that are decoded straight from the file into memory that is used again.
_READ_IN_PLACE = frozenset({"png", "bmp", "netpbm", "webp"})
# What no picture is likely to begin with.
_MARK = np.array([85, 170, 17, 204, 51, 238, 102, 153])


@dataclass(frozen=True, slots=True)
class Coding:
    """How pixels are encoded where a format leaves a choice.

    Attributes
    ----------
    quality : int or None
        1 to 100, for formats that lose something; None is 95 for JPEG, and WebP without loss.
    subsampling : tuple of int
        Pixels per sample of chrominance along x and y, for JPEG.
    progressive : bool
        Whether a JPEG comes in scans that grow finer and finer.
    tiff_compression : int or None
        TIFF's number of a compression without loss; None leaves it to OpenCV (LZW).
    """

    quality: int | None = None
    subsampling: tuple[int, int] = (1, 1)
    progressive: bool = False
    tiff_compression: int | None = None


_COMMON = Coding(subsampling=(2, 2))


def decode(path: str | Path, content: bytes, flags: int, most_pixels: int = MOST_PIXELS) -> Image:
    """Decode the content of an image file.

    From memory OpenCV refuses a truncated file, which from a disk it would fill up with grey.

    Parameters
    ----------
    path : str or Path
        What to call it.
    content : bytes
    flags : int
        OpenCV's.
    most_pixels : int
        Refuse more before they are decoded.

    Raises
    ------
    InputError
        If the file is truncated, damaged, too big or no image, or has pixels of an unsupported kind.
    """
    check_content(path, content, most_pixels)
    return _checked(path, content, _decoded(path, content, flags))


def decode_into(path: Path, content: bytes, buffer: Image | None) -> tuple[Image, list[str]]:
    """Decode an image file as it is stored, into a buffer if it suits, which takes half the time where memory is fresh.

    Parameters
    ----------
    path : Path
    content : bytes
        Of that file, checked by `check_content`.
    buffer : ndarray or None
        What an earlier call returned; overwritten if the image has its size and kind.

    Returns
    -------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, BGR order.
    warnings : list of str
        What is odd about the file.

    Raises
    ------
    InputError
        As `decode` does; also for a JPEG that is damaged in the middle.
    """
    kind = image_format(content)
    if kind == "jpeg":
        from camcal.formats.imaging.jpeg_pixels import decode_jpeg

        return decode_jpeg(path, content, buffer)
    image = _read_in_place(path, buffer) if kind in _READ_IN_PLACE else None
    if image is None:
        image = _decoded(path, content, AS_STORED)
    image = _checked(path, content, image)
    if kind == "png":
        from camcal.formats.imaging.png import with_transparent_grey

        image = with_transparent_grey(content, image)
    return image, []


def _read_in_place(path: Path, buffer: Image | None) -> Image | None:
    """Read straight from the file; None if it cannot be, or the buffer does not suit."""
    if not str(path).isascii():
        # Not every system lets OpenCV open such a name.
        return None
    try:
        with quiet():
            return cv2.imread(str(path), AS_STORED) if buffer is None else _read_over(path, buffer)
    except cv2.error:
        return None


def _read_over(path: Path, buffer: Image) -> Image | None:
    """Read into a buffer; None if that fails, or cannot be told from failing.

    Of a file whose header it cannot read, OpenCV returns the buffer as it was: with the picture before.
    """
    corner = buffer.reshape(-1)[: _MARK.size]
    corner[:] = mark = _MARK[: corner.size].astype(buffer.dtype)
    image: Image | None = cv2.imread(str(path), buffer, AS_STORED)
    return None if image is buffer and np.array_equal(corner, mark) else image


def check_content(path: str | Path, content: bytes, most_pixels: int = MOST_PIXELS) -> None:
    """Refuse what is seen to be wrong without decoding: no image, damaged, truncated, too many pixels."""
    if image_format(content) is None:
        raise InputError(f"{path}: not an image (its first bytes are {shown(content[:8])}). Convert it to PNG or JPEG.")
    with damage_refused(path):
        defect = image_defect(content)
    if defect:
        raise InputError(f"{path}: {defect}. Copy it again.")
    refuse_bomb(path, content, most_pixels)


def check_storable(path: str | Path, dtype: np.dtype[np.generic], channels: int) -> None:
    """Refuse a file whose format cannot hold such pixels as they are.

    Raises
    ------
    InputError
        If so, or the format is not one that is written; names those that do.
    """
    extension = Path(path).suffix.lower()
    if extension not in _STORES:
        raise InputError(
            f"{path}: not a format to write (got '{extension}', expected one of {', '.join(_STORES)}). Choose one."
        )
    types, counts = _STORES[extension]
    if dtype.name in types and channels in counts:
        return
    fitting = [other for other in (".png", ".tiff") if dtype.name in _STORES[other][0] and channels in _STORES[other][1]]
    expected = f"{' or '.join(types)} with {' or '.join(map(str, counts))} channel{'' if counts == (1,) else 's'}"
    advice = f"Write {' or '.join(fitting)} instead." if fitting else "Convert the pixels first."
    raise InputError(
        f"{path}: pixels that {extension} cannot hold (got {dtype.name} with {channels}, expected {expected}). {advice}"
    )


def channels_of(image: Image) -> int:
    """Return the number of channels."""
    return 1 if image.ndim == 2 else int(image.shape[2])


def lacks_grey(path: str | Path) -> bool:
    """Tell whether a file's format is one that is written and holds colours only."""
    _, counts = _STORES.get(Path(path).suffix.lower(), ((), (1,)))
    return 1 not in counts


def as_colours(grey: Image) -> Image:
    """Return the same value in each of three colours."""
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


def encode(path: str | Path, image: Image, coding: Coding | None = None) -> bytes:
    """Encode an image in the format that a file's extension names.

    Parameters
    ----------
    path : str or Path
    image : ndarray of shape (height, width) or (height, width, channels)
        BGR order.
    coding : Coding, optional
        How; by default JPEG at quality 95 with chrominance of half the width and height, and anything else without loss.

    Raises
    ------
    InputError
        If the format cannot hold such pixels as they are, or that many.
    """
    extension = Path(path).suffix.lower()
    check_storable(path, image.dtype, channels_of(image))
    try:
        with quiet():
            done, encoded = cv2.imencode(extension, image, _options(extension, coding or _COMMON))
    except cv2.error:
        done = False
    if not done:
        raise InputError(f"{path}: cannot be encoded (got {image.shape[1]}x{image.shape[0]} pixels). Choose another format.")
    return encoded.tobytes()


def _options(extension: str, coding: Coding) -> list[int]:
    """OpenCV's options for encoding."""
    if extension in JPEG_EXTENSIONS:
        sampling = _SAMPLINGS.get(coding.subsampling, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)
        quality = [] if coding.quality is None else [cv2.IMWRITE_JPEG_QUALITY, coding.quality]
        progressive = [cv2.IMWRITE_JPEG_PROGRESSIVE, 1] if coding.progressive else []
        return [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, sampling, *quality, *progressive]
    if extension == ".webp":
        return [cv2.IMWRITE_WEBP_QUALITY, _LOSSLESS_WEBP if coding.quality is None else coding.quality]
    if extension == ".jp2":
        return [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]
    if extension in {".tif", ".tiff"} and coding.tiff_compression is not None:
        return [cv2.IMWRITE_TIFF_COMPRESSION, coding.tiff_compression]
    return []


def _decoded(path: str | Path, content: bytes, flags: int) -> Image | None:
    """Decode from memory."""
    if image_format(content) == "tiff":
        from camcal.formats.imaging.tiff import unturned_tiff

        with damage_refused(path):
            content = unturned_tiff(content, as_stored=flags == AS_STORED)
    try:
        with quiet():
            return cv2.imdecode(np.frombuffer(content, dtype=np.uint8), flags)
    except cv2.error as error:
        raise InputError(f"{path}: cannot be decoded ({' '.join(str(error.err).split())}). Convert or copy it again.") from None


def _checked(path: str | Path, content: bytes, image: Image | None) -> Image:
    """Refuse what could not be decoded and pixels that nothing here computes with."""
    if image is None:
        raise InputError(f"{path}: truncated or damaged image ({len(content)} bytes). Copy it again.")
    if image.dtype.name not in PIXEL_TYPES:
        raise InputError(
            f"{path}: unsupported pixels (got {image.dtype.name}, expected {' or '.join(PIXEL_TYPES)}). Convert it."
        )
    return image
