"""The limits that a calibration is judged by, in the one place that every judge reads."""

from __future__ import annotations

LARGEST_RMS_PX = 3.0
"""Above this the model does not describe the corners: real corners are found within a few tenths of a pixel."""

ASPECT_RANGE = (0.8, 1.25)
"""Where fx / fy of ordinary pixels lies."""

LARGEST_RELATIVE_FOCAL_SIGMA = 0.25
"""A focal length known no better than this is not known: the views are degenerate."""

DOUBTFUL_RELATIVE_FOCAL_SIGMA = 0.01
"""A focal length known no better than this is worth a warning; ordinary captures reach a tenth of it."""

LARGEST_CONDITION = 1e14
"""Of the scaled normal equations of the intrinsics: beyond it nothing of a float64 is left."""

OUTSTANDING_RATIO = 5.0
"""A view whose RMS is so many times the median view's does not belong; blurred ones stay well below."""

OUTSTANDING_RMS_PX = 1.0
"""... and it has to be above this, so that views which merely fit very well name nobody."""
