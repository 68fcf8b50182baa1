"""views.yaml: every view of a run, where its board stood, or why it was rejected."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from camcal.formats.output import write_atomically
from camcal.formats.text import file_in
from camcal.formats.versions import VIEWS_FORMAT_VERSION
from camcal.formats.yaml_dump import dump_yaml
from camcal.records import ViewRecord

VIEWS_FILE_NAME = "views.yaml"

_HEADING = """\
X_camera = R X_board + t: t in metres; camera x right, y down, z forward; board x right, y down as printed, z into the board.
R and t are read back; rvec (axis times angle in radians) repeats R for people. path: the image, seen from this folder."""


def save_views(path: str | Path, records: Sequence[ViewRecord], options: Sequence[str] = ()) -> None:
    """Write a views file.

    Parameters
    ----------
    path : str or Path
    records : sequence of ViewRecord
    options : sequence of str
        Options of `camcal calibrate` that led to them, where they are not the defaults; nothing is written of none.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    told = {"options": list(options)} if options else {}
    content = {"format_version": VIEWS_FORMAT_VERSION, **told, "views": [_entry(record) for record in records]}
    write_atomically(path, dump_yaml(content, _HEADING))


def load_views(path: str | Path) -> tuple[ViewRecord, ...]:
    """Read a views file.

    Parameters
    ----------
    path : str or Path
        A file, or a folder that holds `views.yaml`.

    Returns
    -------
    tuple of ViewRecord
        In the order of the file.

    Raises
    ------
    InputError
        If it cannot be used; says `file:line: key: problem`.
    """
    return load_views_and_options(path)[0]


def load_views_and_options(path: str | Path) -> tuple[tuple[ViewRecord, ...], tuple[str, ...]]:
    """Read a views file as `load_views` does, and the options of `camcal calibrate` that it was written with."""
    # pydantic takes its time to import; a command that only writes does without it.
    from camcal.formats.views_schema import read_views

    return read_views(file_in(path, VIEWS_FILE_NAME))


def _entry(record: ViewRecord) -> dict[str, Any]:
    """Lay one view out; what it does not have is left out."""
    entry: dict[str, Any] = {"file": record.source}
    if record.path:
        entry["path"] = record.path
    entry["status"] = "used" if record.used else "rejected"
    if not record.used:
        entry["reason"] = record.reason
    pose = record.T_cam_board
    if pose is not None:
        entry |= {"R": pose.R.tolist(), "t": pose.t.tolist(), "rvec": pose.rvec.tolist()}
    return entry | {"rms_px": float(record.rms_px), "corners": int(record.corners), "notes": list(record.notes)}
