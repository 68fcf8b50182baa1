"""Working forms: how pixels stand in memory while they are resampled, and the way there and back.

Gray and four channels are resampled as they are. Two and three become four, which OpenCV resamples faster, and exactly
where it rounds the weights of two; splines need float32; linear light and colours under a varying alpha are averaged as
what they stand for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import cv2
import numpy as np

from camcal.undistortion.light import Curve, Floats
from camcal.undistortion.scratch import Scratch

if TYPE_CHECKING:
    from camcal.observations import Image

DEPTHS = {"uint8": cv2.CV_8U, "uint16": cv2.CV_16U, "float32": cv2.CV_32F}
"""OpenCV's name of each dtype that can be resampled."""

# Below this share of full scale alpha is rounding, and the colour under it nothing.
_NO_ALPHA = np.float32(1e-6)


class Form(Protocol):
    """A way to hold pixels while they are resampled."""

    @property
    def dtype(self) -> np.dtype[Any]:
        """Dtype of the pixels."""
        ...

    @property
    def channels(self) -> tuple[int, ...]:
        """Shape of one pixel: () for gray, else (channels,)."""
        ...

    def prepare(self, source: Image, scratch: Scratch) -> Image:
        """Bring a piece of an image into this form."""
        ...

    def restore(self, resampled: Image, out: Image, scratch: Scratch) -> None:
        """Write what was resampled into the result; `resampled` is used up."""
        ...


@dataclass(frozen=True, slots=True)
class AsItIs:
    """Pixels as they are."""

    dtype: np.dtype[Any]
    channels: tuple[int, ...]

    def prepare(self, source: Image, _scratch: Scratch) -> Image:
        """Return the piece."""
        return source

    def restore(self, resampled: Image, out: Image, _scratch: Scratch) -> None:
        """Copy the pixels."""
        out[...] = resampled


@dataclass(frozen=True, slots=True)
class InFour:
    """Two or three channels, and idle ones to make four.

    Attributes
    ----------
    dtype : dtype
    count : int
        Channels of the image, 2 or 3.
    """

    dtype: np.dtype[Any]
    count: int

    @property
    def channels(self) -> tuple[int, ...]:
        """Shape of one pixel."""
        return (4,)

    def prepare(self, source: Image, scratch: Scratch) -> Image:
        """Add the idle channels."""
        four = scratch.array("four", (*source.shape[:2], 4), self.dtype)
        if self.count == 3:
            return cv2.cvtColor(source, cv2.COLOR_BGR2BGRA, dst=four)
        four[..., :2] = source
        four[..., 2:] = 0
        return four

    def restore(self, resampled: Image, out: Image, _scratch: Scratch) -> None:
        """Leave the idle channels out."""
        if self.count == 3:
            cv2.cvtColor(resampled, cv2.COLOR_BGRA2BGR, dst=out)
        else:
            out[...] = resampled[..., :2]


@dataclass(frozen=True, slots=True)
class AsFloats:
    """Pixels as float32, more channels than one as four; as light if a curve is given, colours times alpha if asked for.

    Attributes
    ----------
    depth : dtype
        Of the image.
    count : int
        Channels of the image.
    curve : Curve or None
    alpha : bool
        Whether the last channel is an alpha, which has no curve.
    premultiplied : bool
        Whether colours are multiplied by it.
    """

    depth: np.dtype[Any]
    count: int
    curve: Curve | None
    alpha: bool
    premultiplied: bool = False

    @property
    def dtype(self) -> np.dtype[Any]:
        """float32."""
        return np.dtype(np.float32)

    @property
    def channels(self) -> tuple[int, ...]:
        """Shape of one pixel."""
        return () if self.count == 1 else (4,)

    @property
    def _full(self) -> np.float32:
        """Full scale of the image."""
        return np.float32(1 if self.depth == np.float32 else np.iinfo(self.depth).max)

    def prepare(self, source: Image, scratch: Scratch) -> Floats:
        """Convert a piece."""
        values = source if self.curve is None else self.curve.light(source)
        floats = scratch.array("floats", (*source.shape[:2], *self.channels), np.float32)
        if self.count == 3:
            cv2.cvtColor(values.astype(np.float32, copy=False), cv2.COLOR_BGR2BGRA, dst=floats)
        elif self.count == 2:
            floats[..., 0], floats[..., 1:3], floats[..., 3] = values[..., 0], 0, values[..., 1]
        else:
            np.copyto(floats, values)
        if self.curve is not None and self.alpha:
            np.divide(source[..., -1], self._full, out=floats[..., -1])
        if self.premultiplied:
            _scale_colours(floats, cv2.extractChannel(floats, 3) / self._scale)
        return floats

    def restore(self, resampled: Floats, out: Image, _scratch: Scratch) -> None:
        """Convert back, rounded and saturated."""
        if self.premultiplied:
            share = cv2.extractChannel(resampled, 3) / self._scale
            _scale_colours(resampled, np.where(share > _NO_ALPHA, 1 / np.maximum(share, _NO_ALPHA), np.float32(0)))
        if self.curve is not None:
            opacity = resampled[..., -1] * self._full if self.alpha else None
            resampled = self.curve.values(resampled) * self._full
            if opacity is not None:
                resampled[..., -1] = opacity
        if self.depth != np.float32:
            resampled = cv2.add(resampled, 0, dtype=DEPTHS[self.depth.name])  # type: ignore[call-overload]
        if self.count == 3:
            cv2.cvtColor(resampled, cv2.COLOR_BGRA2BGR, dst=out)
        else:
            out[...] = resampled[..., ::3] if self.count == 2 else resampled

    @property
    def _scale(self) -> np.float32:
        """Full scale of what is resampled."""
        return self._full if self.curve is None else np.float32(1)


def _scale_colours(pixels: Floats, factor: Floats) -> None:
    """Multiply the first three of four channels, in place, by a factor for each pixel."""
    cv2.multiply(pixels, cv2.merge([factor, factor, factor, np.ones_like(factor)]), dst=pixels)


@dataclass(frozen=True, slots=True)
class Forms:
    """The forms for the pieces of one image.

    Attributes
    ----------
    plain : Form
    translucent : Form or None
        For pieces in which alpha varies; None if there is no alpha.
    """

    plain: Form
    translucent: Form | None = None

    def of(self, source: Image) -> Form:
        """Choose the form for a piece of the image: where alpha is the same everywhere, colours can do without it."""
        if self.translucent is None:
            return self.plain
        alpha = source[..., -1]
        return self.plain if alpha.min() == alpha.max() else self.translucent


def forms_for(depth: np.dtype[Any], count: int, curve: Curve | None, *, floats: bool, alpha: bool) -> Forms:
    """Choose the forms for images of a dtype and a number of channels.

    Parameters
    ----------
    depth : dtype
        uint8, uint16 or float32.
    count : int
        Channels, 1 to 4; 1 stands for images without an axis of channels.
    curve : Curve or None
        For linear light.
    floats : bool
        Whether the interpolation needs float32.
    alpha : bool
        Whether the last of two or four channels is an alpha.
    """
    alpha = alpha and count in (2, 4)
    translucent = AsFloats(depth, count, curve, alpha, premultiplied=True) if alpha else None
    if floats or curve is not None:
        return Forms(AsFloats(depth, count, curve, alpha), translucent)
    plain = InFour(depth, count) if count in (2, 3) else AsItIs(depth, () if count == 1 else (count,))
    return Forms(plain, translucent)
