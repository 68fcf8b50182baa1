"""What the commands do to files, done to arrays: render and undistort an image, find the corners in it, load a camera."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection, Image, Rejected
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light, Sensor
from camcal.synthesis.sensor import expose
from camcal.undistortion import maps
from camcal.undistortion.target import target_camera
from camcal.workflows.given import known_camera
from camcal.workflows.inputs import check_image, images_to_work_on
from camcal.workflows.observe import observe
from camcal.workflows.reporting import LogReporter, Reporter, SilentReporter

_KEPT = 8
"""How many maps between cameras are kept."""


def load_camera(path: str | Path, *, reporter: Reporter | None = None) -> Camera:
    """Read the camera of a camera file; `load_intrinsics` also tells how well it is known.

    Parameters
    ----------
    path : str or Path
        A camera file of any tool that camcal reads, or a folder that `calibrate` or `synth` wrote.
    reporter : Reporter, optional
        Told if the file is marked as not to be trusted, or is about images of another size; the `camcal` logger by default.

    Returns
    -------
    Camera
        `K` of shape (3, 3) and `dist` of shape (8,), float64, are what cv2 takes; `size` is (width, height).

    Raises
    ------
    InputError
        If the file cannot be used; says `file:line: key: problem`.

    Examples
    --------
    >>> import tempfile, cv2, camcal
    >>> truth = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06, 0, 0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     camcal.save_intrinsics(f"{folder}/camera.yaml", camcal.Intrinsics(truth))
    ...     camera = camcal.load_camera(folder)
    >>> camera
    Camera(640x480, fx=520, fy=523, cx=322, cy=236, k1=-0.18, k2=0.06)
    >>> points = np.array([[0.1, 0.2, 1.0]])
    >>> seen, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.K, camera.dist)
    >>> bool(np.allclose(seen.reshape(-1, 2), camera.project(points)))
    True
    """
    reporter = reporter or LogReporter()
    known = known_camera(path, reporter)
    if known.problems:
        reporter.warn(f"{path}: marked as not to be trusted: {known.problems[0]}")
    return known.camera


def render(
    camera: Camera,
    board: str | Board,
    T_cam_board: Pose,
    *,
    light: Light | None = None,
    sensor: Sensor | None = None,
    seed: int = 0,
) -> Image:
    """Render what a camera sees of a board.

    The true position of its corners is `camera.project(T_cam_board.apply(board.object_points))`.

    Parameters
    ----------
    camera : Camera
    board : str or Board
        As for `calibrate`.
    T_cam_board : Pose
        Where the board stands: in front of the camera with its print towards it.
    light : Light, optional
        Brightness of paper, ink and background, vignetting and gradient; a plain one by default.
    sensor : Sensor, optional
        Blur, noise, gamma and depth; by default a blur of 0.7 px, noise of 2 of 255 grey levels, and 8 bits.
    seed : int
        Of the noise; the same seed gives the same bytes.

    Returns
    -------
    ndarray of shape (height, width)
        uint8, or uint16 if the sensor has 16 bits.

    Raises
    ------
    InputError
        If the board is not wholly in front of the camera or turns its back to it, or the SPEC, the pose or the sensor makes
        no sense.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> pose = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])
    >>> image = camcal.render(camera, "checkerboard:7x6:20mm", pose)
    >>> image.shape, image.dtype
    ((480, 640), dtype('uint8'))
    """
    recorder = sensor or Sensor()
    if not isinstance(T_cam_board, Pose):
        raise InputError(f"T_cam_board: not a pose (got {type(T_cam_board).__name__}). Make one: camcal.Pose(R, t).")
    target = load_board(board) if isinstance(board, str) else board
    blur, defocus = recorder.blur_sigma_px, recorder.defocus_radius_px
    ideal = render_ideal(camera, target, T_cam_board, light, blur_sigma_px=blur, defocus_radius_px=defocus)
    try:
        return expose(ideal, recorder, np.random.default_rng(seed))
    except ValueError as error:
        raise InputError(str(error)) from None


def detect_corners(image: Image, board: str | Board, *, name: str = "image", refine: str = "saddle") -> Detection | Rejected:
    """Find the corners of a board in an image.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, 3)
        uint8, uint16 or float32; blue first.
    board : str or Board
        As for `calibrate`.
    name : str
        What the view is called; `calibrate` wants another name for each.
    refine : str
        `saddle` (a blurred corner is fitted to each) or `opencv` (cv2.cornerSubPix).

    Returns
    -------
    Detection or Rejected
        Ids and positions of the corners; or why the board was not found.

    Raises
    ------
    InputError
        If the array is no image, the SPEC makes no sense, or the refinement is unknown.

    Examples
    --------
    >>> import camcal
    >>> board = camcal.load_board("checkerboard:7x6:20mm")
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> pose = camcal.Pose.from_rvec([0.3, -0.2, 0.1], [-0.07, -0.05, 0.3])
    >>> seen = camcal.detect_corners(camcal.render(camera, board, pose), board)
    >>> len(seen), seen.corners_px.shape
    (42, (42, 2))
    >>> truth = camera.project(pose.apply(board.object_points[seen.ids]))
    >>> bool(abs(seen.corners_px - truth).max() < 0.1)
    True
    >>> camcal.detect_corners(np.zeros((480, 640), np.uint8), board).reason
    'the image is almost black (grey levels 0 to 0 of 255): add light or lengthen the exposure'
    """
    if refine not in ("saddle", "opencv"):
        raise InputError(f"refine: unknown (got {refine!r}, expected saddle or opencv).")
    quiet = SilentReporter()
    target = load_board(board) if isinstance(board, str) else board
    found, rejected = observe(images_to_work_on({name: image}, quiet), target, refine, 1, quiet)
    return found[0].detection if found else rejected[0]


def undistort_image(
    image: Image,
    camera: Camera,
    target: Camera | None = None,
    *,
    interpolation: str = "linear",
    fill: float | Sequence[float] = 0.0,
    gamma: str | float | None = None,
) -> Image:
    """Take the lens out of an image: render what another camera in the same place would have seen.

    The maps of the last few pairs of cameras are kept, so that the frames of a video need not build them again.

    Parameters
    ----------
    image : ndarray of shape (height, width) or (height, width, channels)
        uint8, uint16 or float32, of the camera's size, with one to four channels.
    camera : Camera
        The camera that took the image.
    target : Camera, optional
        The camera of the result; `target_camera(camera)` by default, every pixel of which sees the source. With a lens, that
        lens is added.
    interpolation : str
        "linear"; "cubic", which keeps fine detail; "lanczos", which keeps the finest, for its price.
    fill : float or sequence of float
        Value of pixels that see nothing, for all channels or for each.
    gamma : str or float, optional
        Average light instead of pixel values: "srgb", or the exponent of a power law. Floats have full scale 1 then.

    Returns
    -------
    ndarray
        Of the target's size, and of the image's dtype and channels. Measure in it with the target camera, not with `camera`.

    Raises
    ------
    InputError
        If the image has another size than the camera or is none, an option is not one of the above, or `fill` is no value
        of such an image.

    Examples
    --------
    >>> import camcal
    >>> camera = camcal.Camera((640, 480), [[520, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06])
    >>> image = np.full((480, 640, 3), 200, np.uint8)
    >>> target = camcal.target_camera(camera, alpha=0.5)
    >>> camcal.undistort_image(image, camera, target).shape
    (480, 640, 3)
    >>> target.dist.any()
    np.False_
    """
    check_image("image", image, channels=(1, 2, 3, 4))
    if image.shape[1::-1] != camera.size:
        got, expected = ("{}x{}".format(*size) for size in (image.shape[1::-1], camera.size))
        raise InputError(f"image: not of the camera's size (got {got}, expected {expected}). Scale it: Camera.scaled.")
    chosen = _default_target(camera) if target is None else target
    return maps.undistort_image(image, _map(camera, chosen), interpolation=interpolation, fill=fill, gamma=gamma)


@lru_cache(maxsize=_KEPT)
def _default_target(camera: Camera) -> Camera:
    """Return the camera in which every pixel sees the source; the same object each time."""
    return target_camera(camera)


@lru_cache(maxsize=_KEPT)
def _map(camera: Camera, target: Camera) -> maps.UndistortMap:
    """Return the map between two cameras, which never change."""
    return maps.undistort_map(camera, target)
