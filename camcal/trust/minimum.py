"""The minimum that a calibration stands at, as its tests need it: linearised, with more freed, or with some views only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.board_shape import shape_basis
from camcal.calibration.finish import descend
from camcal.calibration.normal_equations import NormalEquations, Observations, State, residuals
from camcal.calibration.parameters import places
from camcal.calibration.weights import total_sigma_px
from camcal.geometry.arrays import BoolArray, FloatArray, IntArray
from camcal.observations import Calibration

ONE_LENS = ("k1", "k2", "p1", "p2", "k3")
"""What any one lens may have: freed where a lens model that is too simple must not be taken for something else."""


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """A state at the lowest sum of squares, and the corners it was reached with.

    Attributes
    ----------
    state : State
    seen : Observations
        The corners with their weights.
    columns : ndarray of shape (F,)
        Places of the free parameters in `State.shared`.
    """

    state: State
    seen: Observations
    columns: IntArray

    @classmethod
    def of(cls, calibration: Calibration, board: Board) -> Minimum:
        """Take up a calibration where it ended: its corners weigh what they weighed, its board's shape is free if it was."""
        points, detections, shape = board.object_points, calibration.detections, calibration.shape
        seen = Observations.gather(detections, points).shaped(detections, shape_basis(points, shape.names))
        state = replace(State.of(calibration.camera, calibration.poses), shape=np.array(shape.values))
        columns = places(calibration.camera, calibration.free)
        columns = np.append(columns, calibration.camera.intrinsics.size + np.arange(len(shape.names)))
        sigma_px = np.concatenate([detection.sigma_px for detection in detections])
        total = total_sigma_px(sigma_px, residuals(state, seen), columns.size + 6 * len(detections))
        return cls(state, seen if total is None else seen.weighted(total), columns)

    @property
    def residuals(self) -> FloatArray:
        """Weighted residuals, shape (M, 2): pixels of a corner of weight 1."""
        weighted: FloatArray = residuals(self.state, self.seen) * self.seen.weights[:, None]
        return weighted

    @property
    def cost(self) -> float:
        """Weighted sum of squared residuals, px²."""
        return float((self.residuals**2).sum())

    @property
    def variance_px2(self) -> float:
        """Variance per axis of a corner of weight 1; NaN where nothing is left to tell it."""
        freedom = 2 * self.seen.view.size - self.columns.size - 6 * self.seen.starts.size
        return self.cost / freedom if freedom > 0 else float("nan")

    def view_information(self) -> tuple[FloatArray, FloatArray]:
        """What each view says about the free parameters: information (V, F, F) and gradient (V, F), per px² of variance."""
        return NormalEquations.build(self.state, self.seen, self.columns).view_information()

    def freed(self, intrinsics: tuple[str, ...] = (), basis: FloatArray | None = None) -> Minimum:
        """Free more parameters, which still stand where they stood.

        Parameters
        ----------
        intrinsics : tuple of str
            Names of intrinsics that are free from now on.
        basis : ndarray of shape (M, 3, S), optional
            By how much each seen feature moves per unit of further parameters of the board's shape; they come last.
        """
        count = self.state.camera.intrinsics.size
        camera = np.union1d(self.columns[self.columns < count], places(self.state.camera, intrinsics).astype(np.int64))
        shape = self.columns[self.columns >= count]
        if basis is None:
            return replace(self, columns=np.append(camera, shape))
        added = count + self.state.shape.size + np.arange(basis.shape[-1])
        return Minimum(
            replace(self.state, shape=np.append(self.state.shape, np.zeros(basis.shape[-1]))),
            replace(self.seen, shape_basis=np.concatenate([self.seen.shape_basis, basis], axis=-1)),
            np.concatenate([camera, shape, added]),
        )

    def only(self, views: BoolArray) -> Minimum:
        """Keep some of the views, shape (V,)."""
        return replace(self, state=self.state.of_views(np.flatnonzero(views)), seen=self.seen.only(views[self.seen.view]))

    def descended(self) -> Minimum | None:
        """Descend to the minimum of what is free; None if there is none to be reached."""
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = descend(self.state, self.seen, self.columns)
        return None if found.failure else replace(self, state=found.state)
