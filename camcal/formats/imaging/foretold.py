"""What pixels an image will have once it is decoded, as far as its header tells."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from camcal.formats.imaging.kinds import SURPRISES, image_format

_GREY, _COLOUR, _ALPHA = 1, 3, 4
_HEADER_BYTES = 4096
_FULL_OF_BYTE = 255
_BYTE_BITS, _WORD_BITS = 8, 16
_FLOAT_SAMPLES = 3
_TIFF_GREYS, _TIFF_COLOURS = {0, 1}, {2}


def foretold_pixels(content: bytes) -> tuple[np.dtype[np.generic], int] | None:
    """Tell the dtype and the number of channels that an image is decoded to.

    Parameters
    ----------
    content : bytes
        Of a file that has no defect, and no obstacle to being changed without loss.

    Returns
    -------
    tuple of dtype and int
        None where it shows only when the file is decoded.
    """
    known = {"jpeg": _of_jpeg, "png": _of_png, "tiff": _of_tiff, "netpbm": _of_netpbm}
    tell = known.get(image_format(content) or "")
    try:
        found = tell(content) if tell else None
    except SURPRISES:
        return None
    return None if found is None else (np.dtype(found[0]), found[1])


def _of_jpeg(content: bytes) -> tuple[npt.DTypeLike, int] | None:
    from camcal.formats.imaging.jpeg_header import jpeg_header

    header = jpeg_header(content)
    return (np.uint8, _GREY if header.colour == "grey" else _COLOUR) if header and header.bits == _BYTE_BITS else None


def _of_png(content: bytes) -> tuple[npt.DTypeLike, int] | None:
    from camcal.formats.imaging.png import png_header

    header = png_header(content)
    # A transparent value turns into an alpha channel; it stands before the pixels.
    is_transparent = b"tRNS" in content[: content.find(b"IDAT")]
    channels = {0: _GREY, 2: _COLOUR, 3: _COLOUR}.get(header.colour, _ALPHA)
    return np.uint16 if header.bits == _WORD_BITS else np.uint8, _ALPHA if is_transparent else channels


def _of_tiff(content: bytes) -> tuple[npt.DTypeLike, int] | None:
    from camcal.formats.imaging.tiff import tiff_layout

    layout = tiff_layout(content)
    if layout is None:
        return None
    if layout.photometric not in _TIFF_GREYS | _TIFF_COLOURS:
        # A palette, or luminance and chrominance.
        return (np.uint8, _COLOUR) if layout.bits <= _BYTE_BITS else None
    whole = np.uint16 if layout.bits == _WORD_BITS else np.uint8
    return np.float32 if layout.sample_format == _FLOAT_SAMPLES else whole, layout.channels


def _of_netpbm(content: bytes) -> tuple[npt.DTypeLike, int] | None:
    plain = re.sub(rb"#[^\n]*", b"", content[:_HEADER_BYTES])
    found = re.match(rb"P([2356])\s+\d+\s+\d+\s+(\d+)\s", plain)
    if found is None:
        return None
    return np.uint8 if int(found[2]) <= _FULL_OF_BYTE else np.uint16, _GREY if found[1] in b"25" else _COLOUR
