"""One image file in, one out: undistorted, with the depth, the channels, the coding and the metadata it had.

Images are decoded into memory that is used again and resampled where they are, because fresh memory costs more than the work
done in it.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import camcal
from camcal.errors import InputError
from camcal.formats.imaging.fidelity import coding_like, expansions, has_alpha, refuse_loss
from camcal.formats.imaging.header import MOST_PIXELS, image_size
from camcal.formats.imaging.pixels import (
    as_colours,
    channels_of,
    check_content,
    check_storable,
    decode_into,
    encode,
    lacks_grey,
)
from camcal.formats.metadata import carry_metadata
from camcal.formats.output import write_atomically
from camcal.formats.text import read_bytes
from camcal.observations import Image
from camcal.undistortion.kernels import KERNELS
from camcal.undistortion.maps import UndistortMap, undistort_image
from camcal.undistortion.sizes import advice_on_size

_memory = threading.local()


@dataclass(frozen=True, slots=True)
class ImageOptions:
    """How images are undistorted.

    Attributes
    ----------
    quality : int or None
        1 to 100, where the format loses something. None is 95, or the source's own if that is higher; a format that may
        do either (WebP) then loses nothing unless the source has lost something already.
    most_pixels : int
        Images with more are refused before they are decoded.
    interpolation, fill, gamma
        As `undistort_image` takes them; `fill` of a colour image in the order of its channels in memory (blue, green, red).
    """

    quality: int | None = None
    most_pixels: int = MOST_PIXELS
    interpolation: str = "linear"
    fill: float | Sequence[float] = 0.0
    gamma: str | float | None = None

    def __post_init__(self) -> None:
        if self.quality is not None and not 1 <= self.quality <= 100:
            raise InputError(f"--quality: out of range (got {self.quality}, expected 1 to 100).")
        if self.most_pixels < 1:
            raise InputError(f"--most-pixels: too few (got {self.most_pixels}, expected at least 1).")


def undistort_image_file(
    source: Path, target: Path, undistort: UndistortMap, options: ImageOptions | None = None
) -> tuple[str, ...]:
    """Undistort an image file into another, whole or not at all.

    Pixels are resampled as they are stored, never turned; the orientation tag goes along with all other metadata.

    Parameters
    ----------
    source : Path
        Any image file that OpenCV reads, of the size of the map's source.
    target : Path
        Its extension decides the format; its folder exists. Replaced if it exists.
    undistort : UndistortMap
    options : ImageOptions, optional

    Returns
    -------
    tuple of str
        Warnings, one clause each: what could not be carried over, and what was converted because it had to be.

    Raises
    ------
    InputError
        If the source cannot be read, is damaged, too big, of another size or of a kind that would lose something; if the
        target's format cannot hold its pixels; if the target is the source or cannot be written.
    """
    chosen = options or ImageOptions()
    refuse_same_file(source, target)
    content = useful_content(source, undistort.source.size, chosen.most_pixels)
    image, warnings = _decoded(source, content)
    warnings += _spread(image, chosen.interpolation)
    is_widened = refuse_unstorable(target, image.dtype, channels_of(image))
    result = _resampled(source, image, undistort, chosen, is_alpha=has_alpha(content))
    if is_widened:
        result = as_colours(result)
        warnings.append(f"grey: written as colour, the same value in each, because {target.suffix.lower()} has no grey")
    encoded = encode(target, result, coding_like(content, target, chosen.quality))
    complete, left_behind = carry_metadata(content, encoded, _note(undistort), source)
    write_atomically(target, complete)
    return (*warnings, *left_behind)


def useful_content(source: Path, size: tuple[int, int], most_pixels: int) -> bytes:
    """Read an image file, and refuse it if it is of no use, as far as that shows without decoding it.

    Parameters
    ----------
    source : Path
    size : tuple of int
        (width, height) that it must have.
    most_pixels : int

    Raises
    ------
    InputError
        If the file cannot be read, is damaged, too big, of another size or of a kind that would lose something.
    """
    content = read_bytes(source)
    check_content(source, content, most_pixels)
    refuse_size(source, image_size(content), size)
    refuse_loss(source, content)
    return content


def refuse_unstorable(target: Path, dtype: np.dtype[np.generic], channels: int) -> bool:
    """Refuse pixels that a target's format cannot hold; tell whether grey ones have to become colours for it.

    Raises
    ------
    InputError
        If it cannot hold them.
    """
    is_widened = channels == 1 and lacks_grey(target)
    check_storable(target, dtype, 3 if is_widened else channels)
    return is_widened


def refuse_same_file(source: Path, target: Path) -> None:
    """Refuse to replace an image by what is made of it.

    Raises
    ------
    InputError
        If both are one file, under whatever name.
    """
    try:
        same = source.resolve() == target.resolve() or (target.exists() and target.samefile(source))
    except OSError:
        same = False
    if same:
        raise InputError(f"{target}: output would replace its own input. Choose another folder or file with -o.")


def refuse_size(path: Path, size: tuple[int, int] | None, expected: tuple[int, int]) -> None:
    """Refuse an image of another size than the camera's.

    Raises
    ------
    InputError
        If the size is known and another one.
    """
    if size is not None and size != expected:
        raise InputError(
            f"{path}: not the camera's image size (got {size[0]}x{size[1]}, expected {expected[0]}x{expected[1]}). "
            f"{advice_on_size(size, expected)}"
        )


def _decoded(path: Path, content: bytes) -> tuple[Image, list[str]]:
    """Decode into this thread's memory; also say what of it is not as it was stored."""
    image, warnings = decode_into(path, content, getattr(_memory, "decoded", None))
    _memory.decoded = image
    return image, warnings + expansions(path, content)


def _spread(image: Image, interpolation: str) -> list[str]:
    """Say if pixels that are no numbers will spoil others around them: sharper kernels read many pixels for each."""
    kernel = KERNELS.get(interpolation)
    if kernel is None or not kernel.needs_floats or image.dtype != np.float32 or np.isfinite(image).all():
        return []
    return [f"NaN or infinite pixels spoil others up to {kernel.reach} px away: --interpolation linear only their neighbours"]


def _resampled(path: Path, image: Image, undistort: UndistortMap, options: ImageOptions, *, is_alpha: bool) -> Image:
    """Resample into this thread's memory."""
    height, width = image.shape[:2]
    refuse_size(path, (width, height), undistort.source.size)
    out = _buffer("resampled", (*undistort.target.size[::-1], *image.shape[2:]), image.dtype)
    return undistort_image(
        image,
        undistort,
        interpolation=options.interpolation,
        fill=options.fill,
        gamma=options.gamma,
        alpha=is_alpha,
        out=out,
    )


def _buffer(name: str, shape: tuple[int, ...], dtype: np.dtype[np.generic]) -> Image:
    """Return an array of this thread's with whatever it held before."""
    held: Image | None = getattr(_memory, name, None)
    if held is None or held.shape != shape or held.dtype != dtype:
        held = np.empty(shape, dtype)
        setattr(_memory, name, held)
    return held


def _note(undistort: UndistortMap) -> str:
    """One line on what was done, with the camera that the image now has."""
    target = undistort.target
    what = "distortion of a lens added" if target.dist.any() else "lens distortion removed"
    (fx, _, cx), (_, fy, cy) = target.K[:2].tolist()
    return f"camcal {camcal.__version__}: {what}; camera matrix fx={fx:.9g} fy={fy:.9g} cx={cx:.9g} cy={cy:.9g}"
