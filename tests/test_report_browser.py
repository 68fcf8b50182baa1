"""The pages in a real browser (Debian's chromium): nothing fails, everything shows, the bars lead to their photographs.

Skipped where there is no browser, unless CAMCAL_BROWSER=required.
"""

from __future__ import annotations

import base64
import importlib.util
import io
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from camcal.cli import main
from camcal.report.figures.catalogue import FIGURES

REQUIRED = os.environ.get("CAMCAL_BROWSER") == "required"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
MISSING = [
    name
    for name, there in (("selenium", importlib.util.find_spec("selenium")), ("chromium", CHROMIUM), ("chromedriver", DRIVER))
    if not there
]
pytestmark = pytest.mark.skipif(bool(MISSING) and not REQUIRED, reason=f"no {', '.join(MISSING)} here")

FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--window-size=1200,900"),
)
PHONE_PX = 360


class Browser:
    """A headless browser, asked through the DevTools protocol."""

    def __init__(self, profile: Path) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        options.binary_location = CHROMIUM or ""
        for flag in (*FLAGS, f"--user-data-dir={profile}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service(DRIVER))

    def open(self, page: Path, *, width: int = 1200, phone: bool = False, dark: bool = False) -> None:
        """Load a page on a screen of some width, afresh."""
        metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": phone}
        self.ask("Emulation.setDeviceMetricsOverride", **metrics)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.ask("Emulation.setEmulatedMedia", features=[scheme])
        self.driver.get("about:blank")
        self.driver.get(page.as_uri())

    def ask(self, command: str, **arguments):
        """Send one command of the DevTools protocol."""
        return self.driver.execute_cdp_cmd(command, arguments)

    def run(self, script: str, *arguments):
        """Run a script in the page and return its result."""
        return self.driver.execute_script(script, *arguments)

    def log(self) -> list[str]:
        """What the page complained about since it was asked last."""
        return [entry["message"] for entry in self.driver.get_log("browser")]

    def pictures(self, *selectors: str) -> list[np.ndarray]:
        """Pixels (height, width, 3) of elements, cut from one picture of the whole page."""
        boxes = self.run(
            "return arguments[0].map(s => document.querySelector(s).getBoundingClientRect())"
            ".map(r => [r.x + scrollX, r.y + scrollY, r.width, r.height].map(Math.round))",
            list(selectors),
        )
        width, height = self.run("const e = document.documentElement; return [e.scrollWidth, e.scrollHeight]")
        clip = {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}
        data = self.ask("Page.captureScreenshot", captureBeyondViewport=True, clip=clip)["data"]
        whole = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
        return [whole[y : y + h, x : x + w] for x, y, w, h in boxes]

    def chosen(self) -> list[str]:
        """Ids of the views that can be seen."""
        return self.run("return [...document.querySelectorAll('article.view')].filter(v => v.offsetHeight).map(v => v.id)")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """One browser for all tests."""
    assert not MISSING, f"CAMCAL_BROWSER=required, but there is no {', '.join(MISSING)}"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SE_OFFLINE", "true")
        started = Browser(tmp_path_factory.mktemp("profile"))
        try:
            yield started
        finally:
            started.driver.quit()


@pytest.fixture(scope="module")
def pages(dataset, tmp_path_factory) -> dict[str, Path]:
    """The three kinds of page, of a calibration with a rejected image."""
    folder = tmp_path_factory.mktemp("pages")
    shutil.copytree(dataset / "images", folder / "photos")
    cv2.imwrite(str(folder / "photos/street.png"), np.random.default_rng(0).integers(0, 255, (480, 640), dtype=np.uint8))
    calib, board = folder / "calib", dataset / "board.yaml"
    arguments = ["calibrate", folder / "photos", "--board", board, "-o", calib, "--name", "<script>alert(1)</script>"]
    assert main([str(argument) for argument in arguments]) == 0
    assert main(["verify", str(calib), "--truth", str(dataset), "--html", str(folder / "verify.html")]) == 0
    return {"report": calib / "report.html", "verify": folder / "verify.html"}


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("name", ["report", "verify"])
def test_page_opens_without_complaint(browser, pages, name, dark):
    """Nothing in the console, no script but the page's own, its name as it is called, the scheme that the system asks for."""
    browser.open(pages[name], dark=dark)
    assert browser.log() == []
    assert browser.run("return document.documentElement.className") == "script"
    assert browser.run("return document.scripts.length") == 1
    ground = browser.run("return getComputedStyle(document.body).backgroundColor")
    brightness = sum(int(part) for part in ground.strip("rgb()").split(",")) / 3
    assert (brightness < 64) is dark
    if name == "report":
        assert browser.run("return document.querySelector('h1').textContent") == "<script>alert(1)</script>"


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("name", ["report", "verify"])
def test_every_figure_is_drawn(browser, pages, name, dark):
    """Each has a size, and pixels of several colours that stand out from its ground, on a light and on a dark page."""
    browser.open(pages[name], dark=dark)
    figures = browser.run("return [...document.querySelectorAll('figure.plot')].map(f => f.id)")
    assert len(figures) == (len(FIGURES) if name == "report" else 2)
    pictures = browser.pictures(*(f"#{figure} svg" for figure in figures))
    for figure, picture in zip(figures, pictures, strict=True):
        pixels = picture.astype(int)
        assert min(pixels.shape[:2]) > 100, figure
        ground = np.median(pixels.reshape(-1, 3), axis=0)
        contrast = np.abs(pixels - ground).max(axis=2)
        # Text alone covers some per cent; a figure without data or with ink in the colour of the ground covers less.
        assert (contrast > 64).mean() > 0.01, figure
        assert len(np.unique(pixels.reshape(-1, 3) // 32, axis=0)) > 4, figure


def test_photographs_are_shown(browser, pages):
    """All pictures of the page decode, and the chosen view's are seen with its marks over it."""
    browser.open(pages["report"])
    broken = "return [...document.images].filter(i => !i.complete || !i.naturalWidth).map(i => i.alt)"
    browser.run("document.documentElement.classList.replace('script', 'no-script')")
    assert browser.run(broken) == []
    browser.run("document.documentElement.classList.replace('no-script', 'script')")
    with_marks = browser.pictures(".view.chosen .photo")[0].astype(int)
    browser.run("document.getElementById('marks').click()")
    without = browser.pictures(".view.chosen .photo")[0].astype(int)
    assert with_marks.std() > 10
    changed = (np.abs(with_marks - without).max(axis=2) > 32).mean()
    # 42 dots of 5 px and their residuals on a picture of some 500 x 375 px.
    assert 0.002 < changed < 0.2


def test_a_bar_leads_to_its_photograph(browser, pages):
    """A click on each bar shows its view and no other; at first it is the worst."""
    browser.open(pages["report"])
    order = browser.run("return [...document.querySelectorAll('article.view')].map(v => v.id)")
    assert len(order) == 8
    assert browser.chosen() == order[:1]
    for view in reversed(order):
        bar = f'#figure-view_rms a[href="#{view}"]'
        browser.run("document.querySelector(arguments[0]).scrollIntoView({block: 'center', behavior: 'instant'})", bar)
        x, y = browser.run(
            "const r = document.querySelector(arguments[0]).getBoundingClientRect();"
            "return [r.x + r.width / 2, r.y + r.height / 2]",
            bar,
        )
        for event in ("mousePressed", "mouseReleased"):
            browser.ask("Input.dispatchMouseEvent", type=event, x=x, y=y, button="left", clickCount=1)
        assert browser.chosen() == [view]
        assert browser.run("return document.getElementById('view-choice').value") == view.removeprefix("view-")
    assert browser.log() == []


def test_keys_lead_to_views_too(browser, pages):
    """Enter on a bar that has the focus, the buttons to and fro, the list, and the address of a view."""
    browser.open(pages["report"])
    order = browser.run("return [...document.querySelectorAll('article.view')].map(v => v.id)")
    browser.run("document.querySelector(arguments[0]).focus()", f'#figure-view_rms a[href="#{order[3]}"]')
    for event in ("keyDown", "keyUp"):
        browser.ask("Input.dispatchKeyEvent", type=event, key="Enter", code="Enter", windowsVirtualKeyCode=13, text="\r")
    assert browser.chosen() == [order[3]]
    browser.run("document.getElementById('better').click()")
    assert browser.chosen() == [order[4]]
    browser.run("document.getElementById('worse').click(); document.getElementById('worse').click()")
    assert browser.chosen() == [order[2]]
    number = order[6].removeprefix("view-")
    browser.run(
        "const c = document.getElementById('view-choice'); c.value = arguments[0]; c.dispatchEvent(new Event('change'))", number
    )
    assert browser.chosen() == [order[6]]
    browser.driver.get(f"{pages['report'].as_uri()}#{order[5]}")
    browser.run("location.hash = arguments[0]", order[5])
    assert order[5] in browser.chosen()


def test_button_turns_the_page_dark_and_light(browser, pages):
    """Pressed once on a light system it is dark, then light, then what the system asks for."""
    browser.open(pages["report"])
    grounds = []
    for _ in range(4):
        grounds.append(browser.run("return getComputedStyle(document.body).backgroundColor"))
        browser.run("document.getElementById('theme').click()")
    assert grounds[0] == grounds[2] == grounds[3] != grounds[1]


@pytest.mark.parametrize("name", ["report", "verify"])
def test_page_fits_a_phone(browser, pages, name):
    """On 360 px nothing makes the page wider than the screen, and text is as large as elsewhere."""
    browser.open(pages[name], width=PHONE_PX, phone=True)
    assert browser.run("return [innerWidth, document.documentElement.scrollWidth]") == [PHONE_PX, PHONE_PX]
    assert float(browser.run("return getComputedStyle(document.body).fontSize").removesuffix("px")) >= 14
    drawn_px = browser.run(
        "const text = document.querySelector('figure.plot svg text'); return text.getBoundingClientRect().height"
    )
    assert drawn_px >= 10


@pytest.mark.parametrize("name", ["report", "verify"])
def test_page_prints(browser, pages, name):
    """A PDF of a few pages, none of them empty; every view is printed, and dark pages are printed dark on light."""
    from pypdf import PdfReader

    browser.open(pages[name], dark=True)
    data = browser.ask("Page.printToPDF", printBackground=True, preferCSSPageSize=True)["data"]
    reader = PdfReader(io.BytesIO(base64.b64decode(data)))
    texts = [page.extract_text() for page in reader.pages]
    assert 2 <= len(texts) <= 15
    assert all(len(text.split()) > 5 for text in texts)
    if name == "report":
        printed = "\n".join(texts)
        assert all(f"view_{number:04d}.png" in printed for number in range(8))
    browser.ask("Emulation.setEmulatedMedia", media="print", features=[{"name": "prefers-color-scheme", "value": "dark"}])
    ground = browser.run("return getComputedStyle(document.body).backgroundColor")
    browser.ask("Emulation.setEmulatedMedia", media="")
    assert ground == "rgb(255, 255, 255)"


def test_no_figure_is_cut_in_print(browser, pages):
    """On A4 between its margins every figure is lower than a page, so that none has to be cut."""
    browser.open(pages["report"])
    width, height = (round(side * 96 / 25.4) for side in (210 - 28, 297 - 28))
    self_size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.ask("Emulation.setDeviceMetricsOverride", **self_size)
    browser.ask("Emulation.setEmulatedMedia", media="print")
    heights = browser.run("return [...document.querySelectorAll('figure.plot')].map(f => f.getBoundingClientRect().height)")
    widths = browser.run("return [document.documentElement.scrollWidth, innerWidth]")
    browser.ask("Emulation.setEmulatedMedia", media="")
    assert max(heights) < height
    assert widths[0] <= widths[1]
