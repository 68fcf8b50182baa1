"""What a views file must look like, and the way from it to view records."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import ConfigDict

from camcal.formats.camera_schema import check_format_version
from camcal.formats.validation import AnyNumber, Count, Name, Number, Schema, Text, Whole, list_of, schema_only, validate
from camcal.formats.versions import VIEWS_FORMAT_VERSION
from camcal.formats.yaml_io import Document, KeyPath, load_yaml
from camcal.geometry.pose import Pose
from camcal.records import ViewRecord

Triple = Annotated[list[Number], list_of(3)]


# A rejected view has a reason, a used one has none; a pose is both R and t, or neither.
_RULES: dict[str, Any] = {
    "if": {"properties": {"status": {"const": "rejected"}}},
    "then": {"required": ["reason"], "properties": {"reason": {"minLength": 1}}},
    "else": {"properties": {"reason": {"maxLength": 0}}},
    "dependentRequired": {"R": ["t"], "t": ["R"]},
}


class ViewEntry(Schema):
    """One view, used or rejected."""

    model_config = ConfigDict(json_schema_extra=_RULES)

    file: Name
    """Name of the image."""
    path: Text = ""
    """Where the image is, relative to the folder of this file; empty if that is not known."""
    status: Literal["used", "rejected"]
    """Whether the view went into the solve."""
    reason: Text = ""
    """Why it was rejected; not for a used view."""
    R: Annotated[list[Triple], list_of(3)] | None = None
    """Rotation from the board to the camera, row by row."""
    t: Triple | None = None
    """Translation from the board to the camera, metres: X_camera = R X_board + t."""
    rvec: Triple | None = None
    """The rotation once more, for people: its axis times its angle in radians."""
    rms_px: AnyNumber
    """Root mean square of the 2-D residual length per corner, pixels; .nan where it is not known."""
    corners: Count
    """How many corners were seen."""
    notes: tuple[Text, ...] = ()
    """What a person should know about the view."""


class ViewsFile(Schema):
    """Every view of a run: where its board stood, or why it was rejected."""

    format_version: Annotated[Whole, schema_only(const=VIEWS_FORMAT_VERSION)]
    """Version of this format."""
    options: tuple[Text, ...] = ()
    """Options of the command line that the run was made with, where they are not the defaults."""
    views: list[ViewEntry]
    """Each image has one."""


def read_views(path: str | Path) -> tuple[tuple[ViewRecord, ...], tuple[str, ...]]:
    """Read a views file: its views, and the options that it was written with.

    Raises
    ------
    InputError
        If it cannot be used.
    """
    document = load_yaml(path)
    check_format_version(document, (), VIEWS_FORMAT_VERSION)
    file = validate(document, ViewsFile)
    entries = file.views
    first: dict[str, int] = {}
    for index, entry in enumerate(entries):
        if entry.file in first:
            line = document.line(("views", first[entry.file]))
            raise document.error(("views", index, "file"), f"a second view of '{entry.file}' (the first is on line {line})")
        first[entry.file] = index
    records = tuple(_record(document, ("views", index), entry) for index, entry in enumerate(entries))
    return records, file.options


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
    return ViewRecord(entry.file, entry.reason, pose, entry.rms_px, entry.corners, entry.notes, entry.path)
