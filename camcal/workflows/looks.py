"""What the photographs of a calibration look like, view by view."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from camcal.boards.base import Board
from camcal.errors import InputError
from camcal.formats.images import ImageFile
from camcal.geometry.arrays import BoolArray
from camcal.geometry.camera import Camera
from camcal.geometry.pose import Pose
from camcal.observations import Calibration, Detection
from camcal.refinement.look import Look, completed_looks, flat_noise, measured_look
from camcal.refinement.warped import refine_warped
from camcal.synthesis.render import render_ideal
from camcal.synthesis.scenario import Light
from camcal.workflows.parallel import each

# Ink is 0 and paper 1 where nothing else reaches; what is behind the board is neither.
_MARKED = Light(white=1.0, black=0.0, background=0.5)
_EVEN = 0.004
# How much wider than it is measured the blur is taken: fringes of sharpening and compression reach farther.
_MARGIN_PX = 0.5


def measured_looks(calibration: Calibration, board: Board, found: Sequence[ImageFile], jobs: int | None) -> tuple[Look, ...]:
    """Measure what each view that a calibration used looks like; empty if that is not known of any.

    The edges that the calibration predicts are fitted once more, whatever refined the corners before, and the noise is that
    of ink and paper where the calibration sees neither end. What a view does not tell is taken from the others.

    Parameters
    ----------
    calibration : Calibration
    board : Board
    found : sequence of ImageFile
        The photographs, by name.
    jobs : int or None
        Images worked on at once; all processors if None.

    Raises
    ------
    InputError
        If a photograph cannot be read again.
    """
    images = {image.name: image for image in found}
    camera = calibration.camera

    def work(view: tuple[Detection, Pose]) -> Look | None:
        seen, pose = view
        gray = images[seen.source].gray()
        look = measured_look(gray, refine_warped(gray, seen.ids, seen.corners_px, board, camera=camera, T_cam_board=pose))
        if look is None:
            return None
        return replace(look, noise=flat_noise(gray, *_even_parts(camera, board, seen, pose, look.blur_sigma_px)))

    views = list(zip(calibration.detections, calibration.poses, strict=True))
    return completed_looks(each(work, views, jobs, lambda: None))


def _even_parts(camera: Camera, board: Board, seen: Detection, pose: Pose, blur_sigma_px: float) -> tuple[BoolArray, BoolArray]:
    """Which pixels between the corners seen show nothing but ink, and nothing but paper; (height, width) each."""
    width, height = camera.size
    between = np.zeros((height, width), dtype=np.uint8)
    hull = cv2.convexHull(np.rint(seen.corners_px).astype(np.int32))
    cv2.fillConvexPoly(between, hull, 1)
    inside = between.astype(bool)
    try:
        share = render_ideal(camera, board, pose, _MARKED, blur_sigma_px=blur_sigma_px + _MARGIN_PX)
    except InputError:
        return np.zeros_like(inside), np.zeros_like(inside)
    return inside & (share < _EVEN), inside & (share > 1 - _EVEN)
