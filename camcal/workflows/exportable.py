"""What can be exported: whether a name is that of a camera, of a board or of corners."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

from camcal import resources
from camcal.errors import InputError
from camcal.formats.corner_exchange.table import is_corners_path
from camcal.formats.yaml_io import load_yaml

Exportable: TypeAlias = Literal["cameras", "boards", "corners"]

_BOARD_SUFFIXES = (".yaml", ".yml")


def what_is(given: str) -> Exportable:
    """Tell what a file, a folder, the name of a sample board or a one-liner is.

    Corners are told by the name of the file; a board by the type that its file states, or because there is no such file.
    Everything else is taken for a camera.

    Examples
    --------
    >>> what_is("aprilgrid:6x6:88mm:0.3"), what_is("seen/corners.vnl"), what_is("calib")
    ('boards', 'corners', 'cameras')
    """
    if is_corners_path(given):
        return "corners"
    return "boards" if _is_board(given) else "cameras"


def _is_board(given: str) -> bool:
    """Whether something is a board: a file that says its type, a sample board, or a one-liner."""
    path = Path(given)
    try:
        is_file, exists = path.is_file(), path.exists()
    except OSError:
        return False
    if is_file:
        return path.suffix.lower() in _BOARD_SUFFIXES and _says_its_type(path)
    return not exists and (given in resources.sample_board_names() or ":" in given)


def _says_its_type(path: Path) -> bool:
    """Whether a YAML file has a board's keys."""
    try:
        return not {"type", "target_type"}.isdisjoint(load_yaml(path).data)
    except InputError:
        return False
