"""`camcal undistort`: images, videos and points without the lens, and the camera that belongs to them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from camcal.errors import InputError
from camcal.formats.images import ImageFile
from camcal.formats.imaging.header import MOST_PIXELS
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.workflows.given import GivenCamera, camera_name, camera_path, known_camera
from camcal.workflows.inputs import Inputs, as_paths
from camcal.workflows.reporting import LogReporter, Reporter
from camcal.workflows.undistort.companions import Companions, camera_of_results
from camcal.workflows.undistort.geometry import Cameras, Geometry, share_blind, share_past_fold
from camcal.workflows.undistort.image import ImageOptions
from camcal.workflows.undistort.inputs import Source, Sources, find_sources
from camcal.workflows.undistort.options import FileChoice, refuse_for_points
from camcal.workflows.undistort.passed_over import warn_of_others
from camcal.workflows.undistort.plan import Place, choose_place, first_size, refuse_lost_cameras
from camcal.workflows.undistort.run import Run, Undistortion
from camcal.workflows.undistort.work import Setting

__all__ = ["Undistortion", "undistort", "undistort_found"]

_MOST_BLIND = 0.5


def undistort(
    inputs: Inputs,
    camera: GivenCamera,
    output: str | Path,
    *,
    alpha: float = 0.0,
    fov_deg: float | None = None,
    size: tuple[int, int] | None = None,
    scale: float = 1.0,
    crop: str = "none",
    target: GivenCamera | None = None,
    distort: bool = False,
    rescale: bool = False,
    interpolation: str = "linear",
    exact: bool = False,
    gamma: str | float | None = None,
    fill: float | Sequence[float] | None = None,
    file_format: str | None = None,
    quality: int | None = None,
    most_pixels: int = MOST_PIXELS,
    mask: bool = False,
    maps: bool = False,
    codec: str | None = None,
    crf: float | None = None,
    pixel_format: str | None = None,
    frames: str | None = None,
    preset: str | None = None,
    lossless: bool | None = None,
    progressive: bool = False,
    recursive: bool = False,
    listed: Iterable[str | Path] = (),
    resume: bool = False,
    dry_run: bool = False,
    force: bool = False,
    scheduler: str | None = None,
    jobs: int | None = None,
    reporter: Reporter | None = None,
) -> Undistortion:
    """Take the lens out of images, videos or points.

    Every result is written whole or not at all. The camera of the results is written beside them when they are all there.

    Parameters
    ----------
    inputs : path or sequence of path
        Image and video files, folders or patterns; or one CSV file of points with the columns x and y, whose other columns
        are kept. What is named must be of use; others, found in a folder, are rejected one by one.
    camera : path, Camera or Intrinsics
        A camera file, a folder that `calibrate` wrote, or the camera itself.
    output : path
        Folder for the results, which keep their names and places below the given folders, or the name of a single result.
    alpha : float
        0: only pixels that see the source; 1: every pixel of the source; between them, a frame in between.
    fov_deg : float, optional
        Horizontal field of view of the results instead, degrees.
    size : tuple of int, optional
        (width, height) of the results in pixels; the camera's by default.
    scale : float
        Factor by which the results are larger than the camera's images.
    crop : str
        "none", or "valid": only the largest rectangle of pixels that see the source.
    target : path, Camera or Intrinsics, optional
        The camera of the results instead of all this.
    distort : bool
        Add the lens to images of the camera that the options above describe, instead of removing it.
    rescale : bool
        Scale the camera to the size of the first file, if it has the camera's aspect ratio.
    interpolation : str
        "linear"; "cubic", which keeps fine detail; "lanczos", which keeps the finest, for its price.
    exact : bool
        Compute every position by the cameras themselves instead of interpolating it to 2e-4 pixels.
    gamma : str or float, optional
        Average light, not pixel values: "srgb" or the exponent of a power law. Images only.
    fill : float or sequence of float, optional
        Value of pixels that see nothing, 0 by default; for all channels or red, green, blue and alpha, which is 0 if left
        out. Images only.
    file_format : str, optional
        Extension that the results get, of the kind of file that it belongs to.
    quality : int, optional
        1 to 100, for image formats that lose something; 95 or the source's own by default.
    most_pixels : int
        Larger images are refused before they are decoded.
    mask : bool
        Whether mask.png is written too: 255 where a pixel sees the source, else 0.
    maps : bool
        Whether maps.npz and maps.tiff are written too: float32 source coordinates as `cv2.remap` takes them.
    codec, pixel_format, preset : str, optional
        Of videos, by libav's names; as the source's by default.
    crf : float, optional
        Quality of videos on the codec's own scale.
    frames : str, optional
        Which frames of videos: "A:B", "A:" or ":B".
    lossless : bool, optional
        Of videos; as the source by default.
    progressive : bool
        Take frames of videos that are marked as interlaced as whole ones.
    recursive : bool
        Whether folders within the given folders are looked into, but for results of earlier runs; they are made again in
        the output.
    listed : iterable of path
        More inputs, of which one that cannot be used is rejected instead of refused.
    resume : bool
        Pass over what an earlier run finished: the same source, the same camera and the same options.
    dry_run : bool
        Whether to say what would be done, and write nothing. Files are looked into, but not decoded.
    force : bool
        Whether a folder that exists is written into.
    scheduler : str, optional
        Address of a Dask cluster that does the work, one file per task; every path must mean the same on its machines.
    jobs : int, optional
        Images worked on at once; all processors by default.
    reporter : Reporter, optional

    Returns
    -------
    Undistortion

    Raises
    ------
    InputError
        If a named file or an option cannot be used, nothing found is of use, or a result would replace an input.

    Examples
    --------
    >>> import tempfile, cv2, camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> pose = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = cv2.imwrite(f"{folder}/left.png", camcal.render(camera, "checkerboard:7x6:20mm", pose))
    ...     done = camcal.undistort(f"{folder}/left.png", camera, f"{folder}/straight", alpha=1)
    >>> done.images, done.target
    (('left.png',), Camera(640x480, fx=468.201, fy=470.902, cx=322.28, cy=235.782))
    """
    reporter = reporter or LogReporter()
    paths = as_paths(inputs)
    ideal = None if target is None else known_camera(target, reporter).camera
    geometry = Geometry(alpha, fov_deg, size, scale, crop, ideal, distort, rescale)
    choice = FileChoice(
        interpolation, gamma, fill, file_format, quality, codec, crf, pixel_format, frames, preset, lossless, progressive
    )
    known = _load_camera(camera, reporter)
    points = _points_file(paths)
    if points is not None:
        flags = {"--mask": mask, "--maps": maps, "--resume": resume, "--rescale": rescale, "--scheduler": scheduler}
        refuse_for_points(choice, flags)
        # Images do not need it.
        from camcal.workflows.undistort.points import undistort_points_file

        in_use = (camera_path(camera), camera_path(target))
        return undistort_points_file(points, output, known, geometry, in_use, dry_run=dry_run, force=force, reporter=reporter)
    image_options = choice.image_options(most_pixels)
    found = find_sources(paths, listed=listed, recursive=recursive, without=Path(output), extension=choice.extension)
    choice.check_kinds(found.files)
    warn_of_others(found, reporter)
    place = choose_place(output, found.files, choice.extension)
    refuse_lost_cameras(place, (camera_path(camera), camera_path(target)))
    cameras = _cameras(geometry, known.camera, found.files, most_pixels)
    _warn_of_fold(camera_name(camera), known.camera, geometry, reporter)
    _warn_of_blindness(place, cameras, geometry, reporter)
    has_videos = any(file.is_video for file in found.files)
    video_options = choice.video_options(jobs or 0) if has_videos else None
    setting = Setting(cameras, image_options, video_options, exact, distort)
    companions = Companions(place, camera_of_results(known, cameras), mask, maps)
    run = Run(setting, companions, reporter, jobs, scheduler)
    return run.over(found, force=force, resume=resume, dry_run=dry_run)


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
    """Do what `undistort` does for images that have been found already, for another command."""
    known = _load_camera(camera, reporter)
    place = Place(Path(output))
    refuse_lost_cameras(place, (Path(camera),))
    cameras = Geometry(alpha).cameras(known.camera)
    companions = Companions(place, camera_of_results(known, cameras))
    run = Run(Setting(cameras, ImageOptions()), companions, reporter, jobs, is_resumable=False)
    return run.over(Sources(tuple(Source(image.path, image.name, image.named) for image in found)), force=force)


def _points_file(paths: Sequence[str | Path]) -> Path | None:
    """Return the points file if that is what was named."""
    named = [Path(path) for path in paths if str(path).lower().endswith(".csv")]
    if named and len(paths) > 1:
        raise InputError(f"{named[0]}: a points file stands alone (got {len(paths)} inputs). Run it by itself.")
    return named[0] if named and not named[0].is_dir() else None


def _load_camera(camera: GivenCamera, reporter: Reporter) -> Intrinsics:
    """Read the camera, and pass on if it is not to be trusted."""
    known = known_camera(camera, reporter)
    if known.problems:
        reporter.warn(f"{camera_name(camera)}: marked as not to be trusted: {known.problems[0]}")
    return known


def _warn_of_fold(name: str, camera: Camera, geometry: Geometry, reporter: Reporter) -> None:
    """Say how much of the image has no place in a result that is to show all of it."""
    share = share_past_fold(camera) if geometry.shows_all else 0.0
    if share > 0:
        where = f"its lens model folds {camera.valid_radius_px:.0f} px from the principal point"
        reporter.warn(f"{name}: {where}; what lies farther out, {share:.1%} of the image, cannot be shown.")


def _warn_of_blindness(place: Place, cameras: Cameras, geometry: Geometry, reporter: Reporter) -> None:
    """Say if most of each result is going to be empty."""
    share = share_blind(cameras) if geometry.shows_all else 0.0
    if share > _MOST_BLIND:
        advice = "Show less around it (smaller --alpha or --fov), or leave out what is empty with --crop valid."
        if geometry.target is not None or geometry.distort:
            advice = "Check that the two cameras belong together."
        reporter.warn(f"{place.file or place.folder}: {share:.1%} of each result sees nothing of its source. {advice}")


def _cameras(geometry: Geometry, camera: Camera, files: Sequence[Source], most_pixels: int) -> Cameras:
    """Choose the cameras, for the size of the first file if the camera may be scaled to it."""
    first = first_size(files, most_pixels) if geometry.rescale else None
    if first is None:
        return geometry.cameras(camera)
    path, size = first
    try:
        return geometry.cameras(camera, size)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
