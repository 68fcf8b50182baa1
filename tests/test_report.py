"""The report: what its page says, that it needs nothing but itself, and that it can be made again from the files alone."""

from __future__ import annotations

import base64
import hashlib
import itertools
import json
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from scenes import BOARD, detections, poses

from camcal.calibration.solve import solve
from camcal.cli import main
from camcal.formats.camera_file import load_intrinsics
from camcal.formats.corners_file import save_corners
from camcal.formats.views_file import load_views, load_views_and_options
from camcal.geometry.camera import Camera
from camcal.observations import Detection, Rejected
from camcal.report.calibration_page import Making, calibration_page
from camcal.report.figures.catalogue import FIGURES
from camcal.report.lens import lens_words
from camcal.report.overlay import overlay
from camcal.report.record import Record
from camcal.trust.assess import assess
from camcal.verdict import Finding, Verdict
from camcal.workflows import report as report_workflow
from camcal.workflows.calibrate import _intrinsics, calibrate
from camcal.workflows.photographs import photographs
from camcal.workflows.report import make_report, record_of, write_plots
from camcal.workflows.reporting import SilentReporter
from camcal.workflows.restore import restore

NAME = """<b>&"rear" 'cam'</b> 😀"""
ODD_IMAGE = "a <i>&'view'é😀.png"
MEGABYTE = 1_000_000


class Page(HTMLParser):
    """What a browser would make of a page: its tags, its links, its text by element."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, list[str]] = {}
        self.inside: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        """Remember a tag, and what follows as its text."""
        self.tags.append((tag, {name: value or "" for name, value in attributes}))
        self.inside.append(tag)
        self.text.setdefault(tag, []).append("")

    def handle_endtag(self, tag):
        """Close every tag up to this one."""
        while self.inside and self.inside.pop() != tag:
            pass

    def handle_data(self, data):
        """Add text to all open elements."""
        for tag in set(self.inside):
            self.text[tag][-1] += data

    def all(self, tag: str) -> list[dict[str, str]]:
        """Attributes of every element of a kind."""
        return [attributes for name, attributes in self.tags if name == tag]


def undated(page: Path) -> str:
    """Content of a page without the time it was made."""
    return re.sub(r"<time>[^<]*</time>", "", page.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def photographed(dataset, tmp_path_factory) -> Path:
    """The small dataset with an odd file name, a photograph without a board, and a file that is no image."""
    folder = tmp_path_factory.mktemp("report") / "photos"
    shutil.copytree(dataset / "images", folder)
    (folder / "view_0003.png").rename(folder / ODD_IMAGE)
    cv2.imwrite(str(folder / "street.png"), np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8))
    (folder / "torn.png").write_bytes((folder / "view_0000.png").read_bytes()[:500])
    return folder


@pytest.fixture(scope="module")
def reported(photographed, dataset) -> Path:
    """The folder of a calibration from the command line, with its page. Not to be written into."""
    folder = photographed.parent / "calib"
    arguments = ["calibrate", photographed, "--board", dataset / "board.yaml", "-o", folder, "--name", NAME]
    assert main([str(argument) for argument in arguments]) == 0
    return folder


@pytest.fixture(scope="module")
def text(reported) -> str:
    """The page."""
    return (reported / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def page(text) -> Page:
    """The page, parsed."""
    return Page(text)


def test_calibrate_writes_the_page_last(reported):
    """Five files, the page of them the youngest: a camera is there before it is shown."""
    files = {path.name: path.stat().st_mtime_ns for path in reported.iterdir()}
    assert sorted(files) == ["board.yaml", "camera.yaml", "corners.csv", "report.html", "views.yaml"]
    assert max(files, key=lambda name: files[name]) == "report.html"


def test_page_says_the_verdict_and_every_finding(reported, page):
    """The word in title and heading, and each finding with its level and advice, as camera.yaml has them."""
    stored = yaml.safe_load((reported / "camera.yaml").read_text(encoding="utf-8"))["camcal"]
    assert page.text["title"] == [f"{NAME}: {stored['verdict']}"]
    assert f"Verdict: {stored['verdict']}" in page.text["h2"]
    body = " ".join(page.text["body"][0].split())
    assert stored["findings"]
    for finding in stored["findings"]:
        assert finding["text"][1:] in body
        assert finding["advice"] in body


def test_page_holds_the_camera_to_the_last_bit(reported, page, text):
    """The Python text of the page gives the numbers of camera.yaml; the table gives them rounded to their sigma."""
    stored = yaml.safe_load((reported / "camera.yaml").read_text(encoding="utf-8"))
    code = next(block for block in page.text["code"] if block.startswith("K = "))
    values: dict[str, np.ndarray] = {}
    exec(code, {"np": np}, values)
    assert values["K"].ravel().tolist() == stored["camera_matrix"]["data"]
    assert values["dist"].tolist() == stored["distortion_coefficients"]["data"]
    rows = re.findall(r'<th scope="row">(\w+)</th><td>([-\d.]+)</td><td>± ([\d.]+)</td>', text)
    known = load_intrinsics(reported)
    truth = dict(zip(known.camera.intrinsic_names, known.camera.intrinsics.tolist(), strict=True))
    assert [name for name, *_ in rows] == list(known.free)
    for name, value, sigma in rows:
        # Two digits of sigma are written, and as many decimals of the value: half a unit of the last, at most 5 % of sigma.
        assert float(value) == pytest.approx(truth[name], abs=0.051 * known.sigma[name])
        assert float(sigma) == pytest.approx(known.sigma[name], rel=0.051)


def test_page_has_every_figure_and_section_in_order(page):
    """Verdict, camera, the figures as the catalogue has them, then rejected images and how it was made."""
    sections = [attributes["id"] for attributes in page.all("section")]
    expected = ["verdict", "camera", "uncertainty", "coverage", "residuals", "views", "space", "lens", "board"]
    assert sections == [*expected, "rejected", "made"]
    figures = [a["id"].removeprefix("figure-") for a in page.all("figure") if a.get("id", "").startswith("figure-")]
    assert figures == [kind.name for kind in FIGURES]
    links = [a["href"] for a in page.all("a") if a["href"] in {f"#{section}" for section in sections}]
    assert links == [f"#{section}" for section in sections]


def test_names_are_escaped(reported, page, text):
    """A camera and an image named like markup show as they are called, and make no markup."""
    assert page.text["h1"] == [NAME]
    assert ODD_IMAGE in page.text["h3"]
    assert not page.all("b")
    assert not page.all("i")
    assert "<i>" not in text
    assert load_intrinsics(reported).name == NAME


def test_page_asks_the_network_for_nothing(page, text):
    """Every reference is a place on the page or data in it; the policy forbids the rest and names the script's hash."""
    references = [
        value for _, attributes in page.tags for name, value in attributes.items() if name in {"href", "src", "srcset"}
    ]
    assert references
    assert all(reference.startswith(("#", "data:")) for reference in references)
    assert "@import" not in text
    assert all(target.strip("'\"").startswith(("#", "data:")) for target in re.findall(r"url\(([^)]*)\)", text))
    policy = next(a["content"] for a in page.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'; img-src data:;")
    (script,) = page.text["script"]
    assert f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'" in policy
    handlers = [name for _, attributes in page.tags for name in attributes if name.startswith("on")]
    assert handlers == []


def test_page_is_accessible(page):
    """A language, a title, one main heading, headings that skip no level, alternative texts, ids that are unique."""
    assert page.all("html")[0]["lang"] == "en"
    assert len(page.all("h1")) == 1
    levels = [int(tag[1]) for tag, _ in page.tags if re.fullmatch(r"h[1-6]", tag)]
    assert all(after - before <= 1 for before, after in itertools.pairwise(levels))
    assert all(attributes.get("alt") for attributes in page.all("img"))
    ids = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(ids) == len(set(ids))


def test_views_are_shown_with_their_corners_and_twins(reported, page, text):
    """A panel for each used view, the worst first, with two pictures; the bars of the figure lead to them."""
    views = [view for view in load_views(reported) if view.used]
    panels = [a["id"] for a in page.all("article")]
    order = sorted(range(len(views)), key=lambda index: -views[index].rms_px)
    assert panels == [f"view-{index}" for index in order]
    assert sorted(a["href"] for a in page.all("a") if a["href"].startswith("#view-")) == sorted(f"#{panel}" for panel in panels)
    for view in views:
        assert text.count(f'alt="Photograph {_attribute(view.source)}"') == 1
        assert text.count(f'alt="{_attribute(view.source)} without the lens"') == 1


def _attribute(name: str) -> str:
    """A name as an attribute holds it."""
    for mark, entity in {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&#34;", "'": "&#39;"}.items():
        name = name.replace(mark, entity)
    return name


def test_rejected_images_are_shown_with_their_reason(reported, page, text):
    """The photograph without a board has its picture; the torn one has none; each has its reason."""
    reasons = {view.source: view.reason for view in load_views(reported) if not view.used}
    assert set(reasons) == {"street.png", "torn.png"}
    body = page.text["body"][0]
    assert all(reason[1:] in body for reason in reasons.values())
    assert text.count('alt="Photograph street.png"') == 1
    assert 'alt="Photograph torn.png"' not in text
    assert page.text["div"].count("no photograph") == 1


def test_report_makes_the_same_page_again(reported, tmp_path):
    """From the folder's files alone, in another process: byte for byte, its date excepted."""
    command = [sys.executable, "-m", "camcal", "report", str(reported), "-o", str(tmp_path / "again.html")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert undated(tmp_path / "again.html") == undated(reported / "report.html")


def test_page_can_be_made_again_after_moving_house(reported, photographed, tmp_path):
    """Calibration and photographs moved together are found together; the page in the folder is replaced without asking."""
    shutil.copytree(reported, tmp_path / "calib")
    shutil.copytree(photographed, tmp_path / "photos")
    (tmp_path / "calib/report.html").write_text("old")
    assert main(["report", str(tmp_path / "calib")]) == 0
    assert undated(tmp_path / "calib/report.html") == undated(reported / "report.html")


def noisy_file(path: Path, *, moved_view: bool = False) -> None:
    """Corners of twelve views with 0.1 px of noise and one corner 5 px off; one view may be of a board that moved."""
    seen = detections(poses(12, 4), noise_px=0.1, seed=2)
    corners = np.array(seen[2].corners_px)
    corners[7] += 5
    seen[2] = Detection(seen[2].source, seen[2].size, seen[2].ids, corners, seen[2].sigma_px)
    if moved_view:
        corners = np.array(seen[5].corners_px)
        corners[::2] += [3, -2]
        seen[5] = Detection(seen[5].source, seen[5].size, seen[5].ids, corners, seen[5].sigma_px)
    save_corners(path, seen)


@pytest.mark.parametrize(
    "options", [{}, {"warp": True, "scale": True}, {"distortion": "k1,k2,p1,p2"}, {"distortion": "k1,k2", "warp": True}]
)
def test_restored_calibration_is_the_one_that_was_written(tmp_path, options):
    """Corners, poses and residuals bit for bit, the joint covariance to the last digits that its inverse keeps.

    Without weights the same equations are built at the same state but for the last bits of the rotations; the condition of
    the scaled system is far below 1e8, so that eight of sixteen digits are left.
    """
    noisy_file(tmp_path / "seen.csv", moved_view=True)
    made = calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "calib", **options)
    known, again = made.calibration, restore(tmp_path / "calib").calibration
    assert made.calibration.outliers
    assert [seen.source for seen in again.detections] == [seen.source for seen in known.detections]
    for mine, theirs in zip(again.detections, known.detections, strict=True):
        assert np.array_equal(mine.ids, theirs.ids)
        assert np.array_equal(mine.corners_px, theirs.corners_px)
    assert all(np.array_equal(a, b) for a, b in zip(again.residuals_px, known.residuals_px, strict=True))
    assert all(np.array_equal(a.R, b.R) and np.array_equal(a.t, b.t) for a, b in zip(again.poses, known.poses, strict=True))
    scale = np.sqrt(np.diag(known.joint_covariance))
    np.testing.assert_allclose(
        again.joint_covariance / np.outer(scale, scale), known.joint_covariance / np.outer(scale, scale), atol=1e-8
    )
    np.testing.assert_allclose(again.pose_sigmas, known.pose_sigmas, rtol=1e-8)
    assert again.shape.names == known.shape.names
    assert again.rejected == known.rejected
    used = {seen.source for seen in known.detections}
    by_place = {(outlier.source, outlier.id): outlier for outlier in known.outliers}
    assert {(outlier.source, outlier.id) for outlier in again.outliers} == set(by_place)
    for outlier in again.outliers:
        before = by_place[outlier.source, outlier.id]
        assert (outlier.corner_px, outlier.residual_px) == (before.corner_px, before.residual_px)
        assert outlier.reason == before.reason or outlier.source not in used


def test_page_of_a_view_left_out_shows_its_corners(tmp_path):
    """A view that does not fit is among the rejected images, its corners drawn although there is no photograph."""
    noisy_file(tmp_path / "seen.csv", moved_view=True)
    run = calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "calib", report=True)
    assert [rejection.source for rejection in run.calibration.rejected] == ["view_005"]
    page = (tmp_path / "calib/report.html").read_text(encoding="utf-8")
    assert 'aria-label="Corners of view_005, left out"' in page
    assert "were not found" in page
    assert "1 left out" in page


def test_a_page_without_its_photographs_says_so(reported, tmp_path, capsys):
    """A calibration sent without its photographs still has all corners and figures; --images finds them again."""
    shutil.copytree(reported, tmp_path / "calib")
    assert main(["report", str(tmp_path / "calib"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert "not found" in said["missing"]
    bare = Page((tmp_path / "calib/report.html").read_text(encoding="utf-8"))
    assert bare.all("img") == []
    assert "The photographs were not found" in bare.text["body"][0]
    assert len([a for a in bare.all("svg") if a.get("class") == "overlay"]) == 8
    images = reported.parent / "photos"
    assert main(["report", str(tmp_path / "calib"), "--images", str(images)]) == 0
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


def made_record(count: int) -> Record:
    """A calibration of many made views."""
    calibration = solve(detections(poses(count, 11), noise_px=0.2, seed=3), BOARD.object_points)
    return Record(calibration, _intrinsics(calibration, assess(calibration, BOARD), BOARD, "made"), BOARD)


def test_page_of_fifty_views_is_below_5_megabytes(tmp_path):
    """Even if the photographs are noise, which nothing compresses, and there are many corners."""
    record = made_record(50)
    noise = np.random.default_rng(1).integers(0, 255, (960, 1280, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "noise.jpg"), noise)
    places = {seen.source: tmp_path / "noise.jpg" for seen in record.calibration.detections}
    shown = photographs(record.calibration, places, jobs=None, reporter=SilentReporter())
    assert len(shown.photographs) == 50
    text = calibration_page(record, Making(shown.photographs))
    assert Page(text).text["h1"] == ["made"]
    assert len(text.encode()) < 5 * MEGABYTE


@pytest.mark.parametrize(("level", "is_told"), [("rejected", True), ("poor", True), ("usable", False)])
def test_the_head_of_the_page_says_why_not(level, is_told):
    """Where the camera must not be used, the finding that decides stands beside the word, before any figure."""
    record = made_record(4)
    finding = Finding("shape", level, 1.0, "fx / fy is 2.000 (expected 0.8 to 1.25)", "Look again.")
    judged = replace(record.intrinsics, verdict=Verdict((finding,)))
    text = calibration_page(replace(record, intrinsics=judged))
    head = text[text.index("<header") : text.index("</header>")]
    assert f'<p class="word">{level}</p>' in head
    assert ("fx / fy is 2.000 (expected 0.8 to 1.25)." in head) == is_told


def test_a_question_ends_as_one():
    """A reason that asks something gets no full stop behind its question mark; another one gets its full stop."""
    record = made_record(4)
    reasons = (Rejected("a.png", "is it checkerboard:9x8:25mm?"), Rejected("b.png", "no board found"))
    text = calibration_page(replace(record, calibration=replace(record.calibration, rejected=reasons)))
    assert "<p>Is it checkerboard:9x8:25mm?</p>" in text
    assert "<p>No board found.</p>" in text


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


@pytest.mark.parametrize(("k1", "kind"), [(-0.2, "barrel"), (0.2, "pincushion"), (1e-6, "next to none"), (0.0, "next to none")])
def test_lens_in_words(k1, kind):
    """Kind and shift at the corner, from the cubic r_d = r (1 + k1 r²) solved by its roots."""
    camera = Camera((1001, 801), [[800, 0, 500], [0, 800, 400], [0, 0, 1]], [k1])
    seen = math.hypot(500.5, 400.5) / 800
    roots = np.roots([k1, 0, 1, -seen]) if k1 else np.array([seen])
    ideal = min(root.real for root in roots if abs(root.imag) < 1e-12 and root.real > 0)
    words = lens_words(camera)
    assert words.kind == kind
    assert words.corner_px == pytest.approx(800 * (seen - ideal), abs=1e-6)
    assert words.text.startswith(kind)


def test_lens_that_turns_back_in_words():
    """Where no corner has a ray, the last valid place is told: at the fold, r² = 1 / (3 |k1|), r_d = 2 r / 3."""
    camera = Camera((2001, 2001), [[1000, 0, 1000], [0, 1000, 1000], [0, 0, 1]], [-0.3])
    radius = 1000 * 2 / 3 * math.sqrt(1 / 0.9)
    words = lens_words(camera)
    told = float(re.search(r"(\d+) px from the principal point", words.text)[1])
    step = math.hypot(1000.5, 1000.5) / 200
    assert radius - step - 1 <= told <= radius + 0.5
    assert "moved" in words.text


def test_moustache_in_words():
    """A lens that pushes in near the middle and out farther away."""
    camera = Camera((1001, 1001), [[600, 0, 500], [0, 600, 500], [0, 0, 1]], [-0.2, 0.25])
    assert lens_words(camera).kind == "moustache"


def test_options_and_paths_are_remembered(dataset, tmp_path):
    """What differs from the defaults stands in views.yaml, with the way to each image; a replay takes both over."""
    options = {"distortion": "k1,k2", "refine": "saddle", "anamorphic": True}
    calibrate(dataset / "images", str(dataset / "board.yaml"), tmp_path / "one", **options)
    views, told = load_views_and_options(tmp_path / "one")
    assert told == ("--distortion", "k1,k2", "--refine", "saddle", "--anamorphic")
    assert all((tmp_path / "one" / view.path).resolve() == (dataset / "images" / view.source).resolve() for view in views)
    assert not any(Path(view.path).is_absolute() for view in views)
    calibrate(tmp_path / "one/corners.csv", str(dataset / "board.yaml"), tmp_path / "two", distortion="k1,k2")
    again, told = load_views_and_options(tmp_path / "two")
    assert told == ("--refine", "saddle", "--distortion", "k1,k2")
    assert [view.path for view in again] == [view.path for view in views]


def test_commands_on_the_page_give_the_same_camera(dataset, tmp_path, monkeypatch):
    """Both command lines, typed in the calibration's folder, give camera.yaml bit for bit."""
    calibrate(dataset / "images", str(dataset / "board.yaml"), tmp_path / "calib", distortion="k1,k2", name="left eye")
    monkeypatch.chdir(tmp_path / "calib")
    commands = report_workflow.commands(restore("."))
    lines = [shlex.split(line) for _, line in commands if line.startswith("camcal calibrate")]
    assert len(lines) == 2
    for number, (program, *arguments) in enumerate(lines):
        assert program == "camcal"
        arguments[-1] = f"../again{number}"
        assert main([*arguments, "--no-report"]) == 0
        assert (tmp_path / f"again{number}/camera.yaml").read_bytes() == Path("camera.yaml").read_bytes()


def test_no_report_leaves_no_page_behind(calibrated, dataset, tmp_path):
    """--no-report writes four files, and takes away the page of an earlier run, which would be about another camera."""
    folder = tmp_path / "calib"
    folder.mkdir()
    (folder / "report.html").write_text("about another camera")
    arguments = ["calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", folder]
    assert main([str(argument) for argument in (*arguments, "--no-report", "--force")]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["board.yaml", "camera.yaml", "corners.csv", "views.yaml"]


def test_calibration_without_its_page_loads_no_plotting_library(calibrated, dataset, tmp_path):
    """Matplotlib and jinja2 take their time to import; whoever does without the page does without them."""
    arguments = [
        "calibrate",
        calibrated / "corners.csv",
        "--board",
        dataset / "board.yaml",
        "-o",
        tmp_path / "c",
        "--no-report",
    ]
    script = (
        "import sys; from camcal.cli import main; code = main(sys.argv[1:]);"
        "print(code, 'matplotlib' in sys.modules, 'jinja2' in sys.modules, file=sys.stderr)"
    )
    command = [sys.executable, "-c", script, *(str(argument) for argument in arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "0 False False"


def test_a_page_that_cannot_be_written_does_not_lose_the_calibration(calibrated, dataset, tmp_path, capsys):
    """A folder stands where the page should be: a warning, exit code 0, and all four files."""
    folder = tmp_path / "calib"
    (folder / "report.html").mkdir(parents=True)
    arguments = ["calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", folder, "--force"]
    assert main([str(argument) for argument in arguments]) == 0
    assert "warning: report not complete" in capsys.readouterr().err
    assert (folder / "camera.yaml").read_bytes() == (calibrated / "camera.yaml").read_bytes()


def test_a_bug_in_the_page_is_not_hidden(calibrated, dataset, tmp_path, monkeypatch):
    """An exception that is no user's fault comes through; the camera is written by then."""

    def fail(*_: object) -> str:
        raise RuntimeError("bug")

    monkeypatch.setattr("camcal.report.calibration_page.calibration_page", fail)
    with pytest.raises(RuntimeError, match="bug"):
        calibrate(calibrated / "corners.csv", str(dataset / "board.yaml"), tmp_path / "calib", report=True)
    assert (tmp_path / "calib/camera.yaml").is_file()


@pytest.mark.parametrize("name", ["board.yaml", "corners.csv", "views.yaml", "camera.yaml"])
def test_folder_without_a_file_is_refused(calibrated, tmp_path, capsys, name):
    """One line that names the missing file, exit code 2, and nothing written."""
    shutil.copytree(calibrated, tmp_path / "calib")
    (tmp_path / "calib" / name).unlink()
    assert main(["report", str(tmp_path / "calib")]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1
    assert f"{name}: no such file" in err
    assert not (tmp_path / "calib/report.html").exists()


def test_what_is_no_calibration_is_refused(calibrated, dataset, tmp_path, capsys):
    """No folder, a file, a rendered dataset's truth, and files of two calibrations put together: each in one line, code 2."""
    noisy_file(tmp_path / "seen.csv")
    calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "one")
    calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "two", distortion="k1")
    shutil.copy(tmp_path / "two/camera.yaml", tmp_path / "one/camera.yaml")
    shutil.copytree(calibrated, tmp_path / "three")
    shutil.copy(tmp_path / "two/corners.csv", tmp_path / "three/corners.csv")
    shutil.copytree(calibrated, tmp_path / "four")
    shutil.copy(tmp_path / "two/board.yaml", tmp_path / "three/board.yaml")
    (tmp_path / "four/board.yaml").write_text("type: checkerboard\ncolumns: 3\nrows: 3\nsquare_m: 0.02\n")
    cases = {
        tmp_path / "nowhere": "no such folder",
        calibrated / "camera.yaml": "a file (expected a calibration's folder)",
        dataset: "a camera without its calibration",
        tmp_path / "one": "residuals that camera.yaml and views.yaml do not give",
        tmp_path / "three": "used views without used corners in corners.csv",
        tmp_path / "four": "is not on the board",
    }
    for path, said in cases.items():
        assert main(["report", str(path)]) == 2, path
        err = capsys.readouterr().err
        assert len(err.splitlines()) == 1
        assert said in err


def test_outputs_are_claimed_before_any_work(calibrated, tmp_path, capsys):
    """A page and a folder that exist are kept without --force; a folder of photographs must be there; formats are known."""
    shutil.copytree(calibrated, tmp_path / "calib")
    (tmp_path / "page.html").write_text("mine")
    (tmp_path / "plots").mkdir()
    (tmp_path / "plots/mine.txt").write_text("mine")
    calib = str(tmp_path / "calib")
    for arguments, said in (
        (("-o", tmp_path / "page.html"), "output file exists"),
        (("--plots", tmp_path / "plots"), "output folder is not empty"),
        (("--images", tmp_path / "nowhere"), "no such folder"),
        (("--plots", tmp_path / "new", "--plots-format", "pgn"), "png"),
    ):
        assert main(["report", calib, *map(str, arguments)]) == 2
        assert said in capsys.readouterr().err
    assert (tmp_path / "page.html").read_text() == "mine"
    assert not (tmp_path / "calib/report.html").exists()


def test_calibrate_needs_a_folder_for_its_page(dataset):
    """From Python a page without an output folder is refused before any work."""
    with pytest.raises(Exception, match="needs an output folder"):
        calibrate(dataset / "images", str(dataset / "board.yaml"), report=True)


def test_plots_are_written(calibrated, dataset, tmp_path):
    """`calibrate --plots` writes every figure of the report in the formats asked for."""
    arguments = ["calibrate", calibrated / "corners.csv", "--board", dataset / "board.yaml", "-o", tmp_path / "calib"]
    arguments += ["--no-report", "--plots", tmp_path / "plots", "--plots-format", "png"]
    assert main([str(argument) for argument in arguments]) == 0
    files = sorted(path.relative_to(tmp_path / "plots").as_posix() for path in (tmp_path / "plots").rglob("*.*"))
    views = [f"views/{index:03d}_view_{index:04d}.png" for index in range(8)]
    assert files == sorted([*(f"{kind.name}.png" for kind in FIGURES), *views])
    for file in files:
        assert cv2.imread(str(tmp_path / "plots" / file)).std() > 1, file


def test_plots_have_three_formats_and_are_the_same_each_time(tmp_path, monkeypatch):
    """PNG, SVG and PDF of one figure, each what its name says, and the same bytes again."""
    monkeypatch.setattr("camcal.report.figures.catalogue.FIGURES", FIGURES[-1:])
    save_corners(tmp_path / "seen.csv", detections(poses(3, 4), noise_px=0.1))
    calibrate(tmp_path / "seen.csv", BOARD.spec, tmp_path / "calib")
    starts = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    contents = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        written = write_plots(restore(tmp_path / "calib"), tmp_path / name, ("png", "svg", "pdf"), SilentReporter())
        assert [path.name for path in written[:3]] == [f"{FIGURES[-1].name}.{kind}" for kind in starts]
        contents.append([path.read_bytes() for path in written])
    assert all(content.startswith(start) for content, start in zip(contents[0][:3], starts.values(), strict=True))
    assert contents[0] == contents[1]


def test_record_tells_what_was_asked_for(reported):
    """Board, free parameters and options for people; notes by view."""
    record = record_of(restore(reported))
    assert record.settings["Board"] == "checkerboard:7x6:20mm"
    assert record.settings["Solved for"] == "fx, fy, cx, cy, k1, k2, k3"
    assert record.settings["Options"] == "the defaults"
    assert set(record.notes) <= {seen.source for seen in record.calibration.detections}


def test_verify_writes_a_page(calibrated, dataset, tmp_path, capsys):
    """Passed with gates that hold, failed with its reason where one does not, and compared without any."""
    pages = {}
    for name, gates in {"compared": (), "passed": ("--max-sigma", "6"), "failed": ("--max-diff", "0.0001")}.items():
        code = main(["verify", str(calibrated), "--truth", str(dataset), "--html", str(tmp_path / f"{name}.html"), *gates])
        assert code == (5 if name == "failed" else 0)
        pages[name] = Page((tmp_path / f"{name}.html").read_text(encoding="utf-8"))
        assert pages[name].text["title"] == [f"{calibrated}: {name}"]
    reason = capsys.readouterr().err.strip().removeprefix("camcal: verify: ")
    assert " ".join(reason.split()) in " ".join(pages["failed"].text["body"][0].split())
    assert all(reference["href"].startswith(("#", "data:")) for page in pages.values() for reference in page.all("link"))
    cells = pages["compared"].text["td"]
    assert "520" in cells
    assert "-0.18" in cells


def test_regress_writes_a_page(scene_file, tmp_path):
    """Measured without a baseline; failed, with scenario and figure, against one that is too good."""
    baseline, page = tmp_path / "baseline.json", tmp_path / "page.html"
    assert main(["regress", str(scene_file), "--baseline", str(baseline), "--update-baseline", "--html", str(page)]) == 0
    assert Page(page.read_text(encoding="utf-8")).text["title"] == ["Accuracy: measured"]
    stored = json.loads(baseline.read_text())
    stored["scenarios"]["small"]["corner_rms_px"] /= 2
    baseline.write_text(json.dumps(stored))
    assert main(["regress", str(scene_file), "--baseline", str(baseline), "--html", str(page)]) == 5
    failed = Page(page.read_text(encoding="utf-8"))
    assert failed.text["title"] == ["Accuracy: failed"]
    assert "corner_rms_px is" in failed.text["body"][0]
    assert sum("bad" in attributes.get("class", "") for attributes in failed.all("td")) == 1


def test_page_that_cannot_be_written_is_refused_before_the_work(calibrated, dataset, tmp_path, capsys):
    """A folder stands where the page of a verification should be: code 2."""
    (tmp_path / "page.html").mkdir()
    assert main(["verify", str(calibrated), "--truth", str(dataset), "--html", str(tmp_path / "page.html")]) == 2
    assert "a folder (expected a file to write)" in capsys.readouterr().err


def test_images_without_a_path_of_text_are_not_looked_for(dataset, tmp_path):
    """A folder whose name is no text for a file leaves the path empty instead of wrong."""
    folder = tmp_path / "with\ttab"
    shutil.copytree(dataset / "images", folder)
    calibrate(folder, str(dataset / "board.yaml"), tmp_path / "calib")
    assert {view.path for view in load_views(tmp_path / "calib")} == {""}
    assert os.fspath(folder) not in (tmp_path / "calib/views.yaml").read_text()


@pytest.mark.skipif(sys.platform in {"darwin", "win32"}, reason="file names are Unicode on this system")
def test_images_with_names_of_bytes_are_found_in_a_named_folder(reported, photographed, tmp_path):
    """A name that is not UTF-8 stands in escapes in the files, and `--images` still finds the photograph."""
    folder, calib = tmp_path / "odd", tmp_path / "calib"
    folder.mkdir()
    for image in photographed.glob("view_*.png"):
        shutil.copy(image, os.fsencode(folder) + b"/\xe4 " + os.fsencode(image.name))
    calibrate(folder, str(reported / "board.yaml"), calib)
    assert {view.path for view in load_views(calib)} == {""}
    done = make_report(calib, images=folder)
    assert done.missing == ""
    assert 'alt="Photograph \\xe4 view_' in done.page.read_text(encoding="utf-8")
