"""What a format cannot hold is refitted over the image, as well as can be, and told in pixels; or it is refused."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
from exchange_cameras import CAMERAS, WEBCAM, saved
from exchange_samples import write
from messages import Listener

from camcal.errors import InputError, QualityError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.exchange.profile import ForeignLens, Profile
from camcal.formats.exchange.refit import from_foreign, refitted
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.workflows.export import export_camera
from camcal.workflows.import_ import import_camera

RADTAN = Profile("radtan", "radtan", (("k1", "k2", "p1", "p2"),), (".yaml",))
POLY5 = Profile("poly5", "poly5", (("k1", "k2"),), (".xml",), one_focal=True)
# Nearly a fisheye: no polynomial of so low an order follows it.
WIDE = Camera((1280, 720), [[300, 0, 640], [0, 300, 360], [0, 0, 1]], [0.2, 0, 0, 0, 0, 0.5])


def grid(camera: Camera) -> np.ndarray:
    """Pixels over the whole image, edge to edge, in square cells."""
    width, height = camera.size
    u, v = np.meshgrid(np.linspace(-0.5, width - 0.5, 96), np.linspace(-0.5, height - 0.5, round(96 * height / width)))
    return np.column_stack([u.ravel(), v.ravel()])


def away(camera: Camera, fitted: Camera) -> np.ndarray:
    """Distance between where OpenCV sees the camera's points with the fitted one, and where the camera does."""
    pixels = grid(camera)
    zero = np.zeros(3)
    seen = cv2.projectPoints(camera.unproject(pixels), zero, zero, np.array(fitted.K), np.array(fitted.dist))[0]
    return np.linalg.norm(seen.reshape(-1, 2) - pixels, axis=1)


@pytest.mark.parametrize("name", ["webcam", "rational", "skewed"])
def test_the_refit_is_the_best_there_is(name):
    """An independent solver, started there with OpenCV's formula, finds nothing better; the told figures are OpenCV's."""
    optimize = pytest.importorskip("scipy.optimize", reason="scipy is not installed")
    camera = CAMERAS[name]
    fit = refitted(camera, RADTAN)
    assert fit.lost == {"webcam": ("k3",), "rational": ("k3", "k4", "k5", "k6"), "skewed": ("k3", "skew")}[name]
    assert not fit.camera.dist[4:].any()
    assert fit.camera.K[0, 1] == 0
    found_px = away(camera, fit.camera)
    assert fit.max_px == pytest.approx(found_px.max(), abs=1e-9)
    assert fit.rms_px == pytest.approx(np.sqrt((found_px**2).mean()), abs=1e-9)
    pixels = grid(camera)
    rays = camera.unproject(pixels)

    def residual(values: np.ndarray) -> np.ndarray:
        fx, fy, cx, cy = values[:4] * 1000
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        return (cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, values[4:])[0].reshape(-1, 2) - pixels).ravel()

    start = np.concatenate([fit.camera.intrinsics[:4] / 1000, fit.camera.dist[:4]])
    best = optimize.least_squares(residual, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    # Two solvers of one smooth problem differ by the last bits of its sum of squares.
    assert 2 * best.cost == pytest.approx((residual(start) ** 2).sum(), rel=1e-9)


def test_truncation_would_be_far_worse():
    """Leaving k3 out costs several times what the refit does: k3 r⁶ is 2.6 px at this camera's corner."""
    truncated = Camera(WEBCAM.size, WEBCAM.K, WEBCAM.dist[:4])
    fit = refitted(WEBCAM, RADTAN)
    assert fit.max_px < 1.5
    assert away(WEBCAM, truncated).max() > 2.5
    assert fit.rms_px < away(WEBCAM, truncated).std() / 3


@pytest.mark.parametrize("name", ["radtan", "pinhole"])
def test_what_is_held_is_not_touched(name):
    """The very same camera, and nothing to tell."""
    fit = refitted(CAMERAS[name], RADTAN)
    assert fit.camera is CAMERAS[name]
    assert (fit.lost, fit.max_px, fit.rms_px) == ((), 0.0, 0.0)


def test_one_focal_length():
    """Both focal lengths become one; a difference of .6 % leaves about a quarter of it at the edges."""
    fit = refitted(CAMERAS["pinhole"], POLY5)
    assert fit.lost == ("fx != fy",)
    assert fit.camera.K[0, 0] == fit.camera.K[1, 1]
    # The middle of 900.125 and 905.5 moves the edges by 640 * .3 % and 360 * .3 %: the fit does not do worse than that.
    assert 0.5 < fit.max_px < np.hypot(640, 360) * (905.5 / 900.125 - 1) / 2 + 1e-6
    assert fit.max_px == pytest.approx(away(CAMERAS["pinhole"], fit.camera).max(), abs=1e-9)


def test_a_lens_that_turns_back_is_refused():
    """Where no lens of the format covers the image, there is no camera to tell a residual of."""
    with pytest.raises(
        QualityError, match=r"one term: cannot hold k4, and its own lens, refitted, turns back in \d.* % of the image"
    ):
        refitted(WIDE, Profile("one", "one term", (("k1",),), (".txt",)))
    assert refitted(WIDE, RADTAN).max_px > 50


def test_only_the_valid_part_of_the_image_counts():
    """Pixels that the camera's own lens does not reach have no say."""
    camera = Camera((640, 480), [[300, 0, 320], [0, 300, 240], [0, 0, 1]], [-0.2, 0, 0, 0, 1e-4])
    assert camera.valid_radius_px < 400
    fit = refitted(camera, RADTAN)
    assert fit.max_px < 0.1


def test_the_difference_is_told_and_written(tmp_path):
    """On the way, in the result and in the file's comment, alike."""
    listener = Listener()
    done = export_camera(saved(tmp_path, "webcam"), "kalibr", tmp_path / "c.yaml", reporter=listener)
    (told,) = listener.warnings
    figures = rf"differs by up to {done.max_px:.3g} px \(rms {done.rms_px:.2g} px\) over the image"
    assert re.search(rf"Kalibr's camchain cannot hold k3: refitted, it {figures}", told)
    assert re.search(rf"^# Refitted, as the format has no k3: {figures}$", (tmp_path / "c.yaml").read_text(), re.MULTILINE)


def test_gates(tmp_path):
    """Without leave to refit, or beyond the largest difference allowed, nothing is written and the residual is named."""
    source = saved(tmp_path, "webcam")
    for options, message in (
        ({"refit": False}, r"cannot hold k3: refitted, it differs by up to 1\.\d+ px .* Leave out --no-refit"),
        ({"max_refit_px": 0.5}, r"differs by up to 1\.\d+ px .*, more than --max-refit-px 0\.5\."),
    ):
        with pytest.raises(QualityError, match=message):
            export_camera(source, "kalibr", tmp_path / "out.yaml", **options)
    save_intrinsics(tmp_path / "wide.yaml", Intrinsics(WIDE))
    with pytest.raises(QualityError):
        export_camera(tmp_path / "wide.yaml", "kalibr", tmp_path / "out.yaml")
    assert not (tmp_path / "out.yaml").exists()
    # A format that holds the camera needs no leave.
    assert export_camera(source, "mrcal", refit=False, max_refit_px=1e-9).lost == ()
    with pytest.raises(InputError, match="--max-refit-px: out of range"):
        export_camera(source, "kalibr", max_refit_px=0)


def test_what_was_known_is_not_claimed_of_a_refit(tmp_path):
    """RMS and views are those of the calibrated camera; a refitted one has a residual instead."""
    source = saved(tmp_path, "webcam", rms_px=0.25, views=20)
    assert "RMS 0.25 px, 20 views" in str(export_camera(source, "mrcal").content)
    assert "RMS" not in str(export_camera(source, "kalibr").content)


def test_a_foreign_lens_gets_the_fewest_coefficients_that_follow_it():
    """Odd powers of r ask for a denominator, which leaves less than any numerator alone; even powers do not."""
    camera = Camera((5184, 3456), [[4200, 0, 2591.5], [0, 4200, 1727.5], [0, 0, 1]])
    odd = from_foreign(camera, ForeignLens("odd", lambda r: r * (1 - 0.02 * r - 0.09 * r**2 + 0.03 * r**3)))
    even = from_foreign(camera, ForeignLens("even", lambda r: r * (1 - 0.09 * r**2 + 0.01 * r**4)))
    assert odd.camera.dist[5:].any()
    assert not even.camera.dist[5:].any()
    assert even.max_px < 1e-6
    # The largest residual of the best even polynomial: three powers of r², fitted on the same radii.
    r = np.linspace(0, np.hypot(2592, 1728) / 4200, 2000)
    powers = np.stack([r, r**3, r**5, r**7], axis=-1)
    target = r * (1 - 0.02 * r - 0.09 * r**2 + 0.03 * r**3)
    left = target - powers @ np.linalg.lstsq(powers, target, rcond=None)[0]
    assert odd.max_px < 4200 * np.abs(left).max()


def test_nerfstudio_fourth_coefficient(tmp_path):
    """Its k4 is that of r⁸: refitted on import, and not taken without being asked."""
    path = write(tmp_path, "t.json", '{"fl_x": 500, "cx": 320, "cy": 240, "w": 640, "h": 480, "k1": 0.1, "k4": 0.01}')
    with pytest.raises(InputError, match="camcal import"):
        load_intrinsics(path)
    with pytest.raises(QualityError, match="r⁸ term is not camcal's lens: refitted, it differs by up to"):
        import_camera(path, refit=False)
    with pytest.raises(QualityError, match="more than --max-refit-px 1e-05"):
        import_camera(path, tmp_path / "camera.yaml", max_refit_px=1e-5)
    assert not (tmp_path / "camera.yaml").exists()
    camera = import_camera(path).camera
    x = np.linspace(-0.55, 0.55, 23)
    s = x * x
    expected = 500 * x * (1 + 0.1 * s + 0.01 * s**4) + 319.5
    seen = camera.project(np.column_stack([x, np.zeros(23), np.ones(23)]))[:, 0]
    assert np.abs(seen - expected).max() < 0.01
