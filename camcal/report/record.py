"""What a report shows: a finished calibration with all that is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from camcal.boards.base import Board
from camcal.observations import Calibration
from camcal.records import Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """A calibration as the report and its figures take it; the same whether just made or read back from its files.

    Attributes
    ----------
    calibration : Calibration
        With its outliers, its rejected images and the joint covariance.
    intrinsics : Intrinsics
        What camera.yaml holds: the verdict, the uncertainty.
    board : Board
    notes : dict of str to tuple of str
        Clauses about a view, by image name: those of the detection, and the corners that were refused or left out.
    settings : dict of str to str
        How the calibration was made, name and value, for people.
    """

    calibration: Calibration
    intrinsics: Intrinsics
    board: Board
    notes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
