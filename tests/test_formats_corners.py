"""corners.csv: every corner exactly as it was, from our own runs and from other detectors."""

from __future__ import annotations

import csv
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camcal.errors import InputError
from camcal.formats.corners_file import HEADER, load_corner_table, load_corners, save_corners
from camcal.observations import Detection

# Carriage returns never get into a name: images are named on one line.
NAMES = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\x00\r"), min_size=1, max_size=20)


def detection(source: str, count: int, seed: int = 0, size: tuple[int, int] = (640, 480)) -> Detection:
    """A view with some ids left out."""
    rng = np.random.default_rng(seed)
    ids = np.sort(rng.choice(2 * count, count, replace=False))
    return Detection(source, size, ids, rng.uniform(0, 479, (count, 2)), rng.uniform(0.01, 1, count))


def same(one: Detection, other: Detection) -> bool:
    """Whether two detections are equal bit for bit."""
    arrays = all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in ("ids", "corners_px", "sigma_px"))
    return arrays and (one.source, one.size) == (other.source, other.size)


@st.composite
def detections(draw: st.DrawFn) -> Detection:
    """Any view of any name, with corners anywhere in the image and some unknown standard deviations."""
    ids = sorted(draw(st.sets(st.integers(0, 1000), min_size=1, max_size=8)))
    width, height = draw(st.integers(1, 9999)), draw(st.integers(1, 9999))
    inside = st.tuples(st.floats(-0.5, width - 0.5), st.floats(-0.5, height - 0.5))
    corners = draw(st.lists(inside, min_size=len(ids), max_size=len(ids)))
    sigma = draw(st.lists(st.floats(1e-6, 1e3) | st.just(float("nan")), min_size=len(ids), max_size=len(ids)))
    return Detection(draw(NAMES), (width, height), ids, corners, sigma)  # type: ignore[arg-type]


@settings(deadline=None)
@given(st.lists(detections(), min_size=1, max_size=5, unique_by=lambda seen: seen.source))
def test_replay_is_bit_exact(tmp_path_factory: pytest.TempPathFactory, given_: list[Detection]) -> None:
    """Names with commas, quotes and line breaks, and the bits of every number, come back sorted by name."""
    path = tmp_path_factory.mktemp("corners") / "corners.csv"
    save_corners(path, given_)
    found = load_corners(path)
    expected = sorted(given_, key=lambda seen: seen.source)
    assert len(found) == len(expected)
    assert all(map(same, found, expected))


def test_residuals_and_use_come_back(tmp_path: Path) -> None:
    """What a solve adds is read back bit for bit, and `only_used` keeps its choice."""
    seen = [detection("a.png", 6, 1), detection("b.png", 4, 2), detection("c.png", 3, 3)]
    residuals = [np.random.default_rng(4).normal(size=(len(view), 2)) for view in seen]
    residuals[1][2] = np.nan
    used = [np.array([True, False, True, True, True, True]), np.ones(4, dtype=bool), np.zeros(3, dtype=bool)]
    save_corners(tmp_path / "corners.csv", seen, residuals, used)
    table = load_corner_table(tmp_path / "corners.csv")
    for index in range(3):
        assert table.residuals_px[index].tobytes() == residuals[index].tobytes()
        assert table.used[index].tolist() == used[index].tolist()
    assert all(map(same, load_corners(tmp_path / "corners.csv"), seen))
    first, second = load_corners(tmp_path / "corners.csv", only_used=True)
    assert first.ids.tolist() == seen[0].ids[used[0]].tolist()
    assert first.corners_px.tolist() == seen[0].corners_px[used[0]].tolist()
    assert same(second, seen[1])


def test_layout_for_spreadsheets(tmp_path: Path) -> None:
    """A header, one corner a line, shortest exact numbers, empty cells for what is not known, and plain line ends."""
    view = Detection("a,b.png", (640, 480), [3], [[0.1, 1 / 3]], [np.nan])  # type: ignore[arg-type]
    save_corners(tmp_path / "corners.csv", [view])
    expected = 'image,width,height,id,x,y,sigma,residual_x,residual_y,used\n"a,b.png",640,480,3,0.1,0.3333333333333333,,,,1\n'
    assert (tmp_path / "corners.csv").read_bytes() == expected.encode()
    with (tmp_path / "corners.csv").open(newline="") as stream:
        assert next(iter(csv.DictReader(stream))).keys() == set(HEADER)


def test_files_of_other_detectors_are_read(tmp_path: Path) -> None:
    """Only six columns are needed, in any order, with others between, rows in any order, a BOM, CRLF and blank lines."""
    rows = [
        "y,x,id,score,image,height,width",
        "2.5,1.5,7,0.9,b.png,480,640",
        "",
        "4,3,2,0.8,b.png,480,640",
        "1,0,0,1,a.png,48,64",
    ]
    path = tmp_path / "theirs.csv"
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join([*rows, "", ""]).encode())
    first, second = load_corners(path)
    assert (first.source, first.size, first.ids.tolist(), first.corners_px.tolist()) == ("a.png", (64, 48), [0], [[0, 1]])
    assert (second.source, second.size, second.ids.tolist()) == ("b.png", (640, 480), [2, 7])
    assert second.corners_px.tolist() == [[3, 4], [1.5, 2.5]]
    assert np.isnan(second.sigma_px).all()
    assert load_corner_table(path).used[1].tolist() == [True, True]


def test_line_of_a_fault_counts_lines_within_quotes(tmp_path: Path) -> None:
    """A name with a line break moves every line below it."""
    path = tmp_path / "corners.csv"
    path.write_text('image,width,height,id,x,y\n"a\nb.png",640,480,0,1,2\nc.png,640,480,0,1,oops\n')
    with pytest.raises(InputError, match=r"corners\.csv:4: y: not a number \(got 'oops'\)"):
        load_corners(path)


@pytest.mark.parametrize("name", ["missing.csv", "."])
def test_unreadable_paths_are_input_errors(tmp_path: Path, name: str) -> None:
    """A missing file and a folder are told as such."""
    with pytest.raises(InputError, match=r"no such file|a folder"):
        load_corners(tmp_path / name)


def test_two_hundred_thousand_corners_take_seconds_at_most(tmp_path: Path) -> None:
    """Work grows with the number of corners only: 1000 views of 200 corners."""
    seen = [detection(f"{index:04d}.png", 200, index) for index in range(1000)]
    save_corners(tmp_path / "corners.csv", seen)
    started = time.process_time()
    found = load_corners(tmp_path / "corners.csv")
    # A second on the slowest machine seen; anything quadratic would take hours.
    assert time.process_time() - started < 10
    assert all(map(same, found, seen))


@pytest.mark.parametrize(("x", "y", "column"), [("641.6", "10", "x"), ("-3", "10", "x"), ("10", "482", "y")])
def test_corners_outside_their_image_are_refused(tmp_path: Path, x: str, y: str, column: str) -> None:
    """Width and height swapped, or another image's size: the line and the column are named. A pixel beyond the frame passes."""
    path = tmp_path / "corners.csv"
    path.write_text(f"image,width,height,id,x,y\na.png,640,480,0,640.2,479.9\na.png,640,480,1,{x},{y}\n")
    with pytest.raises(InputError, match=rf"corners\.csv:3: {column}: outside the image"):
        load_corners(path)
