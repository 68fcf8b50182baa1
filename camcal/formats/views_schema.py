"""What a views file must look like, and the way from it to view records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from camcal.formats.camera_schema import check_format_version
from camcal.formats.validation import AnyNumber, Count, Name, Number, Schema, Text, Whole, list_of, validate
from camcal.formats.versions import VIEWS_FORMAT_VERSION
from camcal.formats.yaml_io import Document, KeyPath, load_yaml
from camcal.geometry.pose import Pose
from camcal.observations import ViewRecord

Triple = Annotated[list[Number], list_of(3)]


class ViewEntry(Schema):
    """One view."""

    file: Name
    status: Literal["used", "rejected"]
    reason: Text = ""
    R: Annotated[list[Triple], list_of(3)] | None = None
    t: Triple | None = None
    rvec: Triple | None = None
    rms_px: AnyNumber
    corners: Count
    notes: tuple[Text, ...] = ()


class ViewsFile(Schema):
    """The file."""

    format_version: Whole
    views: list[ViewEntry]


def read_views(path: str | Path) -> tuple[ViewRecord, ...]:
    """Read a views file.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    document = load_yaml(path)
    check_format_version(document, (), VIEWS_FORMAT_VERSION)
    entries = validate(document, ViewsFile).views
    first: dict[str, int] = {}
    for index, entry in enumerate(entries):
        if entry.file in first:
            line = document.line(("views", first[entry.file]))
            raise document.error(("views", index, "file"), f"a second view of '{entry.file}' (the first is on line {line})")
        first[entry.file] = index
    return tuple(_record(document, ("views", index), entry) for index, entry in enumerate(entries))


def _record(document: Document, path: KeyPath, entry: ViewEntry) -> ViewRecord:
    """Turn one entry into a record."""
    if (entry.status == "rejected") != bool(entry.reason):
        expected = "its reason for a rejected view, none for a used one"
        raise document.error((*path, "status"), f"contradicts reason (got '{entry.status}', expected {expected})")
    if (entry.R is None) != (entry.t is None):
        raise document.error(path, "half a pose (expected both R and t, or neither)")
    pose = None
    if entry.R is not None and entry.t is not None:
        try:
            pose = Pose(entry.R, entry.t)  # type: ignore[arg-type]
        except ValueError as error:
            raise document.error((*path, "R"), str(error).partition(": ")[2]) from None
    return ViewRecord(entry.file, entry.reason, pose, entry.rms_px, entry.corners, entry.notes)
