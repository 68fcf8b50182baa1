"""What a format can hold, what was read from one, and what is to be written to one."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple
from xml.sax.saxutils import escape

from camcal.errors import InputError
from camcal.formats.camera_layout import LARGEST_SIDE_PX
from camcal.formats.yaml_io import Document, KeyPath, describe, format_path
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""OpenCV's order, which is camcal's."""


@dataclass(frozen=True, slots=True)
class Profile:
    """What a format can hold.

    Attributes
    ----------
    name : str
        As `--to` and `--from` take it.
    title : str
        As a person calls it.
    lenses : tuple of tuple of str
        The sets of distortion coefficients that one of its lens models has, smallest first. A camera goes into the first one
        that has all of its coefficients; one that fits none is refitted to the last.
    suffixes : tuple of str
        Endings of file names. Where there are several, the ending of the output chooses how it is written.
    skew : bool
        Whether it has a skew.
    one_focal : bool
        Whether fx and fy are one number.
    """

    name: str
    title: str
    lenses: tuple[tuple[str, ...], ...]
    suffixes: tuple[str, ...]
    skew: bool = False
    one_focal: bool = False

    def lens_for(self, camera: Camera) -> tuple[str, ...] | None:
        """Return the smallest set of coefficients that holds a camera's lens; None if none does."""
        used = {name for name, value in zip(COEFFICIENTS, camera.dist.tolist(), strict=True) if value != 0}
        return next((lens for lens in self.lenses if used <= set(lens)), None)

    def lens_or_largest(self, camera: Camera) -> tuple[str, ...]:
        """Return the smallest set of coefficients that holds a camera's lens, or else the largest there is."""
        lens = self.lens_for(camera)
        return self.lenses[-1] if lens is None else lens

    def missing(self, camera: Camera) -> tuple[str, ...]:
        """Name what a camera has and the format does not: coefficients, `skew`, `fx != fy`."""
        lost = []
        if self.lens_for(camera) is None:
            values = zip(COEFFICIENTS, camera.dist.tolist(), strict=True)
            lost += [name for name, value in values if value != 0 and name not in self.lenses[-1]]
        if not self.skew and camera.K[0, 1] != 0:
            lost.append("skew")
        if self.one_focal and camera.K[0, 0] != camera.K[1, 1]:
            lost.append("fx != fy")
        return tuple(lost)


class Lineless(Document):
    """A binary file: what is wrong is told by its key alone."""

    def error(self, path: KeyPath, problem: str) -> InputError:
        """Build the error `file: key: problem`."""
        key = f"{format_path(path)}: " if path else ""
        return InputError(f"{self.name}: {key}{problem}")


class Pinhole(NamedTuple):
    """The entries of K, in pixels; the centre of the top-left pixel is (0, 0)."""

    fx: float
    fy: float
    cx: float
    cy: float
    skew: float = 0.0


_NO_PINHOLE = Pinhole(1.0, 1.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class ForeignLens:
    """A radial lens that camcal's formula does not have.

    Attributes
    ----------
    name : str
        As a person calls it.
    distort : callable
        Distorted radius of ideal ones, both normalised: arrays of shape (N,), float64.
    """

    name: str
    distort: Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class Exchanged:
    """One camera of a file.

    Attributes
    ----------
    name : str
        As the file calls it.
    pinhole : Pinhole
    dist : tuple of float
        Coefficients in OpenCV's order, up to 8.
    size : tuple of int or None
        Image (width, height) in pixels; None if the file does not say.
    foreign : ForeignLens or None
        The lens, if `dist` cannot describe it.
    fault : InputError or None
        Why the camera cannot be used, raised when it is chosen; the rest is undefined then.
    known : Intrinsics or None
        All that is known of it, from files of camcal's own.
    cautions : tuple of str
        What the file says and a camera cannot hold, for whoever uses it.
    sized : callable or None
        Builds the camera for an image size, where the file's numbers are relative to it; all but the name is undefined then.
    """

    name: str
    pinhole: Pinhole = _NO_PINHOLE
    dist: tuple[float, ...] = ()
    size: tuple[int, int] | None = None
    foreign: ForeignLens | None = None
    fault: InputError | None = None
    known: Intrinsics | None = None
    cautions: tuple[str, ...] = ()
    sized: Callable[[tuple[int, int]], Exchanged] | None = None

    def intrinsics(self) -> Intrinsics:
        """Return all that is known of the camera; its image size must be."""
        if self.size is None:
            raise ValueError("no image size")
        return replace(self.known or Intrinsics(self.camera(self.size), self.name), cautions=self.cautions)

    def camera(self, size: tuple[int, int]) -> Camera:
        """Build the camera for an image size; a foreign lens is left out."""
        fx, fy, cx, cy, skew = self.pinhole
        return Camera(size, [[fx, skew, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], self.dist)


def checked(document: Document, path: KeyPath, camera: Exchanged) -> Exchanged:
    """Check the numbers of a camera that stands at a key path of a file.

    Raises
    ------
    InputError
        If they are not those of a camera; says `file:line: key`.
    """
    size = camera.size
    if size is not None and not all(1 <= side <= LARGEST_SIDE_PX for side in size):
        problem = f"not an image size (got {size[0]}x{size[1]}, expected 1 to {LARGEST_SIDE_PX} pixels each way)"
        raise document.error(path, problem)
    try:
        camera.camera(size or (1, 1))
    except ValueError as error:
        raise document.error(path, str(error).partition(": ")[2] or str(error)) from None
    return camera


def faulty(document: Document, path: KeyPath, name: str, problem: str) -> Exchanged:
    """Return a camera that cannot be used, with the error that says why."""
    return Exchanged(name, fault=document.error(path, problem))


def fisheye_problem(got: object, expected: str) -> str:
    """Say that a lens model is a fisheye's or another that camcal does not have, and what to do."""
    return (
        f"unsupported lens model (got {describe(got)}, expected {expected}). "
        "Its numbers mean something else here: calibrate from the images again, with camcal."
    )


def one_line(text: str) -> str:
    """Return text as any file can hold it: on one line, without what cannot be seen."""
    return "".join(character for character in " ".join(text.split()) if character.isprintable())


def xml_comment(lines: tuple[str, ...]) -> str:
    """Return lines as a comment of XML, in which no two dashes may meet."""
    return f"<!-- {escape(re.sub('-(?=-)', '- ', chr(10).join(lines)))} -->"


@dataclass(frozen=True, slots=True)
class LensfunNames:
    """What lensfun's database wants to know of a lens and its camera.

    Attributes
    ----------
    lens : str
        Model of the lens; empty for the camera's name.
    crop_factor : float or None
        Diagonal of a full frame over that of the sensor.
    focal_mm : float or None
        Focal length as it is written on the lens, in millimetres.
    """

    lens: str = ""
    crop_factor: float | None = None
    focal_mm: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Outgoing:
    """A camera to be written.

    Attributes
    ----------
    known : Intrinsics
        Its camera is one that the format holds.
    lens : tuple of str
        The set of coefficients to write it with.
    suffix : str
        Ending of the output, which chooses among a format's ways to write.
    heading : tuple of str
        Lines for people, where the format has comments.
    lensfun : LensfunNames
    """

    known: Intrinsics
    lens: tuple[str, ...]
    suffix: str
    heading: tuple[str, ...] = ()
    lensfun: LensfunNames = field(default_factory=LensfunNames)

    @property
    def pinhole(self) -> Pinhole:
        """The entries of K."""
        (fx, skew, cx), (_, fy, cy), _ = self.known.camera.K.tolist()
        return Pinhole(fx, fy, cx, cy, skew)

    @property
    def dist(self) -> dict[str, float]:
        """Every coefficient by its name."""
        return dict(zip(COEFFICIENTS, self.known.camera.dist.tolist(), strict=True))

    def coefficients(self, *names: str) -> list[float]:
        """Return the coefficients of these names."""
        return [self.dist[name] for name in names]

    def comments(self, mark: str) -> str:
        """Return the heading as lines that begin with a mark."""
        return "".join(f"{mark} {line}\n" for line in self.heading)
