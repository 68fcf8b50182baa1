"""How large an image or video is, read from its header before any work is done."""

from __future__ import annotations

from pathlib import Path

from camcal.formats.imaging.size import size_of_image
from camcal.workflows.undistort.inputs import is_video


def size_of_source(path: Path, most_pixels: int, *, as_progressive: bool = True) -> tuple[int, int] | None:
    """Read the (width, height) in pixels of an image or video from its header, and refuse what is seen to be wrong there.

    Parameters
    ----------
    path : Path
    most_pixels : int
        That an image may have.
    as_progressive : bool
        Whether a video may be marked as interlaced.

    Returns
    -------
    tuple of int or None
        None where it shows only when the file is decoded.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, no image or video, has too many pixels, or is interlaced and must not be.
    """
    if is_video(path):
        # libav takes long to import, and images do not need it.
        from camcal.formats.video.reader import probe_video

        return probe_video(path, as_progressive=as_progressive).size
    return size_of_image(path, most_pixels)
