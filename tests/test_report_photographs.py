"""Photographs on the report's page: which are shown, how they look, and which are missing by name."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from report_pages import Page, noisy_file
from scenes import BOARD, detections, poses

from camcal.calibration.solve import solve
from camcal.formats.views_file import load_views
from camcal.geometry.camera import Camera
from camcal.report.overlay import overlay
from camcal.workflows.calibrate import calibrate
from camcal.workflows.photographs import photographs
from camcal.workflows.report import make_report
from camcal.workflows.reporting import SilentReporter
from camcal.workflows.restore import restore


def test_page_of_a_view_left_out_shows_its_corners(tmp_path):
    """A view that does not fit is among the rejected images, its corners drawn although there is no photograph."""
    noisy_file(tmp_path / "seen.csv", moved_view=True)
    made = calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "calib")
    assert [rejection.source for rejection in made.calibration.rejected] == ["view_005"]
    page = (tmp_path / "calib/report.html").read_text(encoding="utf-8")
    assert 'aria-label="Corners of view_005, left out"' in page
    assert "were not found" in page
    assert "1 left out" in page


def test_a_page_without_its_photographs_says_so(run, reported, tmp_path):
    """A calibration sent without its photographs still has all corners and figures; --images finds them again."""
    shutil.copytree(reported, tmp_path / "calib")
    code, out, _ = run("report", tmp_path / "calib", "--json")
    assert code == 0
    assert "not found" in json.loads(out)["missing"]
    bare = Page((tmp_path / "calib/report.html").read_text(encoding="utf-8"))
    assert bare.all("img") == []
    assert "The photographs were not found" in bare.text["body"][0]
    assert len([a for a in bare.all("svg") if a.get("class") == "overlay"]) == 8
    assert run("report", tmp_path / "calib", "--images", reported.parent / "photos")[0] == 0
    found = Page((tmp_path / "calib/report.html").read_text(encoding="utf-8"))
    assert len(found.all("img")) == 8 * 2 + 1


def test_photographs_that_are_not_the_ones_are_passed_over(reported, photographed, tmp_path):
    """One of another size, and one that is damaged now, are missing by name; the others are there."""
    shutil.copytree(photographed, tmp_path / "photos")
    (tmp_path / "photos/view_0000.png").write_bytes(b"not an image any more")
    cv2.imwrite(str(tmp_path / "photos/view_0001.png"), np.zeros((100, 100), np.uint8))
    done = make_report(reported, tmp_path / "page.html", images=tmp_path / "photos")
    assert "view_0000.png" in done.missing
    assert "view_0001.png" in done.missing
    assert len(Page((tmp_path / "page.html").read_text(encoding="utf-8")).all("img")) == 6 * 2 + 1


@pytest.mark.parametrize(
    ("dtype", "channels", "scale"), [("uint16", 1, 16), ("uint16", 3, 256), ("uint8", 4, 1), ("float32", 3, 1 / 255)]
)
def test_photographs_of_every_depth_are_shown_bright(reported, photographed, tmp_path, dtype, channels, scale):
    """Twelve bits in sixteen, sixteen, transparency, floats: the picture is as bright as the one of eight bits."""
    (tmp_path / "photos").mkdir()
    gray = cv2.imread(str(photographed / "view_0000.png"), cv2.IMREAD_GRAYSCALE)
    pixels = (gray.astype(np.float64) * scale).astype(dtype)
    pixels = pixels if channels == 1 else np.repeat(pixels[..., None], channels, axis=2)
    name = "view_0000.png" if dtype != "float32" else "view_0000.tiff"
    cv2.imwrite(str(tmp_path / "photos" / name), pixels)
    (tmp_path / "photos" / name).rename(tmp_path / "photos/view_0000.png")
    known = restore(reported).calibration
    shown = photographs(known, {"view_0000.png": tmp_path / "photos/view_0000.png"}, jobs=1, reporter=SilentReporter())
    picture = cv2.imdecode(np.frombuffer(shown.photographs["view_0000.png"].picture.content, np.uint8), cv2.IMREAD_GRAYSCALE)
    # The brightest thousandth becomes white, so a picture is never darker than its photograph, and white stays white.
    small = cv2.resize(gray, picture.shape[::-1], interpolation=cv2.INTER_AREA)
    assert picture.mean() >= small.mean() - 1
    assert np.corrcoef(picture.ravel(), small.ravel())[0, 1] > 0.99


def test_twin_is_the_photograph_without_its_lens(tmp_path):
    """A line that is straight in space and bent in the photograph is straight in the twin.

    Rounding to grey levels, resampling and JPEG move the middle of a smooth ridge by far less than a quarter of a pixel.
    """
    K = [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]]
    camera = Camera((640, 480), K, [-0.3, 0.09])
    seen = detections(poses(6, 1, camera=camera, reach=(0.2, 0.15)), noise_px=0.05, camera=camera)
    calibration = replace(solve(seen, BOARD.object_points, distortion=("k1", "k2")), camera=camera)
    # Every pixel is as bright as its ray is near the line y = -0.35: a ridge 2 px wide without steps.
    y = camera.unproject(np.stack(np.meshgrid(np.arange(640.0), np.arange(480.0)), axis=-1))[..., 1]
    image = np.rint(250 * np.exp(-(((y + 0.35) * 500 / 2) ** 2))).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "line.png"), image)
    name = calibration.detections[0].source
    shown = photographs(calibration, {name: tmp_path / "line.png"}, jobs=1, reporter=SilentReporter()).photographs[name]
    rows = []
    for picture in (shown.picture, shown.twin):
        pixels = cv2.imdecode(np.frombuffer(picture.content, np.uint8), cv2.IMREAD_GRAYSCALE).astype(float)
        pixels[pixels < 32] = 0  # JPEG's ripples around the line
        rows.append((pixels * np.arange(len(pixels))[:, None]).sum(axis=0) / pixels.sum(axis=0))
    assert np.ptp(rows[0]) > 5
    assert np.ptp(rows[1]) < 0.25


def test_more_photographs_than_a_page_holds_are_counted(tmp_path, monkeypatch):
    """Of too many views those that fit worst are shown, and the page says how many that is."""
    monkeypatch.setattr("camcal.workflows.photographs.MOST_SHOWN", 4)
    calibration = solve(detections(poses(9, 11), noise_px=0.2, seed=3), BOARD.object_points)
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((960, 1280), 90, np.uint8))
    places = {seen.source: tmp_path / "grey.png" for seen in calibration.detections}
    shown = photographs(calibration, places, jobs=1, reporter=SilentReporter())
    worst = np.argsort(calibration.view_rms_px)[-4:]
    assert set(shown.photographs) == {calibration.detections[index].source for index in worst}
    assert "4 of 9 images" in shown.missing


def test_overlay_draws_each_corner_where_it_is():
    """A dot at every corner, and a line along its residual, magnified."""
    calibration = solve(detections(poses(6, 2), noise_px=0.2, seed=1), BOARD.object_points)
    drawn = overlay(calibration, 3, (), 100.0)
    places = np.array(re.findall(r"M(\S+) (\S+?)h0", drawn.corners), dtype=float)
    lines = np.array(re.findall(r"M(\S+) (\S+?)l(\S+) ([-\d.]+)", drawn.residuals), dtype=float)
    assert drawn.view_box == "-0.5 -0.5 1280 960"
    np.testing.assert_allclose(places, calibration.detections[3].corners_px, atol=0.051)
    np.testing.assert_allclose(lines[:, 2:], 100 * calibration.residuals_px[3], atol=0.051)


def test_images_without_a_path_of_text_are_not_looked_for(dataset, tmp_path):
    """A folder whose name is no text for a file leaves the path empty instead of wrong."""
    folder = tmp_path / "with\ttab"
    shutil.copytree(dataset / "images", folder)
    calibrate(folder, str(dataset / "board.yaml"), tmp_path / "calib", report=False)
    assert {view.path for view in load_views(tmp_path / "calib")} == {""}
    assert os.fspath(folder) not in (tmp_path / "calib/views.yaml").read_text()


@pytest.mark.skipif(sys.platform in {"darwin", "win32"}, reason="file names are Unicode on this system")
def test_images_with_names_of_bytes_are_found_in_a_named_folder(reported, photographed, tmp_path):
    """A name that is not UTF-8 stands in escapes in the files, and `--images` still finds the photograph."""
    folder, calib = tmp_path / "odd", tmp_path / "calib"
    folder.mkdir()
    for image in photographed.glob("view_*.png"):
        shutil.copy(image, os.fsencode(folder) + b"/\xe4 " + os.fsencode(image.name))
    calibrate(folder, str(reported / "board.yaml"), calib, report=False)
    assert {view.path for view in load_views(calib)} == {""}
    done = make_report(calib, images=folder)
    assert done.missing == ""
    assert 'alt="Photograph \\xe4 view_' in done.page.read_text(encoding="utf-8")
