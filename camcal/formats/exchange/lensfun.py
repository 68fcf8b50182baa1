"""lensfun's XML database: radial polynomials over a radius in halves of the short side of a sensor.

lensfun maps ideal radii to distorted ones, both in its normalised unit: half the short side of the sensor that the lens was
calibrated on, the sides being measured between the centres of the outermost pixels. Its poly5, 1 + k1 r² + k2 r⁴, is ours
with r counted in that unit instead of the focal length, which is kept in millimetres.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from xml.sax.saxutils import escape

import numpy as np

from camcal.errors import InputError
from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import (
    Exchanged,
    ForeignLens,
    Outgoing,
    Pinhole,
    Profile,
    checked,
    fisheye_problem,
    one_line,
    xml_comment,
)
from camcal.formats.exchange.xml_in import Element
from camcal.formats.text import shown
from camcal.formats.yaml_io import Document
from camcal.geometry.arrays import FloatArray

PROFILE = Profile("lensfun", "lensfun's database", (("k1", "k2"),), (".xml",), one_focal=True)

_FULL_FRAME_MM = math.hypot(36, 24)
_TERMS = {"poly3": ("k1",), "poly5": ("k1", "k2"), "ptlens": ("a", "b", "c"), "acm": ("k1", "k2", "k3", "k4", "k5")}
_ABSURD = 1e6
_RECTILINEAR = ("", "rectilinear")


@dataclass(frozen=True, slots=True)
class _Sensor:
    """How lensfun measures an image.

    Attributes
    ----------
    unit_px : float
        Pixels in its normalised unit.
    unit_mm : float
        The same on the sensor.
    offset_px : float
        Pixels in the unit that it gives the lens's centre in: half the short side of this image.
    centre_px : tuple of float
        Where the middle of the image is.
    """

    unit_px: float
    unit_mm: float
    offset_px: float
    centre_px: tuple[float, float]

    @classmethod
    def of(cls, size: tuple[int, int], crop_factor: float, aspect: float) -> _Sensor:
        """Measure an image for a lens calibrated at a crop factor and an aspect ratio (long over short)."""
        width, height = (max(side - 1, 1) for side in size)
        short, long = min(width, height), max(width, height)
        # Crop factors compare diagonals; the unit is that of the sensor which the lens was calibrated on.
        unit_px = short / 2 * math.hypot(long / short, 1) / math.hypot(aspect, 1)
        return cls(unit_px, _FULL_FRAME_MM / 2 / math.hypot(aspect, 1) / crop_factor, short / 2, (width / 2, height / 2))


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is a database."""
    return loaded.root is not None and loaded.root.tag == "lensdatabase"


def read(loaded: Loaded) -> list[Exchanged]:
    """Read every lens at every focal length that has a distortion, called by both; the image size must be told."""
    lenses = [] if loaded.root is None else [child for child in loaded.root.children if child.tag == "lens"]
    found = [(camera, lens) for lens in lenses for camera in _lens_cameras(loaded.name, lens)]
    if not found:
        raise InputError(f"{loaded.name}:1: no lens with a distortion (expected lens/calibration/distortion)")
    return _distinct(found)


def write(outgoing: Outgoing) -> str:
    """Write a camera and a lens on a mount of their own."""
    camera, names = outgoing.known.camera, outgoing.lensfun
    f, _, cx, cy, _ = outgoing.pinhole
    long, short = max(camera.size), min(camera.size)
    crop = names.crop_factor
    if crop is None:
        # The focal length on the lens tells the sensor's size; without it, focal lengths are those of a full frame.
        full = _Sensor.of(camera.size, 1.0, long / short)
        crop = 1.0 if names.focal_mm is None else f / full.unit_px * full.unit_mm / names.focal_mm
    sensor = _Sensor.of(camera.size, crop, long / short)
    scale = f / sensor.unit_px
    real_mm = scale * sensor.unit_mm
    k1, k2 = (value / scale**power for value, power in zip(outgoing.coefficients("k1", "k2"), (2, 4), strict=True))
    x, y = ((c - middle) / sensor.offset_px for c, middle in zip((cx, cy), sensor.centre_px, strict=True))
    focal_mm = names.focal_mm or real_mm
    # The attribute of <distortion> by this name, which development versions have, is an error to the released ones.
    real = f'            <real-focal-length focal="{focal_mm!r}" real-focal="{real_mm!r}"/>\n' if focal_mm != real_mm else ""
    # lensfun finds cameras and lenses by their names.
    model = escape(one_line(outgoing.known.name) or "camera")
    lens = escape(one_line(names.lens)) or model
    return (
        '<!DOCTYPE lensdatabase SYSTEM "lensfun-database.dtd">\n'
        f'{xml_comment(outgoing.heading)}\n<lensdatabase version="1">\n'
        f"    <mount>\n        <name>camcal {model}</name>\n    </mount>\n"
        f"    <camera>\n        <maker>camcal</maker>\n        <model>{model}</model>\n"
        f"        <mount>camcal {model}</mount>\n        <cropfactor>{crop!r}</cropfactor>\n    </camera>\n"
        f"    <lens>\n        <maker>camcal</maker>\n        <model>{lens}</model>\n        <mount>camcal {model}</mount>\n"
        f"        <cropfactor>{crop!r}</cropfactor>\n        <aspect-ratio>{long}:{short}</aspect-ratio>\n"
        f'        <center x="{x!r}" y="{y!r}"/>\n        <calibration>\n'
        f'            <distortion model="poly5" focal="{focal_mm!r}" k1="{k1!r}" k2="{k2!r}"/>\n{real}'
        "        </calibration>\n    </lens>\n</lensdatabase>\n"
    )


def _distinct(found: list[tuple[Exchanged, Element]]) -> list[Exchanged]:
    """Tell lenses of one name apart: by the crop factor of the camera that each was measured on, or by their order."""
    names = Counter(camera.name for camera, _ in found)
    cameras = [
        replace(camera, name=f"{camera.name}, crop {lens.child_text('cropfactor', '1')}") if names[camera.name] > 1 else camera
        for camera, lens in found
    ]
    seen: Counter[str] = Counter()
    for index, camera in enumerate(cameras):
        seen[camera.name] += 1
        if seen[camera.name] > 1:
            cameras[index] = replace(camera, name=f"{camera.name} ({seen[camera.name]})")
    return cameras


def _lens_cameras(name: str, lens: Element) -> list[Exchanged]:
    """Read a lens at its focal lengths."""
    calibration = lens.child("calibration")
    entries = [] if calibration is None else [child for child in calibration.children if child.tag == "distortion"]
    model = lens.child_text("model", "lens")
    cameras = []
    for entry in entries:
        if entry.attributes.get("model") == "none":
            continue
        reading = _Reading(name, lens, entry)
        label = f"{model} {reading.number(entry, 'focal'):g} mm"
        kind = lens.child_text("type").lower()
        lens_model = entry.attributes.get("model", "")
        if kind not in _RECTILINEAR or lens_model not in _TERMS:
            got = kind if kind not in _RECTILINEAR else lens_model
            problem = fisheye_problem(got, f"rectilinear with {', '.join(_TERMS)}")
            fault = InputError(f"{name}:{entry.line}: distortion: {problem}")
            cameras.append(Exchanged(label, fault=fault))
        else:
            cameras.append(Exchanged(label, sized=reading.for_size))
    return cameras


@dataclass(frozen=True, slots=True)
class _Reading:
    """A distortion entry of a lens, to be read for an image size."""

    file: str
    lens: Element
    entry: Element

    def for_size(self, size: tuple[int, int]) -> Exchanged:
        """Build the camera for an image of (width, height) pixels."""
        crop = self.of_lens("cropfactor", 1.0)
        sensor = _Sensor.of(size, crop, self.aspect())
        model = self.entry.attributes["model"]
        terms = [self.number(self.entry, name, 0.0) for name in _TERMS[model]]
        # poly3 and ptlens keep the middle of the short side in place: their lens shrinks the middle of the image.
        centre_scale = {"poly3": 1 - terms[0], "ptlens": 1 - sum(terms)}.get(model, 1.0)
        if centre_scale <= 0:
            raise InputError(f"{self.file}:{self.entry.line}: distortion: not a lens (it turns the image inside out)")
        focal_mm = self.real_focal_mm() or self.number(self.entry, "focal") * centre_scale
        scale = focal_mm / sensor.unit_mm
        f = scale * sensor.unit_px
        centre = self.lens.child("center")
        x, y = (0.0, 0.0) if centre is None else (self.number(centre, "x", 0.0), self.number(centre, "y", 0.0))
        pinhole = Pinhole(f, f, sensor.centre_px[0] + x * sensor.offset_px, sensor.centre_px[1] + y * sensor.offset_px)
        lines = Document(self.file, {}, {(): self.entry.line})
        if model == "ptlens":
            per_r = [
                term * (scale / centre_scale) ** power / centre_scale for term, power in zip(terms, (3, 2, 1), strict=True)
            ]
            checked(lines, (), Exchanged("", pinhole, (), size))
            return Exchanged("", pinhole, (), size, ForeignLens("lensfun's ptlens model", _polynomial(per_r)))
        return checked(lines, (), Exchanged("", pinhole, _ours(model, terms, scale / centre_scale, centre_scale), size))

    def real_focal_mm(self) -> float | None:
        """Focal length in millimetres if the file has another than the one that is written on the lens."""
        if "real-focal" in self.entry.attributes:
            return self.number(self.entry, "real-focal")
        calibration = self.lens.child("calibration")
        others = [] if calibration is None else [child for child in calibration.children if child.tag == "real-focal-length"]
        focal = self.number(self.entry, "focal")
        return next((self.number(other, "real-focal") for other in others if self.number(other, "focal") == focal), None)

    def aspect(self) -> float:
        """Aspect ratio, long over short side."""
        text = self.lens.child_text("aspect-ratio", "1.5")
        first, _, second = text.partition(":")
        try:
            ratio = float(first) / float(second or 1)
        except (ValueError, ZeroDivisionError):
            ratio = math.nan
        if not 1 <= ratio < 100:
            raise InputError(f"{self.file}:{self.lens.line}: aspect-ratio: not one (got {shown(text)}, expected such as 3:2)")
        return ratio

    def of_lens(self, tag: str, otherwise: float) -> float:
        """Read a positive number that is a child of the lens."""
        text = self.lens.child_text(tag, str(otherwise))
        return self.checked(tag, text, self.lens.line, positive=True)

    def number(self, element: Element, name: str, otherwise: float | None = None) -> float:
        """Read an attribute; it must be there unless there is another value."""
        text = element.attributes.get(name)
        if text is None and otherwise is not None:
            return otherwise
        return self.checked(name, text, element.line, positive=name in ("focal", "real-focal"))

    def checked(self, name: str, text: str | None, line: int, *, positive: bool) -> float:
        """Read a number of a sensible size."""
        try:
            value = float(text or "nan")
        except ValueError:
            value = math.nan
        if not abs(value) < _ABSURD or (positive and not value > 1 / _ABSURD):
            expected = "a positive number" if positive else "a number"
            got = "nothing" if text is None else shown(text)
            raise InputError(f"{self.file}:{line}: {name}: wrong value (got {got}, expected {expected})")
        return value


def _ours(model: str, terms: list[float], scale: float, centre_scale: float) -> tuple[float, ...]:
    """Return the coefficients of a lens that camcal's formula has, in OpenCV's order."""
    if model == "acm":
        k1, k2, k3, p1, p2 = terms
        return k1, k2, p1, p2, k3
    per_r = [term * scale**power / centre_scale for term, power in zip(terms, (2, 4), strict=False)]
    return (*per_r, *(0.0,) * (2 - len(per_r)))


def _polynomial(per_r: list[float]) -> Callable[[FloatArray], FloatArray]:
    """Return r (a r³ + b r² + c r + 1)."""

    def distort(radius: FloatArray) -> FloatArray:
        distorted: FloatArray = radius * np.polyval([*per_r, 1.0], radius)
        return distorted

    return distort
