"""Corners that are sent through other tools' files, and what makes them the same."""

from __future__ import annotations

import numpy as np

from camcal.boards.checkerboard import Checkerboard
from camcal.observations import Detection

# Columns and rows differ, so that rows taken for columns show.
BOARD = Checkerboard(4, 3, 0.02)
SIZE = (640, 480)


def views(*, missing: tuple[int, ...] = ()) -> list[Detection]:
    """Two views whose corner with id i is at (100 + 31 i + 1/3, 50 + 17 i + 1/7), the second shifted; some ids not seen."""
    ids = np.array([one for one in range(12) if one not in missing])
    found = []
    for index, name in enumerate(("a_001.png", "a_002.png")):
        corners = np.stack([100 + 31 * ids + 1 / 3, 50 + 17 * ids + 1 / 7], axis=1) + index
        found.append(Detection(name, SIZE, ids, corners, np.full(ids.size, np.nan)))
    return found


def agree(found, expected, atol: float = 0.0) -> None:
    """The same views: names, sizes, ids, and positions up to a tolerance in pixels."""
    assert [view.source for view in found] == [view.source for view in expected]
    for one, other in zip(found, expected, strict=True):
        assert one.size == other.size
        assert one.ids.tolist() == other.ids.tolist()
        np.testing.assert_allclose(one.corners_px, other.corners_px, rtol=0, atol=atol)
