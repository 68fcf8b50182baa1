"""Corners of other tools, both ways: one module for each format, joined in `table`."""
