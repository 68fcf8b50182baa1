"""Versions of our own file formats; a reader refuses what it does not know."""

CAMERA_FORMAT_VERSION = 2
VIEWS_FORMAT_VERSION = 1
