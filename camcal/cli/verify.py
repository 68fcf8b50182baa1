"""`camcal verify`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from camcal.cli import options
from camcal.cli.console import ConsoleReporter, number, print_json, print_table
from camcal.errors import QualityError
from camcal.rounding import as_given, plus_minus, point_in_line, rounded

if TYPE_CHECKING:
    from camcal.workflows.verify import Verification


@click.command(cls=options.Command, epilog="Example: camcal verify calib/ --truth data/ --max-sigma 4")
@click.argument("estimate")
@click.option("--truth", required=True, metavar="FILE|DIR", help="Folder or camera file that holds the truth.")
@click.option("--max-diff", type=float, metavar="PX", help="Fail if the projection differs by more, anywhere in the image.")
@click.option("--max-sigma", type=float, metavar="N", help="Fail if a parameter is off by more standard deviations.")
@options.html
@options.as_json
@options.help_option
def verify(
    *, estimate: str, truth: str, max_diff: float | None, max_sigma: float | None, html: str | None, as_json: bool
) -> None:
    """Tell how far an estimated camera is from the truth.

    ESTIMATE and TRUTH are folders written by `calibrate` or `synth`, or camera files. The projection difference is taken
    over the whole image, for far points, after the rotation between the two cameras is fitted and removed. Exit code 5
    when a gate fails.
    """
    from camcal.workflows.verify import verify as compare

    reporter = ConsoleReporter()
    with reporter.progress("Comparing", None):
        result = compare(estimate, truth, max_diff_px=max_diff, max_sigma=max_sigma, html=html, reporter=reporter)
    if as_json:
        print_json(result.as_dict())
    else:
        print_verification(result)
    if result.problems:
        raise QualityError("verify: " + "; ".join(result.problems) + ".")


def print_verification(result: Verification) -> None:
    """Print the parameters and the differences as tables."""
    truth = point_in_line([as_given(e.truth, e.sigma) for e in result.parameters])
    if result.both_estimated:
        header = ("", "true", "recovered", "difference ± std. dev.", "in std. dev.")
        recovered = point_in_line([rounded(e.estimate, e.sigma) for e in result.parameters])
        difference = plus_minus([(e.error, e.sigma) for e in result.parameters])
    else:
        header = ("", "true", "recovered ± std. dev.", "difference", "in std. dev.")
        recovered = plus_minus([(e.estimate, e.sigma) for e in result.parameters])
        difference = [rounded(e.error, e.sigma, "+") if e.sigma > 0 else f"{e.error:+.2g}" for e in result.parameters]
    names = [e.name for e in result.parameters]
    in_sigma = [number(e.error_in_sigma, "+.2f") for e in result.parameters]
    rows = list(zip(names, truth, recovered, difference, in_sigma, strict=True))
    print_table("Parameters (fx, fy, cx, cy in pixels)", header, rows)
    p = result.projection
    over = [("projection difference (px)", f"{p.mean_px:.3g}", f"{p.p95_px:.3g}", f"{p.max_px:.3g}")]
    print_table(f"Over {100 * p.compared_share:.0f} % of the image", ("", "mean", "95 %", "max"), over)
    _print_views(result)


def _print_views(result: Verification) -> None:
    """Print how far corners and poses are from the truth, if they could be compared."""
    v = result.views
    if v is None:
        return
    rows = [
        ("corner error, RMS per axis (px)", number(v.corner_rms_px, ".3g")),
        ("corner bias x, y (px)", "{}, {}".format(*(number(bias, "+.4f") for bias in v.corner_bias_px))),
        ("largest corner error (px)", number(v.corner_max_px, ".3g")),
        ("board rotation error, RMS (deg)", number(v.rotation_deg, ".3g")),
        ("board position error, RMS (mm)", number(1000 * v.translation_m, ".3g")),
    ]
    print_table(f"{v.views} views, {v.corners} corners", (), rows)
