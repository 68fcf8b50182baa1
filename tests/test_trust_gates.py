"""Gates and certainty: what makes a calibration one that must not be trusted, or trusted only so far."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenes import BOARD, CAMERA, detections, poses

from camcal.calibration.causes import solve_board
from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.trust.assess import Gates, assess
from camcal.trust.gates import certainty_findings, gate_findings
from camcal.trust.uncertainty import uncertainty

POINTS = BOARD.object_points


def test_a_doubtful_focal_length_is_a_finding():
    """Known to some percent only: the finding gives the relative standard deviation and says to tilt."""
    solved = solve(detections(poses(10, 2, tilt=0.03), noise_px=0.1), POINTS)
    sigma = 100 * np.sqrt(np.diag(solved.covariance)[:2]) / np.diag(solved.camera.K)[:2]
    (finding,) = certainty_findings(solved, uncertainty(solved, POINTS))
    assert finding.code == "uncertain"
    assert f"the focal length to {sigma.max():.2g} %" in finding.text
    assert "tilted 20-45°" in finding.advice


def test_one_mirrored_view_is_named():
    """A single mirrored view is named, and the camera stands: it is counted by view, not on average."""
    views = detections(poses(9, 6), noise_px=0.1)
    corners = views[2].corners_px.reshape(BOARD.rows, BOARD.columns, 2)[:, ::-1].reshape(-1, 2)
    solved = solve_board([*views[:2], replace(views[2], corners_px=corners), *views[3:]], BOARD)
    findings = certainty_findings(solved, uncertainty(solved, POINTS))
    assert [finding.code for finding in findings] == ["seen_from_behind"]
    assert "view_002: the board is seen from behind (1 of 9 views)" in findings[0].text


def test_good_calibration_passes_every_gate():
    """Ordinary noise raises no problem."""
    assert gate_findings(solve(detections(poses(10, 17), noise_px=0.1), POINTS), BOARD) == ()


def test_pixels_far_from_square_need_the_flag():
    """An fx / fy of 2 is a problem unless it was announced."""
    camera = Camera(CAMERA.size, [[900, 0, 640], [0, 450, 480], [0, 0, 1]], [-0.1])
    solved = solve(detections(poses(10, 18, camera=camera), camera=camera), POINTS)
    assert "fx / fy is 2.000" in gate_findings(solved, BOARD)[0].text
    assert gate_findings(solved, BOARD, anamorphic=True) == ()


def test_fold_inside_the_corners_is_a_problem():
    """A model that turns back inside the area of the corners must not be handed over."""
    solved = solve(detections(poses(10, 19), noise_px=0.1), POINTS)
    folded = replace(solved, camera=Camera(CAMERA.size, CAMERA.K, [-2.0]))
    assert "fold_inside_corners" in [finding.code for finding in gate_findings(folded, BOARD)]


def test_demands_reject_what_does_not_meet_them():
    """An RMS or a sigma above the limit asked for, or a lower word: rejected, by a finding that names the option."""
    solved = solve(detections(poses(10, 17), noise_px=0.1), POINTS)
    free = assess(solved, BOARD)
    assert free.verdict.word in ("usable", "good")
    for gates, code, option in (
        (Gates(max_rms_px=0.5 * solved.rms_px), "gate_rms", "--max-rms"),
        (Gates(max_sigma_px=0.001), "gate_sigma", "--max-sigma-px"),
    ):
        verdict = assess(solved, BOARD, gates=gates).verdict
        assert (verdict.word, verdict.findings[0].code) == ("rejected", code)
        assert option in verdict.findings[0].text
    assert assess(solved, BOARD, gates=Gates("poor", 2 * solved.rms_px, 1e3)).verdict == free.verdict
