"""How far two cameras disagree in each intrinsic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.records import Intrinsics


@dataclass(frozen=True, slots=True)
class ParameterError:
    """One intrinsic against its truth.

    Attributes
    ----------
    name : str
    truth, estimate : float
        In the parameter's unit (pixels, or dimensionless for the lens).
    sigma : float
        Standard deviation of the difference: the estimate's, together with the other's if that is an estimate as well;
        NaN if the parameter was not solved for.
    """

    name: str
    truth: float
    estimate: float
    sigma: float

    @property
    def error(self) -> float:
        """Estimate minus truth."""
        return self.estimate - self.truth

    @property
    def error_in_sigma(self) -> float:
        """Error over its standard deviation; NaN where that is not known."""
        return self.error / self.sigma if self.sigma > 0 else float("nan")


def parameter_errors(truth: Intrinsics, estimate: Intrinsics) -> tuple[ParameterError, ...]:
    """Compare every intrinsic that is free in the estimate or not zero in either camera."""
    other = truth.sigma
    sigma = {name: float(np.hypot(value, other.get(name, 0.0))) for name, value in estimate.sigma.items()}
    names = estimate.camera.intrinsic_names
    rows = zip(names, truth.camera.intrinsics.tolist(), estimate.camera.intrinsics.tolist(), strict=True)
    return tuple(
        ParameterError(name, true, value, sigma.get(name, float("nan")))
        for name, true, value in rows
        if name in sigma or true or value
    )
