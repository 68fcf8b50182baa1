"""What a camera file must look like: camcal's own, and ROS's camera_info that it grew from."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import ConfigDict

from camcal.formats.validation import AnyNumber, Count, Name, Number, Schema, Text, Whole, list_of, schema_only
from camcal.formats.versions import CAMERA_FORMAT_VERSION
from camcal.geometry.camera import PINHOLE_NAMES

LENSES = {"plumb_bob": (0, 4, 5), "rational_polynomial": (8,)}
"""Number of coefficients that each lens model may have, in OpenCV's order."""
LARGEST_SIDE_PX = 1_000_000

COEFFICIENT_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""Names of the distortion coefficients, in OpenCV's order."""

_Side = Annotated[Whole, schema_only(minimum=1, maximum=LARGEST_SIDE_PX)]
_Sigma = Annotated[AnyNumber, schema_only(minimum=0)]


def _shape(rows: int, cols: int, *first: dict[str, Any]) -> Any:
    """Say in the JSON Schema what shape a matrix has, and what its first values are held to."""
    count = rows * cols
    data: dict[str, Any] = {"minItems": count, "maxItems": count} | ({"prefixItems": list(first)} if first else {})
    return schema_only(properties={"rows": {"const": rows}, "cols": {"const": cols}, "data": data})


def _coefficients(lens: str) -> dict[str, Any]:
    """Say in the JSON Schema how many coefficients a lens model has."""
    counts = [{"minItems": count, "maxItems": count} for count in LENSES[lens]]
    return {
        "if": {"properties": {"distortion_model": {"const": lens}}, "required": ["distortion_model"]},
        "then": {"properties": {"distortion_coefficients": {"properties": {"data": {"anyOf": counts}}}}},
    }


_POSITIVE, _ZERO, _ONE, _ANY = {"exclusiveMinimum": 0}, {"const": 0}, {"const": 1}, dict[str, Any]()


class Matrix(Schema):
    """A matrix as OpenCV and ROS write it."""

    rows: Whole
    """Number of rows."""
    cols: Whole
    """Number of columns."""
    dt: str = "d"
    """Kind of the numbers, for OpenCV: d, double precision."""
    data: list[Number]
    """The numbers, row by row."""


class ShapeEntry(Schema):
    """How the real board differs from a flat and true print."""

    names: list[Literal["bow_x", "bow_y", "stretch"]]
    """What was solved for: the bow in the middle of the board along x and along y, and the stretch of y against x."""
    values: list[Number]
    """One for each name: bows in metres, positive into the board; the stretch without a unit."""
    standard_deviations: list[Number]
    """One for each name, in the same unit."""
    correlations: list[list[AnyNumber]]
    """A row and a column for each name."""


class ImageSigmaEntry(Schema):
    """Standard deviation of the projection over the image."""

    centre_px: AnyNumber
    """In the middle of the image, pixels along the worst direction."""
    edges_px: Annotated[list[AnyNumber], list_of(4)]
    """At the middle of the top, right, bottom and left edge, pixels."""
    corners_px: Annotated[list[AnyNumber], list_of(4)]
    """At the top-left, top-right, bottom-right and bottom-left corner, pixels."""
    shares: Annotated[list[Number], list_of(3)]
    """Shares of the image, 0 to 1, where it is below 0.1, 0.5 and 1 px."""


class UncertaintyEntry(Schema):
    """How well it is known where a point is seen."""

    range_m: Number
    """Median distance of the boards, metres."""
    at_range: ImageSigmaEntry
    """For points as far away as the boards."""
    at_infinity: ImageSigmaEntry
    """For points infinitely far away."""


class FindingEntry(Schema):
    """One thing found about the calibration."""

    code: Name
    """Short name, for programs."""
    level: Literal["rejected", "poor", "usable", "note"]
    """The best verdict that is left with it; a note leaves any."""
    weight: Number
    """Order among findings of one level, larger first."""
    text: Text
    """What was found."""
    advice: Text
    """What to do about it."""


class Knowledge(Schema):
    """What only camcal writes: how well the camera is known."""

    format_version: Annotated[Whole, schema_only(const=CAMERA_FORMAT_VERSION)]
    """Version of this format."""
    version: Text
    """The camcal that wrote the file."""
    board: Text
    """SPEC of the board, such as checkerboard:9x6:25mm; empty if none is known."""
    free: Annotated[list[Name], schema_only(items={"enum": [*PINHOLE_NAMES, *COEFFICIENT_NAMES]})]
    """Intrinsics that were solved for, in the order fx, fy, cx, cy, skew, k1, k2, p1, p2, k3 ... k6; none for a truth."""
    standard_deviations: dict[str, _Sigma]
    """Of each free intrinsic: pixels for fx, fy, cx, cy and skew, no unit for the coefficients."""
    correlations: list[list[AnyNumber]]
    """A row and a column for each free intrinsic."""
    rms_px: AnyNumber
    """Root mean square of the 2-D residual length per corner, pixels; .nan for a truth."""
    views: Count
    """Number of views that were solved with."""
    corners: Count
    """Number of corners that were solved with."""
    valid_radius_px: AnyNumber
    """Distance from the principal point up to which the lens model is one to one, pixels."""
    board_shape: ShapeEntry | None = None
    """What was found about the board's own shape."""
    uncertainty: UncertaintyEntry | None = None
    """How well it is known where a point is seen; none for a truth."""
    cross_validation: AnyNumber = float("nan")
    """Difference of halves of the views over its prediction, about 1 if the uncertainty is honest."""
    verdict: Literal["rejected", "poor", "usable", "good"] | None = None
    """How far the calibration can be trusted."""
    findings: tuple[FindingEntry, ...] = ()
    """Why, the weightiest first."""


class CameraInfo(Schema):
    """A camera_info file of ROS; what else other programs keep in it is theirs."""

    model_config = ConfigDict(extra="ignore", json_schema_extra={"allOf": [_coefficients(lens) for lens in LENSES]})

    image_width: _Side
    """Width of the images, pixels."""
    image_height: _Side
    """Height of the images, pixels."""
    camera_name: Text = "camera"
    """What the camera is called."""
    distortion_model: Annotated[str, schema_only(enum=list(LENSES))]
    """The lens: plumb_bob (up to k3), or rational_polynomial (up to k6)."""
    camera_matrix: Annotated[Matrix, _shape(3, 3, _POSITIVE, _ANY, _ANY, _ZERO, _POSITIVE, _ANY, _ZERO, _ZERO, _ONE)]
    """K = [fx, skew, cx, 0, fy, cy, 0, 0, 1] in pixels; the centre of the top-left pixel is (0, 0)."""
    distortion_coefficients: Matrix
    """k1, k2, p1, p2, k3, k4, k5, k6 on normalised coordinates, OpenCV's order, as many as the lens has."""
    rectification_matrix: Annotated[Matrix, _shape(3, 3)] | None = None
    """Rotation of a stereo camera's image plane; 1 for a single camera."""
    projection_matrix: Annotated[Matrix, _shape(3, 4)] | None = None
    """[K of the undistorted images | 0], pixels."""


class CameraFile(CameraInfo):
    """A camera as camcal writes it, in one file that ROS and OpenCV read too: nothing in it is unknown."""

    model_config = ConfigDict(extra="forbid")

    rectification_matrix: Annotated[Matrix, _shape(3, 3)]
    """Rotation of a stereo camera's image plane; 1 for a single camera."""
    projection_matrix: Annotated[Matrix, _shape(3, 4)]
    """[K of the undistorted images | 0], pixels."""
    camcal: Knowledge
    """What only camcal writes: how well the camera is known."""
