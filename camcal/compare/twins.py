"""What repeated calibrations of one known camera got wrong, beside what a calibration had predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from camcal.compare.projection import predicted_difference_px, projection_difference
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.records import Intrinsics

_CERTAIN_SIGMAS = 3.0


@dataclass(frozen=True, slots=True)
class TwinParameter:
    """One free intrinsic over all twins.

    Attributes
    ----------
    name : str
    predicted : float
        Standard deviation that the photographs' calibration gives it, in its unit.
    actual : float
        Root mean square of the errors that the twins made.
    bias : float
        Their mean.
    claimed : float
        Root mean square of the standard deviations that the twins' own calibrations gave it; NaN if one held it fixed.
    """

    name: str
    predicted: float
    actual: float
    bias: float
    claimed: float

    @property
    def ratio(self) -> float:
        """Error made over the one predicted."""
        return self.actual / self.predicted


@dataclass(frozen=True, slots=True)
class TwinProjection:
    """How far the twins' projection of far points is off in one part of the image, the implied rotation taken out.

    Attributes
    ----------
    place : str
        "centre", "edges" (the middles of all four), "corners" (all four), or "image" (all of it).
    predicted_px, actual_px, claimed_px : float
        Root mean square length, pixels, as for `TwinParameter`; NaN where a lens has no answer.
    """

    place: str
    predicted_px: float
    actual_px: float
    claimed_px: float

    @property
    def ratio(self) -> float:
        """Error made over the one predicted."""
        return self.actual_px / self.predicted_px


@dataclass(frozen=True, slots=True)
class TwinErrors:
    """What the twins that were calibrated got wrong.

    Attributes
    ----------
    calibrated : int
        How many there were, N.
    parameters : tuple of TwinParameter
    projection : tuple of TwinProjection
        Centre, edges, corners, image.
    compared_share : float
        Share of the image where the true lens and that of every twin have an answer.
    """

    calibrated: int
    parameters: tuple[TwinParameter, ...]
    projection: tuple[TwinProjection, ...]
    compared_share: float

    @property
    def ratio(self) -> float:
        """Projection error made over the one predicted, over the image.

        About 1: noise of the pixels is all that the calibration suffers from, and it says so. Well below 1: the photographs'
        corners are off by more than their noise (the board is not flat, the lens no Brown-Conrady one, the print rough), which
        the prediction takes in and a twin cannot show. Above 1 by more than `ratio_error`: the prediction is too good.
        """
        return self._over_image.ratio

    @property
    def meaning(self) -> str:
        """What the ratio says, as a clause."""
        doubt = 1 + _CERTAIN_SIGMAS * self.ratio_error
        if self.ratio > doubt:
            return "more than predicted: do not rely on the standard deviations"
        if self.ratio < 1 / doubt:
            return "what limits it is not noise but the board, the print or the lens model"
        return "as predicted, so noise is all that limits it"

    @property
    def honesty(self) -> float:
        """Projection error made over the one that the twins' own calibrations claim: 1 if standard deviations are right."""
        return self._over_image.actual_px / self._over_image.claimed_px

    @property
    def ratio_error(self) -> float:
        """Relative standard deviation of either ratio, at most.

        The mean square over N twins of any quadratic form of normal errors has a relative standard deviation of at most
        √(2 / N), reached if all errors are of one kind; its root has half of that.
        """
        return float(1 / np.sqrt(2 * self.calibrated))

    @property
    def _over_image(self) -> TwinProjection:
        return self.projection[-1]

    def as_dict(self) -> dict[str, object]:
        """Return everything as plain values, for JSON."""
        return {
            "calibrated": self.calibrated,
            "ratio": self.ratio,
            "meaning": self.meaning,
            "honesty": self.honesty,
            "ratio_error": self.ratio_error,
            "compared_share": self.compared_share,
            "parameters": [asdict(parameter) | {"ratio": parameter.ratio} for parameter in self.parameters],
            "projection_px": [asdict(part) | {"ratio": part.ratio} for part in self.projection],
        }


def twin_errors(truth: Intrinsics, estimates: Sequence[Intrinsics]) -> TwinErrors:
    """Compare calibrations of twins with the camera that the twins were rendered with.

    Parameters
    ----------
    truth : Intrinsics
        That camera, as it was estimated from photographs: its covariance is the prediction.
    estimates : sequence of Intrinsics
        At least one, of the same image size.

    Raises
    ------
    InputError
        If an estimate has no pixel in common with the truth.
    """
    differences = [projection_difference(truth.camera, estimate.camera) for estimate in estimates]
    squares = (
        predicted_difference_px(truth) ** 2,
        np.mean([(difference.difference_px**2).sum(axis=1) for difference in differences], axis=0),
        np.mean([predicted_difference_px(estimate) ** 2 for estimate in estimates], axis=0),
    )
    known = np.all(np.isfinite(squares), axis=0)
    parts = _parts(differences[0].pixels, truth.camera.size)
    return TwinErrors(
        calibrated=len(estimates),
        parameters=tuple(_parameter(name, truth, estimates) for name in truth.free),
        projection=tuple(
            TwinProjection(place, *(_root_mean(square[rows][known[rows]]) for square in squares)) for place, rows in parts
        ),
        compared_share=float(known.mean()),
    )


def _parameter(name: str, truth: Intrinsics, estimates: Sequence[Intrinsics]) -> TwinParameter:
    """Judge one intrinsic."""
    column = truth.camera.intrinsic_names.index(name)
    error = np.array([estimate.camera.intrinsics[column] for estimate in estimates]) - truth.camera.intrinsics[column]
    claimed = np.array([estimate.sigma.get(name, np.nan) for estimate in estimates])
    return TwinParameter(name, truth.sigma[name], _root_mean(error**2), float(error.mean()), _root_mean(claimed**2))


def _parts(pixels: FloatArray, size: tuple[int, int]) -> tuple[tuple[str, IntArray | BoolArray], ...]:
    """Parts of the image and the pixels (M, 2) of the comparison's grid that stand for them."""
    right, bottom = size[0] - 1, size[1] - 1
    places: dict[str, list[tuple[float, float]]] = {
        "centre": [(right / 2, bottom / 2)],
        "edges": [(right / 2, 0), (right, bottom / 2), (right / 2, bottom), (0, bottom / 2)],
        "corners": [(0, 0), (right, 0), (right, bottom), (0, bottom)],
    }
    parts: list[tuple[str, IntArray | BoolArray]] = [
        (place, np.array([np.linalg.norm(pixels - point, axis=1).argmin() for point in points]))
        for place, points in places.items()
    ]
    return (*parts, ("image", np.ones(len(pixels), dtype=bool)))


def _root_mean(squares: FloatArray) -> float:
    """Square root of the mean; NaN of nothing."""
    return float(np.sqrt(squares.mean())) if squares.size else float("nan")
