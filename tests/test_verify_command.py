"""`camcal verify`: its gates, and cameras that are compared without their views."""

from __future__ import annotations

import json

from messages import one_line

from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.records import Intrinsics


def test_verify_gates(run, dataset, calibrated):
    """A gate that fails is exit 5 and says by how much; the table still goes to stdout."""
    code, out, err = run("verify", calibrated, "--truth", dataset, "--max-diff", "1e-6")
    assert code == 5
    assert "projection difference" in out
    assert "--max-diff" in one_line(err)
    code, _, err = run("verify", calibrated, "--truth", dataset, "--max-sigma", "1e-6")
    assert code == 5
    assert "--max-sigma" in one_line(err)
    assert run("verify", calibrated, "--truth", dataset, "--max-diff", "-1")[0] == 2
    assert run("verify", dataset, "--truth", calibrated, "--max-sigma", "4")[0] == 2


def test_verify_of_camera_files(run, dataset, calibrated, tmp_path):
    """Camera files alone are compared too, without views; another image size is refused with both sizes."""
    code, out, _ = run("verify", calibrated / "camera.yaml", "--truth", dataset / "camera.yaml", "--json")
    assert code == 0
    assert json.loads(out)["views"] is None
    scaled = tmp_path / "scaled.yaml"
    save_intrinsics(scaled, Intrinsics(load_intrinsics(dataset).camera.scaled((320, 240))))
    code, _, err = run("verify", calibrated / "camera.yaml", "--truth", scaled)
    assert code == 2
    assert "640x480" in one_line(err)
    assert "320x240" in one_line(err)
