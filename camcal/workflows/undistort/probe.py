"""How large an image or video is, read from its header before any work is done."""

from __future__ import annotations

from pathlib import Path

from camcal.formats.imaging.header import image_format, image_size, refuse_bomb
from camcal.formats.imaging.pixels import check_content
from camcal.formats.text import read_bytes, unreadable
from camcal.workflows.undistort.inputs import is_video

# Where a header is, but for one behind a large thumbnail or colour profile.
_HEAD_BYTES = 1 << 16


def size_of_source(path: Path, most_pixels: int) -> tuple[int, int] | None:
    """Read the (width, height) in pixels of an image or video from its header, and refuse what is seen to be wrong there.

    Returns
    -------
    tuple of int or None
        None where it shows only when the file is decoded.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, no image or video, or has too many pixels.
    """
    if is_video(path):
        # libav takes long to import, and images do not need it.
        from camcal.formats.video.reader import probe_video

        return probe_video(path).size
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
