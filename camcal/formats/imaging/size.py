"""How large an image file's picture is, from its header, without reading the rest where that is enough."""

from __future__ import annotations

from pathlib import Path

from camcal.formats.imaging.header import image_format, image_size, refuse_bomb
from camcal.formats.imaging.pixels import check_content
from camcal.formats.text import read_bytes, unreadable

# Where a header is, but for one behind a large thumbnail or colour profile.
_HEAD_BYTES = 1 << 16


def size_of_image(path: Path, most_pixels: int) -> tuple[int, int] | None:
    """Read the (width, height) in pixels of an image file, and refuse what is seen to be wrong in its header.

    Returns
    -------
    tuple of int or None
        None where it shows only when the file is decoded.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, no image, or has too many pixels.
    """
    try:
        whole = not path.is_file() or path.stat().st_size <= _HEAD_BYTES
        head = b"" if whole else _head(path)
    except OSError as error:
        raise unreadable(path, error) from None
    if whole or image_format(head) is None:
        content = read_bytes(path)
        check_content(path, content, most_pixels)
        return image_size(content)
    refuse_bomb(path, head, most_pixels)
    # A TIFF may say everything at its end.
    return image_size(head) or image_size(read_bytes(path))


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD_BYTES)
