"""Rendered views: the ideal image of a board, then what a sensor makes of it, with the truth beside it."""

from __future__ import annotations

import numpy as np

from camcal.boards.base import Board
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Detection, View
from camcal.synthesis.edges import Scene
from camcal.synthesis.poses import sample_pose
from camcal.synthesis.scenario import Light, Scenario
from camcal.synthesis.scene import scene_light
from camcal.synthesis.sensor import expose, shading
from camcal.synthesis.streams import NOISE, random_stream


def render_view(scenario: Scenario, index: int) -> View:
    """Render one view of a scenario; it depends on nothing but the scenario and the index.

    Parameters
    ----------
    scenario : Scenario
    index : int
        Which view, 0..count - 1.

    Returns
    -------
    View
        The image (uint8 or uint16), the pose, and every feature whose true position lies in the image. The truth is
        called `view_0000.png` and so on, and its sigma is NaN.

    Raises
    ------
    InputError
        If no pose satisfies the scenario.
    ValueError
        If there is no such view.
    """
    pose = sample_pose(scenario, index)
    sensor = scenario.sensor
    ideal = render_ideal(
        scenario.camera,
        scenario.board,
        pose,
        scenario.light,
        blur_sigma_px=sensor.blur_sigma_px,
        defocus_radius_px=sensor.defocus_radius_px,
    )
    image = expose(ideal, sensor, random_stream(scenario.seed, index, NOISE))
    return View(image, pose, true_detection(scenario.camera, scenario.board, pose, f"view_{index:04d}.png"))


def render_ideal(
    camera: Camera,
    board: Board,
    T_cam_board: Pose,
    light: Light | None = None,
    *,
    blur_sigma_px: float = 0.0,
    defocus_radius_px: float = 0.0,
) -> FloatArray:
    """Render a board without noise, clipping, gamma or quantisation.

    Parameters
    ----------
    camera : Camera
    board : Board
    T_cam_board : Pose
        The board must be wholly in front of the camera, its print towards it.
    light : Light, optional
        The default light if none is given.
    blur_sigma_px : float
        Standard deviation of the Gaussian blur of the continuous image (the pixel's own area comes on top); 0 for none.
    defocus_radius_px : float
        Radius of a uniform disc that the continuous image is blurred by as well; 0 for none.

    Returns
    -------
    ndarray of shape (height, width)
        Linear light as a share of full scale, averaged over the area of each pixel; float64. It is 0 where the lens lets
        nothing through.

    Raises
    ------
    InputError
        If the board is not wholly in front of the camera, or turns its back to it.
    """
    light = Light() if light is None else light
    scene = Scene(board.pattern, T_cam_board, light)
    ideal = scene_light(camera, scene, blur_sigma_px=blur_sigma_px, defocus_radius_px=defocus_radius_px)
    if light.vignetting or light.gradient:
        ideal *= shading(camera.size, light)
    return ideal


def true_detection(camera: Camera, board: Board, T_cam_board: Pose, source: str) -> Detection:
    """Project a board's features: those whose true position lies in the image, with sigma NaN."""
    corners = camera.project(T_cam_board.apply(board.object_points))
    ids = np.flatnonzero(camera.contains(corners))
    return Detection(source, camera.size, ids, corners[ids], np.full(ids.size, np.nan))
