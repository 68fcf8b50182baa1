"""`camcal undistort`: images without the lens, and the camera that belongs to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from camcal.errors import InputError
from camcal.formats.camera_file import load_intrinsics, save_intrinsics
from camcal.formats.images import ImageFile, read_image, write_image
from camcal.formats.output import claim_folder
from camcal.geometry.camera import Camera
from camcal.observations import Image, Intrinsics, Rejected
from camcal.undistortion.maps import undistort_image, undistort_map
from camcal.undistortion.target import target_camera
from camcal.workflows.inputs import Inputs, images_to_work_on, warn_of_each
from camcal.workflows.parallel import each
from camcal.workflows.reporting import LogReporter, Reporter


@dataclass(frozen=True, slots=True)
class Undistortion:
    """What `undistort` wrote.

    Attributes
    ----------
    folder : Path
        Holds the images under their names, and `camera.yaml`: the camera of the undistorted images.
    target : Camera
        That camera.
    images : tuple of str
        Names of the images written.
    rejected : tuple of Rejected
        Images of a folder that were passed over, with the reason.
    """

    folder: Path
    target: Camera
    images: tuple[str, ...]
    rejected: tuple[Rejected, ...] = ()


def undistort(
    inputs: Inputs,
    camera: str | Path,
    output: str | Path,
    *,
    alpha: float = 0.0,
    force: bool = False,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> Undistortion:
    """Take the lens out of images.

    Parameters
    ----------
    inputs : path or sequence of path
        Image files, folders or globs. A named file must be an image of the camera's size; others found in a folder are
        passed over by name.
    camera : path
        A camera file, or a folder that `calibrate` wrote.
    output : path
        Folder for the undistorted images (same names) and their camera.yaml.
    alpha : float
        0 keeps only pixels that see the source, 1 keeps every pixel of the source.
    force : bool
        Whether a folder that exists is written into.
    jobs : int, optional
        Images worked on at once; all processors by default.
    reporter : Reporter, optional

    Returns
    -------
    Undistortion

    Raises
    ------
    InputError
        If a file cannot be used, an image is not of the camera's size, or an output would replace an input.
    """
    reporter = reporter or LogReporter()
    found = images_to_work_on(inputs, reporter)
    return undistort_found(found, camera, output, alpha=alpha, force=force, jobs=jobs, reporter=reporter)


def undistort_found(
    found: Sequence[ImageFile],
    camera: str | Path,
    output: str | Path,
    *,
    reporter: Reporter,
    alpha: float = 0.0,
    force: bool = False,
    jobs: int | None = None,
) -> Undistortion:
    """Do what `undistort` does for images that have been found already."""
    intrinsics = load_intrinsics(camera)
    if intrinsics.problems:
        reporter.warn(f"{camera}: marked as not to be trusted: {intrinsics.problems[0]}")
    folder = Path(output)
    _check_nothing_is_replaced(found, folder)
    target = target_camera(intrinsics.camera, alpha)
    claim_folder(folder, force=force)
    maps = undistort_map(intrinsics.camera, target)

    def work(image: ImageFile) -> Rejected | None:
        try:
            pixels = _read_of_size(image, intrinsics.camera.size)
        except InputError as error:
            if image.named:
                raise
            return Rejected(image.name, str(error).removeprefix(f"{image.path}: "))
        path = folder / image.name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_image(path, undistort_image(pixels, maps))
        return None

    with reporter.progress("Undistorting", len(found)) as advance:
        outcomes = each(work, found, jobs, advance)
    rejected = tuple(outcome for outcome in outcomes if outcome is not None)
    warn_of_each(((rejection.source, f"passed over: {rejection.reason}") for rejection in rejected), reporter)
    if len(rejected) == len(found):
        raise InputError(f"undistort: no usable image (first: {rejected[0].source}: {rejected[0].reason})")
    save_intrinsics(folder / "camera.yaml", Intrinsics(target, name=intrinsics.name, verdict=intrinsics.verdict))
    done = tuple(image.name for image, outcome in zip(found, outcomes, strict=True) if outcome is None)
    return Undistortion(folder, target, done, rejected)


def _check_nothing_is_replaced(found: Sequence[ImageFile], folder: Path) -> None:
    """Refuse an output folder in which an image would replace its source, or the new camera a calibration."""
    if any(image.path.resolve() == (folder / image.name).resolve() for image in found):
        raise InputError(f"{folder}: output would replace its own input. Choose another folder with -o.")
    if any((folder / name).exists() for name in ("views.yaml", "corners.csv")):
        raise InputError(f"{folder}: holds a calibration, whose camera.yaml would be replaced. Choose another folder with -o.")


def _read_of_size(image: ImageFile, size: tuple[int, int]) -> Image:
    """Read an image that must have the camera's size."""
    pixels = read_image(image.path)
    height, width = pixels.shape[:2]
    if (width, height) != size:
        raise InputError(
            f"{image.path}: not the camera's image size (got {width}x{height}, expected {size[0]}x{size[1]}). "
            "Use the camera file that was calibrated at this size."
        )
    return pixels
