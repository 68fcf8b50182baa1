"""What ROS's camera_info says of the images apart from the camera: how they are binned, and which window of it they are."""

from __future__ import annotations

from camcal.formats.yaml_io import Document

_NOT_APPLIED = "which is not applied: it is read as the camera of full images"


def cautions_of(document: Document, size: tuple[int, int] | None) -> tuple[str, ...]:
    """Say what has to be done to a camera before it fits images of less than the full resolution, as its file tells.

    K is that of the full image always: the driver bins and cuts out afterwards.

    Parameters
    ----------
    document : Document
        A camera_info.
    size : tuple of int or None
        (width, height) of the full image in pixels, if it is known.

    Returns
    -------
    tuple of str
        `file:line: key: sentence`; none for images of full resolution.
    """
    data = document.data
    found = []
    along_x, along_y = (_whole(data.get(key)) or 1 for key in ("binning_x", "binning_y"))
    if max(along_x, along_y) > 1:
        key = "binning_x" if along_x > 1 else "binning_y"
        text = f"images of this camera are binned {along_x}x{along_y}, {_NOT_APPLIED}."
        found.append(((key,), f"{text} Scale it to the binned ones, as undistort --rescale does."))
    roi = data.get("roi")
    if isinstance(roi, dict):
        left, top, width, height = (_whole(roi.get(key)) for key in ("x_offset", "y_offset", "width", "height"))
        if min(width, height) > 0 and ((left, top) != (0, 0) or (width, height) != size):
            text = f"images of this camera are its window of {width}x{height} pixels at ({left}, {top}), {_NOT_APPLIED}."
            found.append((("roi",), f"{text} Take the offset off cx and cy, put in the window's size, and remove roi."))
    return tuple(str(document.error(path, text)) for path, text in found)


def _whole(value: object) -> int:
    """A whole number that is not negative; 0 for anything else, which these keys are free to be."""
    return value if isinstance(value, int) and not isinstance(value, bool) and value > 0 else 0
