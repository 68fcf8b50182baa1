"""Small images and cameras to undistort, and what became of a folder."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from camcal.geometry.camera import Camera

SIZE = (64, 48)
CAMERA = Camera(SIZE, [[50, 0, 30.3], [0, 51, 24.7], [0, 0, 1]], [-0.2, 0.05, 0.001, -0.002, 0])
FOLDED = Camera(SIZE, [[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1]], [-0.6, 0.1])


def picture(seed: int = 0, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A smooth colour image, another for each seed."""
    noise = np.random.default_rng(seed).integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)
    return cv2.GaussianBlur(noise, (0, 0), 2)


def make_images(folder: Path, *names: str, size: tuple[int, int] = SIZE) -> Path:
    """Write images, each another one; return the folder."""
    for index, name in enumerate(names):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(path), picture(index, size))
    return folder


def tree(folder: Path) -> list[str]:
    """Every file of a folder, by its path below it, and every folder that is empty."""
    found = (path for path in folder.rglob("*") if not path.is_dir() or not any(path.iterdir()))
    return sorted(path.relative_to(folder).as_posix() for path in found)


def stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """Inode and time of every image of a folder: both change when a file is replaced."""
    return {
        name: (status.st_ino, status.st_mtime_ns)
        for name in tree(folder)
        if ".png" in name and (status := (folder / name).stat())
    }
