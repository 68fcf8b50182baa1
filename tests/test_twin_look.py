"""The look of a photograph: what is measured of an image is what it was rendered with."""

from __future__ import annotations

from dataclasses import replace
from math import erf, sqrt

import numpy as np
import pytest
from corner_scenes import LOOK, scene
from scenes import BOARD, CAMERA

from camcal.refinement.look import completed_looks, flat_noise, measured_look
from camcal.refinement.warped import refine_warped
from camcal.synthesis.psf import sharpened
from camcal.synthesis.scenario import Light, Sensor
from camcal.workflows.twin import render_look


def fitted_look(made):
    """Measure the look of a rendered scene, with the fit that its true camera predicts; the noise is left out."""
    fit = refine_warped(made.image, made.ids, made.corners_px, made.board, camera=made.camera, T_cam_board=made.pose)
    return measured_look(made.image, fit)


class TestLook:
    """What is measured of an image is what it was rendered with."""

    @pytest.mark.parametrize("blur", [0.5, 0.9, 2.0])
    def test_levels_and_blur(self, blur):
        """Blur within 5 %, ink and paper within half a level of 255, a slope of the light within 0.01."""
        light = Light(white=0.8, black=0.1, background=0.6, gradient=0.2, gradient_direction_deg=30.0)
        look = fitted_look(scene(3, light=light, sensor=Sensor(blur_sigma_px=blur)))
        assert look.blur_sigma_px == pytest.approx(blur, rel=0.05)
        assert (look.ink, look.paper) == pytest.approx((0.1, 0.8), abs=0.5 / 255)
        slope = look.gradient * np.exp(1j * np.radians(look.gradient_direction_deg))
        assert abs(slope - 0.2 * np.exp(1j * np.radians(30))) < 0.01
        assert look.bits == 8

    def test_deep_image(self):
        """A 12-bit image stored in 16 bits has small shares of full scale."""
        look = fitted_look(scene(2, light=Light(white=0.8 / 16, black=0.1 / 16), sensor=Sensor(0.7, 0, 2 / 16, bits=16)))
        assert (look.ink, look.paper, look.bits) == (pytest.approx(0.1 / 16, rel=0.05), pytest.approx(0.8 / 16, rel=0.01), 16)

    def test_background_is_bright(self):
        """A dark room behind the board is rendered half-way between ink and paper."""
        look = fitted_look(scene(3, light=Light(background=0.0), fill=(0.35, 0.4)))
        assert look.background == pytest.approx(0.5 * (look.ink + look.paper))

    def test_nothing_accepted(self):
        """Without a corner there is no look."""
        made = scene(1)
        empty = np.full_like(made.image, 128)
        fit = refine_warped(empty, made.ids, made.corners_px, BOARD, camera=CAMERA, T_cam_board=made.pose)
        assert measured_look(empty, fit) is None

    def test_steep_light_stays_positive(self):
        """Light that seems to vanish within the image is rendered no steeper than 0.8 over half the diagonal."""
        made = scene(3, light=Light(gradient=0.95))
        assert fitted_look(made).gradient == pytest.approx(0.8)


class TestFlatNoise:
    """Noise is measured where the image is even."""

    @staticmethod
    def masks(shape):
        """Ink on the left half, paper on the right."""
        left = np.zeros(shape, dtype=bool)
        left[:, : shape[1] // 2] = True
        return left, ~left

    @pytest.mark.parametrize(("ink_levels", "paper_levels"), [(2.0, 2.0), (1.0, 3.0), (0.0, 4.0)])
    def test_mean_variance(self, ink_levels, paper_levels):
        """Independent noise of ink and paper gives the root of their mean variance; a slope of the light changes little.

        A slope of 0.05 levels per pixel adds 2 · 0.05² = 0.005 to the variance in a window of five. 14,400 pixels are 576
        windows of 24 degrees of freedom, whose median variance is known to 1.25 · √(2 / 24 / 576) = 1.5 %, half of that for
        the deviation; windows that overlap do better. Allowed are four times that.
        """
        left, right = self.masks((120, 240))
        rng = np.random.default_rng(1)
        level = np.where(left, 40.0, 200.0) + 0.05 * np.arange(240)
        image = level + rng.normal(size=left.shape) * np.where(left, ink_levels, paper_levels)
        expected = sqrt((ink_levels**2 + paper_levels**2) / 2)
        measured = flat_noise(np.rint(image).astype(np.uint8), left, right)
        assert measured * 255 == pytest.approx(expected, rel=0.035)

    def test_dust(self):
        """Specks on a hundredth of the image do not count: a fifth of the windows hold one, which moves the median a little."""
        left, right = self.masks((120, 240))
        rng = np.random.default_rng(2)
        image = 128 + 2 * rng.normal(size=left.shape)
        image[rng.random(left.shape) < 0.01] = 255
        assert flat_noise(np.rint(image).astype(np.uint8), left, right) * 255 == pytest.approx(2.0, rel=0.15)

    def test_too_little(self):
        """Few even pixels tell nothing; one colour is enough."""
        left, _ = self.masks((120, 240))
        nothing = np.zeros_like(left)
        image = np.full(left.shape, 100, dtype=np.uint8)
        assert np.isnan(flat_noise(image, nothing, nothing))
        assert flat_noise(image, left, nothing) == 0.0

    def test_float_image(self):
        """Pixels that are floats are not rounded, and their largest value is full scale."""
        left, right = self.masks((120, 240))
        image = (1000 + 5 * np.random.default_rng(3).normal(size=left.shape)).astype(np.float32)
        assert flat_noise(image, left, right) * float(image.max()) == pytest.approx(5.0, rel=0.03)


class TestCompletedLooks:
    """What is not known of a view is what is typical of the others."""

    def test_filled(self):
        """A view without a look gets medians and even light; one without noise gets the others' noise."""
        other = replace(LOOK, blur_sigma_px=0.9, gradient=0.3, noise=0.01)
        silent = replace(LOOK, blur_sigma_px=1.1, noise=float("nan"))
        first, second, third, missing = completed_looks([LOOK, other, silent, None])
        assert (first, second) == (LOOK, other)
        assert third.noise == pytest.approx(0.009)
        assert (missing.blur_sigma_px, missing.noise, missing.gradient) == pytest.approx((0.9, 0.009, 0.0))

    def test_no_flat_part_anywhere(self):
        """Without any even part the noise is what the fits leave unexplained."""
        (only,) = completed_looks([replace(LOOK, noise=float("nan"), unexplained=0.02)])
        assert only.noise == 0.02

    def test_nothing_known(self):
        """Nothing comes of nothing."""
        assert completed_looks([None, None]) == ()


class TestSharpened:
    """Sharpening is a fringe on both sides of every edge."""

    @pytest.mark.parametrize("angle_deg", [0.0, 45.0, 20.0])
    def test_edge(self, angle_deg):
        """An edge Φ(a) becomes Φ(a) + o/2 He3(a) φ(a), at any angle.

        A stencil of tenth order is off by 1/16632 of the twelfth derivative. Twice applied to Φ it is off by 2/16632 of the
        fourteenth, at most 0.43 √13! / blur¹⁴ by Cramér's inequality: 0.35 blur⁴ times that is 0.0014 for a blur of 2 px.
        """
        blur, overshoot = 2.0, -0.7
        y, x = np.mgrid[-30:31, -30:31].astype(float)
        a = (np.cos(np.radians(angle_deg)) * x + np.sin(np.radians(angle_deg)) * y) / blur
        edge = 0.5 * (1 + np.vectorize(erf)(a / sqrt(2)))
        expected = edge + overshoot / 2 * (a**3 - 3 * a) * np.exp(-(a**2) / 2) / sqrt(2 * np.pi)
        inside = np.s_[12:-12, 12:-12]
        assert np.abs(sharpened(edge, blur, overshoot) - expected)[inside].max() < 0.0014

    def test_none(self):
        """A disc of defocus, whose overshoot is positive, is not taken for sharpening."""
        image = np.zeros((9, 9))
        assert sharpened(image, 1.0, 0.05) is image

    def test_measured_again(self):
        """A sharpened render measures as such; the stencil falls a little short of its finest detail."""
        made = scene(3)
        image = render_look(
            CAMERA, BOARD, made.pose, replace(LOOK, blur_sigma_px=0.9, overshoot=-0.8), np.random.default_rng(1)
        )
        look = fitted_look(replace(made, image=image))
        assert look.overshoot == pytest.approx(-0.8, abs=0.1)
        assert look.blur_sigma_px == pytest.approx(0.9, rel=0.05)
