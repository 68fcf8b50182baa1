"""The whole judgement of a calibration: every check, what explains what, and one verdict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camcal.boards.base import Board
from camcal.calibration.board_shape import BOW
from camcal.observations import Calibration
from camcal.records import Uncertainty
from camcal.threads import single_threaded
from camcal.trust.board_tests import board_findings
from camcal.trust.consistency import consistency
from camcal.trust.coverage import coverage_findings
from camcal.trust.cross_validation import CrossValidation, cross_validate
from camcal.trust.explanations import explained
from camcal.trust.fisheye import check_fisheye
from camcal.trust.gates import certainty_findings, gate_findings
from camcal.trust.influence import Influence, influence
from camcal.trust.linearised import Linearised
from camcal.trust.minimum import Minimum
from camcal.trust.models import compare_models
from camcal.trust.structure import structure_findings
from camcal.trust.uncertainty import uncertainty
from camcal.trust.views import view_findings
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
    cross_validation : CrossValidation
    influence : Influence
        The view that moves the answer most.
    verdict : Verdict
    """

    uncertainty: Uncertainty
    cross_validation: CrossValidation
    influence: Influence
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
        minimum = Minimum.of(calibration, board)
        linearised = Linearised.of(minimum)
        known = uncertainty(calibration, board.object_points)
        halves = cross_validate(linearised, is_bow_free=set(BOW) <= set(calibration.shape.names))
        corners = np.concatenate([seen.corners_px for seen in calibration.detections])
        weightiest = influence(linearised, [seen.source for seen in calibration.detections], corners)
        models = compare_models(minimum, linearised)
        fisheye = check_fisheye(minimum)
        findings = [
            *gate_findings(calibration, board, anamorphic=anamorphic),
            *certainty_findings(calibration, known),
            *halves.findings,
            *weightiest.findings,
            *(models.findings if models else ()),
            *(fisheye.findings if fisheye else ()),
            *board_findings(calibration, board),
            *consistency(calibration, board),
            *structure_findings(calibration, board),
            *coverage_findings(calibration, board),
            *view_findings(calibration, board),
        ]
    verdict = explained(findings)
    verdict = Verdict.of([*verdict.findings, *_failed_gates(calibration, known, verdict, gates)])
    return Assessment(known, halves, weightiest, verdict)


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
