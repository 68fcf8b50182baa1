"""`camcal verify`: its gates, and cameras that are compared without their views."""

from __future__ import annotations

import json
import math

from messages import one_line

from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.rounding import spread


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


def test_the_standard_deviation_stands_beside_what_it_is_of(run, dataset, calibrated):
    """Beside the estimate where the truth is exact; beside the difference, and wider, where the truth is an estimate too."""
    _, out, _ = run("verify", calibrated, "--truth", dataset)
    assert "recovered ± std. dev.   difference   in" in out
    _, out, _ = run("verify", calibrated, "--truth", calibrated)
    assert "recovered   difference ± std. dev.   in" in out
    known = load_intrinsics(calibrated)
    line = next(line.split() for line in out.splitlines() if line.startswith(" fx "))
    assert line[-3:] == ["±", spread(math.sqrt(2) * known.sigma["fx"]), "+0.00"]


def test_numbers_of_unknown_spread_are_short(run, dataset, tmp_path):
    """Six digits of each parameter where neither file has standard deviations: 0.00107908653494 is not what anybody reads."""
    camera = load_intrinsics(dataset).camera
    dist, longer = camera.dist.copy(), [[1.0000123456789, 1, 1], [1, 1, 1], [1, 1, 1]]
    dist[2] = 0.00107908653494
    save_intrinsics(tmp_path / "camera.yaml", Intrinsics(Camera(camera.size, camera.K * longer, dist)))
    _, out, _ = run("verify", tmp_path / "camera.yaml", "--truth", dataset)
    lines = {line.split()[0]: line.split()[1:] for line in out.splitlines() if line.startswith((" fx ", " p1 "))}
    assert lines["fx"] == ["520", "520.006", "±", "-", "+0.0064", "-"]
    assert lines["p1"] == ["0", "0.00107909", "±", "-", "+0.0011", "-"]
