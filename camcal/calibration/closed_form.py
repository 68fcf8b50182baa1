"""A start without any guess: Zhang's closed form with a free principal point.

Zhang 2000, "A flexible new technique for camera calibration", section 3.1, with the skew held at 0. It knows no
distortion, but it finds principal points far from the image's centre, where a start from the centre goes astray.
"""

from __future__ import annotations

import numpy as np

from camcal.calibration.normal_equations import Observations, State
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.geometry.homography import homography_from_points


def closed_form_camera(seen: Observations, size: tuple[int, int]) -> Camera:
    """Solve for K from the views' homographies.

    Parameters
    ----------
    seen : Observations
    size : tuple of int
        Image (width, height).

    Returns
    -------
    Camera
        Without distortion. Where the homographies contradict each other, so that no K explains them, the principal
        point is the image's centre and the focal length the image's longer side.
    """
    longer = max(size)
    centre = (np.array(size) - 1) / 2
    fallback = Camera(size, [[longer, 0, centre[0]], [0, longer, centre[1]], [0, 0, 1]])
    # Coordinates about one keep the system well conditioned.
    N = np.array([[2 / longer, 0, -2 * centre[0] / longer], [0, 2 / longer, -2 * centre[1] / longer], [0, 0, 1]])
    rows = [_constraints(N @ H) for H in homographies(seen) if np.isfinite(H).all()]
    if len(rows) < 3:
        return fallback
    b11, b22, b13, b23, b33 = np.linalg.svd(np.concatenate(rows))[2][-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = b33 - b13**2 / b11 - b23**2 / b22
        focal_squared = scale / np.array([b11, b22])
    if not (np.isfinite(focal_squared).all() and (focal_squared > 0).all()):
        return fallback
    fx, fy = np.sqrt(focal_squared)
    return Camera(size, np.linalg.inv(N) @ [[fx, 0, -b13 / b11], [0, fy, -b23 / b22], [0, 0, 1]])


def facing(camera: Camera, seen: Observations) -> State:
    """Put every board upright before the camera, ten times its size away: the poses' blank guess."""
    extent = float(np.ptp(seen.points_board, axis=0).max())
    rvecs = np.zeros((seen.starts.size, 3))
    return State(camera, rvecs, np.tile([0.0, 0.0, 10 * extent], (len(rvecs), 1)))


def homographies(seen: Observations) -> list[FloatArray]:
    """Homography (3, 3) from the board to pixels of each view."""
    points = np.split(seen.points_board[:, :2], seen.starts[1:])
    corners = np.split(seen.corners_px, seen.starts[1:])
    return [homography_from_points(*pair) for pair in zip(points, corners, strict=True)]


def _constraints(H: FloatArray) -> FloatArray:
    """Return two rows (2, 5) on B = K⁻ᵀ K⁻¹ (b11, b22, b13, b23, b33): the board's axes are orthogonal and of equal length."""
    h = (H / np.linalg.norm(H[:, 0])).T

    def v(i: int, j: int) -> FloatArray:
        a, b = h[i], h[j]
        return np.array([a[0] * b[0], a[1] * b[1], a[0] * b[2] + a[2] * b[0], a[1] * b[2] + a[2] * b[1], a[2] * b[2]])

    return np.stack([v(0, 1), v(0, 0) - v(1, 1)])
