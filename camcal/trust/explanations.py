"""What explains what: a bent board explains residuals with structure, boards kept central explain an uncertain corner.

A cause stands before the symptoms it brings about and is as grave as they are, so that a person reads first what to change.
What is only worth a note is no cause of anything grave.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from camcal.verdict import LEVELS, Finding, Verdict

_MISFITS = ("large_rms", "inconsistent", "structured_residuals", "outliers", "bad_view", "influential_view")
_UNSURE = ("uncertain", "fold_in_image", "influential_view")

EXPLAINS = {
    "rows_columns_swapped": (*_MISFITS, *_UNSURE, "odd_aspect", "off_centre", "fold_inside_corners"),
    "seen_from_behind": (*_MISFITS, "off_centre"),
    "fisheye": (*_MISFITS, *_UNSURE, "odd_aspect", "off_centre", "fold_inside_corners", "lens_too_simple"),
    "mixed_cameras": (*_MISFITS, *_UNSURE, "odd_aspect", "off_centre", "fold_inside_corners"),
    "drift": (*_MISFITS, "uncertain", "off_centre"),
    "repeated_views": (
        *_UNSURE,
        "unsupported_coefficient",
        "few_views",
        "fronto_parallel",
        "one_distance",
        "uncovered",
        "central_only",
        "off_centre",
    ),
    "few_views": (*_UNSURE, "unsupported_coefficient", "uncovered"),
    "wrong_spacing": (*_MISFITS, "odd_aspect", "off_centre", "fold_inside_corners"),
    "lens_too_simple": (*_MISFITS, "off_centre"),
    "stretched_print": (*_MISFITS, "odd_aspect"),
    "bent_board": _MISFITS,
    "blurred_views": ("outliers", "bad_view", "influential_view", "uncertain"),
    "fronto_parallel": (*_UNSURE, "off_centre", "one_distance"),
    "one_orientation": (*_UNSURE, "off_centre"),
    "central_only": (*_UNSURE, "uncovered", "fold_inside_corners"),
    "uncovered": _UNSURE,
    "small_boards": _UNSURE,
    "one_distance": ("uncertain",),
    "coarse_corners": ("uncertain", "inconsistent", "structured_residuals"),
    "unsupported_coefficient": ("uncertain", "fold_in_image"),
}
"""By cause, the symptoms it may bring about."""

ORDER = (
    *(cause for cause in EXPLAINS if cause != "unsupported_coefficient"),
    "odd_aspect",
    "fold_inside_corners",
    "large_rms",
    "bad_view",
    "outliers",
    "inconsistent",
    "structured_residuals",
    "unsupported_coefficient",
    "off_centre",
    "fold_in_image",
    "uncertain",
    "influential_view",
)
"""Order of findings of one level that nothing else explains; those not named here come last."""


def explained(findings: Iterable[Finding]) -> Verdict:
    """Make a verdict of findings.

    Parameters
    ----------
    findings : iterable of Finding
        In any order.
    """
    found = list(findings)
    levels = {finding.code: finding.level for finding in Verdict.of(found).findings}
    # A symptom's own symptoms come first in the order, so that one pass from the last cause to the first carries levels on.
    for cause in reversed(EXPLAINS):
        if levels.get(cause, "note") != "note":
            borne = [levels[cause], *(levels[symptom] for symptom in EXPLAINS[cause] if symptom in levels)]
            levels[cause] = min(borne, key=LEVELS.index)
    explained_away = {symptom for cause in levels for symptom in EXPLAINS.get(cause, ()) if levels[cause] != "note"}
    ranks = {code: rank for rank, code in enumerate(reversed(ORDER), start=1)}
    return Verdict.of(
        replace(
            finding,
            level=levels[finding.code],
            weight=float(ranks.get(finding.code, 0) - len(ranks) * (finding.code in explained_away)),
        )
        for finding in Verdict.of(found).findings
    )
