"""`camcal regress`: the accuracy suite. Each scenario is rendered, calibrated from pixels and compared with its truth."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camcal.compare.parameters import parameter_errors
from camcal.compare.projection import predicted_difference_px, projection_difference
from camcal.compare.views import closest_corners
from camcal.errors import InputError
from camcal.formats.baseline_file import Baseline, claim_baseline, load_baseline, save_baseline
from camcal.formats.corners_file import load_corners
from camcal.formats.junit_file import claim_junit, save_junit
from camcal.formats.page_file import claim_page
from camcal.formats.scenario_file import load_scenario
from camcal.geometry.arrays import FloatArray
from camcal.observations import Detection
from camcal.records import Intrinsics
from camcal.resources import config_names, config_path
from camcal.synthesis.bound import corner_bound, sensor_noise_levels
from camcal.synthesis.poses import sample_pose
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Scenario
from camcal.workflows.calibrate import CalibrationRun, calibrate
from camcal.workflows.comparison_report import write_suite
from camcal.workflows.parallel import each
from camcal.workflows.reporting import LogReporter, ProgressOnly, Reporter, SilentReporter
from camcal.workflows.synth import IMAGES, scenario_file, synth


@dataclass(frozen=True, slots=True)
class Figure:
    """One figure of the suite.

    Attributes
    ----------
    name : str
    title : str
        Heading in a table.
    slack : float
        How much worse than the baseline it may be, as a share of the baseline.
    floor : float
        The same as an absolute amount; the larger of the two counts.
    higher_is_better : bool
    """

    name: str
    title: str
    slack: float
    floor: float
    higher_is_better: bool = False


FIGURES = (
    Figure("views", "views used", 0.0, 0.0, higher_is_better=True),
    Figure("detected_share", "corners found, share", 0.0, 0.002, higher_is_better=True),
    Figure("corner_rms_px", "corner RMS, px", 0.05, 0.0),
    Figure("corner_rms_over_bound", "corner RMS / bound", 0.05, 0.0),
    Figure("corner_max_over_bound", "worst corner / bound", 0.15, 0.0),
    Figure("corner_bias_px", "corner bias, px", 0.25, 0.0005),
    Figure("projection_mean_px", "projection, mean px", 0.25, 0.002),
    Figure("projection_max_px", "projection, max px", 0.25, 0.01),
    Figure("projection_over_sigma", "projection / predicted", 0.25, 0.25),
    Figure("worst_parameter_sigma", "worst parameter / sigma", 0.25, 0.5),
)
"""What is measured of each scenario, and how much worse than its baseline it may get."""

_BOUND_EVERY = 4
"""The bound is computed for every so many views: it changes little from view to view and costs renders."""

_RADIUS_SHARE = 0.45


@dataclass(frozen=True, slots=True)
class ScenarioResult:
    """One scenario's figures.

    Attributes
    ----------
    name : str
    figures : dict of str to float
        By name, those of `FIGURES`.
    seconds : float
        Wall time.
    problems : tuple of str
        Which figures are worse than the baseline by more than their slack.
    """

    name: str
    figures: Mapping[str, float]
    seconds: float
    problems: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Regression:
    """The whole suite.

    Attributes
    ----------
    results : tuple of ScenarioResult
    baseline : Path or None
        What it was held against.
    """

    results: tuple[ScenarioResult, ...]
    baseline: Path | None

    @property
    def problems(self) -> tuple[str, ...]:
        """Every problem, with its scenario."""
        return tuple(f"{result.name}: {problem}" for result in self.results for problem in result.problems)

    def as_dict(self) -> dict[str, object]:
        """Return everything as plain values, for JSON."""
        return {
            "baseline": None if self.baseline is None else str(self.baseline),
            "scenarios": {
                r.name: {"figures": dict(r.figures), "seconds": r.seconds, "problems": list(r.problems)} for r in self.results
            },
        }


def regress(
    configs: Sequence[str | Path] = (),
    *,
    baseline: str | Path | None = None,
    update_baseline: bool = False,
    junit: str | Path | None = None,
    html: str | Path | None = None,
    refine: str = "warped",
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> Regression:
    """Run the accuracy suite and hold it against a baseline.

    Parameters
    ----------
    configs : sequence of path
        Scenario files, or names of shipped ones; all shipped ones by default.
    baseline : path, optional
        JSON file of the figures to hold the run against; without it nothing can fail.
    update_baseline : bool
        Whether the baseline is written from this run instead.
    junit : path, optional
        Where to write the results as JUnit XML as well; earlier ones are replaced, any other file is refused.
    html : path, optional
        Where to write them as a page as well; one that camcal wrote is replaced, any other file is refused.
    refine : str
        How corners are refined, as for `calibrate`.
    jobs : int, optional
        Images worked on at once; all processors by default.
    reporter : Reporter, optional

    Returns
    -------
    Regression
        Its `problems` name scenario and figure.

    Raises
    ------
    InputError
        If a config or the baseline cannot be used, the baseline lacks a scenario, or an output would replace something else.
    CamcalError
        If a scenario cannot be calibrated at all.
    """
    reporter = reporter or LogReporter()
    if update_baseline and baseline is None:
        raise InputError("--update-baseline: needs --baseline FILE to write to.")
    if junit is not None:
        claim_junit(junit)
    page = None if html is None else claim_page(html)
    scenarios = [scenario_file(config) for config in configs] or [config_path(name) for name in config_names()]
    loaded = [load_scenario(path) for path in scenarios]
    names = [scenario.name for scenario in loaded]
    if len(set(names)) < len(names):
        raise InputError(f"regress: two scenarios of one name (got {', '.join(names)}). Give each its own.")
    known = None
    if baseline is not None and update_baseline:
        claim_baseline(baseline)
    elif baseline is not None:
        known = load_baseline(baseline)
    if known is not None:
        known.check_holds(names)
    results = []
    with reporter.progress("Scenarios", len(loaded)) as advance:
        for path, scenario in zip(scenarios, loaded, strict=True):
            started = time.perf_counter()
            figures = measure(path, scenario, refine=refine, jobs=jobs, reporter=ProgressOnly(reporter))
            problems = () if known is None else worse_figures(figures, known.figures[scenario.name])
            results.append(ScenarioResult(scenario.name, figures, time.perf_counter() - started, problems))
            advance()
    regression = Regression(tuple(results), None if baseline is None else Path(baseline))
    if update_baseline and baseline is not None:
        save_baseline(baseline, Baseline({result.name: result.figures for result in results}))
    if junit is not None:
        save_junit(junit, [(result.name, result.seconds, result.problems) for result in results])
    if page is not None:
        with reporter.progress("Drawing the report", None):
            write_suite(page, regression, FIGURES, {} if known is None else known.figures)
    return regression


def worse_figures(figures: Mapping[str, float], reference: Mapping[str, float]) -> tuple[str, ...]:
    """Name the figures that are worse than the reference by more than their slack."""
    problems = []
    for figure in FIGURES:
        if figure.name not in reference:
            continue
        value, expected = figures[figure.name], reference[figure.name]
        allowed = max(figure.slack * abs(expected), figure.floor)
        limit = expected - allowed if figure.higher_is_better else expected + allowed
        fine = value >= limit if figure.higher_is_better else value <= limit
        if not fine:
            bound = "at least" if figure.higher_is_better else "at most"
            problems.append(f"{figure.name} is {value:.4g} (expected {bound} {limit:.4g}; baseline {expected:.4g})")
    return tuple(problems)


def measure(
    path: Path, scenario: Scenario, *, refine: str, jobs: int | None, reporter: Reporter | None = None
) -> dict[str, float]:
    """Render a scenario into a temporary folder, calibrate it from pixels, and compare with its truth."""
    quiet = reporter or SilentReporter()
    with tempfile.TemporaryDirectory(prefix="camcal-regress-") as name:
        data = Path(name)
        synth(path, data, force=True, jobs=jobs, reporter=quiet)
        run = calibrate(data / IMAGES, str(data / "board.yaml"), refine=refine, jobs=jobs, reporter=quiet)
        truth = load_corners(data / "corners.csv")
    with quiet.progress("Bounding", None):
        corners = _corner_figures(scenario, truth, run, jobs)
    return {
        "views": float(len(run.calibration.detections)),
        "detected_share": run.calibration.corner_count / sum(len(view) for view in truth),
        **corners,
        **_camera_figures(scenario, run),
    }


def _corner_figures(scenario: Scenario, truth: Sequence[Detection], run: CalibrationRun, jobs: int | None) -> dict[str, float]:
    """Errors of the corners per axis, in pixels and over the Cramér-Rao bound."""
    true = {view.source: view for view in truth}
    errors, ids = {}, {}
    for found in run.calibration.detections:
        errors[found.source], ids[found.source], _ = closest_corners(true[found.source], found, run.board)
    every = np.concatenate(list(errors.values()))
    sources = [view.source for view in truth]
    chosen = [index for index in range(0, len(truth), _BOUND_EVERY) if sources[index] in errors]
    bounds = each(lambda index: _bound(scenario, index), chosen, jobs, lambda: None)
    relative = np.concatenate([errors[sources[i]] / bound[ids[sources[i]]] for i, bound in zip(chosen, bounds, strict=True)])
    relative = relative[np.isfinite(relative).all(axis=1)]
    return {
        "corner_rms_px": float(np.sqrt((every**2).mean())),
        "corner_rms_over_bound": float(np.sqrt((relative**2).mean())),
        "corner_max_over_bound": float(np.abs(relative).max()),
        "corner_bias_px": float(np.linalg.norm(every.mean(axis=0))),
    }


def _bound(scenario: Scenario, index: int) -> FloatArray:
    """Cramér-Rao bound (N, 2) of every feature of a view; NaN where its patch leaves the image."""
    pose = sample_pose(scenario, index)
    corners = scenario.camera.project(pose.apply(scenario.board.object_points))
    between = np.linalg.norm(corners[:, None] - corners, axis=-1)
    np.fill_diagonal(between, np.inf)
    blur = scenario.sensor.blur_sigma_px
    signal = render_ideal(scenario.camera, scenario.board, pose, scenario.light, blur_sigma_px=blur)
    return corner_bound(
        scenario.camera,
        scenario.board,
        pose,
        scenario.light,
        blur_sigma_px=blur,
        noise_levels=sensor_noise_levels(signal, scenario.sensor),
        radius_px=_RADIUS_SHARE * np.nan_to_num(between, nan=np.inf).min(axis=1),
    )


def _camera_figures(scenario: Scenario, run: CalibrationRun) -> dict[str, float]:
    """Errors of the camera: over the image, against what its covariance predicts, and of the worst parameter."""
    difference = projection_difference(scenario.camera, run.intrinsics.camera)
    predicted = predicted_difference_px(run.intrinsics)
    both = np.isfinite(predicted) & np.isfinite(difference.difference_px).all(axis=1)
    length = np.linalg.norm(difference.difference_px[both], axis=1)
    errors = parameter_errors(Intrinsics(scenario.camera), run.intrinsics)
    return {
        "projection_mean_px": difference.mean_px,
        "projection_max_px": difference.max_px,
        "projection_over_sigma": float(np.sqrt((length**2).mean() / (predicted[both] ** 2).mean())),
        "worst_parameter_sigma": max(abs(error.error_in_sigma) for error in errors if error.sigma > 0),
    }
