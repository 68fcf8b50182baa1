"""One camera or several: mixed and changed ones are found, named and described; what one camera shows by itself is no alarm."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scenes import BOARD, CAMERA, detections, poses

from camcal.boards.checkerboard import Checkerboard
from camcal.calibration.board_shape import shape_basis
from camcal.calibration.solve import solve
from camcal.geometry.camera import Camera
from camcal.trust.consistency import consistency
from camcal.trust.grouping import Scores, best_change, best_partitions, fisher_tail, in_course
from camcal.trust.likeness import likeness

NOISE_PX = 0.1


def changed(**values: float) -> Camera:
    """The scene's camera with other intrinsics."""
    names = dict(zip(CAMERA.intrinsic_names, CAMERA.intrinsics.tolist(), strict=True))
    return CAMERA.with_intrinsics(list((names | values).values()))


ZOOMED = changed(fx=927.0, fy=932.15)
"""3 % longer."""


def with_another(other: Camera, odd: list[int], count: int, seed: int, noise_px: float = NOISE_PX):
    """Views of the scene's camera, the odd ones of another camera and in other poses."""
    views = detections(poses(count, seed), noise_px=noise_px, seed=seed)
    strange = detections(poses(count, seed + 1000, camera=other), noise_px=noise_px, seed=seed + 7, camera=other)
    return [strange[index] if index in odd else view for index, view in enumerate(views)]


def verdict(views, **options):
    """The finding, or None."""
    found = consistency(solve(views, BOARD.object_points, **options), BOARD)
    return found[0] if found else None


def values(text: str) -> list[float]:
    """The two values of a change, each with its standard deviation."""
    figures = re.match(r".. is ([\d.]+) ± ([\d.]+) up to \S+ and ([\d.]+) ± ([\d.]+) from ", text)
    return [float(figure) for figure in figures.groups()]


@pytest.mark.parametrize("count", [5, 6, 8, 14, 20])
def test_one_camera_is_no_alarm(count):
    """Clean views of one camera, whatever their noise: an alarm by chance is a matter of one in a thousand captures."""
    for seed in range(3):
        noise_px = (0.02, 0.1, 0.5)[seed % 3]
        assert verdict(detections(poses(count, seed + 300), noise_px=noise_px, seed=seed)) is None


def test_perfect_corners_are_no_alarm():
    """Corners without noise leave nothing but last bits, which mean nothing."""
    assert verdict(detections(poses(10, 0))) is None


def test_bent_and_stretched_board_is_no_other_camera():
    """A bow of half a millimetre and a print 1 % longer along y make views differ by their poses only."""
    bent = BOARD.object_points + shape_basis(BOARD.object_points) @ [5e-4, -3e-4, 0.01]

    class Bent:
        object_points = bent

    for seed in range(4):
        assert verdict(detections(poses(12, seed), noise_px=NOISE_PX, seed=seed, board=Bent)) is None


def test_lens_that_is_too_simple_is_no_other_camera():
    """A wide lens fitted without any coefficient leaves 3 px, and views that all differ: still one camera."""
    wide = Camera((1280, 960), [[700, 0, 640], [0, 702, 480], [0, 0, 1]], [-0.3, 0.12, 0, 0, -0.014])
    for seed in range(3):
        views = detections(poses(14, seed, camera=wide), noise_px=NOISE_PX, seed=seed, camera=wide)
        assert verdict(views, distortion=()) is None


@pytest.mark.parametrize(
    ("other", "likely"),
    [
        (ZOOMED, "refocused or zoomed"),
        (changed(cx=545.3, cy=420.2), "cropped or shifted"),
        (changed(fy=995.5), "stretched"),
        (changed(fx=1080.0, fy=1086.0), "refocused or zoomed"),
        (changed(fx=700.0, fy=702.0, cx=620.0, cy=500.0, k1=-0.1, k2=0.02), None),
    ],
)
def test_two_cameras_mixed(other, likely):
    """Four or ten of twenty views are of another camera: those are counted and named, and both cameras are described."""
    for odd in ([1, 7, 10, 16], [0, 3, 4, 5, 8, 11, 12, 14, 17, 19]):
        found = verdict(with_another(other, odd, 20, seed=1))
        assert found.code == "mixed_cameras"
        assert f"{len(odd)} of 20 views" in found.text
        named = re.findall(r"view_\d+", found.text)
        # Half the views are named as one group or as the other.
        outside = [index for index in range(20) if index not in odd]
        few = odd if len(odd) < 10 or named[0] == f"view_{odd[0]:03d}" else outside
        assert named == [f"view_{index:03d}" for index in few[: len(named)]]
        assert "fx 900, fy 905, cx 64" in found.text
        assert found.level == "rejected"
        if likely:
            assert f"as if {likely}" in found.text


def test_another_camera_that_was_left_out():
    """Four of twenty views at half the focal length do not fit at all; they are out, and fit each other."""
    found = verdict(with_another(changed(fx=450.0, fy=452.5), [2, 7, 11, 16], 20, seed=2))
    assert found.code == "mixed_cameras"
    assert "4 of 20 views" in found.text
    assert re.search(r"fx 4(49|50|51), ", found.text)


def test_mirrored_images():
    """Mirroring a view of a checkerboard moves the principal point to the other side, here by 51.4 px."""
    camera = changed(cx=665.2)
    columns_turned = np.arange(54).reshape(6, 9)[:, ::-1].ravel()
    views = detections(poses(16, 3, camera=camera), noise_px=0.03, camera=camera)
    mirrored = [
        replace(view, corners_px=np.c_[1279 - view.corners_px[:, 0], view.corners_px[:, 1]][columns_turned])
        if index in {1, 2, 5, 8, 9, 13}
        else view
        for index, view in enumerate(views)
    ]
    found = verdict(mirrored)
    assert found.code == "mixed_cameras"
    assert "6 of 16 views" in found.text
    assert found.text.endswith("as if mirrored left to right")


@pytest.mark.parametrize("first", [5, 10, 16])
def test_refocused_midway(first):
    """The focal length grows by 1 % from one view on: that view and the one before are named, both values are right."""
    longer = changed(fx=909.0, fy=914.05)
    for seed in range(3):
        found = verdict(with_another(longer, list(range(first, 20)), 20, seed=seed + 40))
        assert found.code == "drift"
        assert found.level in {"poor", "rejected"}
        assert f"up to view_{first - 1:03d} and" in found.text
        assert f"from view_{first:03d} on" in found.text
        before, sigma_before, after, sigma_after = values(found.text)
        name = found.text[:2]
        true = {"fx": (900.0, 909.0), "fy": (905.0, 914.05)}[name]
        assert abs(before - true[0]) < 4 * sigma_before
        assert abs(after - true[1]) < 4 * sigma_after


def test_small_change_is_seen_where_it_can_be():
    """0.7 % is 6.3 px of a focal length known to half a pixel by either half: seen in every one of three captures."""
    longer = changed(fx=906.3, fy=911.335)
    for seed in range(3):
        assert verdict(with_another(longer, list(range(12, 24)), 24, seed=seed)).code == "drift"


def test_moved_lens_is_described():
    """A principal point that moves by 30 px in the course of the views is told as such."""
    found = verdict(with_another(changed(cx=675.3), list(range(8, 18)), 18, seed=3))
    assert found.code == "drift"
    assert found.text.startswith("cx is 64")
    assert "as if cropped or shifted" in found.text


def test_likeness_of_cameras():
    """Each way in which images get changed is told from the two cameras alone."""
    one = Camera((1000, 800), [[800, 0, 520], [0, 800, 380], [0, 0, 1]])

    def like(fx, fy, cx, cy):
        return likeness(Camera(one.size, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), one)

    assert like(800, 800, 999 - 520, 380) == ", as if mirrored left to right"
    assert like(800, 800, 520, 799 - 380) == ", as if upside down"
    assert like(800, 800, 999 - 520, 799 - 380) == ", as if turned by 180°"
    assert like(800, 800, 420, 380) == ", as if cropped or shifted"
    assert like(400, 400, 259.75, 189.75) == ", as if rescaled"
    assert like(820, 820, 520, 380) == ", as if refocused or zoomed"
    assert like(800, 880, 520, 380) == ", as if stretched"
    assert like(700, 700, 600, 300) == ""


def test_fisher_tail():
    """For 2 degrees of freedom the tail is a power; for 4 and 6 it is the integral of the density."""
    for ratio in (0.3, 2.0, 20.0):
        assert fisher_tail(ratio, 2, 9) == pytest.approx((1 + 2 * ratio / 9) ** -4.5)
    for numerator in (4, 6):
        # The integral over y = x / (1 + x) of x^(a-1) (1+x)^-(a+b), x = ratio * numerator / denominator.
        y = np.linspace(0, 1, 400_001)[1:-1]
        a, b = numerator / 2, 9 / 2
        density = y ** (a - 1) * (1 - y) ** (b - 1)
        start = 2.0 * numerator / 9
        expected = density[y > start / (1 + start)].sum() / density.sum()
        assert fisher_tail(2.0, numerator, 9) == pytest.approx(expected, rel=1e-4)


def scores_of(values: np.ndarray) -> Scores:
    """Views that each measure two parameters directly, with unit information, taken at their mean."""
    return Scores(np.tile(np.eye(2), (len(values), 1, 1)), values - values.mean(axis=0), own=2)


def test_best_partition_by_hand():
    """Points at ±3 along x with small errors: the split takes exactly the between-group part of the sum of squares."""
    rng = np.random.default_rng(0)
    side = np.array([True, False, False, True, True, False, True, False])
    values = np.where(side, 3.0, -3.0)[:, None] * [1.0, 0.0] + 0.1 * rng.normal(size=(8, 2))
    mask, share = best_partitions(scores_of(values))[0]
    assert (mask == side).all() or (mask == ~side).all()
    centred = values - values.mean(axis=0)
    between = sum(4 * (centred[part].mean(axis=0) ** 2).sum() for part in (side, ~side))
    assert share == pytest.approx(between / (centred**2).sum())


def test_no_partition_of_few_views():
    """Groups of fewer than three views are none."""
    values = np.array([[3.0, 0], [3, 0.1], [-3, 0], [-3, 0.1], [-3, 0.2]])
    assert best_partitions(scores_of(values)) == ()


def test_best_change_by_hand():
    """A step between views 5 and 6: found there, and unlikely; the same values in another order are no change."""
    rng = np.random.default_rng(1)
    values = np.repeat([[0.0, 0.0], [6.0, 0.0]], [6, 8], axis=0) + rng.normal(size=(14, 2))
    change = best_change(scores_of(values))
    assert change.first == 6
    assert change.chance < 1e-3
    assert change.chance < change.chance_without_one < 1e-2
    assert best_change(scores_of(values[np.argsort(np.arange(14) % 2, kind="stable")])).chance > 0.01


def test_change_carried_by_one_view():
    """One far view at the end looks like a change only until it is left out."""
    rng = np.random.default_rng(2)
    values = rng.normal(size=(14, 2))
    scores = scores_of(values)
    information, gradient = scores.information.copy(), scores.gradient.copy()
    information[-2] *= 400
    gradient[-2] = [150.0, 0.0]
    gradient -= information @ (gradient.sum(axis=0) / information.sum(axis=0).diagonal())
    change = best_change(Scores(information, gradient, own=2))
    assert change.chance_without_one > 0.01


def test_in_course():
    """Two groups one after the other, with one stray among fifteen or more; alternating ones are in no order."""
    assert in_course(np.array([1, 1, 1, 0, 0, 0, 0], dtype=bool)) == 3
    assert in_course(np.array([0, 0, 0, 0, 1, 1, 1], dtype=bool)) == 4
    assert in_course(np.array([1, 1, 0, 1, 0, 0, 0], dtype=bool)) is None
    assert in_course(np.array([1] * 6 + [0] + [1] * 2 + [0] * 9, dtype=bool)) == 9


def test_board_with_other_counts():
    """The tests take any board: a 7x5 one whose camera is refocused."""
    board = Checkerboard(7, 5, 0.03)
    placed = poses(16, 5, board=board)
    views = [
        *detections(placed, noise_px=NOISE_PX, board=board)[:8],
        *detections(placed, noise_px=NOISE_PX, board=board, camera=ZOOMED, seed=1)[8:],
    ]
    found = consistency(solve(views, board.object_points), board)
    assert found[0].code == "drift"
    assert "up to view_007 and" in found[0].text
