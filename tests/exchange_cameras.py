"""Cameras that are sent through other tools' files, and where they see points."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from camcal.formats.camera_file import save_intrinsics
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics

K = [[900.125, 0, 640.3], [0, 905.5, 352.7], [0, 0, 1]]
WEBCAM = Camera((1280, 720), K, [-0.25, 0.1, 1e-3, -5e-4, -0.02])
CAMERAS = {
    "pinhole": Camera((1280, 720), K),
    "radtan": Camera((1280, 720), K, [-0.25, 0.1, 1e-3, -5e-4]),
    "webcam": WEBCAM,
    "rational": Camera(
        (720, 1280), [[900.125, 0, 352.7], [0, 905.5, 640.3], [0, 0, 1]], [-0.25, 0.1, 1e-3, -5e-4, -0.02, 0.05, -0.01, 0.002]
    ),
    "skewed": Camera((1280, 720), [[900.125, 1.5, 640.3], [0, 905.5, 352.7], [0, 0, 1]], [-0.25, 0.1, 1e-3, -5e-4, -0.02]),
    "one focal": Camera((1280, 720), [[900.125, 0, 640.3], [0, 900.125, 352.7], [0, 0, 1]], [-0.25, 0.1]),
}


def points(camera: Camera, count: int = 1000) -> np.ndarray:
    """Points in front of a camera that it sees all over its image, at ranges from .5 to 5 m: shape (count, 3)."""
    rng = np.random.default_rng(6)
    pixels = rng.uniform([-0.5, -0.5], np.array(camera.size) - 0.5, (count, 2))
    return camera.unproject(pixels) * rng.uniform(0.5, 5, (count, 1))


def saved(folder: Path, camera: str, **known: object) -> Path:
    """One of the cameras, as a camera file."""
    path = folder / f"{camera}.yaml"
    save_intrinsics(path, replace(Intrinsics(CAMERAS[camera], name=camera), **known))
    return path


def same(camera: Camera, other: Camera, ulps: int = 0) -> None:
    """Check that two cameras are the same, but for so many last bits of the principal point."""
    assert camera.size == other.size
    assert camera.dist.tobytes() == other.dist.tobytes()
    assert camera.K[:, :2].tobytes() == other.K[:, :2].tobytes()
    off = np.abs(camera.K[:, 2] - other.K[:, 2])
    assert (off <= ulps * np.spacing(np.abs(camera.K[:, 2]))).all()
