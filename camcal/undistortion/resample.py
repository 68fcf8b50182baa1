"""Images through maps: tile by tile, in whatever form the pixels need, with memory for a few tiles only."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import numpy.typing as npt

from camcal.errors import InputError
from camcal.undistortion.forms import DEPTHS, AsItIs, Forms, forms_for
from camcal.undistortion.kernels import KERNELS, Kernel
from camcal.undistortion.lattice import COLUMNS, ROWS
from camcal.undistortion.light import parse_curve
from camcal.undistortion.scratch import Scratch

if TYPE_CHECKING:
    from camcal.observations import Image
    from camcal.undistortion.maps import UndistortMap
    from camcal.undistortion.tiles import FloatMap, Tile


def undistort_image(
    image: Image,
    undistort: UndistortMap,
    *,
    interpolation: str = "linear",
    fill: float | Sequence[float] = 0.0,
    gamma: str | float | None = None,
    alpha: bool = True,
    out: Image | None = None,
) -> Image:
    """Resample an image through a map.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, of the source's size, with one to four channels.
    undistort : UndistortMap
    interpolation : str
        "linear"; "cubic", a spline that keeps fine detail; "lanczos", which keeps the finest, for its price.
    fill : float or sequence of float
        Value of pixels that see nothing, for all channels or for each; for three of four, the fourth is an alpha and 0.
    gamma : str or float, optional
        Average light instead of pixel values: "srgb", or the exponent of a power law. Floats have full scale 1 then.
    alpha : bool
        Whether the last of two or four channels is an alpha: colours count as much as it says.
    out : ndarray, optional
        Where to write the result: of its shape and dtype, without gaps between pixels, not the image itself.

    Returns
    -------
    ndarray
        The resampled image, of the target's size and the image's dtype and channels. A float32 NaN of the source is NaN
        wherever it is read: next to it by linear interpolation, farther around by the others.

    Raises
    ------
    InputError
        If an option is not one of the above, or `fill` is no value of such an image.
    ValueError
        If the image or `out` has another size, dtype or number of channels.
    """
    count = _channels(image, undistort.source.size)
    result = _result(image, undistort, out)
    kernel = KERNELS.get(interpolation)
    if kernel is None:
        raise InputError(f"--interpolation: unknown (got {interpolation}, expected one of {', '.join(KERNELS)}).")
    nothing = np.empty((ROWS, COLUMNS, *image.shape[2:]), image.dtype)
    nothing[...] = _fill_value(fill, image, alpha=alpha)
    curve = None if gamma is None else parse_curve(gamma)
    forms = forms_for(image.dtype, count, curve, floats=kernel.needs_floats, alpha=alpha)
    pixels, target, nothing = (a[..., 0] if a.ndim == 3 and count == 1 else a for a in (image, result, nothing))
    resampler = _Resampler(pixels, undistort, kernel, forms, nothing)
    n = undistort.samples
    for tile in undistort.tiles:
        rows, columns = (slice(a // n, (a + side) // n) for a, side in ((tile.top, tile.height), (tile.left, tile.width)))
        resampler.write(tile, target[rows, columns])
    return result


class _Resampler:
    """Resamples one image, tile by tile."""

    def __init__(self, image: Image, undistort: UndistortMap, kernel: Kernel, forms: Forms, nothing: Image) -> None:
        self.image = image
        self.undistort = undistort
        self.kernel = kernel
        self.forms = forms
        self.nothing = nothing
        self.scratch = Scratch()

    def write(self, tile: Tile, block: Image) -> None:
        """Resample a tile into its block of the result."""
        nothing = self.nothing[: block.shape[0], : block.shape[1]]
        if tile.sees_nothing:
            block[...] = nothing
            return
        undistort = self.undistort
        xy = tile.coordinates(self.scratch.array("xy", (2, tile.height, tile.width), np.float32))
        valid = None if tile.whole else tile.is_valid(xy, undistort.low_px, undistort.high_px)
        self._sample(tile, xy, block)
        if valid is not None:
            invalid = ~_whole_pixels(valid, undistort.samples)
            cv2.copyTo(nothing, invalid.view(np.uint8), dst=block)

    def _sample(self, tile: Tile, xy: FloatMap, block: Image) -> None:
        """Interpolate at the coordinates of a tile, which are used up, in the form that the pixels need."""
        # The window already has a pixel around it.
        left, top, right, bottom = _widened(tile.window, self.kernel.reach - 1, self.undistort.source.size)
        for axis, moved in enumerate((tile.window[0] - left, tile.window[1] - top)):
            if moved:
                xy[axis] += moved
        source = self.image[top:bottom, left:right]
        form = self.forms.of(source)
        prepared = form.prepare(source, self.scratch)
        if isinstance(form, AsItIs) and self.undistort.samples == 1:
            self.kernel.sample(prepared, xy, block, self.scratch)
            return
        sampled = self.scratch.array("sampled", (tile.height, tile.width, *form.channels), form.dtype)
        self.kernel.sample(prepared, xy, sampled, self.scratch)
        if self.undistort.samples > 1:
            sampled = cv2.resize(sampled, block.shape[1::-1], interpolation=cv2.INTER_AREA)
        form.restore(sampled, block, self.scratch)


def _widened(window: tuple[int, int, int, int], by: int, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Widen a window on every side, within the image."""
    left, top, right, bottom = window
    return max(left - by, 0), max(top - by, 0), min(right + by, size[0]), min(bottom + by, size[1])


def _whole_pixels(valid: npt.NDArray[np.bool_], samples: int) -> npt.NDArray[np.bool_]:
    """Tell which pixels have all their samples valid."""
    if samples == 1:
        return valid
    height, width = valid.shape
    return np.asarray(valid.reshape(height // samples, samples, width // samples, samples).all(axis=(1, 3)))


def _channels(image: Image, size: tuple[int, int]) -> int:
    """Return the number of channels of an image that must have the given size."""
    if image.ndim not in (2, 3) or image.dtype.name not in DEPTHS or not image.dtype.isnative:
        raise ValueError(f"image: not an image (got {image.dtype} of shape {image.shape}, expected {' or '.join(DEPTHS)})")
    height, width = image.shape[:2]
    if (width, height) != size:
        raise ValueError(f"image: wrong size (got {width}x{height}, expected {size[0]}x{size[1]})")
    count = 1 if image.ndim == 2 else image.shape[2]
    if not 1 <= count <= 4:
        raise ValueError(f"image: too many channels (got {count}, expected 1 to 4)")
    return count


def _result(image: Image, undistort: UndistortMap, out: Image | None) -> Image:
    """Return the array that the result goes to."""
    width, height = undistort.target.size
    shape = (height, width, *image.shape[2:])
    if out is None:
        return np.empty(shape, image.dtype)
    if out.shape != shape or out.dtype != image.dtype:
        raise ValueError(f"out: wrong shape or dtype (got {out.dtype} {out.shape}, expected {image.dtype} {shape})")
    pixel = out.strides[1:] == np.empty((1, *shape[1:]), out.dtype).strides[1:]
    if not pixel or not out.flags.writeable or np.may_share_memory(image, out):
        raise ValueError("out: cannot be written to (read-only, gaps between its pixels, or the image itself)")
    return out


def _fill_value(fill: float | Sequence[float], image: Image, *, alpha: bool) -> npt.NDArray[Any]:
    """Return the fill as one pixel value; a colour without an alpha has an alpha that says that nothing is seen."""
    wanted = np.asarray(fill, dtype=np.float64)
    channels = image.shape[2:]
    if alpha and (wanted.shape, channels) == ((3,), (4,)):
        wanted = np.append(wanted, 0.0)
    with np.errstate(invalid="ignore", over="ignore"):
        value = wanted.astype(image.dtype)
    fits = wanted.ndim == 0 or wanted.shape == channels
    if not fits or (image.dtype != np.float32 and not np.array_equal(value, wanted)):
        count = channels[0] if channels else 1
        kind = "number" if image.dtype == np.float32 else f"whole number from 0 to {np.iinfo(image.dtype).max}"
        several = f", or {count} of them" if count > 1 else ""
        got = ", ".join(f"{part:g}" for part in wanted[value != wanted].flat) if fits else f"{wanted.size} numbers"
        raise InputError(f"--fill: no value of such pixels (got {got}, expected one {kind}{several}).")
    return value
