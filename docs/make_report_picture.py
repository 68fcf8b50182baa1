"""Make docs/report.png, the head of a report in a browser: `python docs/make_report_picture.py` (needs chromium)."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import cv2

import camcal
from camcal.resources import config_path

SCENARIO = "wide_action"
# A few views only, so that the page has something to advise.
VIEWS = 5
WINDOW = (1180, 1775)
# Chromium as root, without asking the network for anything.
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
    "--hide-scrollbars",
)


def main() -> None:
    """Render, calibrate, and photograph the page."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        camcal.synth(config_path(SCENARIO), folder / "data")
        images = sorted((folder / "data/images").iterdir())[:VIEWS]
        calib = folder / "calib"
        camcal.calibrate(images, str(folder / "data/board.yaml"), calib, report=True, name="wide action")
        shot = folder / "shot.png"
        size = ",".join(map(str, WINDOW))
        page = (calib / "report.html").as_uri()
        command = [
            "chromium",
            *FLAGS,
            f"--user-data-dir={folder / 'browser'}",
            f"--window-size={size}",
            f"--screenshot={shot}",
            page,
        ]
        subprocess.run(command, check=True, capture_output=True)
        picture = cv2.imread(str(shot))
        # Wide enough for a README.
        smaller = cv2.resize(picture, None, fx=0.8, fy=0.8, interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(Path(__file__).with_name("report.png")), smaller, [cv2.IMWRITE_PNG_COMPRESSION, 9])


if __name__ == "__main__":
    main()
