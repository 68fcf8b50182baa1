"""The report's words for a lens: its kind and by how much it moves a corner."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from camcal.geometry.camera import Camera
from camcal.report.lens import lens_words


@pytest.mark.parametrize(("k1", "kind"), [(-0.2, "barrel"), (0.2, "pincushion"), (1e-6, "next to none"), (0.0, "next to none")])
def test_lens_in_words(k1, kind):
    """Kind and shift at the corner, from the cubic r_d = r (1 + k1 r²) solved by its roots."""
    camera = Camera((1001, 801), [[800, 0, 500], [0, 800, 400], [0, 0, 1]], [k1])
    seen = math.hypot(500.5, 400.5) / 800
    roots = np.roots([k1, 0, 1, -seen]) if k1 else np.array([seen])
    ideal = min(root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0)
    words = lens_words(camera)
    assert words.kind == kind
    assert words.corner_px == pytest.approx(800 * (seen - ideal), abs=1e-6)
    assert words.text.startswith(kind)


def test_lens_that_turns_back_in_words():
    """Where no corner has a ray, the last valid place is told: at the fold, r² = 1 / (3 |k1|), r_d = 2 r / 3."""
    camera = Camera((2001, 2001), [[1000, 0, 1000], [0, 1000, 1000], [0, 0, 1]], [-0.3])
    radius = 1000 * 2 / 3 * math.sqrt(1 / 0.9)
    words = lens_words(camera)
    told = float(re.search(r"(\d+) px from the principal point", words.text)[1])
    step = math.hypot(1000.5, 1000.5) / 200
    assert radius - step - 1 <= told <= radius + 0.5
    assert "moved" in words.text


def test_moustache_in_words():
    """A lens that pushes in near the middle and out farther away."""
    camera = Camera((1001, 1001), [[600, 0, 500], [0, 600, 500], [0, 0, 1]], [-0.2, 0.25])
    assert lens_words(camera).kind == "moustache"
