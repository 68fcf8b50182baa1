"""Which coefficients are free: lists of names, in any order, and none that makes no sense."""

from __future__ import annotations

import pytest

from camcal.calibration.parameters import free_names, parse_distortion
from camcal.errors import InputError


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("k1,k2,k3", ("k1", "k2", "k3")),
        ("k3, k1", ("k1", "k3")),
        ("p2,p1,k1", ("k1", "p1", "p2")),
        ("none", ()),
        ("k1,k2,p1,p2,k3,k4,k5,k6", ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
    ],
)
def test_distortion_lists_are_read_in_any_order(text, names):
    """The names come back in stored order."""
    assert parse_distortion(text) == names
    assert free_names(names)[:4] == ("fx", "fy", "cx", "cy")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("k7", "unknown coefficient"),
        ("k1,k1", "each coefficient once"),
        ("", "each coefficient once"),
        ("k1,p1", "go together"),
    ],
)
def test_wrong_distortion_lists_are_refused(text, message):
    """Unknown, repeated, missing names and half a tangential pair."""
    with pytest.raises(InputError, match=message):
        parse_distortion(text)
