"""Maps without interpolation: where every pixel looks is worked out by the cameras themselves."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from camcal.undistortion.tiles import Rough, Tile

if TYPE_CHECKING:
    from camcal.geometry.camera import Camera
    from camcal.undistortion.maps import UndistortMap


def exact_map(undistort: UndistortMap) -> UndistortMap:
    """Work out every position of a map one by one.

    Parameters
    ----------
    undistort : UndistortMap

    Returns
    -------
    UndistortMap
        The same pixels, at `source.project(target.unproject(pixel))` to float64's last bits; float32 when they are used.
        It takes 24 bytes of memory a pixel.
    """
    width, height = undistort.target.size
    n = undistort.samples
    sampled = undistort.target if n == 1 else undistort.target.scaled((width * n, height * n))
    tiles = tuple(tile if tile.sees_nothing else _exact_tile(tile, undistort, sampled) for tile in undistort.tiles)
    return replace(undistort, tiles=tiles)


def _exact_tile(tile: Tile, undistort: UndistortMap, sampled: Camera) -> Tile:
    """Replace what a tile interpolates."""
    u, v = np.arange(tile.left, tile.left + tile.width), np.arange(tile.top, tile.top + tile.height)
    xy = undistort.source.project(sampled.unproject(np.stack(np.meshgrid(u, v), axis=-1))).reshape(-1, 2)
    valid = ((xy >= undistort.low_px) & (xy <= undistort.high_px)).all()
    every = Rough(np.zeros((tile.height, tile.width), dtype=bool), np.arange(tile.width * tile.height), xy)
    return replace(tile, whole=bool(valid), rough=every)
