"""How near the refined corners come to the Cramér-Rao bound, scene by scene: `python benchmarks/corners.py [--only NAME]`.

Every view is rendered with its truth, its corners are refined by both stages from starts up to half a pixel off, and the
errors are taken per axis. The second stage is given the true camera and pose; `benchmarks/parameters.py` measures with
those that a calibration gives. The last column says how many corners were not refused. The exit code is 1 if a row misses.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import cv2
import numpy as np

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Image
from camcal.refinement.corner_shapes import corner_shapes
from camcal.refinement.saddle import refine_saddle
from camcal.refinement.verdicts import Refinement
from camcal.refinement.warped import refine_warped
from camcal.synthesis.bound import corner_bound
from camcal.synthesis.poses import sample_pose
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light, PoseSampling, Range, Scenario, Sensor
from camcal.synthesis.sensor import expose
from camcal.workflows.parallel import each

PLAIN = Camera((1280, 960), [[900.0, 0.0, 645.3], [0.0, 905, 470.2], [0.0, 0.0, 1.0]], [-0.25, 0.08, 0, 0, -0.01])
BARREL = Camera((1280, 960), [[780.0, 0.0, 645.3], [0.0, 782, 470.2], [0.0, 0.0, 1.0]], [-0.38, 0.16, 0, 0, -0.03])
UNEVEN = Light(vignetting=0.4, gradient=0.2, gradient_direction_deg=30)
BOARD = Checkerboard(9, 6, 0.025)
LARGE_SQUARES = Checkerboard(6, 5, 0.025)
WITH_SQUARES = AprilGrid(4, 3, tag_m=0.06, gap_m=0.018)
WITHOUT_SQUARES = AprilGrid(4, 3, tag_m=0.06, gap_m=0.03, squares=False)

RADIUS_SHARE = 0.45
SADDLE_RADIUS_PX = 12.0
ROUNDING_LEVELS = 12**-0.5
START_PX = 0.5
FAR_START_PX = 1.5
WRONG_SHARE = 0.02
WRONG_SIGMAS = 6.0
DRAWS = 4


@dataclass(frozen=True, slots=True)
class Scene:
    """What is rendered; the pose comes from a seed."""

    camera: Camera = PLAIN
    board: Board = BOARD
    light: Light = field(default_factory=Light)
    blur_px: float = 0.7
    defocus_px: float = 0.0
    fill: Range = (0.35, 0.8)


@dataclass(frozen=True, slots=True, eq=False)
class Ideal:
    """A scene before the sensor, with its truth: corners (N, 2) and the distance to the nearest other one (N,), pixels."""

    scene: Scene
    pose: Pose
    signal: FloatArray
    corners_px: FloatArray
    spacing_px: FloatArray

    @classmethod
    def render(cls, scene: Scene, seed: int) -> Ideal:
        """Render a scene at the seed's pose."""
        views = PoseSampling(count=1, fill=scene.fill)
        pose = sample_pose(Scenario("corners", seed, scene.camera, scene.board, views=views), 0)
        blur, defocus = scene.blur_px, scene.defocus_px
        signal = render_ideal(scene.camera, scene.board, pose, scene.light, blur_sigma_px=blur, defocus_radius_px=defocus)
        corners = scene.camera.project(pose.apply(scene.board.object_points))
        neighbours = corner_shapes(scene.board).neighbours
        distance = np.linalg.norm(corners[neighbours] - corners[:, None], axis=-1)
        distance[neighbours < 0] = np.inf
        return cls(scene, pose, signal, corners, distance.min(axis=1))

    def bound_px(self, largest_px: float = np.inf) -> FloatArray:
        """Cramér-Rao bound (N, 2) for noise of one level, which it is proportional to.

        The radius is 0.45 of the spacing, at most `largest_px` and what the print leaves clear around a corner. A defocus
        disc counts as the Gaussian of its variance.
        """
        scene, shapes = self.scene, corner_shapes(self.scene.board)
        clear = self.spacing_px * shapes.clear_m / shapes.pitch_m.min(axis=1)
        radius = np.minimum(np.minimum(RADIUS_SHARE * self.spacing_px, clear), largest_px)
        blur = float(np.hypot(scene.blur_px, scene.defocus_px / 2))
        return corner_bound(
            scene.camera, scene.board, self.pose, scene.light, blur_sigma_px=blur, noise_levels=1.0, radius_px=radius
        )


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Errors (N, 2) of both stages in pixels, NaN where a corner was refused, and the standard deviations they claim."""

    saddle_px: FloatArray
    warped_px: FloatArray
    saddle_sigma_px: FloatArray
    warped_sigma_px: FloatArray

    @property
    def wrong(self) -> int:
        """How many corners either stage accepted too far from the truth, by their own standard deviations."""
        with np.errstate(invalid="ignore"):
            first = np.abs(self.saddle_px) > WRONG_SIGMAS * self.saddle_sigma_px
            second = np.abs(self.warped_px) > WRONG_SIGMAS * self.warped_sigma_px
        return int((first | second).any(axis=1).sum())


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the table; a figure must not exceed its limit."""

    scene: str
    what: str
    reached: float
    must: float
    kept: str

    @property
    def fine(self) -> bool:
        """Whether the figure is a number within its limit."""
        return self.reached <= self.must


def sensor(noise_levels: float, gamma: float = 1.0) -> Sensor:
    """Return a sensor of 8 bits."""
    return Sensor(read_noise_levels=noise_levels, gamma=gamma)


def total_noise_levels(noise_levels: float) -> float:
    """Return the noise of an 8-bit sensor, rounding included."""
    return float(np.hypot(noise_levels, ROUNDING_LEVELS))


def shaken(corners_px: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return starts up to half a pixel off along each axis."""
    return corners_px + rng.uniform(-START_PX, START_PX, corners_px.shape)


def fit(ideal: Ideal, image: Image, starts_px: FloatArray) -> Fit:
    """Refine an image's corners by both stages, as a calibration does."""
    scene, ids = ideal.scene, np.arange(len(starts_px))
    first = refine_saddle(image, ids, starts_px, scene.board)
    second = refine_warped(image, ids, first.corners_px, scene.board, camera=scene.camera, T_cam_board=ideal.pose)

    def error(found: Refinement) -> FloatArray:
        return found.corners_px - ideal.corners_px

    return Fit(error(first), error(second), first.sigma_px, second.sigma_px)


def exposed(ideal: Ideal, recorded_by: Sensor, seed: int, draw: int = 0) -> Fit:
    """Expose a view and refine its corners from starts nearby."""
    rng = np.random.default_rng((seed, draw))
    image = expose(ideal.signal, recorded_by, rng)
    return fit(ideal, image, shaken(ideal.corners_px, rng))


def rms(values: FloatArray) -> float:
    """Root mean square, NaN left out; NaN if nothing is left."""
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if known.size else float("nan")


def kept(errors_px: FloatArray) -> str:
    """Say how many of the corners (..., 2) were not refused."""
    good = np.isfinite(errors_px).all(axis=-1)
    return f"{int(good.sum())}/{good.size}"


def on_all_processors(function: Callable[..., Any], *axes: Sequence[Any]) -> list[Any]:
    """Call a function for every combination of its arguments, in order."""
    return each(lambda arguments: function(*arguments), list(product(*axes)), None, lambda: None)


def checkerboard(seeds: int) -> list[Row]:
    """Ordinary blur and noise: both stages against their bounds."""

    def work(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        ideal = Ideal.render(Scene(), seed)
        found, noise = exposed(ideal, sensor(2.0), seed), total_noise_levels(2.0)
        bound, small_bound = noise * ideal.bound_px(), noise * ideal.bound_px(SADDLE_RADIUS_PX)
        return found.warped_px, found.warped_px / bound, found.saddle_px / small_bound

    parts = on_all_processors(work, range(8 * seeds))
    errors, warped, saddle = (np.concatenate(values) for values in zip(*parts, strict=True))
    name = "blur 0.7, noise 2"
    return [
        Row(name, f"warped RMS / bound ({rms(errors):.4f} px)", rms(warped), 1.15, kept(warped)),
        Row(name, "saddle RMS / radius-12 bound", rms(saddle), 1.6, kept(saddle)),
    ]


BLURS_PX = (0.4, 0.7, 1.2, 2.0)
NOISES_LEVELS = (0.5, 2.0, 8.0)
LOOKS = {"plain": (PLAIN, Light()), "barrel, uneven": (BARREL, UNEVEN)}
SIZES = ((BOARD, (0.17, 0.18)), (BOARD, (0.27, 0.29)), (BOARD, (0.55, 0.58)), (LARGE_SQUARES, (0.84, 0.87)))


def grid(seeds: int) -> list[Row]:
    """Every combination of blur, noise, lens and light, and size; a cell is one of them."""

    def work(blur: float, look: str, size: int, seed: int) -> tuple[FloatArray, list[FloatArray]]:
        (camera, light), (board, fill) = LOOKS[look], SIZES[size]
        ideal = Ideal.render(Scene(camera, board, light, blur, fill=fill), seed)
        bound = ideal.bound_px()
        # Every cell has noise of its own: with the same one, chance would favour or harm all of them together.
        stream = len(NOISES_LEVELS) * (size + len(SIZES) * (list(LOOKS).index(look) + len(LOOKS) * BLURS_PX.index(blur)))
        ratios = []
        for draw, noise in enumerate(NOISES_LEVELS, stream):
            errors = exposed(ideal, sensor(noise), seed, draw).warped_px
            ratios.append(errors / (total_noise_levels(noise) * bound))
        return ideal.spacing_px, ratios

    parts = on_all_processors(work, BLURS_PX, list(LOOKS), range(len(SIZES)), range(seeds))
    cells = {}
    for index, key in enumerate(product(BLURS_PX, LOOKS, range(len(SIZES)))):
        spacings, ratios = zip(*parts[index * seeds : (index + 1) * seeds], strict=True)
        between = np.concatenate(spacings)
        for noise, one_noise in zip(NOISES_LEVELS, zip(*ratios, strict=True), strict=True):
            name = f"blur {key[0]}, noise {noise}, {key[1]}, {between.min():.0f}-{between.max():.0f} px"
            cells[name] = np.concatenate(one_noise)
    every = np.concatenate([part[0] for part in parts])
    name = f"grid of {len(cells)} cells, {every.min():.0f}-{every.max():.0f} px"
    means = {cell: rms(values) for cell, values in cells.items()}
    # A cell of which nothing is left is the worst of all.
    worst = sorted(means, key=lambda cell: np.nan_to_num(means[cell], nan=np.inf))[-3:][::-1]
    total = np.concatenate(list(cells.values()))
    fewest = min(cells, key=lambda cell: np.isfinite(cells[cell]).mean())
    return [
        Row(name, "mean over cells of RMS / bound", float(np.mean(list(means.values()))), 1.3, kept(total)),
        Row(name, "RMS / bound over all corners", rms(total), 1.3, kept(total)),
        *(
            Row(name, f"no. {place} of the worst cells: {cell}", means[cell], 1.6, kept(cells[cell]))
            for place, cell in enumerate(worst, 1)
        ),
        Row(name, f"most refused: {fewest}", means[fewest], 1.6, kept(cells[fewest])),
    ]


def floor(seeds: int) -> list[Row]:
    """What is left without noise and with 16 bits."""
    noise_free = Sensor(read_noise_levels=0, bits=16)

    def work(look: str, seed: int) -> FloatArray:
        camera, light = LOOKS[look]
        return exposed(Ideal.render(Scene(camera, light=light), seed), noise_free, seed).warped_px

    parts, rows = on_all_processors(work, list(LOOKS), range(2 * seeds)), []
    for index, look in enumerate(LOOKS):
        errors = np.concatenate(parts[2 * seeds * index : 2 * seeds * (index + 1)])
        largest = np.nanmax(np.abs(errors))
        rows.append(Row("noise-free, blur 0.7", f"{look}: RMS px (max {largest:.5f})", rms(errors), 0.001, kept(errors)))
    return rows


@dataclass(frozen=True, slots=True)
class Recording:
    """A sensor that the fit has no exact model of."""

    name: str
    noise_levels: float = 2.0
    defocus_px: float = 0.0
    gamma: float = 1.0
    jpeg_quality: int | None = None

    def image(self, ideal: Ideal, rng: np.random.Generator) -> Image:
        """Record a view."""
        image = expose(ideal.signal, sensor(self.noise_levels, self.gamma), rng)
        if self.jpeg_quality is None:
            return image
        _, stored = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality])
        decoded: Image = np.asarray(cv2.imdecode(stored, cv2.IMREAD_GRAYSCALE))
        return decoded


RECORDINGS = (
    Recording("defocus disc 1.5 px", defocus_px=1.5),
    Recording("gamma 2.2", gamma=2.2),
    Recording("8 bits, no noise", noise_levels=0.0),
    Recording("JPEG 90", jpeg_quality=90),
    Recording("JPEG 90 and gamma 2.2", jpeg_quality=90, gamma=2.2),
)


def sensors(seeds: int) -> list[Row]:
    """Sensors beyond the model: what is left after averaging the noise, and the scatter over the linear sensor's bound."""

    def work(recording: Recording, seed: int) -> tuple[FloatArray, FloatArray]:
        ideal = Ideal.render(Scene(defocus_px=recording.defocus_px), seed)
        errors = []
        for draw in range(DRAWS if recording.noise_levels else 1):
            rng = np.random.default_rng((seed, draw))
            image = recording.image(ideal, rng)
            errors.append(fit(ideal, image, shaken(ideal.corners_px, rng)).warped_px)
        return np.array(errors), total_noise_levels(recording.noise_levels) * ideal.bound_px()

    parts, rows = on_all_processors(work, RECORDINGS, range(seeds)), []
    for index, recording in enumerate(RECORDINGS):
        here = parts[index * seeds : (index + 1) * seeds]
        errors = np.concatenate([part[0] for part in here], axis=1)
        bound = np.concatenate([part[1] for part in here])
        mean = np.hypot(*np.nanmean(errors, axis=(0, 1)))
        what = f"bias of a corner, RMS px (common to all: {mean:.5f})"
        rows.append(Row(recording.name, what, bias_px(errors), 0.01, kept(errors)))
        if recording.noise_levels:
            what = f"RMS / bound ({rms(errors):.4f} px)"
            rows.append(Row(recording.name, what, rms(errors / bound), 2.0, kept(errors)))
    return rows


def bias_px(errors_px: FloatArray) -> float:
    """RMS of each corner's expected error, from D draws of its noise: (D, N, 2).

    The scatter of a mean of D errors is taken off it; of one draw alone nothing is.
    """
    draws = len(errors_px)
    squares = errors_px.mean(axis=0) ** 2
    if draws > 1:
        squares = squares - errors_px.var(axis=0, ddof=1) / draws
    return float(np.sqrt(max(0.0, float(np.nanmean(squares)))))


def aprilgrid(seeds: int) -> list[Row]:
    """AprilGrid with black squares at its crossings, and without them."""

    def work(board: Board, seed: int) -> tuple[FloatArray, FloatArray]:
        ideal = Ideal.render(Scene(board=board, fill=(0.6, 0.9)), seed)
        errors = exposed(ideal, sensor(2.0), seed).warped_px
        return errors, errors / (total_noise_levels(2.0) * ideal.bound_px())

    count = 3 * seeds
    parts = on_all_processors(work, (WITH_SQUARES, WITHOUT_SQUARES), range(count))
    (with_px, with_ratio), (without_px, without_ratio) = (
        tuple(np.concatenate(values) for values in zip(*half, strict=True)) for half in (parts[:count], parts[count:])
    )
    without = f"without squares: RMS px ({rms(without_ratio):.2f} x bound)"
    return [
        Row("AprilGrid", f"with squares: RMS / bound ({rms(with_px):.4f} px)", rms(with_ratio), 1.3, kept(with_px)),
        Row("AprilGrid", without, rms(without_px), 0.03, kept(without_px)),
    ]


def starts(seeds: int) -> list[Row]:
    """Starts that are far off, and starts on another corner."""

    def far(ideal: Ideal, rng: np.random.Generator) -> FloatArray:
        angle = rng.uniform(0, 2 * np.pi, len(ideal.corners_px))
        return ideal.corners_px + FAR_START_PX * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    def swapped(ideal: Ideal, rng: np.random.Generator) -> FloatArray:
        # A corner nearby is the likeliest mistake, and the hardest to tell.
        begin, neighbours = shaken(ideal.corners_px, rng), corner_shapes(ideal.scene.board).neighbours
        count = len(begin)
        chosen = rng.choice(count, max(1, round(WRONG_SHARE * count)), replace=False)
        other = np.array([rng.choice(neighbours[corner][neighbours[corner] >= 0]) for corner in chosen])
        if rng.random() < 0.5:
            other = (chosen + rng.integers(1, count, chosen.size)) % count
        begin[chosen] = ideal.corners_px[other]
        return begin

    def work(begin: Callable[..., FloatArray], blur: float, size: int, seed: int) -> tuple[int, FloatArray]:
        board, fill = SIZES[size]
        ideal = Ideal.render(Scene(board=board, blur_px=blur, fill=fill), seed)
        rng = np.random.default_rng(seed)
        found = fit(ideal, expose(ideal.signal, sensor(2.0), rng), begin(ideal, rng))
        return found.wrong, found.warped_px

    parts = on_all_processors(work, (far, swapped), (0.4, 0.7, 2.0), range(len(SIZES)), range(2 * seeds))
    names, half = (f"starts {FAR_START_PX} px off", f"{WRONG_SHARE:.0%} of starts on another corner"), len(parts) // 2
    rows = []
    for name, here in zip(names, (parts[:half], parts[half:]), strict=True):
        wrong, errors = sum(part[0] for part in here), np.concatenate([part[1] for part in here])
        largest = np.nanmax(np.abs(errors))
        what = f"accepted beyond {WRONG_SIGMAS:.0f} of their sigmas (max {largest:.3f} px)"
        rows.append(Row(name, what, wrong, 0, kept(errors)))
    return rows


SCENES = {
    "checkerboard": checkerboard,
    "grid": grid,
    "floor": floor,
    "sensors": sensors,
    "aprilgrid": aprilgrid,
    "starts": starts,
}


def main() -> int:
    """Print the table; 1 if a row misses its limit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4, help="views per cell of the grid; the other rows use a multiple")
    parser.add_argument("--only", choices=SCENES, help="one scene alone")
    arguments = parser.parse_args()
    began, missed = time.perf_counter(), 0
    print(f"{'scene':34}{'what':72}{'reached':>10}{'must':>9}  {'kept':>13}")
    for name in [arguments.only] if arguments.only else SCENES:
        for row in SCENES[name](arguments.seeds):
            verdict = "" if row.fine else "  MISSED"
            print(f"{row.scene:34}{row.what:72}{row.reached:10.4g}{'<= ' + format(row.must, 'g'):>9}  {row.kept:>13}{verdict}")
            missed += not row.fine
    print(f"{missed} missed; {time.perf_counter() - began:.0f} s")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
