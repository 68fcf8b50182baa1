"""Synth configs: the YAML of a scenario, checked down to the last value."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.validation import Name, NotNegative, Number, Positive, Schema, Whole, list_of, validate
from camcal.formats.yaml_io import Document, KeyPath, load_yaml
from camcal.geometry.camera import Camera
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor

_SAMPLING, _LIGHT, _SENSOR = PoseSampling(), Light(), Sensor()
_STEEPEST_TILT_DEG = 85.0
_LENS_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")

Side = Annotated[Whole, Field(ge=16, le=20_000)]
Interval = Annotated[tuple[Number, ...], list_of(2)]
Brightness = Annotated[NotNegative, Field(le=10)]
Blur = Annotated[NotNegative, Field(le=100)]


class DistortionPart(Schema):
    """Coefficients by name; the others are zero."""

    k1: Number = 0.0
    k2: Number = 0.0
    k3: Number = 0.0
    k4: Number = 0.0
    k5: Number = 0.0
    k6: Number = 0.0
    p1: Number = 0.0
    p2: Number = 0.0


class CameraPart(Schema):
    """The true camera."""

    size: Annotated[tuple[Side, ...], list_of(2)]
    fx: Positive
    fy: Positive
    cx: Number
    cy: Number
    skew: Number = 0.0
    distortion: DistortionPart = DistortionPart()


class ViewsPart(Schema):
    """How the boards stand."""

    count: Annotated[Whole, Field(ge=1, le=10_000)] = _SAMPLING.count
    tilt_deg: Interval = _SAMPLING.tilt_deg
    roll_deg: Interval = _SAMPLING.roll_deg
    fill: Interval = _SAMPLING.fill
    partial: bool = _SAMPLING.partial


class LightPart(Schema):
    """Light that reaches the sensor."""

    white: Brightness = _LIGHT.white
    black: Brightness = _LIGHT.black
    background: Brightness = _LIGHT.background
    vignetting: Annotated[NotNegative, Field(le=1)] = _LIGHT.vignetting
    gradient: Annotated[Number, Field(ge=-1, le=1)] = _LIGHT.gradient
    gradient_direction_deg: Annotated[Number, Field(ge=-360, le=360)] = _LIGHT.gradient_direction_deg


class SensorPart(Schema):
    """From the continuous image to numbers."""

    blur_sigma_px: Blur = _SENSOR.blur_sigma_px
    defocus_radius_px: Blur = _SENSOR.defocus_radius_px
    read_noise_levels: Annotated[NotNegative, Field(le=255)] = _SENSOR.read_noise_levels
    full_well_electrons: Annotated[NotNegative, Field(le=1e9)] = _SENSOR.full_well_electrons
    gamma: Annotated[Number, Field(ge=0.1, le=10)] = _SENSOR.gamma
    bits: Literal[8, 16] = _SENSOR.bits  # type: ignore[assignment]


class ScenarioFile(Schema):
    """The file."""

    name: Name
    seed: Annotated[Whole, Field(ge=0, lt=2**63)]
    camera: CameraPart
    board: Name
    views: ViewsPart = ViewsPart()
    light: LightPart = LightPart()
    sensor: SensorPart = SensorPart()


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
    dist = [getattr(part.distortion, name) for name in _LENS_NAMES]
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
