"""What is to be rendered: camera, board, poses, light and sensor, as frozen values (the YAML is read in `formats/`)."""

from __future__ import annotations

from dataclasses import dataclass, field

from camcal.boards.base import Board
from camcal.geometry.camera import Camera

Range = tuple[float, float]
"""A closed interval (low, high) to draw from uniformly."""


@dataclass(frozen=True, slots=True)
class PoseSampling:
    """How the boards stand.

    Attributes
    ----------
    count : int
        Number of views.
    tilt_deg : Range
        Angle between the board's normal and the line of sight to its centre.
    roll_deg : Range
        Turn of the board about its normal.
    fill : Range
        How much of the image the print spans, as the larger of its share of the width and its share of the height: its
        distance, camera-independent. Of a partial board: the share if it stood in the middle, so that it may exceed 1.
    partial : bool
        Whether a board may leave the frame (never a checkerboard, whose detection needs all of it).
    """

    count: int = 20
    tilt_deg: Range = (0.0, 45.0)
    roll_deg: Range = (-180.0, 180.0)
    fill: Range = (0.35, 0.8)
    partial: bool = False


@dataclass(frozen=True, slots=True)
class Light:
    """Light that reaches the sensor, as shares of full scale before gamma.

    Attributes
    ----------
    white, black, background : float
        Linear signal of paper, of ink, and of what is behind the board, in 0..1 (above 1 saturates).
    vignetting : float
        Loss at the image corner relative to the centre, 0..1, falling with the square of the distance to the centre.
    gradient : float
        Relative change of the illumination over half the image's diagonal, linear.
    gradient_direction_deg : float
        Where it grows to: 0 is right, 90 is down.
    """

    white: float = 0.86
    black: float = 0.15
    background: float = 0.35
    vignetting: float = 0.0
    gradient: float = 0.0
    gradient_direction_deg: float = 0.0


@dataclass(frozen=True, slots=True)
class Sensor:
    """From the continuous image to numbers.

    Attributes
    ----------
    blur_sigma_px : float
        Standard deviation of the Gaussian point spread of the continuous image (the pixel's own area not included); 0 for none.
    defocus_radius_px : float
        Radius of a uniform disc of defocus; 0 for none. The image is blurred by both.
    read_noise_levels : float
        Standard deviation of the signal-independent noise in 8-bit levels of the linear signal.
    full_well_electrons : float
        Electrons at full scale, for shot noise; 0 for none.
    gamma : float
        Encoding exponent: stored = linear ** (1 / gamma).
    bits : int
        8 or 16.
    """

    blur_sigma_px: float = 0.7
    defocus_radius_px: float = 0.0
    read_noise_levels: float = 2.0
    full_well_electrons: float = 0.0
    gamma: float = 1.0
    bits: int = 8


@dataclass(frozen=True, slots=True)
class Scenario:
    """Everything that decides a rendered dataset, down to the last bit.

    Attributes
    ----------
    name : str
    seed : int
        View i draws only from child i of this seed, so order and parallelism change nothing.
    camera : Camera
    board : Board
    views : PoseSampling
    light : Light
    sensor : Sensor
    """

    name: str
    seed: int
    camera: Camera
    board: Board
    views: PoseSampling = field(default_factory=PoseSampling)
    light: Light = field(default_factory=Light)
    sensor: Sensor = field(default_factory=Sensor)
