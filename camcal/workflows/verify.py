"""`camcal verify`: how far an estimated camera is from the truth, and whether that is good enough."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from camcal.compare.parameters import ParameterError, parameter_errors
from camcal.compare.projection import ProjectionDifference, projection_difference
from camcal.compare.views import PosedView, ViewErrors, view_errors
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.corners_file import load_corners
from camcal.formats.page_file import claim_page
from camcal.formats.views_file import load_views
from camcal.workflows.comparison_report import write_comparison
from camcal.workflows.given import GivenCamera, camera_name, camera_path, known_camera
from camcal.workflows.reporting import Reporter


@dataclass(frozen=True, slots=True)
class Verification:
    """What `verify` found.

    Attributes
    ----------
    projection : ProjectionDifference
        Estimate against truth over the image.
    parameters : tuple of ParameterError
    views : ViewErrors or None
        Corner and pose errors; None unless both sides are folders with views in common.
    problems : tuple of str
        One line for each gate that failed, and for each reason why the estimate itself must not be trusted.
    both_estimated : bool
        Whether both cameras have standard deviations, so that those of the parameters are their differences'.
    """

    projection: ProjectionDifference
    parameters: tuple[ParameterError, ...]
    views: ViewErrors | None
    problems: tuple[str, ...]
    both_estimated: bool = False

    def as_dict(self) -> dict[str, object]:
        """Return everything as plain values, for JSON."""
        p = self.projection
        return {
            "projection_difference_px": {
                "mean": p.mean_px,
                "p95": p.p95_px,
                "max": p.max_px,
                "compared_share": p.compared_share,
                "implied_rvec_rad": p.rvec.tolist(),
            },
            "parameters": [asdict(e) | {"error": e.error, "error_in_sigma": e.error_in_sigma} for e in self.parameters],
            "views": None if self.views is None else asdict(self.views),
            "problems": list(self.problems),
        }


def verify(
    estimate: GivenCamera,
    truth: GivenCamera,
    *,
    max_diff_px: float | None = None,
    max_sigma: float | None = None,
    html: str | Path | None = None,
    reporter: Reporter | None = None,
) -> Verification:
    """Compare an estimate with the truth.

    Parameters
    ----------
    estimate, truth : path, Camera or Intrinsics
        A folder that `calibrate` or `synth` wrote, a camera file, or the camera itself. Views are compared if both are
        folders.
    max_diff_px : float, optional
        Gate: the largest projection difference over the image, after the implied rotation is fitted, in pixels.
    max_sigma : float, optional
        Gate: the largest error of a solved parameter in its standard deviations.
    html : path, optional
        Where to write the result as a page as well; one that camcal wrote is replaced, any other file is refused.
    reporter : Reporter, optional
        Told what the files of the cameras say besides.

    Returns
    -------
    Verification
        Its `problems` say which gates failed.

    Raises
    ------
    InputError
        If a file is missing or wrong, the cameras' image sizes differ, or a gate cannot be applied.

    Examples
    --------
    >>> import tempfile, camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> longer = camcal.Camera(camera.size, camera.K * [[1.01, 1, 1], [1, 1.01, 1], [1, 1, 1]], camera.dist)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_intrinsics(f"{folder}/truth.yaml", camcal.Intrinsics(camera))
    ...     camcal.save_intrinsics(f"{folder}/estimate.yaml", camcal.Intrinsics(longer))
    ...     found = camcal.verify(f"{folder}/estimate.yaml", f"{folder}/truth.yaml", max_diff_px=1)
    >>> found.problems
    ('--max-diff: projection differs by up to 4.012 px (expected at most 1)',)
    """
    for option, limit in (("--max-diff", max_diff_px), ("--max-sigma", max_sigma)):
        if limit is not None and not limit > 0:
            raise InputError(f"{option}: out of range (got {limit:g}, expected more than 0).")
    page = None if html is None else claim_page(html)
    estimated, true = known_camera(estimate, reporter), known_camera(truth, reporter)
    projection = projection_difference(true.camera, estimated.camera)
    parameters = parameter_errors(true, estimated)
    if max_sigma is not None and not estimated.free:
        raise InputError(
            f"{camera_name(estimate)}: no standard deviations known of this camera, "
            "which --max-sigma needs. Gate with --max-diff."
        )
    problems = (
        *(f"the estimate is marked as not to be trusted: {problem}" for problem in estimated.problems),
        _difference_problem(projection, max_diff_px),
        _sigma_problem(parameters, max_sigma),
    )
    views = _compare_views(camera_path(estimate), camera_path(truth))
    failed = tuple(problem for problem in problems if problem)
    found = Verification(projection, parameters, views, failed, both_estimated=bool(true.free and estimated.free))
    if page is not None:
        gates = {"--max-diff": max_diff_px, "--max-sigma": max_sigma}
        write_comparison(page, found, (camera_name(estimate), camera_name(truth)), true.camera.size, gates)
    return found


def _difference_problem(projection: ProjectionDifference, limit: float | None) -> str | None:
    if limit is not None and projection.lost_share > 0:
        return (
            f"--max-diff: the estimate's lens turns back in {100 * projection.lost_share:.2g} % of the image (expected nowhere)"
        )
    if limit is None or projection.max_px <= limit:
        return None
    return f"--max-diff: projection differs by up to {projection.max_px:.4g} px (expected at most {limit:g})"


def _sigma_problem(parameters: tuple[ParameterError, ...], limit: float | None) -> str | None:
    known = [p for p in parameters if p.sigma > 0]
    if limit is None or not known:
        return None
    worst = max(known, key=lambda p: abs(p.error_in_sigma))
    if abs(worst.error_in_sigma) <= limit:
        return None
    return (
        f"--max-sigma: {worst.name} is off by {abs(worst.error_in_sigma):.3g} standard deviations (expected at most {limit:g})"
    )


def _compare_views(estimate: Path | None, truth: Path | None) -> ViewErrors | None:
    """Compare the views of two folders; None unless both have corners and the truth has its board."""
    if estimate is None or truth is None:
        return None
    files = [folder / name for folder in (estimate, truth) for name in ("corners.csv", "views.yaml")] + [truth / "board.yaml"]
    if not all(file.is_file() for file in files):
        return None
    return view_errors(_posed_views(truth), _posed_views(estimate), load_board(str(truth / "board.yaml")))


def _posed_views(folder: Path) -> dict[str, PosedView]:
    """Corners and poses of the used views of a folder, by image name."""
    poses = {record.source: record.T_cam_board for record in load_views(folder / "views.yaml") if record.used}
    detections = load_corners(folder / "corners.csv")
    return {d.source: PosedView(d, poses[d.source]) for d in detections if d.source in poses}
