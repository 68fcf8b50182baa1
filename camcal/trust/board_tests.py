"""Whether the board is what its SPEC says: flat, as long along y as along x, and with the spacing that was named."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.calibration.board_shape import BOW, STRETCH, shape_basis
from camcal.compare.projection import predicted_difference_px, projection_difference
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.observations import Calibration
from camcal.records import Intrinsics
from camcal.trust.linearised import inverse
from camcal.trust.minimum import ONE_LENS, Minimum
from camcal.trust.wording import rounded
from camcal.verdict import Finding

_SPACING = ("spacing",)

# Noise passes 4 standard deviations once in 3,000 boards along two axes, once in 16,000 along one.
_SIGNIFICANT_SIGMAS = 4.0
_NAMED_SIGMAS = 3.0
# A deviation matters if it moves the projection, in the median over the image, by this much and by more than is known of it.
_RELEVANT_PX = 0.1
_RELEVANT_SIGMAS = 1.0
# No print is off by this share of its spacing: another spacing was meant.
_WRONG_SPACING = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Deviation:
    """How far some parameters of the board's shape are from what they are taken for, with all the others free.

    Attributes
    ----------
    names : tuple of str
        Of `board_shape.SHAPE_NAMES`, or `spacing`.
    values : ndarray of shape (S,)
        Bow in metres; stretch of y against x; change of an AprilGrid's gap in metres.
    sigmas : ndarray of shape (S,)
        Standard deviations: the predicted ones, or those that leaving out one view after another shows, if these are larger.
    length_sigmas : float
        Distance from zero in standard deviations, correlations included.
    """

    names: tuple[str, ...]
    values: FloatArray
    sigmas: FloatArray
    length_sigmas: float


def board_deviations(calibration: Calibration, board: Board) -> tuple[Deviation, ...]:
    """Estimate by one Newton step what was not solved for of the board's shape: its bow, its stretch, its spacing.

    Whatever one lens may have is free as well, so that a lens model that is too simple is not taken for a bent board.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Deviation
        None for a shape that the calibration has solved for; all of them empty if the corners leave no freedom.
    """
    plain = Minimum.of(calibration, board)
    groups = _open_groups(calibration, board)
    names = tuple(name for group in groups for name in group)
    if not names or not plain.variance_px2 > 0:
        return ()
    freed = plain.freed(ONE_LENS, _rows(calibration, _basis(board, names)))
    information, gradient = freed.view_information()
    inverted = inverse(information.sum(axis=0))
    step = inverted @ gradient.sum(axis=0)
    covariance = plain.variance_px2 * inverted
    seen = _jackknife_variance(information, gradient, step)
    wider = np.maximum(1, seen / np.maximum(np.diag(covariance), np.finfo(float).tiny))
    found, first = [], len(step) - len(names)
    for group in groups:
        at = first + np.array([names.index(name) for name in group])
        block = covariance[np.ix_(at, at)] * wider[at].max()
        length = float(np.sqrt(step[at] @ inverse(block) @ step[at]))
        found.append(Deviation(group, step[at], np.sqrt(np.diag(block)), length))
    return tuple(found)


def board_findings(calibration: Calibration, board: Board) -> tuple[Finding, ...]:
    """Test the board's flatness, its print's scale and an AprilGrid's spacing, as far as they were not solved for.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Finding
        `wrong_spacing`, `bent_board`, `stretched_print`: only what is significant; a note if it does not matter.
    """
    significant = [each for each in board_deviations(calibration, board) if each.length_sigmas > _SIGNIFICANT_SIGMAS]
    values = _solved_values(calibration, board) if significant else {}
    telling = {"bow_x": _bent, "stretch": _stretched, "spacing": _spaced}
    found = []
    for deviation in significant if values else []:
        solved = replace(deviation, values=np.array([values[name] for name in deviation.names]))
        found.append(telling[deviation.names[0]](_shift(calibration, board, solved), board))
    return tuple(found)


@dataclass(frozen=True, slots=True, eq=False)
class _Shift:
    """A deviation solved for, and what that does to the camera: in the median over the image, pixels and predicted sigmas."""

    deviation: Deviation
    pixels: float
    sigmas: float

    @property
    def level(self) -> str:
        return "usable" if self.pixels >= _RELEVANT_PX and self.sigmas >= _RELEVANT_SIGMAS else "note"

    @property
    def weight(self) -> float:
        """From 0 to 1."""
        return 1 - 1 / (1 + self.pixels)

    @property
    def text(self) -> str:
        px, sigmas = rounded(self.pixels), rounded(self.sigmas)
        return f"which moves the projection by {px} px in the median ({sigmas} of its standard deviations)"


def _solved_values(calibration: Calibration, board: Board) -> dict[str, float]:
    """Solve for everything that was not solved for of the board's shape; empty if that leads nowhere."""
    names = tuple(name for group in _open_groups(calibration, board) for name in group)
    solved = Minimum.of(calibration, board).freed((), _rows(calibration, _basis(board, names))).descended()
    return {} if solved is None else dict(zip(names, solved.state.shape[-len(names) :].tolist(), strict=True))


def _shift(calibration: Calibration, board: Board, deviation: Deviation) -> _Shift:
    """Solve for the camera with a board that deviates so."""
    plain = Minimum.of(calibration, board)
    freed = plain.freed((), _rows(calibration, _basis(board, deviation.names)))
    shape = np.append(plain.state.shape, deviation.values)
    solved = Minimum(replace(freed.state, shape=shape), freed.seen, plain.columns).descended()
    if solved is None:
        return _Shift(deviation, float("inf"), float("inf"))
    return _Shift(deviation, *_camera_shift(calibration, solved.state.camera))


def _camera_shift(calibration: Calibration, other: Camera) -> tuple[float, float]:
    """Median difference of the projection over the image to another camera, in pixels and in predicted deviations."""
    predicted = predicted_difference_px(
        Intrinsics(calibration.camera, free=calibration.free, covariance=calibration.covariance)
    )
    try:
        length = np.linalg.norm(projection_difference(calibration.camera, other).difference_px, axis=1)
    except InputError:
        return float("inf"), float("inf")
    known = np.isfinite(length) & np.isfinite(predicted)
    return float(np.median(length[known])), float(np.median(length[known] / predicted[known]))


def _bent(shift: _Shift, board: Board) -> Finding:  # noqa: ARG001
    bows = zip(("x", "y"), (1e3 * shift.deviation.values).tolist(), (1e3 * shift.deviation.sigmas).tolist(), strict=True)
    axes = sorted(bows, key=lambda bow: -abs(bow[1]) / bow[2])
    told = [axes[0], *(bow for bow in axes[1:] if abs(bow[1]) > _NAMED_SIGMAS * bow[2])]
    how = " and ".join(f"by {rounded(abs(bow))} ± {rounded(sigma)} mm along {axis}" for axis, bow, sigma in told)
    return Finding(
        "bent_board",
        shift.level,
        shift.weight,
        f"the board is bowed {how}, {shift.text}",
        "Pass --warp to solve for the bow, or glue the board to something flat and take the views anew.",
    )


def _stretched(shift: _Shift, board: Board) -> Finding:  # noqa: ARG001
    (stretch,), (sigma,) = shift.deviation.values.tolist(), shift.deviation.sigmas.tolist()
    which = "longer" if stretch > 0 else "shorter"
    return Finding(
        "stretched_print",
        shift.level,
        shift.weight,
        f"the print is {rounded(100 * abs(stretch))} ± {rounded(100 * sigma)} % {which} along y than its SPEC says, against x, "
        f"{shift.text}",
        "Measure the print along both sides; pass --scale to solve for the stretch, or print it anew at true scale.",
    )


def _spaced(shift: _Shift, board: Board) -> Finding:
    if not isinstance(board, AprilGrid):
        raise TypeError(f"board: only an AprilGrid has a spacing (got {board.spec})")
    off, sigma, named = (
        float(length) / board.tag_m for length in (shift.deviation.values[0], shift.deviation.sigmas[0], board.gap_m)
    )
    wrong = abs(off) > _WRONG_SPACING * named
    return Finding(
        "wrong_spacing",
        "rejected" if wrong else shift.level,
        shift.weight,
        f"the corners fit a spacing of {named + off:.4g} ± {rounded(sigma)} of the tag's side (the SPEC says {named:.4g}), "
        f"{shift.text}",
        "Measure the gap between two tags and a tag's black border, outside to outside, and name their ratio in the SPEC.",
    )


def _open_groups(calibration: Calibration, board: Board) -> list[tuple[str, ...]]:
    """What may deviate and was not solved for."""
    groups = [BOW, STRETCH, *([_SPACING] if isinstance(board, AprilGrid) else [])]
    return [group for group in groups if not set(group) & set(calibration.shape.names)]


def _basis(board: Board, names: tuple[str, ...]) -> FloatArray:
    """By how much each feature moves per unit of each parameter, shape (N, 3, S)."""
    points = board.object_points
    parts = [spacing_basis(board) if name in _SPACING else shape_basis(points, (name,)) for name in names]
    return np.concatenate(parts, axis=-1)


def spacing_basis(board: Board) -> FloatArray:
    """By how much each feature of an AprilGrid moves per metre of its gap: shape (N, 3, 1)."""
    if not isinstance(board, AprilGrid):
        raise TypeError(f"board: only an AprilGrid has a spacing (got {board.spec})")
    # Features lie a whole number of tags and gaps from the origin, so a difference quotient is exact.
    wider = replace(board, gap_m=board.gap_m + board.tag_m).object_points
    moved: FloatArray = (wider - board.object_points)[..., None] / board.tag_m
    return moved


def _rows(calibration: Calibration, basis: FloatArray) -> FloatArray:
    """Rows of a basis for every corner seen."""
    rows: FloatArray = basis[np.concatenate([detection.ids for detection in calibration.detections])]
    return rows


def _jackknife_variance(information: FloatArray, gradient: FloatArray, step: FloatArray) -> FloatArray:
    """Variance (F,) of a Newton step by leaving out one view after another (Efron and Stein 1981).

    It holds for whatever the corners of one view have in common: noise alone does not explain how views differ.
    """
    left = gradient - information @ step
    others = information.sum(axis=0) - information
    moved = (inverse(others) @ left[..., None])[..., 0]
    count = len(gradient)
    variance: FloatArray = (count - 1) / count * ((moved - moved.mean(axis=0)) ** 2).sum(axis=0)
    return variance
