"""Which cameras an undistortion works between: that of the files it reads and that of the files it writes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from camcal.errors import InputError
from camcal.undistortion.frames import sees_source
from camcal.undistortion.maps import UndistortMap, undistort_map
from camcal.undistortion.sizes import rescaled_camera
from camcal.undistortion.target import target_camera

if TYPE_CHECKING:
    from camcal.geometry.camera import Camera

_NODES = 101


@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """How the user describes the camera of the undistorted images; `undistort` documents each field.

    Raises
    ------
    InputError
        If two of them contradict each other.
    """

    alpha: float = 0.0
    fov_deg: float | None = None
    size: tuple[int, int] | None = None
    scale: float = 1.0
    crop: str = "none"
    target: Camera | None = None
    distort: bool = False
    rescale: bool = False

    def __post_init__(self) -> None:
        if self.target is None:
            return
        others = {
            "--alpha": self.alpha != 0,
            "--fov": self.fov_deg is not None,
            "--size": self.size is not None,
            "--scale": self.scale != 1,
            "--crop": self.crop != "none",
        }
        given = [name for name, is_given in others.items() if is_given]
        if given:
            raise InputError(f"--target and {given[0]}: both choose the camera of the results. Give one of them.")

    def cameras(self, camera: Camera, size: tuple[int, int] | None = None) -> Cameras:
        """Choose the cameras.

        Parameters
        ----------
        camera : Camera
            With its lens.
        size : tuple of int, optional
            (width, height) of the files that are read, to which the camera is scaled if that was asked for.

        Raises
        ------
        InputError
            If a value is out of range or the camera cannot be scaled to the size.
        """
        if self.rescale and size is not None:
            camera = rescaled_camera(camera, size)
        ideal = self.target or target_camera(
            camera, self.alpha, fov_deg=self.fov_deg, size=self.size, scale=self.scale, crop=self.crop
        )
        return Cameras(ideal, camera) if self.distort else Cameras(camera, ideal)

    @property
    def shows_all(self) -> bool:
        """Whether more is asked for than what surely sees the source."""
        return self.alpha > 0 or self.fov_deg is not None or self.target is not None or self.distort


def share_past_fold(camera: Camera) -> float:
    """Share of a camera's image that lies past the fold of its lens, where no ray ends, to about a thousandth."""
    width, height = camera.size
    corners = np.array([(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)])
    if np.linalg.norm(corners - camera.K[:2, 2], axis=1).max() <= camera.valid_radius_px:
        return 0.0
    u, v = (np.linspace(0, side - 1, _NODES) for side in camera.size)
    rays = camera.unproject(np.stack(np.meshgrid(u, v), axis=-1))
    return float(np.isnan(rays[..., 0]).mean())


def share_blind(cameras: Cameras) -> float:
    """Share of the pixels of a target that see nothing of the source, to about a hundredth."""
    u, v = (np.linspace(0, side - 1, _NODES) for side in cameras.target.size)
    rays = cameras.target.unproject(np.stack(np.meshgrid(u, v), axis=-1))
    return float(1 - sees_source(cameras.source, rays[..., :2]).mean())


@dataclass(frozen=True, slots=True, eq=False)
class Cameras:
    """Two cameras that look the same way.

    Attributes
    ----------
    source : Camera
        Of the files that are read.
    target : Camera
        Of the files that are written.
    """

    source: Camera
    target: Camera

    def map(self, *, exact: bool = False) -> UndistortMap:
        """Build the map from the one to the other, interpolated to 2e-4 pixels or exact."""
        undistort = undistort_map(self.source, self.target)
        if not exact:
            return undistort
        from camcal.undistortion.exact import exact_map

        return exact_map(undistort)
