"""The report's page: what it says, that it needs nothing but itself, and how large it may become."""

from __future__ import annotations

import base64
import hashlib
import itertools
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
import yaml
from report_pages import NAME, ODD_IMAGE, Page
from scenes import BOARD, detections, poses

from camcal.calibration.solve import solve
from camcal.formats.camera_file import load_intrinsics
from camcal.formats.views_file import load_views
from camcal.observations import Rejected
from camcal.report.calibration_page import Making, calibration_page
from camcal.report.figures.catalogue import FIGURES
from camcal.report.record import Record
from camcal.trust.assess import assess
from camcal.verdict import Finding, Verdict
from camcal.workflows.calibrate import _intrinsics
from camcal.workflows.photographs import photographs
from camcal.workflows.reporting import SilentReporter

MEGABYTE = 1_000_000


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
