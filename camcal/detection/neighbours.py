"""Corners against their neighbours: a board is flat and a lens is smooth, so each corner follows from those around it."""

from __future__ import annotations

import numpy as np

from camcal.geometry.arrays import FloatArray, IntArray

# A quadratic map has six coefficients; sixteen corners are four tags, or the ring of neighbours two wide without corners.
_NEIGHBOURS = 16
_RIDGE = 1e-6


def without_strays(layout: FloatArray, corners_px: FloatArray, farthest_px: FloatArray) -> FloatArray:
    """Mark corners that lie off where their neighbours put them, the worst of each neighbourhood first.

    Parameters
    ----------
    layout : ndarray of shape (N, 2)
        Where the corners are on the board, in spacings of the order of 1.
    corners_px : ndarray of shape (N, 2)
        Where they were seen, in pixels; NaN where one was not.
    farthest_px : ndarray of shape (N,)
        How far off each may lie.

    Returns
    -------
    ndarray of shape (N, 2)
        With NaN for the strays. With hardly more corners than a prediction needs nothing is marked.
    """
    corners = corners_px.copy()
    while True:
        known = np.flatnonzero(np.isfinite(corners[:, 0]))
        if known.size <= _NEIGHBOURS:
            return corners
        around, predicted = _predicted_each(layout[known], corners[known])
        stray = np.linalg.norm(corners[known] - predicted, axis=1) / farthest_px[known]
        worst = (stray > 1) & (stray >= stray[around].max(axis=1))
        if not worst.any():
            return corners
        corners[known[worst]] = np.nan


def _predicted_each(layout: FloatArray, corners_px: FloatArray) -> tuple[IntArray, FloatArray]:
    """Each corner (K, 2) from its neighbours alone, by a quadratic map: perspective and lens distortion are one, locally.

    Returns
    -------
    around : ndarray of shape (K, n)
        The neighbours' indices.
    predicted : ndarray of shape (K, 2)
    """
    distance = np.linalg.norm(layout[:, None] - layout[None], axis=2)
    np.fill_diagonal(distance, np.inf)
    around = np.argsort(distance, axis=1, kind="stable")[:, :_NEIGHBOURS]
    x, y = np.moveaxis(layout[around] - layout[:, None], 2, 0)
    # At the corner itself x = y = 0: the prediction is the constant term of the fit.
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    centre = corners_px[around].mean(axis=1, keepdims=True)
    # A trace of a ridge keeps corners on two lines, which leave a curvature open, solvable.
    normal = np.swapaxes(terms, 1, 2) @ terms + _RIDGE * np.eye(terms.shape[2])
    coefficients = np.linalg.solve(normal, np.swapaxes(terms, 1, 2) @ (corners_px[around] - centre))
    predicted = coefficients[:, 0] + centre[:, 0]
    return around, predicted
