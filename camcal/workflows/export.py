"""`camcal export`: a camera as another tool's file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from camcal.errors import InputError, QualityError
from camcal.formats.exchange.profile import LensfunNames
from camcal.formats.exchange.table import FORMATS, format_named
from camcal.formats.exchange.writing import suffix_of, written
from camcal.formats.output import claim_file, write_atomically
from camcal.geometry.camera import Camera
from camcal.workflows.given import GivenCamera, camera_name, known_camera
from camcal.workflows.reporting import LogReporter, Reporter

MAX_REFIT_PX = 3.0
"""Unless it is said otherwise, a camera that a format can only hold with a larger difference than this is not written."""

_OF_OTHERS = {"camcal": "boards", "csv": "corners", "vnl": "corners"}
_OWN = " A camera file of camcal's own is what camcal import -o camera.yaml writes."


@dataclass(frozen=True, slots=True, eq=False)
class Exported:
    """A camera in another tool's format.

    Attributes
    ----------
    content : str or bytes
        What is in the file.
    camera : Camera
        The camera that is in it: the one that was given, or the nearest that the format holds.
    lost : tuple of str
        What the format could not hold; empty if the camera is the same.
    max_px, rms_px : float
        Largest, and root mean square, distance between the two cameras over the image, pixels.
    """

    content: str | bytes
    camera: Camera
    lost: tuple[str, ...]
    max_px: float
    rms_px: float


def export_camera(
    camera: GivenCamera,
    to: str,
    output: str | Path | None = None,
    *,
    refit: bool = True,
    max_refit_px: float = MAX_REFIT_PX,
    lens_name: str = "",
    crop_factor: float | None = None,
    focal_mm: float | None = None,
    force: bool = False,
    reporter: Reporter | None = None,
) -> Exported:
    """Write a camera in another tool's format, in that tool's pixel convention.

    What the format cannot hold (k3 in Kalibr's radtan, a skew nearly everywhere) is never cut off: the camera is refitted to
    what the format has, over the whole image, and the difference is told in pixels.

    Parameters
    ----------
    camera : path, Camera or Intrinsics
        A camera file of any known format, or a folder that `calibrate` wrote; or the camera itself.
    to : str
        ros, opencv, kalibr, colmap, mrcal, nerfstudio, matlab, lensfun or json.
    output : path, optional
        Where to write; without it nothing is written.
    refit : bool
        Whether the camera may be refitted where the format cannot hold it.
    max_refit_px : float
        The largest difference that a refit may leave anywhere in the image.
    lens_name, crop_factor, focal_mm : optional
        What lensfun wants to know: the lens's name, its camera's crop factor and the focal length that is written on it.
    force : bool
        Whether an existing file is replaced.
    reporter : Reporter, optional
        Where the difference that a refit leaves is told.

    Returns
    -------
    Exported

    Raises
    ------
    InputError
        If a file or an option cannot be used.
    QualityError
        If the format holds the camera only with a larger difference than allowed. Nothing is written then.

    Examples
    --------
    >>> import tempfile, camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_intrinsics(f"{folder}/camera.yaml", camcal.Intrinsics(camera))
    ...     made = camcal.export_camera(folder, "colmap", f"{folder}/cameras.txt")
    ...     again = camcal.load_camera(f"{folder}/cameras.txt")
    >>> print(made.content.splitlines()[-1])
    1 OPENCV 640 480 520.0 523.0 322.5 236.5 -0.18 0.06 0.0 0.0
    >>> again
    Camera(640x480, fx=520, fy=523, cx=322, cy=236, k1=-0.18, k2=0.06)
    """
    reporter = reporter or LogReporter()
    other = _OF_OTHERS.get(to.strip().lower())
    if other is not None:
        advice = _OWN if other == "boards" else ""
        raise InputError(f"--to: {to} is a format of {other} (got a camera, expected {', '.join(sorted(FORMATS))}).{advice}")
    kind = format_named(to, "--to")
    for option, value in (("--crop-factor", crop_factor), ("--focal-mm", focal_mm), ("--max-refit-px", max_refit_px)):
        if value is not None and not value > 0:
            raise InputError(f"{option}: out of range (got {value:g}, expected more than 0).")
    if kind is not FORMATS["lensfun"]:
        for option, given in (("--lens-name", lens_name), ("--crop-factor", crop_factor), ("--focal-mm", focal_mm)):
            if given:
                raise InputError(f"{option}: only for lensfun (got --to {to}). Leave it away.")
    path = None if output is None else Path(output)
    suffix = suffix_of(path, kind)
    known, source = known_camera(camera, reporter), camera_name(camera)
    if known.problems:
        reporter.warn(f"{source}: marked as not to be trusted: {known.problems[0]}")
    if path is not None:
        claim_file(path, force=force)
    made = written(known, kind, suffix, LensfunNames(lens_name, crop_factor, focal_mm))
    fit = made.refit
    if fit.lost:
        text = f"{kind.profile.title} cannot hold {', '.join(fit.lost)}: refitted, it differs by {fit.told}"
        if not refit:
            raise QualityError(f"{source}: {text}. Leave out --no-refit, or choose another format.")
        if fit.max_px > max_refit_px:
            raise QualityError(
                f"{source}: {text}, more than --max-refit-px {max_refit_px:g}. Raise it, or choose another format."
            )
        reporter.warn(f"{text}.")
    if path is not None:
        write_atomically(path, made.content)
    return Exported(made.content, fit.camera, fit.lost, fit.max_px, fit.rms_px)
