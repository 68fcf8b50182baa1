"""Maps for other programs: where each pixel of an image looks in another, as cv2.remap takes it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt

from camcal.errors import InputError
from camcal.formats.imaging.tiff_tags import LONG, SHORT, Directory, Tag, directory_bytes, text_tag
from camcal.formats.output import write_atomically

FloatMap = npt.NDArray[np.float32]

_LARGEST_TIFF_BYTES = 2**32 - 2**16
_HEADER_BYTES = 8
_FLOAT_FORMAT, _BLACK_IS_ZERO, _UNSPECIFIED = 3, 1, 0


def save_maps_npz(path: str | Path, map_x: FloatMap, map_y: FloatMap) -> None:
    """Write maps for numpy.

    Parameters
    ----------
    path : str or Path
    map_x, map_y : ndarray of shape (height, width)
        float32 source coordinates in pixels.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    stream = io.BytesIO()
    np.savez(stream, map_x=map_x, map_y=map_y)
    write_atomically(path, stream.getvalue())


def save_maps_tiff(path: str | Path, map_x: FloatMap, map_y: FloatMap) -> None:
    """Write maps as an uncompressed TIFF with two float32 channels, x and y.

    Parameters
    ----------
    path : str or Path
    map_x, map_y : ndarray of shape (height, width)
        float32 source coordinates in pixels.

    Raises
    ------
    InputError
        If the file cannot be written, or the maps are too large for a TIFF.
    """
    height, width = map_x.shape
    pixels = np.stack([map_x, map_y], axis=-1).astype("<f4", copy=False)
    if pixels.nbytes > _LARGEST_TIFF_BYTES:
        raise InputError(f"{path}: too large for a TIFF (got {width}x{height} pixels). Use maps.npz.")
    # How long the directory is does not depend on where the pixels are.
    start = _HEADER_BYTES + len(directory_bytes(_directory(width, height, 0), _HEADER_BYTES))
    directory = directory_bytes(_directory(width, height, start), _HEADER_BYTES)
    write_atomically(path, b"".join([b"II*\0", _long(_HEADER_BYTES), directory, pixels.tobytes()]))


def _directory(width: int, height: int, start: int) -> Directory:
    """Tags of two float32 channels in one strip from byte `start` on (TIFF 6.0, sections 8 and 18 to 19)."""
    tags = [
        Tag(256, LONG, _long(width)),
        Tag(257, LONG, _long(height)),
        Tag(258, SHORT, _short(32) * 2),
        Tag(259, SHORT, _short(1)),
        Tag(262, SHORT, _short(_BLACK_IS_ZERO)),
        text_tag(270, "x and y in the source, pixels; the centre of its top-left pixel is (0, 0)"),
        Tag(273, LONG, _long(start)),
        Tag(277, SHORT, _short(2)),
        Tag(278, LONG, _long(height)),
        Tag(279, LONG, _long(width * height * 8)),
        Tag(284, SHORT, _short(1)),
        Tag(338, SHORT, _short(_UNSPECIFIED)),
        Tag(339, SHORT, _short(_FLOAT_FORMAT) * 2),
    ]
    return Directory({tag.code: tag for tag in tags})


def _long(value: int) -> bytes:
    return value.to_bytes(4, "little")


def _short(value: int) -> bytes:
    return value.to_bytes(2, "little")
