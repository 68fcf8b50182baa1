"""Corners to the statistical bound: a blurred saddle, then the template whose edges a calibration predicts."""
