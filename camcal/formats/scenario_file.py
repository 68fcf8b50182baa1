"""Synth configs: the YAML of a scenario, checked down to the last value."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.camera_layout import COEFFICIENT_NAMES
from camcal.formats.validation import NO_BOOL, Name, Number, Positive, Schema, list_of, schema_only, validate
from camcal.formats.yaml_io import Document, KeyPath, load_yaml
from camcal.geometry.camera import Camera
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor

_SAMPLING, _LIGHT, _SENSOR = PoseSampling(), Light(), Sensor()
_STEEPEST_TILT_DEG = 85.0


def _within(least: float, most: float) -> Any:
    """Say in the JSON Schema between which numbers an interval lies."""
    return schema_only(items={"type": "number", "minimum": least, "maximum": most})


Side = Annotated[int, Field(ge=16, le=20_000), NO_BOOL]
Interval = Annotated[tuple[Number, ...], list_of(2)]
Brightness = Annotated[float, Field(ge=0, le=10), NO_BOOL]
Blur = Annotated[float, Field(ge=0, le=100), NO_BOOL]


class DistortionPart(Schema):
    """Coefficients by name, OpenCV's, on normalised coordinates; the others are zero."""

    k1: Number = 0.0
    """Radial, of r²."""
    k2: Number = 0.0
    """Radial, of r⁴."""
    k3: Number = 0.0
    """Radial, of r⁶."""
    k4: Number = 0.0
    """Radial, of r² in the denominator."""
    k5: Number = 0.0
    """Radial, of r⁴ in the denominator."""
    k6: Number = 0.0
    """Radial, of r⁶ in the denominator."""
    p1: Number = 0.0
    """Tangential."""
    p2: Number = 0.0
    """Tangential."""


class CameraPart(Schema):
    """The true camera."""

    size: Annotated[tuple[Side, ...], list_of(2)]
    """Image [width, height], pixels."""
    fx: Positive
    """Focal length along x, pixels."""
    fy: Positive
    """Focal length along y, pixels."""
    cx: Number
    """Principal point, pixels; the centre of the first pixel is 0."""
    cy: Number
    """Principal point, pixels; the centre of the first pixel is 0."""
    skew: Number = 0.0
    """Pixels."""
    distortion: DistortionPart = DistortionPart()
    """The lens."""


class ViewsPart(Schema):
    """How the boards stand."""

    count: Annotated[int, Field(ge=1, le=10_000), NO_BOOL] = _SAMPLING.count
    """Number of views."""
    tilt_deg: Annotated[Interval, _within(0, _STEEPEST_TILT_DEG)] = _SAMPLING.tilt_deg
    """[least, most] angle between the board's normal and the line of sight to its centre, degrees."""
    roll_deg: Annotated[Interval, _within(-360, 360)] = _SAMPLING.roll_deg
    """[least, most] turn of the board about its normal, degrees."""
    fill: Annotated[Interval, _within(0.02, 3)] = _SAMPLING.fill
    """[least, most] share of the image's width or height that the print spans; over 1 only for partial boards."""
    partial: bool = _SAMPLING.partial
    """Whether a board may leave the frame; never a checkerboard."""


class LightPart(Schema):
    """Light that reaches the sensor, as shares of full scale before gamma; above 1 it saturates."""

    white: Brightness = _LIGHT.white
    """Of paper."""
    black: Brightness = _LIGHT.black
    """Of ink; less than of paper."""
    background: Brightness = _LIGHT.background
    """Of what is behind the board."""
    vignetting: Annotated[float, Field(ge=0, le=1), NO_BOOL] = _LIGHT.vignetting
    """Loss at the image corner relative to the centre."""
    gradient: Annotated[float, Field(ge=-1, le=1), NO_BOOL] = _LIGHT.gradient
    """Relative change over half the image's diagonal."""
    gradient_direction_deg: Annotated[float, Field(ge=-360, le=360), NO_BOOL] = _LIGHT.gradient_direction_deg
    """Where it grows to, degrees: 0 is right, 90 is down."""


class SensorPart(Schema):
    """From the continuous image to numbers."""

    blur_sigma_px: Blur = _SENSOR.blur_sigma_px
    """Standard deviation of the lens's blur, pixels; the pixels themselves come on top."""
    defocus_radius_px: Blur = _SENSOR.defocus_radius_px
    """Radius of the disc that a point out of focus becomes, pixels; in place of the blur."""
    read_noise_levels: Annotated[float, Field(ge=0, le=255), NO_BOOL] = _SENSOR.read_noise_levels
    """Standard deviation of the noise that is alike everywhere, grey levels of 255."""
    full_well_electrons: Annotated[float, Field(ge=0, le=1e9), NO_BOOL] = _SENSOR.full_well_electrons
    """Electrons of a white pixel, for the noise of the light itself; 0 is none."""
    gamma: Annotated[float, Field(ge=0.1, le=10), NO_BOOL] = _SENSOR.gamma
    """Grey level = light to the power of 1 / gamma; 1 is linear."""
    bits: Literal[8, 16] = _SENSOR.bits  # type: ignore[assignment]
    """Of a pixel."""


class ScenarioFile(Schema):
    """A scene for camcal synth: a true camera, a board, and how photographs of it come about."""

    name: Name
    """What the scenario is called."""
    seed: Annotated[int, Field(ge=0, lt=2**63), NO_BOOL]
    """Every view is drawn from its own child of it."""
    camera: CameraPart
    """The true camera."""
    board: Name
    """One-liner such as checkerboard:9x6:25mm, sample board, or board file relative to this file."""
    views: ViewsPart = ViewsPart()
    """How the boards stand."""
    light: LightPart = LightPart()
    """Light that reaches the sensor."""
    sensor: SensorPart = SensorPart()
    """From the continuous image to numbers."""


def load_scenario(path: str | Path) -> Scenario:
    """Read a synth config.

    Parameters
    ----------
    path : str or Path
        What it names as `board` is relative to its folder.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key: problem`.
    """
    document = load_yaml(path)
    file = validate(document, ScenarioFile)
    _check_views(document, file.views)
    if file.light.black >= file.light.white:
        problem = f"no contrast (got {file.light.black:g}, expected less than white, {file.light.white:g})"
        raise document.error(("light", "black"), problem)
    try:
        board = load_board(file.board, Path(path).parent)
    except InputError as error:
        raise document.error(("board",), str(error)) from None
    if file.views.partial and isinstance(board, Checkerboard):
        problem = "not with a checkerboard, which is found only as a whole (got true, expected false)"
        raise document.error(("views", "partial"), problem)
    return Scenario(
        name=file.name,
        seed=file.seed,
        camera=_camera(file.camera),
        board=board,
        views=PoseSampling(**file.views.model_dump()),
        light=Light(**file.light.model_dump()),
        sensor=_sensor(document, file.sensor),
    )


def _camera(part: CameraPart) -> Camera:
    dist = [getattr(part.distortion, name) for name in COEFFICIENT_NAMES]
    K = [[part.fx, part.skew, part.cx], [0.0, part.fy, part.cy], [0.0, 0.0, 1.0]]
    return Camera((part.size[0], part.size[1]), K, dist)


def _check_views(document: Document, views: ViewsPart) -> None:
    """Check the intervals that poses are drawn from."""
    _check_interval(document, ("views", "tilt_deg"), views.tilt_deg, 0, _STEEPEST_TILT_DEG)
    _check_interval(document, ("views", "roll_deg"), views.roll_deg, -360, 360)
    # Only a board that may leave the frame can be larger than it.
    _check_interval(document, ("views", "fill"), views.fill, 0.02, 3 if views.partial else 1)


def _check_interval(document: Document, path: KeyPath, interval: tuple[float, ...], least: float, most: float) -> None:
    low, high = interval
    if low > high:
        raise document.error(path, f"not an interval (got [{low:g}, {high:g}], expected [low, high])")
    if low < least or high > most:
        raise document.error(path, f"out of range (got [{low:g}, {high:g}], expected within [{least:g}, {most:g}])")


def _sensor(document: Document, part: SensorPart) -> Sensor:
    """Build the sensor; a defocus that is asked for takes the place of the blur that is not."""
    values = part.model_dump()
    if part.defocus_radius_px > 0:
        if part.blur_sigma_px > 0 and "blur_sigma_px" in part.model_fields_set:
            problem = "a second blur (expected blur_sigma_px or defocus_radius_px). Set one of them to 0."
            raise document.error(("sensor", "defocus_radius_px"), problem)
        values["blur_sigma_px"] = 0.0
    return Sensor(**values)
