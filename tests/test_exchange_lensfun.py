"""Lenses of lensfun's database: imported, they distort as lensfun does."""

from __future__ import annotations

import numpy as np
import pytest
from exchange_samples import LENS, write
from messages import Listener

from camcal.errors import InputError
from camcal.geometry.camera import Camera
from camcal.workflows.import_ import import_camera

LENSES = {
    "poly3": ('model="poly3"', {"k1": -0.03}, ""),
    "poly5": ('model="poly5"', {"k1": -0.03, "k2": 0.01}, "<aspect-ratio>4:3</aspect-ratio>"),
    "ptlens": ('model="ptlens"', {"a": 0.02, "b": -0.05, "c": 0.01}, '<center x="0.02" y="-0.03"/>'),
}


@pytest.mark.parametrize("model", LENSES)
def test_lensfun_lenses(tmp_path, model):
    """The imported camera distorts as lensfun does: exactly, or within what its refit tells."""
    lensfunpy = pytest.importorskip("lensfunpy", reason="lensfunpy is not installed")
    _, values, extra = LENSES[model]
    terms = " ".join(f'{name}="{value}"' for name, value in values.items())
    path = write(tmp_path, "lens.xml", LENS.format(model=model, terms=terms, extra=extra))
    size = (900, 600)
    reporter = Listener()
    camera = import_camera(path, size=size, reporter=reporter).camera
    assert (camera.K[0, 1], camera.K[0, 0]) == (0, camera.K[1, 1])
    told = reporter.warnings
    assert ("refitted" in " ".join(told)) == (model == "ptlens")
    allowed_px = float(told[0].partition("up to ")[2].split()[0]) if told else 0.0
    assert allowed_px < 0.1
    database = lensfunpy.Database(xml=path.read_text(), load_common=False, load_bundled=False)
    body = database.find_cameras("M", "C")[0]
    lens = database.find_lenses(body, "M", "L")[0]
    modifier = lensfunpy.Modifier(lens, 1.5, *size)
    modifier.initialize(20.0, 4.0, 10.0, scale=1.0, flags=lensfunpy.ModifyFlags.DISTORTION)
    ideal = np.random.default_rng(2).uniform([0, 0], np.array(size) - 1, (500, 2)).astype(np.float32).astype(float)
    found = np.array([modifier.apply_geometry_distortion(u, v, 1, 1)[0, 0] for u, v in ideal], dtype=float)
    inside = (np.abs(found - (np.array(size) - 1) / 2) < np.array(size) / 2).all(axis=1)
    # lensfun's ideal image has its own scale, by which poly3 and ptlens shrink the middle.
    shrunk = 1 - sum(values.values()) if model != "poly5" else 1.0
    shrunk = 1 - values["k1"] if model == "poly3" else shrunk
    # 20 mm on a sensor 1.5 times smaller than a full frame, of the calibration's aspect.
    half_side_mm = np.hypot(36, 24) / 2 / 1.5 / np.hypot(4 / 3 if model == "poly5" else 1.5, 1)
    half_side_px = 599 / 2 * np.hypot(899 / 599, 1) / np.hypot(4 / 3 if model == "poly5" else 1.5, 1)
    f = 20 * shrunk / half_side_mm * half_side_px
    centre = (np.array(size) - 1) / 2 + (np.array([0.02, -0.03]) * 599 / 2 if model == "ptlens" else 0)
    rays = np.column_stack([(ideal - centre) * shrunk / f, np.ones(500)])
    # The coordinates are 32-bit floats after a few operations.
    close_px = allowed_px + 8 * max(size) * 2.0**-24
    assert np.abs(found - camera.project(rays))[inside].max() < close_px


def test_lensfun_acm_is_ours(tmp_path):
    """Adobe's model counts in focal lengths, as ours does; its k4, k5 are our p1, p2."""
    terms = 'k1="0.1" k2="0.02" k3="0.003" k4="0.0004" k5="0.00005"'
    path = write(tmp_path, "lens.xml", LENS.format(model="acm", terms=terms, extra=""))
    camera = import_camera(path, size=(900, 600)).camera
    assert isinstance(camera, Camera)
    assert camera.dist[:5].tolist() == [0.1, 0.02, 0.0004, 0.00005, 0.003]


def test_lensfun_lenses_of_one_name(tmp_path):
    """Its database has lenses twice, measured on cameras of different sensors: each can be had, none is taken unasked."""
    text = LENS.format(model="poly3", terms='k1="-0.03"', extra="")
    lens = text[text.index("  <lens>") : text.index("</lensdatabase>")]
    others = lens.replace("1.5", "1") + lens.replace("-0.03", "-0.02")
    path = write(tmp_path, "lens.xml", text.replace("</lensdatabase>", others + "</lensdatabase>"))
    with pytest.raises(
        InputError, match=r"several cameras \(got L 20 mm, crop 1\.5, L 20 mm, crop 1, L 20 mm, crop 1\.5 \(2\)"
    ):
        import_camera(path, size=(640, 480))
    first, second, third = (
        import_camera(path, size=(640, 480), camera=f"L 20 mm, crop {crop}").camera for crop in ("1.5", "1", "1.5 (2)")
    )
    # A sensor 1.5 times as large has a unit 1.5 times as long, in millimetres and so in the focal length's pixels.
    assert second.K[0, 0] / first.K[0, 0] == pytest.approx(1 / 1.5, rel=1e-12)
    assert third.K[0, 0] / first.K[0, 0] == pytest.approx(1.02 / 1.03, rel=1e-12)
