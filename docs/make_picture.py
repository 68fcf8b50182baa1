"""Make docs/picture.png, the README's picture: a rendered view, the detected board on it, and the undistorted view.

python docs/make_picture.py
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from camcal.detection.detect import detect_board
from camcal.formats.scenario_file import load_scenario
from camcal.observations import Detection, Image
from camcal.resources import config_path
from camcal.synthesis.render import render_view
from camcal.undistortion.maps import undistort_image, undistort_map
from camcal.undistortion.target import target_camera

PANEL_WIDTH = 560
GAP = 14
SCENARIO, VIEW = "wide_action", 7


def main() -> None:
    """Render, detect, undistort, and put the three beside each other."""
    scenario = load_scenario(config_path(SCENARIO))
    image = render_view(scenario, VIEW).image
    found = detect_board(image, scenario.board, "view")
    if not isinstance(found, Detection):
        raise SystemExit(found.reason)
    maps = undistort_map(scenario.camera, target_camera(scenario.camera, 0.6))
    colour = cv2.cvtColor(image, cv2.COLOR_GRAY2BGR)
    panels = [colour, drawn(colour, found), undistort_image(colour, maps, fill=255)]
    small = [
        cv2.resize(p, (PANEL_WIDTH, round(PANEL_WIDTH * p.shape[0] / p.shape[1])), interpolation=cv2.INTER_AREA) for p in panels
    ]
    gap = np.full((small[0].shape[0], GAP, 3), 255, np.uint8)
    picture = np.concatenate([small[0], gap, small[1], gap, small[2]], axis=1)
    cv2.imwrite(str(Path(__file__).with_name("picture.png")), picture)


def drawn(image: Image, found: Detection) -> Image:
    """Mark every corner, coloured along the ids, and join them in the order of the ids."""
    canvas = image.copy()
    hues = np.linspace(0, 170, len(found)).astype(np.uint8)
    colours = cv2.cvtColor(
        np.stack([hues, np.full_like(hues, 255), np.full_like(hues, 255)], axis=-1)[None], cv2.COLOR_HSV2BGR
    )[0]
    thickness = max(2, image.shape[1] // 500)
    points = np.round(found.corners_px * 16).astype(int)
    for a, b, colour in zip(points[:-1], points[1:], colours, strict=False):
        cv2.line(canvas, a.tolist(), b.tolist(), colour.tolist(), thickness, cv2.LINE_AA, shift=4)
    for point, colour in zip(points, colours, strict=True):
        cv2.circle(canvas, point.tolist(), 16 * 4 * thickness, colour.tolist(), thickness, cv2.LINE_AA, shift=4)
    return canvas


if __name__ == "__main__":
    main()
