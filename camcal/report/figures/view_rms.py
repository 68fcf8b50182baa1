"""How well each view fits: one bar for its RMS, sorted, coloured by how far it is from the others."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from camcal.report.figures.canvas import blank, dress, legend
from camcal.report.figures.style import Style, with_plain_settings
from camcal.report.record import Record
from camcal.trust.wording import named, rounded

NOTABLE, BAD = 1.5, 2.5
"""Times the median RMS from which on a view is to be looked at, and from which on something is wrong with it."""

_MOST_NAMED, _LONGEST_NAME = 50, 16
_FEW = 4
_HEADROOM = 1.16


@with_plain_settings
def draw(record: Record, style: Style) -> Figure:
    """Draw the bars, largest first.

    The bar of view i of `calibration.detections` has the gid `bar-i` and links to `#view-i`.
    """
    rms = np.array(record.calibration.view_rms_px)
    order = np.argsort(-rms, kind="stable")
    middle = float(np.median(rms))
    figure = blank(3.6 if rms.size <= _MOST_NAMED else 3.0, style)
    axes = figure.subplots()
    dress(axes, style, f"RMS of {rms.size} views, worst first", "view", "RMS residual (px)", grid="y")
    bars = axes.bar(np.arange(rms.size), rms[order], width=_width(rms.size), color=style.plain)
    for place, index in enumerate(order.tolist()):
        bar = bars[place]
        bar.set(gid=f"bar-{index}", url=f"#view-{index}", facecolor=_colour(rms[index], middle, style))
    axes.axhline(middle, color=style.strong, linewidth=1.2, linestyle=(0, (5, 3)), label=f"median {rounded(middle)} px")
    axes.set_xlim(-0.7, rms.size - 0.3)
    axes.set_ylim(0, _HEADROOM * float(rms.max()) or 1.0)
    if rms.size <= _MOST_NAMED:
        names = [short_name(record.calibration.detections[index].source) for index in order]
        axes.set_xticks(np.arange(rms.size), names, rotation=90 if rms.size > _FEW else 0)
        axes.set_xlabel("")
    key = [
        (style.plain, "like the others"),
        (style.notable, f"over {NOTABLE:g} ×"),
        (style.bad, f"over {BAD:g} ×"),
    ]
    handles = [Patch(color=colour, label=text) for colour, text in key]
    legend(axes, style, handles=[*axes.lines, *handles], ncols=4, columnspacing=1.4, loc="upper right")
    return figure


def caption(record: Record) -> str:
    """Say what good looks like, and which views stand out."""
    rms = np.array(record.calibration.view_rms_px)
    odd = np.flatnonzero(rms > BAD * np.median(rms))
    good = "Good: all bars about as high."
    if not odd.size:
        return f"{good} Here no view is over {BAD:g} times the median."
    worst = [record.calibration.detections[index].source for index in odd[np.argsort(-rms[odd])]]
    return f"{good} Look at {named(worst)}: blurred, moved, or mistaken corners."


def _width(count: int) -> float:
    """Width of a bar, by how many there are."""
    if count <= _FEW:
        return 0.5
    return 0.8 if count <= _MOST_NAMED else 1.0


def _colour(rms_px: float, median_px: float, style: Style) -> str:
    """Colour by how many times the median an RMS is."""
    if rms_px > BAD * median_px:
        return style.bad
    return style.notable if rms_px > NOTABLE * median_px else style.plain


def short_name(name: str, longest: int = _LONGEST_NAME) -> str:
    """Leave out a long name's beginning."""
    return name if len(name) <= longest else "…" + name[1 - longest :]
