"""Whether the residuals look like noise: against the radius, the place in the image, the feature, and their neighbours.

Corners that are merely noisy leave residuals that average out wherever they are averaged. What does not average out is
told by where it does not: a lens that the model cannot follow, a board that is not as its SPEC says, views that are off
as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.board_shape import BOW
from camcal.geometry.arrays import FloatArray, IntArray
from camcal.geometry.pose import rotation_from_rvec
from camcal.observations import Calibration
from camcal.trust.minimum import Minimum
from camcal.trust.wording import rounded
from camcal.verdict import Finding

_RINGS = 12
_COLUMNS = 8
_TANGENTIAL = {"p1", "p2"}
_ENOUGH = {"k1", "k2", "k3"} | _TANGENTIAL
_FEWEST_SIGHTS = 3
# Standard deviations by which the averages must exceed what noise leaves of them.
_SIGNIFICANT_SIGMAS = 5.0
# A kind is named if it holds this part of what neighbours have in common; rings if they hold this part
# of what the largest kind does: boards and noise leave next to nothing in them.
_TELLING, _RINGS_TELL = 0.45, 0.35
# A note from the first on; from the second on the predicted uncertainty is too small to be taken at its word.
_NOTED_PX, _RELEVANT_PX = 0.01, 0.1


@dataclass(frozen=True, slots=True)
class Structure:
    """A part of the residuals that is no noise.

    Attributes
    ----------
    kind : str
        What the residuals go with: `radius`, `position` (in the image), `feature` (of the board) or `neighbours` (in a view).
    size_px : float
        Root mean square of that part per axis, what noise leaves of it taken off; 0 if there is none.
    sigmas : float
        By how many standard deviations it exceeds what noise leaves.
    """

    kind: str
    size_px: float
    sigmas: float


def structures(calibration: Calibration, board: Board) -> tuple[Structure, ...]:
    """Measure every kind of structure.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Structure
        Of the four kinds, in this order; empty if the corners leave nothing over.
    """
    minimum = Minimum.of(calibration, board)
    if not minimum.variance_px2 > 0:
        return ()
    ids = np.concatenate([detection.ids for detection in calibration.detections])
    return (_by_radius(minimum), _by_position(minimum), _by_feature(minimum, ids), _by_neighbours(minimum, ids, board))


def structure_findings(calibration: Calibration, board: Board) -> tuple[Finding, ...]:
    """Say what the residuals go with if they are no noise.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Finding
        `structured_residuals` for the largest structure that is significant, or nothing.
    """
    found = [each for each in structures(calibration, board) if each.sigmas > _SIGNIFICANT_SIGMAS]
    every = max((each.size_px for each in found), default=0.0)
    if every < _NOTED_PX:
        return ()
    largest = _most_telling(found)
    text, advice = _told(largest, calibration, board)
    return (
        Finding(
            "structured_residuals",
            "usable" if every >= _RELEVANT_PX else "note",
            every / (1 + every),
            f"{text} ({rounded(largest.size_px)} px per axis of {rounded(calibration.rms_px / np.sqrt(2))})",
            advice,
        ),
    )


def _most_telling(found: list[Structure]) -> Structure:
    """Choose the kind that says most: whatever is structured shows between neighbours too, and a lens in more than rings."""
    by_kind = {each.kind: each for each in found}
    telling = [each for each in found if each.kind != "neighbours"]
    largest = max(telling, key=lambda each: each.size_px, default=found[0])
    alike = by_kind.get("neighbours", largest)
    if largest.size_px < _TELLING * alike.size_px:
        return alike
    radius = by_kind.get("radius", largest)
    return radius if "radius" in by_kind and radius.size_px > _RINGS_TELL * largest.size_px else largest


def _told(structure: Structure, calibration: Calibration, board: Board) -> tuple[str, str]:
    """Text and advice for a kind of structure."""
    if structure.kind == "radius":
        more = (
            "" if set(calibration.free) >= _ENOUGH else "Free more coefficients with --distortion (k1,k2,k3, then p1,p2), and "
        )
        return (
            "the residuals go with the distance from the principal point: the lens model does not follow the lens",
            _sentence(f"{more}check that the lens is no fisheye."),
        )
    if structure.kind == "position":
        more = "" if set(calibration.free) >= _TANGENTIAL else "Free p1,p2 with --distortion, and "
        return (
            "the residuals go with the place in the image: the lens model does not follow the lens there",
            _sentence(f"{more}check that no software corrects, stabilises or crops the images."),
        )
    if structure.kind == "feature":
        off_mm = 1e3 * board_error_m(calibration, board)
        solve = "" if set(BOW) <= set(calibration.shape.names) else ", and try --warp"
        return (
            f"the same features are off in every view: the board is not as its SPEC says, by {rounded(off_mm)} mm",
            f"Measure the print, glue it to something flat{solve}; if it stays so, use a better board.",
        )
    return (
        "neighbouring corners are off alike within each view",
        "Hold camera and board still while the shutter is open, and check that no software corrects or stabilises the images.",
    )


def _sentence(text: str) -> str:
    """Begin with a capital letter."""
    return text[0].upper() + text[1:]


def board_error_m(calibration: Calibration, board: Board) -> float:
    """Root mean square distance of the features from where the SPEC has them, as far as the residuals tell, in metres.

    What poses and camera could make up for is not in it, so the board is off by this at least.
    """
    minimum = Minimum.of(calibration, board)
    ids = np.concatenate([detection.ids for detection in calibration.detections])
    information, pushed = _feature_information(minimum, ids)
    offsets = np.linalg.solve(information, pushed[..., None])[..., 0]
    # Noise is what is left once every feature stands where its residuals want it.
    freedom = minimum.cost / minimum.variance_px2 - offsets.size
    variance = (minimum.cost - float((offsets * pushed).sum())) / max(1.0, freedom)
    noise = variance * np.trace(np.linalg.inv(information), axis1=1, axis2=2)
    return float(np.sqrt(max(0.0, ((offsets**2).sum(axis=1) - noise).mean())))


def _by_radius(minimum: Minimum) -> Structure:
    """Average the radial residuals over rings of as many corners each."""
    away = minimum.seen.corners_px - minimum.state.camera.K[:2, 2]
    radius = np.linalg.norm(away, axis=1)
    outward = away / np.maximum(radius, np.finfo(float).tiny)[:, None]
    ring = np.argsort(np.argsort(radius)) * _RINGS // radius.size
    radial = (minimum.residuals * outward).sum(axis=1)[:, None]
    return _averages("radius", radial, ring, minimum)


def _by_position(minimum: Minimum) -> Structure:
    """Average the residuals over cells of the image."""
    width, height = minimum.state.camera.size
    rows = max(1, round(_COLUMNS * height / width))
    cell = ((minimum.seen.corners_px + 0.5) / [width, height] * [_COLUMNS, rows]).astype(np.int64)
    cell = np.clip(cell, 0, [_COLUMNS - 1, rows - 1])
    return _averages("position", minimum.residuals, cell[:, 1] * _COLUMNS + cell[:, 0], minimum)


def _averages(kind: str, residuals: FloatArray, group: IntArray, minimum: Minimum) -> Structure:
    """Compare the means of weighted residuals (M, D) over groups (M,) with what noise leaves of them."""
    weights = minimum.seen.weights
    _, group = np.unique(group, return_inverse=True)
    total = np.stack([np.bincount(group, weights * column) for column in residuals.T], axis=1)
    gains = (total**2).sum(axis=1) / np.bincount(group, weights**2)
    return _structure(kind, float(gains.sum()), total.size, minimum)


def _by_feature(minimum: Minimum, ids: IntArray) -> Structure:
    """Move each feature of the board to where its residuals want it."""
    information, pushed = _feature_information(minimum, ids)
    gains = (pushed * np.linalg.solve(information, pushed[..., None])[..., 0]).sum(axis=1)
    return _structure("feature", float(gains.sum()), pushed.size, minimum)


def _feature_information(minimum: Minimum, ids: IntArray) -> tuple[FloatArray, FloatArray]:
    """Information (N, 3, 3) and gradient (N, 3) about each feature's place on the board; features seen often enough only."""
    state, seen = minimum.state, minimum.seen
    R = rotation_from_rvec(state.rvecs)[seen.view]
    points = seen.points_board + seen.shape_basis @ state.shape
    _, d_point, _ = state.camera.project_with_jacobians((R @ points[..., None])[..., 0] + state.ts[seen.view])
    rows = np.concatenate([d_point @ R * seen.weights[:, None, None], minimum.residuals[..., None]], axis=-1)
    products = np.zeros((ids.max() + 1, 4, 4))
    np.add.at(products, ids, np.swapaxes(rows, -1, -2) @ rows)
    products = products[np.bincount(ids) >= _FEWEST_SIGHTS]
    # Views from one side only leave a feature's height open: a hair of what is known of its place is added to it.
    information = products[:, :3, :3]
    hair = 1e-6 * np.trace(information, axis1=1, axis2=2)
    return information + hair[:, None, None] * np.eye(3), products[:, :3, 3]


def _structure(kind: str, gain: float, parameters: int, minimum: Minimum) -> Structure:
    """Rate a gain in the weighted sum of squares by so many parameters: chi squared if there is only noise."""
    variance = minimum.variance_px2
    excess = gain / variance - parameters
    size = np.sqrt(max(0.0, excess) * variance / (minimum.residuals.size * _mean_square_weight(minimum)))
    return Structure(kind, float(size), float(excess / np.sqrt(2 * max(1, parameters))))


def _mean_square_weight(minimum: Minimum) -> float:
    """Turns weighted squares into squares of pixels."""
    return float((minimum.seen.weights**2).mean())


def _by_neighbours(minimum: Minimum, ids: IntArray, board: Board) -> Structure:
    """Correlate the residuals of corners that lie side by side on the board, within each view."""
    view, seen = minimum.seen.view, minimum.residuals
    one, other = _neighbours(board.object_points)
    place = np.full((minimum.seen.starts.size, len(board.object_points)), -1)
    place[view, ids] = np.arange(ids.size)
    first, second = place[:, one].ravel(), place[:, other].ravel()
    both = (first >= 0) & (second >= 0)
    products = (seen[first[both]] * seen[second[both]]).sum(axis=1)
    variance = minimum.variance_px2
    covariance = float(products.mean() / 2) if products.size else 0.0
    size = np.sqrt(max(0.0, covariance) / _mean_square_weight(minimum))
    return Structure("neighbours", float(size), covariance / variance * float(np.sqrt(2 * products.size)))


def _neighbours(object_points: FloatArray) -> tuple[IntArray, IntArray]:
    """Ids of pairs of features that are nearest to each other on the board, each pair once."""
    apart = np.linalg.norm(object_points[:, None] - object_points, axis=-1)
    np.fill_diagonal(apart, np.inf)
    near = apart <= 1.01 * apart.min(axis=1, keepdims=True)
    one, other = np.nonzero(np.triu(near | near.T))
    return one, other
