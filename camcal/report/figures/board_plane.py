"""Where the residuals want each feature of the board to be: what is wrong with the board is alike in all views."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from camcal.calibration.board_shape import shape_basis
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.report.figures.canvas import WIDTH_IN, arrows, blank, dots, dress, length_key, magnification, magnified, round_below
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.wording import rounded

SIGNIFICANT_SIGMAS = 4.0
"""A feature that is off by more standard deviations of its mean residual is really elsewhere."""

_FEWEST_SIGHTS = 2
_ROOM_SHARE, _KEY_SHARE, _MARGIN_SHARE = 0.07, 0.2, 0.08
_MM = 1e3


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the mean residual of each feature, carried to the board's plane, in millimetres."""
    places = _MM * record.board.object_points[:, :2]
    offsets, sigmas = feature_offsets(record)
    offsets, sigmas = _MM * offsets, _MM * sigmas
    seen = np.isfinite(sigmas)
    low, high = places.min(axis=0), places.max(axis=0)
    width, height = (high - low) * (1 + 2 * _MARGIN_SHARE)
    figure = blank(float(np.clip((WIDTH_IN - 0.9) * height / width, 2.0, 4.6)) + 0.95, style)
    axes = figure.subplots()
    factor = magnification(offsets[seen], _ROOM_SHARE * width)
    dress(axes, style, f"Mean residual of each feature, {magnified(factor)}", "x on the board (mm)", "y on the board (mm)")
    axes.set_aspect("equal")
    axes.set_xlim(low[0] - _MARGIN_SHARE * width, high[0] + _MARGIN_SHARE * width)
    axes.set_ylim(high[1] + _MARGIN_SHARE * width, low[1] - _MARGIN_SHARE * width)
    dots(axes, places, style.muted, area=10)
    off = significant(offsets, sigmas)
    arrows(axes, places[seen & ~off], factor * offsets[seen & ~off], style.plain, width=1.2)
    arrows(axes, places[off], factor * offsets[off], style.bad, width=1.5)
    length = round_below(_KEY_SHARE * width / factor)
    length_key(axes, style, length * factor, f"{length:g} mm")
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and how many features are off."""
    offsets, sigmas = feature_offsets(record)
    off = significant(offsets, sigmas)
    good = (
        "Good: short arrows in all directions. Arrows that agree with their neighbours show a board that is stretched, bent or "
        "badly printed."
    )
    if not off.any():
        return f"{good} Here no feature is off by more than noise."
    largest = _MM * float(np.linalg.norm(offsets[off], axis=1).max())
    return f"{good} Here {off.sum()} of {off.size} features (in red) are off by up to {rounded(largest)} mm."


def feature_offsets(record: Record) -> tuple[FloatArray, FloatArray]:
    """By how much each feature seems to be off in the board's plane: the least-squares shift for all its residuals.

    Returns
    -------
    offsets : ndarray of shape (N, 2)
        Seen minus specified, metres, board frame; 0 where `sigmas` is NaN.
    sigmas : ndarray of shape (N,)
        Standard deviation per axis that noise leaves of it; NaN for a feature that was seen in fewer than two views.
    """
    calibration, points = record.calibration, record.board.object_points
    if calibration.shape.names:
        points = points + shape_basis(points, calibration.shape.names) @ calibration.shape.values
    ids = np.concatenate([seen.ids for seen in calibration.detections])
    view = np.repeat(np.arange(len(calibration.poses)), [len(seen) for seen in calibration.detections])
    R = np.array([pose.R for pose in calibration.poses])[view]
    t = np.array([pose.t for pose in calibration.poses])[view]
    residuals = np.concatenate(calibration.residuals_px)
    with np.errstate(all="ignore"):
        _, d_point, _ = calibration.camera.project_with_jacobians((R @ points[ids][..., None])[..., 0] + t)
        J = d_point @ R[..., :2]
        information = _summed(np.swapaxes(J, -1, -2) @ J, ids, len(points))
        pushed = _summed((np.swapaxes(J, -1, -2) @ residuals[..., None])[..., 0], ids, len(points))
    determined = np.linalg.det(information) > 0
    usable = (
        (np.bincount(ids, minlength=len(points)) >= _FEWEST_SIGHTS) & np.isfinite(information).all(axis=(1, 2)) & determined
    )
    offsets, sigmas = np.zeros((len(points), 2)), np.full(len(points), np.nan)
    inverse = np.linalg.inv(information[usable])
    offsets[usable] = (inverse @ pushed[usable][..., None])[..., 0]
    sigmas[usable] = calibration.rms_px / np.sqrt(2) * np.sqrt(np.trace(inverse, axis1=1, axis2=2) / 2)
    return offsets, sigmas


def significant(offsets: FloatArray, sigmas: FloatArray) -> BoolArray:
    """Tell which features (N,) are off by more than noise."""
    off: BoolArray = np.linalg.norm(offsets, axis=1) > SIGNIFICANT_SIGMAS * np.nan_to_num(sigmas, nan=np.inf)
    return off


def _summed(values: FloatArray, ids: IntArray, count: int) -> FloatArray:
    """Sum values (M, ...) over the corners of each feature: shape (count, ...)."""
    flat = values.reshape(len(values), -1)
    sums = np.stack([np.bincount(ids, column, minlength=count) for column in flat.T], axis=1)
    return sums.reshape(count, *values.shape[1:]).astype(np.float64)
