"""The pixels of JPEGs, decoded by libjpeg-turbo (by way of `simplejpeg`) into memory that is used again, its warnings heard."""

from __future__ import annotations

import numpy as np

from camcal.errors import InputError
from camcal.formats.imaging.jpeg_header import jpeg_header
from camcal.observations import Image

# Cameras pad, and so decoders take it lightly; but where bits were lost, this may be all that tells.
_HARMLESS = "extraneous bytes before marker 0xd9"


def decode_jpeg(path: object, content: bytes, buffer: Image | None = None) -> tuple[Image, list[str]]:
    """Decode a JPEG.

    Parameters
    ----------
    path : object
        What to call it.
    content : bytes
        Not CMYK.
    buffer : ndarray, optional
        What an earlier call returned; overwritten if it suits.

    Returns
    -------
    image : ndarray of shape (height, width) or (height, width, 3)
        uint8; BGR order.
    warnings : list of str
        What is odd about the file.

    Raises
    ------
    InputError
        If it is damaged, or coded in a way that libjpeg-turbo cannot read.
    """
    import simplejpeg  # type: ignore[import-untyped]

    header = jpeg_header(content)
    if header is None:
        raise InputError(f"{path}: truncated or damaged image (no frame header). Copy it again.")
    grey = header.colour == "grey"
    shape = header.size[::-1] if grey else (*header.size[::-1], 3)
    if buffer is None or buffer.shape != shape or buffer.dtype != np.uint8:
        buffer = np.empty(shape, np.uint8)
    warnings = []
    try:
        simplejpeg.decode_jpeg(content, "GRAY" if grey else "BGR", buffer=buffer, strict=True)
    except ValueError as error:
        if _HARMLESS not in str(error):
            raise InputError(f"{path}: truncated or damaged image ({error}). Copy it again.") from None
        warnings.append(f"perhaps damaged: look at it ({error})")
    return buffer, warnings
