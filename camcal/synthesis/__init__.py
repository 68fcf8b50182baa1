"""Scenario to rendered views with exact truth: poses, pattern coverage, sensor."""
