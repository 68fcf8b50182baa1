"""What twins got wrong, from cameras that are known to the last digit."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from scenes import CAMERA

from camcal.compare.projection import predicted_difference_px
from camcal.compare.twins import twin_errors
from camcal.records import Intrinsics


class TestTwinErrors:
    """What twins got wrong, from cameras that are known to the last digit."""

    SIGMA = np.array([0.05, 0.06, 0.03, 0.02, 1e-4, 2e-4, 1e-4])

    def known(self, camera=CAMERA, factor=1.0) -> Intrinsics:
        """A camera whose parameters are known to some standard deviations, without correlations."""
        free = ("fx", "fy", "cx", "cy", "k1", "k2", "k3")
        return Intrinsics(camera, free=free, covariance=np.diag((factor * self.SIGMA) ** 2))

    def moved(self, steps, factor=1.0) -> Intrinsics:
        """The camera with its free parameters off by some standard deviations."""
        values = CAMERA.intrinsics.copy()
        columns = [CAMERA.intrinsic_names.index(name) for name in self.known().free]
        values[columns] += self.SIGMA * np.asarray(steps)
        return self.known(CAMERA.with_intrinsics(values), factor)

    def test_parameters(self):
        """Errors of +3 and -1 standard deviations have a mean of 1 and a root mean square of √5."""
        errors = twin_errors(self.known(), [self.moved([3] * 7), self.moved([-1] * 7)])
        for parameter, sigma in zip(errors.parameters, self.SIGMA, strict=True):
            assert parameter.predicted == pytest.approx(sigma)
            assert parameter.bias == pytest.approx(sigma)
            assert parameter.actual == pytest.approx(sqrt(5) * sigma)
            assert parameter.claimed == pytest.approx(sigma)
            assert parameter.ratio == pytest.approx(sqrt(5))

    @pytest.mark.parametrize(("made", "claimed"), [(1.0, 1.0), (0.1, 0.2), (4.0, 1.0)])
    def test_ratio(self, made, claimed):
        """Errors drawn from the covariance times a factor give that ratio, within four of its standard deviations.

        The same where it is told from what the twins claim themselves, and in every part of the image. The projection is
        linear in errors this small.
        """
        rng = np.random.default_rng(5)
        errors = twin_errors(self.known(), [self.moved(made * rng.normal(size=7), claimed) for _ in range(60)])
        doubt = 4 / sqrt(2 * 60)
        assert errors.calibrated == 60
        assert errors.ratio_error == pytest.approx(1 / sqrt(120))
        assert errors.ratio == pytest.approx(made, rel=doubt)
        assert errors.honesty == pytest.approx(made / claimed, rel=doubt)
        for part in errors.projection:
            assert part.ratio == pytest.approx(made, rel=doubt)
        assert errors.projection[-1].ratio == errors.ratio
        meaning = {1.0: "as predicted", 0.1: "what limits it is not noise", 4.0: "more than predicted"}
        assert errors.meaning.startswith(meaning[made])

    def test_parts(self):
        """Each part of the image is the prediction there: the grid holds the corners, and the centre but for half a cell."""
        truth = self.known()
        predicted = predicted_difference_px(truth).reshape(48, 64)
        part = {each.place: each.predicted_px for each in twin_errors(truth, [truth]).projection}
        ends = predicted[[0, 0, -1, -1], [0, -1, -1, 0]]
        assert part["corners"] == pytest.approx(sqrt((ends**2).mean()))
        middle = predicted[23:25, 31:33]
        assert middle.min() <= part["centre"] <= middle.max()
        assert part["image"] == pytest.approx(sqrt((predicted**2).mean()))
        assert part["centre"] < part["edges"] < part["corners"]

    def test_no_error(self):
        """Twins that recover the truth exactly make no error."""
        errors = twin_errors(self.known(), [self.known()])
        assert errors.ratio == pytest.approx(0.0, abs=1e-9)
        assert errors.compared_share == 1.0

    def test_fold(self):
        """Where the true lens has no answer nothing is compared, and the corners say so."""
        folding = CAMERA.with_intrinsics([900, 905, 645.3, 470.2, *([0] * (CAMERA.intrinsics.size - 4))])
        values = folding.intrinsics.copy()
        values[folding.intrinsic_names.index("k1")] = -0.6
        truth = self.known(folding.with_intrinsics(values))
        errors = twin_errors(truth, [truth])
        assert 0.3 < errors.compared_share < 1.0
        assert np.isnan(errors.projection[2].actual_px)
        assert np.isfinite(errors.ratio)

    def test_held_coefficient(self):
        """A twin that holds a coefficient at 0 is off by all of it, and claims no standard deviation."""
        values = CAMERA.intrinsics.copy()
        values[CAMERA.intrinsic_names.index("k3")] = 0.0
        held = Intrinsics(CAMERA.with_intrinsics(values), free=self.known().free[:-1], covariance=np.diag(self.SIGMA[:-1] ** 2))
        last = twin_errors(self.known(), [held]).parameters[-1]
        assert (last.name, last.actual) == ("k3", pytest.approx(0.01))
        assert np.isnan(last.claimed)
