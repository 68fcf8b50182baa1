"""The whole judgement of a calibration: every check, what explains what, and one verdict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.observations import Calibration, Uncertainty
from camcal.threads import single_threaded
from camcal.trust.explanations import explained
from camcal.trust.gates import certainty_findings, gate_findings
from camcal.trust.uncertainty import uncertainty
from camcal.verdict import Finding, Verdict


@dataclass(frozen=True, slots=True)
class Gates:
    """What a user demands of a calibration; NaN and an empty word demand nothing.

    Attributes
    ----------
    require : str
        The least word of the verdict.
    max_rms_px : float
        Largest RMS reprojection error.
    max_sigma_px : float
        Largest standard deviation of the projection at the middle, the edges and the corners of the image, for points at
        the boards' range; places without a ray do not count.
    """

    require: str = ""
    max_rms_px: float = float("nan")
    max_sigma_px: float = float("nan")


NO_GATES = Gates()


@dataclass(frozen=True, slots=True)
class Assessment:
    """How far a calibration can be trusted.

    Attributes
    ----------
    uncertainty : Uncertainty
    cross_validation : float
        Difference of halves of the views over its prediction; NaN where there are too few views.
    verdict : Verdict
    """

    uncertainty: Uncertainty
    cross_validation: float
    verdict: Verdict


def assess(calibration: Calibration, board: Board, *, anamorphic: bool = False, gates: Gates = NO_GATES) -> Assessment:
    """Judge a calibration.

    Parameters
    ----------
    calibration : Calibration
    board : Board
        The board it was solved with.
    anamorphic : bool
        Whether pixels far from square are expected.
    gates : Gates
        What it must reach, beyond not being rejected.
    """
    with single_threaded():
        known = uncertainty(calibration, board.object_points)
        findings = [
            *gate_findings(calibration, board, anamorphic=anamorphic),
            *certainty_findings(calibration, known),
        ]
        cross = float("nan")
    verdict = explained(findings)
    return Assessment(known, cross, Verdict.of([*verdict.findings, *_failed_gates(calibration, known, verdict, gates)]))


def _failed_gates(calibration: Calibration, known: Uncertainty, verdict: Verdict, gates: Gates) -> list[Finding]:
    """Turn every demand that is not met into a finding that rejects the calibration."""
    found = []
    if gates.require and not verdict.reaches(gates.require):
        text = f"the verdict is {verdict.word} (--require {gates.require})"
        found.append(Finding("gate_verdict", "rejected", -1.0, text, "Follow the advice of the other findings."))
    if calibration.rms_px > gates.max_rms_px:
        text = f"RMS reprojection error is {calibration.rms_px:.3g} px (--max-rms {gates.max_rms_px:g})"
        found.append(Finding("gate_rms", "rejected", -2.0, text, "Look at the views and corners that fit worst."))
    at_range = known.at_range
    worst = float(np.nanmax([at_range.centre_px, *at_range.edges_px, *at_range.corners_px]))
    if not worst <= gates.max_sigma_px and not np.isnan(gates.max_sigma_px):
        text = f"the projection is known to {worst:.3g} px only at worst (--max-sigma-px {gates.max_sigma_px:g})"
        found.append(Finding("gate_sigma", "rejected", -3.0, text, "Add views that reach the image's corners."))
    return found
