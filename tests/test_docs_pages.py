"""The pages in docs/: commands parse or run, code runs, links and anchors lead somewhere, nothing is left out."""

from __future__ import annotations

import ast
import importlib.util
import inspect
import re
import shlex
import shutil
from pathlib import Path
from types import ModuleType
from urllib.parse import urlsplit

import click
import cv2
import numpy as np
import pytest
import skimage.io
from every_command import COMMANDS

import camcal
from camcal.cli import cli, main
from camcal.formats.scenario_file import load_scenario
from camcal.report.calibration_page import GROUPS
from camcal.resources import config_names, sample_board_names
from camcal.verdict import LEVELS

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = {
    str(path.relative_to(DOCS)): path.read_text(encoding="utf-8")
    for path in DOCS.rglob("*.md")
    if "_generated" not in str(path)
}


def blocks(page: str, language: str) -> list[str]:
    """Contents of the fenced blocks of a language, their common indentation taken off."""
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```$", PAGES[page], flags=re.MULTILINE | re.DOTALL)
    return [re.sub(rf"^{indent}", "", body, flags=re.MULTILINE) for indent, body in found]


def commands(page: str) -> list[list[str]]:
    """Arguments of every command that a page shows."""
    lines = [line for block in blocks(page, "console") for line in block.splitlines() if line.startswith("$ ")]
    return [shlex.split(line.removeprefix("$ camcal ")) for line in lines]


def text_of(page: str) -> str:
    """A page without its blocks of code."""
    return re.sub(r"^ *```.*?^ *```$", "", PAGES[page], flags=re.MULTILINE | re.DOTALL)


def anchors(page: str) -> set[str]:
    """What a link may name after `#`: the headings as GitHub and MyST write them."""
    headings = re.findall(r"^#{1,3} +(.+)$", text_of(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def script(name: str) -> ModuleType:
    """Import a script of the documentation."""
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_there_are_pages():
    """The index leads to every page."""
    listed = {
        f"{name}.md" for block in blocks("index.md", "{toctree}") for name in block.split() if "/" in name or name.isalpha()
    }
    assert set(PAGES) - {"index.md"} <= listed


@pytest.mark.parametrize("page", sorted(PAGES))
def test_links_lead_somewhere(page):
    """Relative links are files and headings that exist, figures are drawn; others are well-formed addresses."""
    drawn = script("figures")
    figures = {*drawn.FIGURES, *(f"report-{name}" for name in drawn.REPORT_FIGURES)}
    for target in re.findall(r"\]\(([^)\s]+)\)", text_of(page)):
        if "://" in target:
            parts = urlsplit(target)
            assert parts.scheme == "https", target
            assert "." in parts.netloc, target
            continue
        name, _, anchor = target.partition("#")
        path = (DOCS / page).parent / name if name else DOCS / page
        if "_generated/figures" in target:
            assert path.stem in figures, target
            continue
        assert path.exists(), target
        if anchor:
            assert anchor in anchors(str(path.resolve().relative_to(DOCS))), target


@pytest.mark.parametrize("page", sorted(page for page in PAGES if commands(page)))
def test_commands_parse(page, tmp_path, monkeypatch):
    """Every command shown is one that there is, with options that it has and values that they take."""
    monkeypatch.chdir(tmp_path)
    for name, *arguments in commands(page):
        with click.Context(cli, info_name="camcal") as parent:
            COMMANDS[name].make_context(name, arguments, parent=parent).close()


@pytest.mark.parametrize("page", sorted(PAGES))
def test_options_named_in_the_text_exist(page):
    """Every `--option` that a page names is one of some command."""
    known = {
        name for command in COMMANDS.values() for option in command.params for name in (*option.opts, *option.secondary_opts)
    }
    for code in re.findall(r"`([^`]+)`", text_of(page)):
        for name in re.findall(r"(?<!\S)--[a-z][a-z-]*", code):
            assert name in known, name


def test_the_tutorial_runs(tmp_path, monkeypatch, capsys):
    """Its commands, in order, in one folder; then its Python; the files that it names are there."""
    monkeypatch.chdir(tmp_path)
    for arguments in commands("tutorial.md"):
        assert main(arguments) == 0, f"{arguments}\n{capsys.readouterr().err}"
    for name in re.findall(r"^- `([\w.]+)`:", PAGES["tutorial.md"], flags=re.MULTILINE):
        assert (tmp_path / "calib" / name).is_file(), name
    given = {"points": np.array([[0.1, 0.1, 1.0]]), "rvec": np.zeros(3), "tvec": np.zeros(3)}
    for block in blocks("tutorial.md", "python"):
        exec(block, given)
    np.testing.assert_allclose(given["rays"], given["points"], atol=1e-9)


def test_maps_are_read_as_the_page_says(tmp_path, monkeypatch):
    """What is in maps.npz goes into cv2.remap; OpenCV does not read maps.tiff, whose two channels are the same."""
    monkeypatch.chdir(tmp_path)
    camera = camcal.Camera((64, 48), [[52, 0, 32.2], [0, 52.3, 23.6], [0, 0, 1]], [-0.18, 0.06])
    image = np.random.default_rng(0).integers(0, 255, (48, 64), dtype=np.uint8)
    Path("photos").mkdir()
    cv2.imwrite("photos/a.png", image)
    camcal.undistort("photos", camera, "undistorted", maps=True)
    maps = np.load("undistorted/maps.npz")
    straight = cv2.remap(image, maps["map_x"], maps["map_y"], cv2.INTER_LINEAR)
    written = cv2.imread("undistorted/a.png", cv2.IMREAD_UNCHANGED)
    assert np.abs(straight.astype(int) - written).max() <= 8  # positions in 1/32 of a pixel
    assert cv2.imread("undistorted/maps.tiff", cv2.IMREAD_UNCHANGED) is None
    pair = skimage.io.imread("undistorted/maps.tiff")
    np.testing.assert_array_equal(pair, np.dstack([maps["map_x"], maps["map_y"]]))


def test_the_tutorial_reads_the_whole_report():
    """Every section of the report has a word in bold."""
    for label, _, _ in GROUPS.values():
        assert f"**{label}" in PAGES["tutorial.md"], label


@pytest.mark.parametrize("page", sorted(page for page in PAGES if blocks(page, "python") and page != "tutorial.md"))
def test_python_runs(page, calibrated, tmp_path, monkeypatch):
    """The blocks of a page are one program, which may find a calibration in `calib`."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(calibrated, tmp_path / "calib")
    given: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(block, given)


def test_opencv_reads_what_the_page_says(calibrated, tmp_path, monkeypatch):
    """The block for OpenCV gives the camera that camcal reads."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(calibrated, tmp_path / "calib")
    given: dict[str, object] = {"cv2": cv2}
    exec(blocks("howto/moving.md", "python")[0], given)
    camera = camcal.load_camera("calib")
    np.testing.assert_array_equal(given["K"], camera.K)
    np.testing.assert_array_equal(np.ravel(given["dist"]), camera.dist[:5])


def test_scenarios_shown_are_valid(tmp_path):
    """The scenario of the page on CI is one."""
    (shown,) = [block for block in blocks("howto/ci.md", "yaml") if block.startswith("name:")]
    (tmp_path / "my_camera.yaml").write_text(shown)
    assert load_scenario(tmp_path / "my_camera.yaml").camera.size == (1920, 1200)


def test_every_finding_is_explained():
    """The codes that the checks give are those of the page; levels are levels."""
    codes = set()
    for path in sorted(Path(inspect.getfile(camcal)).parent.joinpath("trust").glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Finding":
                codes.add(ast.literal_eval(node.args[0]))
    rows = re.findall(r"^\| `(\w+)` \| ([^|]+) \|", PAGES["reference/findings.md"], flags=re.MULTILINE)
    assert sorted(code for code, _ in rows) == sorted(codes)
    for code, levels in rows:
        assert set(re.split(r", | to ", levels)) <= set(LEVELS), code


def test_every_public_name_is_in_the_reference():
    """The Python page shows each, and nothing that there is not."""
    shown = re.findall(
        r"^\.\. auto(?:function|class|exception):: (camcal\.[\w.]+)", PAGES["reference/python.md"], flags=re.MULTILINE
    )
    assert {f"camcal.{name}" for name in camcal.__all__ if name != "__version__"} <= set(shown)
    for name in shown:
        module, _, member = name.rpartition(".")
        assert hasattr(importlib.import_module(module), member), name


def test_generated_tables_tell_what_there_is(tmp_path):
    """Each key of each file, every format, scenario and board, read off the code."""
    script("generated").main(tmp_path)
    parts = {path.stem: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()}
    assert {name for page in PAGES.values() for name in re.findall(r"_generated/(\w+)\.md", page)} == set(parts)
    for part, names in (
        ("camera", ("image_width", "camcal.uncertainty.at_range.centre_px", "camcal.findings[].code")),
        ("views", ("views[].reason", "views[].R")),
        ("board", ("square_m", "gap_m")),
        ("synth", ("camera.distortion.k1", "sensor.gamma")),
        ("formats", ("kalibr", "colmap")),
        ("scenarios", config_names()),
        ("boards", sample_board_names()),
    ):
        for name in names:
            assert f"`{name}`" in parts[part], (part, name)


@pytest.mark.parametrize("name", ["lens", "uncertainty"])
def test_figures_are_the_same_every_time(name, tmp_path):
    """Drawn twice, a figure has the same bytes: nothing in it is random or dated."""
    for path in (tmp_path / "first.svg", tmp_path / "second.svg"):
        script("figures").write(name, path)
    assert (tmp_path / "first.svg").read_bytes() == (tmp_path / "second.svg").read_bytes()
