"""`camcal import`: another tool's camera as a camera file of camcal's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from camcal.errors import InputError, QualityError
from camcal.formats.camera_file import CAMERA_FILE_NAME, save_intrinsics, split_choice
from camcal.formats.exchange.loaded import load_file, load_standard_input
from camcal.formats.exchange.reading import chosen, read_cameras, with_size
from camcal.formats.exchange.refit import from_foreign
from camcal.formats.output import claim_file
from camcal.formats.text import file_in
from camcal.records import Intrinsics
from camcal.workflows.export import MAX_REFIT_PX
from camcal.workflows.given import pass_on_cautions
from camcal.workflows.reporting import LogReporter, Reporter

_STANDARD_INPUT = "-"


def import_camera(
    path: str | Path,
    output: str | Path | None = None,
    *,
    file_format: str | None = None,
    camera: str | None = None,
    size: tuple[int, int] | None = None,
    name: str | None = None,
    refit: bool = True,
    max_refit_px: float = MAX_REFIT_PX,
    force: bool = False,
    reporter: Reporter | None = None,
) -> Intrinsics:
    """Read a camera of another tool, in camcal's conventions, and write it as a camera file.

    Parameters
    ----------
    path : path
        A file of ROS, OpenCV, Kalibr, COLMAP, mrcal, nerfstudio, MATLAB, lensfun, or camcal's JSON; `-` for standard input.
    output : path, optional
        Camera file to write; without it nothing is written.
    file_format : str, optional
        Name of the format; without it, it is recognised by the content.
    camera : str, optional
        Which camera, where the file has several.
    size : tuple of int, optional
        Image (width, height) in pixels, for files that do not say.
    name : str, optional
        What to call the camera.
    refit : bool
        Whether a lens that camcal does not have may be refitted to the one it has.
    max_refit_px : float
        The largest difference that a refit may leave anywhere in the image.
    force : bool
        Whether an existing file is replaced.
    reporter : Reporter, optional
        Where the difference that a refit leaves is told, and what the file says that a camera file does not hold.

    Returns
    -------
    Intrinsics

    Raises
    ------
    InputError
        If the file or an option cannot be used.
    QualityError
        If a refit would leave a larger difference than allowed. Nothing is written then.

    Examples
    --------
    >>> import tempfile, camcal
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with open(f"{folder}/cameras.txt", "w") as file:
    ...         _ = file.write("1 OPENCV 640 480 520 523 322.5 236.5 -0.18 0.06 0 0")
    ...     known = camcal.import_camera(f"{folder}/cameras.txt", f"{folder}/camera.yaml", name="left")
    >>> known.name, known.camera
    ('left', Camera(640x480, fx=520, fy=523, cx=322, cy=236, k1=-0.18, k2=0.06))
    """
    reporter = reporter or LogReporter()
    if not max_refit_px > 0:
        raise InputError(f"--max-refit-px: out of range (got {max_refit_px:g}, expected more than 0).")
    file, choice = (Path(path), camera) if camera is not None else split_choice(path)
    loaded = load_standard_input() if str(path) == _STANDARD_INPUT else load_file(file_in(file, CAMERA_FILE_NAME))
    cameras = read_cameras(loaded, file_format)
    found = with_size(loaded.name, chosen(loaded.name, cameras, choice, how="Choose one with --camera NAME."), size)
    known = found.intrinsics()
    if name is not None:
        known = replace(known, name=name)
    pass_on_cautions(known, reporter)
    if output is not None:
        claim_file(output, force=force)
    if found.foreign is not None:
        fit = from_foreign(known.camera, found.foreign)
        text = f"{found.foreign.name} is not camcal's lens: refitted, it differs by {fit.told}"
        if not refit:
            raise QualityError(f"{loaded.name}: {text}. Leave out --no-refit.")
        if fit.max_px > max_refit_px:
            raise QualityError(
                f"{loaded.name}: {text}, more than --max-refit-px {max_refit_px:g}. Raise it to take it all the same."
            )
        reporter.warn(f"{text}.")
        known = Intrinsics(fit.camera, known.name)
    if output is not None:
        save_intrinsics(output, known)
    return known
