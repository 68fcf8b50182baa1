"""What the capture shows the solve: where in the image the corners fell, and how the boards were tilted and how far away."""

from __future__ import annotations

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import BoolArray, FloatArray
from camcal.observations import Calibration
from camcal.trust.uncertainty import image_grid
from camcal.trust.wording import listed, rounded
from camcal.verdict import Finding

_THIRDS = (("top-left", "top", "top-right"), ("left", "middle", "right"), ("bottom-left", "bottom", "bottom-right"))
_ROW, _COLUMN = np.indices((3, 3))
_SIDES = {"left": _COLUMN == 0, "right": _COLUMN == 2, "top": _ROW == 0, "bottom": _ROW == 2}
_CELLS = 8
_MANY_THIRDS = 4

# How far corners reach (98 of 100 stay below), from the image's middle to its corner. Made captures that cover the image
# reach 0.65 to 0.8; where they end, a polynomial lens is on its own.
_REACH_SHARE = 0.98
_POOR_REACH, _USABLE_REACH = 0.4, 0.5

# Tilt is what tells the focal length from the distance.
_POOR_TILT_DEG, _TILTED_DEG, _FEWEST_TILTED = 10.0, 15.0, 3
# Parallel boards tell no more than one of them, however they are turned or shifted.
_POOR_SPREAD_DEG, _USABLE_SPREAD_DEG = 8.0, 12.0
_ONE_AXIS_DEG = 4.0
_ONE_DISTANCE_RATIO = 1.15
# Share of the image's width or height that the median board spans.
_SMALL_BOARD, _TINY_BOARD = 0.25, 0.15

_OFF_CENTRE, _FAR_OFF_CENTRE, _OFF_CENTRE_SIGMAS = 0.06, 0.1, 5.0
_POOR_FOLDED_SHARE = 1 / 3


def coverage_findings(calibration: Calibration, board: Board) -> tuple[Finding, ...]:
    """Judge where the corners fell and how the boards stood, and what the lens does where no corner fell.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.

    Returns
    -------
    tuple of Finding
        Some of `central_only` or `uncovered`, `fronto_parallel` or `one_orientation`, `one_distance`, `small_boards`,
        `off_centre` and `fold_in_image`.
    """
    corners = np.concatenate([detection.corners_px for detection in calibration.detections])
    normals = np.array([pose.R[:, 2] * np.sign(pose.R[2, 2]) for pose in calibration.poses])
    checks = (
        _central(corners, calibration.camera.size) or _uncovered(corners, calibration.camera.size),
        _fronto_parallel(normals) or _one_orientation(normals),
        _one_distance(calibration, board),
        _small_boards(calibration),
        _off_centre(calibration),
        _fold_in_image(calibration, corners),
    )
    return tuple(finding for finding in checks if finding)


def reached_share(corners_px: FloatArray, size: tuple[int, int]) -> float:
    """Share of an image's cells, an eighth of its width and about as high, in which a corner (M, 2) fell."""
    rows = max(1, round(_CELLS * size[1] / size[0]))
    return float(_reached(corners_px, size, _CELLS, rows).mean())


def _reached(corners_px: FloatArray, size: tuple[int, int], columns: int, rows: int) -> BoolArray:
    """Tell in which cells of a grid over the image a corner fell, shape (rows, columns)."""
    cell = ((corners_px + 0.5) / size * [columns, rows]).astype(np.int64)
    column, row = np.clip(cell, 0, [columns - 1, rows - 1]).T
    reached = np.zeros((rows, columns), dtype=bool)
    reached[row, column] = True
    return reached


def _central(corners_px: FloatArray, size: tuple[int, int]) -> Finding | None:
    middle = (np.array(size) - 1) / 2
    away = np.linalg.norm(corners_px - middle, axis=1) / np.linalg.norm(middle)
    reach = float(np.quantile(away, _REACH_SHARE))
    if reach >= _USABLE_REACH:
        return None
    return Finding(
        "central_only",
        "poor" if reach < _POOR_REACH else "usable",
        1 - reach,
        f"the detections keep to the middle of the image: {100 * _REACH_SHARE:.0f} % of them lie within {100 * reach:.0f} % of "
        "the way to its corners",
        "Add views with the board near each edge and in each corner of the image.",
    )


def _uncovered(corners_px: FloatArray, size: tuple[int, int]) -> Finding | None:
    missed = ~_reached(corners_px, size, 3, 3)
    count = int(missed.sum())
    if not count:
        return None
    names: list[str] = []
    left = missed.copy()
    for side, where in _SIDES.items():
        if missed[where].all():
            names.append(side)
            left[where] = False
    names += [_THIRDS[row][column] for row, column in np.argwhere(left)]
    return Finding(
        "uncovered",
        "poor" if count >= _MANY_THIRDS else "usable",
        count / 9,
        f"no corner ever reached the {listed(names)} third{'s' if len(names) > 1 else ''} of the image "
        f"({100 * reached_share(corners_px, size):.0f} % of its cells were reached)",
        f"Add 3 views {'there' if len(names) == 1 else 'in each of them'}.",
    )


def _fronto_parallel(normals: FloatArray) -> Finding | None:
    """Judge the angles between the boards, with their normals (V, 3), and the image plane."""
    tilts = np.degrees(np.arccos(np.minimum(1.0, normals[:, 2])))
    largest, tilted = float(tilts.max()), int((tilts >= _TILTED_DEG).sum())
    if tilted >= _FEWEST_TILTED:
        return None
    if tilted:
        text = f"only {tilted} of {tilts.size} views are tilted by {_TILTED_DEG:.0f}° or more"
    else:
        text = f"every view is within {np.ceil(largest):.0f}° of fronto-parallel"
    level = "poor" if largest < _POOR_TILT_DEG else "usable"
    return Finding("fronto_parallel", level, 1 - largest / 90, text, "Tilt the board 20-45° in different directions.")


def _one_orientation(normals: FloatArray) -> Finding | None:
    """Judge whether the boards, with their normals (V, 3), are tilted differently."""
    mean = normals.mean(axis=0)
    mean = mean / np.linalg.norm(mean)
    spread = float(np.degrees(np.arccos(np.clip(normals @ mean, -1, 1))).max())
    if spread < _USABLE_SPREAD_DEG:
        level = "poor" if spread < _POOR_SPREAD_DEG else "usable"
        text = f"every board is tilted the same way, within {np.ceil(spread):.0f}°: parallel boards tell no more than one"
        return Finding("one_orientation", level, 1 - spread / 90, text, "Tilt the board 20-45° in different directions.")
    across = float(np.degrees(np.linalg.svd(normals[:, :2] - normals[:, :2].mean(axis=0), compute_uv=False)[-1]))
    across /= np.sqrt(len(normals))
    if across >= _ONE_AXIS_DEG:
        return None
    text = f"every board is tilted about the same axis, within {rounded(across)}° RMS"
    return Finding("one_orientation", "note", 0.0, text, "Tilt some boards to the left and right, and others up and down.")


def _one_distance(calibration: Calibration, board: Board) -> Finding | None:
    points = board.object_points
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    distances = np.array([np.linalg.norm(pose.apply(centre)) for pose in calibration.poses])
    ratio = float(distances.max() / distances.min())
    if ratio >= _ONE_DISTANCE_RATIO:
        return None
    return Finding(
        "one_distance",
        "note",
        _ONE_DISTANCE_RATIO - ratio,
        f"every board is about as far away ({distances.min():.3g} to {distances.max():.3g} m)",
        "Add views with the board nearer, and others with it twice as far away.",
    )


def _small_boards(calibration: Calibration) -> Finding | None:
    spans = [float((np.ptp(seen.corners_px, axis=0) / seen.size).max()) for seen in calibration.detections]
    typical = float(np.median(spans))
    if typical >= _SMALL_BOARD:
        return None
    return Finding(
        "small_boards",
        "usable" if typical < _TINY_BOARD else "note",
        1 - typical,
        f"the boards are small in the image: the median one spans {100 * typical:.0f} % of it",
        "Bring the board nearer until it spans half of the image, or use a larger one.",
    )


def _off_centre(calibration: Calibration) -> Finding | None:
    camera = calibration.camera
    offset = camera.K[:2, 2] - (np.array(camera.size) - 1) / 2
    sigmas = np.sqrt(np.diag(calibration.covariance)[[calibration.free.index("cx"), calibration.free.index("cy")]])
    share = np.abs(offset) / camera.size
    axis = int(np.argmax(share))
    if share[axis] < _OFF_CENTRE or abs(offset[axis]) < _OFF_CENTRE_SIGMAS * sigmas[axis]:
        return None
    way = (("left of", "right of"), ("above", "below"))[axis][int(offset[axis] > 0)]
    return Finding(
        "off_centre",
        "usable" if share[axis] > _FAR_OFF_CENTRE else "note",
        float(share[axis]),
        f"the principal point lies {abs(offset[axis]):.0f} ± {rounded(sigmas[axis])} px {way} the image's middle "
        f"({100 * share[axis]:.0f} % of its {('width', 'height')[axis]})",
        "Check that the images are whole and not cropped; if the sensor is read out in part, crop every image alike.",
    )


def _fold_in_image(calibration: Calibration, corners_px: FloatArray) -> Finding | None:
    camera = calibration.camera
    radius = camera.valid_radius_px
    share = float(np.isnan(camera.unproject(image_grid(camera.size))[:, 0]).mean()) if np.isfinite(radius) else 0.0
    # Where the lens turns back among the corners the camera is wrong, which is another finding.
    if not share or np.isnan(camera.unproject(corners_px)[:, 0]).any():
        return None
    farthest = float(np.linalg.norm(corners_px - camera.K[:2, 2], axis=1).max())
    return Finding(
        "fold_in_image",
        "poor" if share > _POOR_FOLDED_SHARE else "usable",
        share,
        f"the lens model turns back {radius:.0f} px from the principal point: {rounded(100 * share)} % of the image is invalid "
        f"(the farthest detection lies at {farthest:.0f} px)",
        "Use the image within that radius, add views that reach its corners, or free fewer coefficients with --distortion.",
    )
