"""How a real board may differ from a flat and true print: a bow of two parameters, and a stretch of one axis.

The bow is a parabola along each axis, z = bow_x 4u(1 - u) + bow_y 4v(1 - v) with u and v from 0 to 1 over the features: what
paper, foam and sheets of aluminium do first. A print that is too large or small all over cannot be told from a camera
farther away, but one that is stretched along one axis can.
"""

from __future__ import annotations

import numpy as np

from camcal.geometry.arrays import FloatArray

BOW = ("bow_x", "bow_y")
STRETCH = ("stretch",)
SHAPE_NAMES = BOW + STRETCH


def shape_basis(object_points: FloatArray, names: tuple[str, ...] = SHAPE_NAMES) -> FloatArray:
    """By how much each feature moves per unit of each parameter of the board's shape.

    Parameters
    ----------
    object_points : ndarray of shape (N, 3)
        Features of the flat, true board in metres.
    names : tuple of str
        Some of `SHAPE_NAMES`.

    Returns
    -------
    ndarray of shape (N, 3, S)
        Metres per metre of bow; metres per unit of stretch (y grows, x stays).

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.2, 0.1, 0]])
    >>> shape_basis(points, ("bow_x",))[:, 2, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    low, high = object_points[:, :2].min(axis=0), object_points[:, :2].max(axis=0)
    u, v = ((object_points[:, :2] - low) / (high - low)).T
    basis = np.zeros((len(object_points), 3, len(SHAPE_NAMES)))
    basis[:, 2, 0] = 4 * u * (1 - u)
    basis[:, 2, 1] = 4 * v * (1 - v)
    basis[:, 1, 2] = object_points[:, 1]
    return basis[..., [SHAPE_NAMES.index(name) for name in names]]
