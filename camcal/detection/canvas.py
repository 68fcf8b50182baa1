"""A picture to draw on in the coordinates of the image it shows, with lines and letters that suit its size."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from camcal.detection.sampling import gray8
from camcal.geometry.arrays import FloatArray
from camcal.observations import Image

if TYPE_CHECKING:
    from PIL import ImageFont

Colour = tuple[int, int, int]
"""Blue, green and red, 0 to 255 each."""

_LEAST_LONG_SIDE_PX = 1200
"""Smaller images are enlarged by a whole factor, so that marks and letters leave the picture visible."""
_MOST_ENLARGED = 16
_LINE_SHARE = 1 / 1000
_LETTER_SHARE = 1 / 62
_LEAST_LETTER_PX = 12
# OpenCV draws at fractions of a pixel in fixed point.
_SHIFT = 4
_DARK: Colour = (0, 0, 0)


class Canvas:
    """An 8-bit colour copy of an image, enlarged if it is small.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, BGR order; stays as it is. What is not 8-bit is shown in grey, stretched to its own range.

    Attributes
    ----------
    scale : int
        Pixels of the picture per pixel of the image.
    pixels : ndarray of shape (scale height, scale width, 3)
        uint8.
    line_px : int
        Width of a thin line.
    letter_px : int
        Height of the letters.
    """

    def __init__(self, image: Image) -> None:
        longest = max(image.shape[:2])
        self.scale = min(max(1, -(-_LEAST_LONG_SIDE_PX // longest)), _MOST_ENLARGED)
        self.pixels = _enlarged(_as_bgr(image), self.scale)
        shown = self.scale * longest
        self.line_px = max(1, round(shown * _LINE_SHARE))
        self.letter_px = max(_LEAST_LETTER_PX, round(shown * _LETTER_SHARE))

    def line(self, points_px: FloatArray, colour: Colour, width: float = 1.0, *, closed: bool = False) -> None:
        """Draw straight pieces through points (P, 2) in pixels of the image; with a dark rim, so that it shows on anything."""
        thickness = max(1, round(width * self.line_px))
        places = [self._fixed(points_px)[:, None]]
        for ink, extra in ((_DARK, 2 * self.line_px), (colour, 0)):
            cv2.polylines(self.pixels, places, closed, ink, thickness + extra, cv2.LINE_AA, _SHIFT)

    def ring(self, point_px: npt.ArrayLike, radius_px: float, colour: Colour) -> None:
        """Draw a ring around a point (2,), and the point itself."""
        centre = self._fixed(point_px).tolist()
        radius = round(radius_px * self.scale * 2**_SHIFT)
        for ink, width in ((_DARK, 3), (colour, 1)):
            cv2.circle(self.pixels, centre, radius, ink, width * self.line_px, cv2.LINE_AA, _SHIFT)
        cv2.circle(self.pixels, centre, self.line_px << _SHIFT, colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)

    def cross(self, point_px: npt.ArrayLike, arm_px: float, colour: Colour) -> None:
        """Draw a diagonal cross at a point (2,)."""
        x, y = np.asarray(point_px, dtype=np.float64)
        for sign in (1, -1):
            self.line(np.array([[x - arm_px, y - sign * arm_px], [x + arm_px, y + sign * arm_px]]), colour)

    def arrow(self, start_px: npt.ArrayLike, end_px: npt.ArrayLike, colour: Colour) -> None:
        """Draw a thick arrow from one point (2,) to another."""
        start, end = (np.asarray(point, dtype=np.float64) for point in (start_px, end_px))
        along = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
        across = np.array([-along[1], along[0]])
        head = 6 * self.line_px / self.scale
        self.line(np.stack([start, end]), colour, 3)
        tip = [end - head * (2 * along - across), end, end - head * (2 * along + across)]
        self.line(np.stack(tip), colour, 3)

    def labels(self, places: Sequence[tuple[npt.ArrayLike, str, Colour]]) -> None:
        """Write short texts, each down right of a point (2,) of the image; those outside the picture are cut off."""
        from PIL import Image as Pictures
        from PIL import ImageDraw

        picture = Pictures.fromarray(np.ascontiguousarray(self.pixels[:, :, ::-1]))
        pen, font = ImageDraw.Draw(picture), _font(self.letter_px)
        for point, text, colour in places:
            x, y = self._place(point) + 0.3 * self.letter_px
            width = max(1, self.letter_px // 8)
            pen.text((x, y), _plain(text), font=font, fill=colour[::-1], stroke_width=width, stroke_fill=_DARK)
        self.pixels = np.ascontiguousarray(np.asarray(picture)[:, :, ::-1])

    def captioned(self, lines: Sequence[tuple[str, Colour]], ground: Colour) -> Image:
        """Return the picture with text on a strip below it, so that none of the image is hidden; long lines are wrapped."""
        from PIL import Image as Pictures
        from PIL import ImageDraw

        font, pad, width = _font(self.letter_px), self.letter_px // 2, self.pixels.shape[1]
        rows = [(row, colour) for text, colour in lines for row in _wrapped(_plain(text), font, width - 2 * pad)]
        step = round(1.4 * self.letter_px)
        strip = Pictures.new("RGB", (width, len(rows) * step + 2 * pad), ground[::-1])
        pen = ImageDraw.Draw(strip)
        for index, (row, colour) in enumerate(rows):
            pen.text((pad, pad + index * step), row, font=font, fill=colour[::-1])
        return np.vstack([self.pixels, np.asarray(strip)[:, :, ::-1]])

    def _place(self, points_px: npt.ArrayLike) -> FloatArray:
        """Where pixels (..., 2) of the image lie in the picture."""
        place: FloatArray = (np.asarray(points_px, dtype=np.float64) + 0.5) * self.scale - 0.5
        return place

    def _fixed(self, points_px: npt.ArrayLike) -> npt.NDArray[np.int32]:
        """The same in fixed point, kept within what OpenCV can draw."""
        limit = 2.0**15
        fixed: npt.NDArray[np.int32] = np.rint(np.clip(self._place(points_px), -limit, limit) * 2**_SHIFT).astype(np.int32)
        return fixed


def _as_bgr(image: Image) -> Image:
    """Any image as 8-bit BGR, shape (height, width, 3)."""
    if image.dtype == np.uint8 and image.ndim == 3 and image.shape[2] in {3, 4}:
        return np.ascontiguousarray(image[:, :, :3])
    return cv2.cvtColor(gray8(image), cv2.COLOR_GRAY2BGR)


def _enlarged(pixels: Image, scale: int) -> Image:
    """A copy with every pixel as a block of scale x scale, so that what a corner fit saw can be seen."""
    return np.ascontiguousarray(pixels.repeat(scale, axis=0).repeat(scale, axis=1))


def _font(height_px: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Letters of a height in pixels: Pillow's own, so that no font needs to be installed."""
    from PIL import ImageFont

    return ImageFont.load_default(height_px)


def _wrapped(text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width_px: int) -> list[str]:
    """A text in lines that fit; a word that is longer than a line is cut off."""
    rows: list[str] = []
    for word in text.split():
        longer = f"{rows[-1]} {word}" if rows else ""
        if rows and font.getlength(longer) <= width_px:
            rows[-1] = longer
        else:
            rows.append(word)
    return rows


def _plain(text: str) -> str:
    """Text in the letters that Pillow's own font has."""
    return text.encode("ascii", "backslashreplace").decode("ascii")
