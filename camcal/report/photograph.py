"""A photograph as the page shows it: small, encoded, and with its twin without the lens."""

from __future__ import annotations

import base64
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Picture:
    """A small image.

    Attributes
    ----------
    content : bytes
        Encoded as JPEG.
    size : tuple of int
        Its (width, height) in pixels.
    """

    content: bytes
    size: tuple[int, int]

    @property
    def uri(self) -> str:
        """The image as text that stands in a page."""
        return f"data:image/jpeg;base64,{base64.b64encode(self.content).decode()}"


@dataclass(frozen=True, slots=True)
class Photograph:
    """A photograph of the calibration.

    Attributes
    ----------
    size : tuple of int
        (width, height) of the photograph itself in pixels, which its corners refer to.
    picture : Picture
        As it was taken.
    twin : Picture or None
        Without the lens; None for an image of another size than the camera's.
    """

    size: tuple[int, int]
    picture: Picture
    twin: Picture | None = None
