"""ROS's camera_info, in its YAML; and camcal's own camera file, which is one with more in it."""

from __future__ import annotations

from camcal.formats.camera_schema import intrinsics_of
from camcal.formats.exchange.loaded import Loaded
from camcal.formats.exchange.profile import COEFFICIENTS, Exchanged, Outgoing, Pinhole, Profile
from camcal.formats.exchange.window import cautions_of
from camcal.formats.yaml_dump import dump_yaml

PROFILE = Profile("ros", "ROS's camera_info", (COEFFICIENTS[:5], COEFFICIENTS), (".yaml", ".yml"))


def matches(loaded: Loaded) -> bool:
    """Tell whether a file is camcal's own, or has ROS's keys."""
    data = loaded.data
    if loaded.syntax != "yaml":
        return False
    # Messages, and the bare lists that some write by hand, are read with OpenCV's names.
    bare = {"K", "k"} & data.keys() or isinstance(data.get("distortion_coefficients"), list)
    return "camcal" in data or ("distortion_model" in data and not bare)


def read(loaded: Loaded) -> list[Exchanged]:
    """Read the camera."""
    known = intrinsics_of(loaded.document)
    fx, fy, cx, cy, skew = known.camera.intrinsics[:5].tolist()
    dist = tuple(known.camera.dist.tolist())
    size = known.camera.size
    cautions = cautions_of(loaded.document, size)
    return [Exchanged(known.name, Pinhole(fx, fy, cx, cy, skew), dist, size, known=known, cautions=cautions)]


def write(outgoing: Outgoing) -> str:
    """Write a camera_info."""
    # A camera file's first keys are just that.
    from camcal.formats.camera_file import camera_info

    return dump_yaml(camera_info(outgoing.known), "\n".join(outgoing.heading))
