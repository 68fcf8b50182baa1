"""Calibration -> one page with figures: what was found, how well, and what to do about it."""
