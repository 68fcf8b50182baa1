"""Versions of our own file formats; a reader refuses what it does not know."""

CAMERA_FORMAT_VERSION = 1
VIEWS_FORMAT_VERSION = 1
