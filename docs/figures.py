"""Draw the figures of the documentation with camcal itself: the same bytes every time.

python docs/figures.py FOLDER
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

import camcal

Floats = npt.NDArray[np.float64]

BOARD = camcal.load_board("checkerboard:9x6:25mm")
CAMERA = camcal.Camera((1280, 960), [[900, 0, 645.3], [0, 905, 470.2], [0.0, 0.0, 1.0]], [-0.25, 0.08, 0, 0, -0.01])
WIDE = camcal.Camera((1280, 960), [[620, 0, 640], [0, 620, 480], [0, 0, 1]], [-0.25, 0.07])
POSE = camcal.Pose.from_rvec([0.55, -0.5, 0.15], [-0.09, -0.05, 0.27])
NOISE_PX = 0.1
BLUE, ORANGE, GREY, RED = "#2a6fb0", "#d9822b", "#8a8f98", "#c23b3b"
INK = "#333940"
STYLE = {
    "font.size": 9.5,
    "axes.edgecolor": "#9aa0a8",
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.dpi": 110,
    "svg.hashsalt": "camcal",
    "svg.fonttype": "path",
}


def main(folder: Path) -> None:
    """Write every figure to a folder, unless it stands there already from this very script and version."""
    folder.mkdir(parents=True, exist_ok=True)
    stamp, mark = folder / "made-by.txt", f"{camcal.__version__} {Path(__file__).stat().st_mtime_ns}"
    if stamp.exists() and stamp.read_text() == mark:
        return
    for name in FIGURES:
        write(name, folder / f"{name}.svg")
    write_report_figures(folder)
    stamp.write_text(mark)


def write(name: str, path: Path) -> None:
    """Draw one figure."""
    with mpl.rc_context(cast(Any, STYLE)):
        FIGURES[name]().savefig(path, metadata={"Date": None}, bbox_inches="tight", facecolor="white")


def write_report_figures(folder: Path) -> None:
    """Calibrate from rendered images, and keep some of the report's own figures."""
    poses = drawn_poses(12, 21, tilt=0.5, reach=(0.4, 0.3))
    images = [camcal.render(CAMERA, BOARD, pose, seed=index) for index, pose in enumerate(poses)]
    with tempfile.TemporaryDirectory() as work:
        camcal.calibrate(images, BOARD, Path(work) / "calib", report=False, plots=Path(work) / "plots", plot_formats=("svg",))
        for name in REPORT_FIGURES:
            shutil.copy(Path(work) / "plots" / f"{name}.svg", folder / f"report-{name}.svg")


def frames() -> Figure:
    """A rendered board with the axes of its frame, and the pixels of the image's top-left corner."""
    figure = blank(7.4, 2.9)
    left, right = figure.subplots(1, 2, width_ratios=[1.35, 1])
    left.imshow(camcal.render(CAMERA, BOARD, POSE), cmap="gray", vmin=0, vmax=255)
    ends = CAMERA.project(POSE.apply(0.075 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])))
    for name, end, colour in zip("xyz", ends[1:], (RED, "#2e8b57", BLUE), strict=True):
        arrow = {
            "arrowstyle": "-|>",
            "color": colour,
            "lw": 2.4,
            "shrinkA": 0,
            "shrinkB": 0,
            "ls": "--" if name == "z" else "-",
        }
        left.annotate("", end, ends[0], arrowprops=arrow)
        away = 45 * (end - ends[0]) / np.linalg.norm(end - ends[0])
        left.text(*(end + away), name, color=colour, weight="bold", size=12, ha="center", va="center")
    left.set(title="board frame: origin at feature 0, z into the board", xlabel="x (px)", ylabel="y (px)")
    right.imshow(np.arange(12).reshape(3, 4) % 2 * 12 + 225, cmap="gray", vmin=0, vmax=255, extent=(-0.5, 3.5, 2.5, -0.5))
    for x in range(4):
        for y in range(3):
            right.plot(x, y, "o", color=BLUE if x or y else RED, ms=4)
    right.text(0.1, 0.25, "(0, 0): the centre of the\ntop-left pixel", color=RED, va="top", fontsize=8.5)
    right.plot([-0.5], [-0.5], "s", color=INK, clip_on=False, ms=4, zorder=5)
    right.text(-0.4, -0.4, "(-0.5, -0.5): its outer corner", color=INK, va="top", fontsize=8.5)
    right.set(title="pixels: whole numbers are centres", xticks=range(4), yticks=range(3), xlabel="x (px)", ylabel="y (px)")
    return tight(figure)


def lens() -> Figure:
    """A straight grid through two lenses, and the distorted radius against the ideal one with its fold."""
    figure = blank(7.4, 2.7)
    barrel, pincushion, curve = figure.subplots(1, 3, width_ratios=[1, 1, 1.15])
    for axes, k1, title in ((barrel, -0.25, "k1 = -0.25: barrel"), (pincushion, 0.2, "k1 = 0.2: pincushion")):
        camera = camcal.Camera((1280, 960), [[900, 0, 639.5], [0, 900, 479.5], [0, 0, 1]], [k1])
        for line in grid_lines(0.8, 0.6, 0.1):
            axes.plot(*camera.project(line).T, color=BLUE, lw=0.9)
        axes.set(title=title, xlim=(-0.5, 1279.5), ylim=(959.5, -0.5), aspect="equal", xticks=[], yticks=[])
        axes.spines[:].set_visible(True)
    r = np.linspace(0, 2.2, 400)
    curve.plot(r, r, ":", color=GREY, label="no lens")
    folding = camcal.Camera((10, 10), np.eye(3), [-0.12, 0.0])
    bare = folding.lens.distort_unchecked(np.stack([r, 0 * r], axis=-1))[:, 0]
    radius = folding.lens.valid_radius
    curve.plot(r[r <= radius], bare[r <= radius], color=BLUE, label="k1 = -0.12")
    curve.plot(r[r > radius], bare[r > radius], "--", color=RED, label="past the fold: no answer")
    curve.axvline(radius, ymin=0.36, color=RED, lw=0.8)
    curve.set(
        title="where a lens model turns back", xlabel="ideal radius", ylabel="distorted radius", xlim=(0, 2.2), ylim=(0, 1.6)
    )
    curve.legend(frameon=False, fontsize=7, loc="lower right", handlelength=1.2, borderaxespad=0)
    return tight(figure)


def uncertainty() -> Figure:
    """Standard deviation of the projection over the image: boards kept in the middle, and boards all over it."""
    figure = blank(7.4, 2.9)
    plots = figure.subplots(1, 2, sharey=True)
    width, height = CAMERA.size
    x, y = np.meshgrid(np.linspace(0, width - 1, 65), np.linspace(0, height - 1, 49))
    levels = [0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10]
    for axes, reach, title in zip(
        plots, ((0.1, 0.08), (0.5, 0.36)), ("boards kept in the middle", "boards all over the image"), strict=True
    ):
        views = noisy_views(16, 4, reach=reach)
        run = camcal.calibrate(views, BOARD)
        sigma = camcal.projection_sigma(run.calibration, np.stack([x, y], axis=-1).reshape(-1, 2), 0.4).reshape(x.shape)
        norm = mpl.colors.BoundaryNorm(levels, 256, extend="both")
        shown = axes.contourf(x, y, sigma, levels=levels, norm=norm, cmap="viridis_r", extend="both")
        corners = np.concatenate([view.corners_px for view in views])
        axes.plot(*corners.T, ".", color="white", ms=1, alpha=0.7)
        axes.set(title=f"{title}\nRMS {run.calibration.rms_px:.3f} px", xlim=(0, width), ylim=(height, 0), aspect="equal")
    figure.colorbar(shown, ax=plots, label="standard deviation (px)", shrink=0.85, ticks=levels)
    return figure


def refinement() -> Figure:
    """Errors of the corners of eight rendered views against the truth, by how they are refined."""
    figure = blank(7.4, 2.5)
    poses = drawn_poses(8, 21, tilt=0.5, reach=(0.4, 0.3))
    images = [camcal.render(CAMERA, BOARD, pose, seed=index) for index, pose in enumerate(poses)]
    names = ("opencv", "saddle", "warped")
    titles = ("cv2.cornerSubPix", "blurred saddle", "warped template")
    for axes, name, title in zip(figure.subplots(1, 3, sharey=True), names, titles, strict=True):
        run = camcal.calibrate(images, BOARD, refine=name)
        errors = np.concatenate(
            [
                seen.corners_px - CAMERA.project(poses[int(seen.source[-4:])].apply(BOARD.object_points[seen.ids]))
                for seen in run.calibration.detections
            ]
        )
        rms = np.sqrt((errors**2).mean())
        axes.plot(*(1000 * errors.T), ".", color=BLUE, ms=3, alpha=0.5)
        axes.set(title=f"{title}\nRMS {rms:.4f} px", aspect="equal", xlim=(-60, 60), ylim=(-60, 60))
        axes.set(xlabel="error in x (px / 1000)")
    figure.axes[0].set_ylabel("error in y (px / 1000)")
    return tight(figure)


def cross_validation() -> Figure:
    """The ratio of the halves' difference to its prediction: flat boards, and boards with a bow that nobody solved for."""
    figure = blank(7.4, 2.4)
    axes = figure.subplots()
    bins = np.arange(0.4, 4.81, 0.2).tolist()
    for bow_m, colour, label in ((0.0, BLUE, "flat board"), (0.0004, ORANGE, "board bowed by 0.4 mm, taken for flat")):
        views = [noisy_views(16, 100 + seed, bow_m=bow_m, noise_px=0.05) for seed in range(16)]
        ratios = [camcal.calibrate(each, BOARD).intrinsics.cross_validation for each in views]
        axes.hist(ratios, bins, color=colour, alpha=0.75, label=f"{label} (median {np.median(ratios):.2f})")
    axes.axvline(1, color=GREY, lw=1)
    axes.axvline(2, color=RED, lw=1, ls="--")
    axes.text(2.04, 4, "a finding\nfrom here on", color=RED, fontsize=8.5)
    axes.set(xlabel="difference of the halves / its prediction", ylabel="calibrations")
    axes.set_ylim(0, 1.45 * axes.get_ylim()[1])
    axes.legend(frameon=False, loc="upper right")
    return tight(figure)


def alpha() -> Figure:
    """An image of a wide lens, and what `--alpha` keeps of it."""
    figure = blank(7.4, 1.75)
    image = camcal.render(WIDE, BOARD, camcal.Pose.from_rvec([0.1, -0.1, 0.05], [-0.1, -0.06, 0.12]))
    targets = {f"--alpha {value:g}": camcal.target_camera(WIDE, value) for value in (0.0, 0.5, 1.0)}
    undistorted = {title: camcal.undistort_image(image, WIDE, target, fill=255) for title, target in targets.items()}
    for axes, (title, pixels) in zip(figure.subplots(1, 4), {"as taken": image, **undistorted}.items(), strict=True):
        axes.imshow(pixels, cmap="gray", vmin=0, vmax=255)
        axes.set(title=title, xticks=[], yticks=[])
        axes.spines[:].set_visible(True)
    return tight(figure)


def drawn_poses(count: int, seed: int, *, tilt: float, reach: tuple[float, float]) -> list[camcal.Pose]:
    """Draw poses whose whole board lies inside the image, `reach` being how far X / Z and Y / Z of its centre go."""
    rng = np.random.default_rng(seed)
    centre = BOARD.object_points.mean(axis=0)
    found: list[camcal.Pose] = []
    while len(found) < count:
        turn = camcal.Pose.from_rvec(rng.normal(size=3) * [tilt, tilt, 0.6], np.zeros(3))
        ray = np.array([rng.uniform(-reach[0], reach[0]), rng.uniform(-reach[1], reach[1]), 1]) * rng.uniform(0.25, 0.5)
        pose = camcal.Pose(turn.R, ray - turn.R @ centre)
        if turn.R[2, 2] > 0.5 and CAMERA.contains(CAMERA.project(pose.apply(BOARD.object_points)), 15).all():
            found.append(pose)
    return found


def noisy_views(
    count: int, seed: int, *, reach: tuple[float, float] = (0.5, 0.36), bow_m: float = 0.0, noise_px: float = NOISE_PX
) -> list[camcal.Detection]:
    """Project a board, bowed if wanted, and add noise of `noise_px` per axis: views as a detector would give them."""
    rng = np.random.default_rng((seed, 1))
    points = BOARD.object_points.copy()
    u, v = (points[:, axis] / points[:, axis].max() for axis in (0, 1))
    points[:, 2] = 4 * bow_m * (u * (1 - u) + v * (1 - v))
    ids, sigma = np.arange(len(points)), np.full(len(points), np.nan)
    return [
        camcal.Detection(
            f"view_{index:02d}",
            CAMERA.size,
            ids,
            CAMERA.project(pose.apply(points)) + rng.normal(0, noise_px, (len(ids), 2)),
            sigma,
        )
        for index, pose in enumerate(drawn_poses(count, seed, tilt=0.4, reach=reach))
    ]


def grid_lines(half_width: float, half_height: float, step: float) -> list[Floats]:
    """Lines of a grid at z = 1, each of shape (N, 3)."""
    across, down = (np.arange(-half, half + step / 2, step) for half in (half_width, half_height))
    t = np.linspace(-1, 1, 81)
    upright = [np.stack([np.full(81, x), half_height * t, np.ones(81)], axis=-1) for x in across]
    return upright + [np.stack([half_width * t, np.full(81, y), np.ones(81)], axis=-1) for y in down]


def blank(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches."""
    return Figure(figsize=(width, height))


def tight(figure: Figure) -> Figure:
    """Let nothing overlap."""
    figure.tight_layout()
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "frames": frames,
    "lens": lens,
    "uncertainty": uncertainty,
    "refinement": refinement,
    "cross-validation": cross_validation,
    "alpha": alpha,
}
"""Every figure by the name of its file."""

REPORT_FIGURES = ("uncertainty", "coverage", "residuals", "view_rms")
"""Figures of a report that the tutorial shows."""

if __name__ == "__main__":
    main(Path(sys.argv[1]))
