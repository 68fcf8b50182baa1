"""Short ways to read and write camcal's own files: the same result as the long way, or none at all."""

from __future__ import annotations

import math
import os
from dataclasses import astuple, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camcal.errors import InputError
from camcal.formats.camera_file import camera_yaml, load_intrinsics, save_intrinsics
from camcal.formats.camera_quick import read_quickly
from camcal.formats.exchange.reading import read_any
from camcal.formats.yaml_dump import dump_yaml
from camcal.formats.yaml_plain import plain_yaml
from camcal.geometry.camera import Camera
from camcal.records import BoardShape, ImageSigma, Intrinsics, Uncertainty
from camcal.verdict import Finding, Verdict

INVALID = sorted((Path(__file__).parent / "data/invalid").glob("*.yaml"))
SIGMA = ImageSigma(0.01, (0.1, 0.2, math.nan, 0.4), (1.0, math.inf, 3.0, 4.0), (0.5, 0.9, 1.0))
FULL = Intrinsics(
    Camera((640, 480), [[520.1, 0, 322], [0, 523, 236], [0, 0, 1]], [-0.18, 0.06, 1e-5, 0, 1e-300, 0.1, 0.02, 0.003]),
    name="front",
    board="checkerboard:7x6:20mm",
    free=("fx", "cy", "k1"),
    covariance=np.array([[4.0, 1.0, 0.1], [1.0, 9.0, 0.3], [0.1, 0.3, 0.25]]) * 1e-3,
    rms_px=0.25,
    views=8,
    corners=336,
    shape=BoardShape(("bow_x", "stretch"), np.array([1e-6, -2e-7]), np.diag([1e-12, 1e-14])),
    uncertainty=Uncertainty(0.34, SIGMA, SIGMA),
    cross_validation=1.02,
    verdict=Verdict((Finding("few_views", "usable", 1.5, "8 views, fewer than 10", "Take more."),)),
)
KNOWN = {
    "full": FULL,
    "truth": Intrinsics(Camera((64, 48), [[50, 0.1, 31], [0, 50, 24], [0, 0, 1]])),
    "no lens": Intrinsics(Camera((64, 48), [[50, 0, 31], [0, 50, 24], [0, 0, 1]]), verdict=Verdict()),
    "unknown sigma": replace(FULL, covariance=np.full((3, 3), np.nan)),
    "umlaut": replace(FULL, name="Süd"),
    "quoted": replace(FULL, name='a "b" \\ c'),
}


def parts(known: Intrinsics) -> list[object]:
    """Everything in it, comparable; NaN equals NaN."""
    shape = known.shape
    arrays = (known.camera.intrinsics, known.covariance, shape.values, shape.covariance)
    return [
        known.camera.size,
        *(repr(array.tolist()) for array in arrays),
        *(known.name, known.board, known.free, known.views, known.corners, shape.names, known.verdict),
        *map(repr, (known.rms_px, known.cross_validation, known.uncertainty and astuple(known.uncertainty))),
    ]


def check_same_or_none(path: Path) -> bool:
    """The short way gives nothing, or what the long way gives; tell which."""
    quick = read_quickly(path)
    if quick is not None:
        assert parts(quick) == parts(read_any(path))
    return quick is not None


@pytest.mark.parametrize("name", KNOWN)
def test_camera_files_of_our_own(tmp_path, name):
    """Every kind of file that is written is read alike both ways; plain ones the short way."""
    save_intrinsics(tmp_path / "c.yaml", KNOWN[name])
    assert check_same_or_none(tmp_path / "c.yaml") == (name not in {"unknown sigma", "quoted"})
    assert parts(load_intrinsics(tmp_path / "c.yaml")) == parts(read_any(tmp_path / "c.yaml"))


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_invalid_files_are_for_the_long_way(path):
    """No file that is refused is read the short way."""
    try:
        read_any(path)
    except InputError:
        assert read_quickly(path) is None
    else:
        check_same_or_none(path)


@pytest.mark.parametrize(
    "make", [lambda _: "/dev/zero", lambda f: f, lambda f: f / "gone.yaml", lambda f: os.mkfifo(f / "p") or f / "p"]
)
def test_what_is_no_file(tmp_path, make):
    """Devices and pipes, which never end, folders and missing files are for the long way."""
    assert read_quickly(Path(make(tmp_path))) is None


TEXT = camera_yaml(FULL)
CHARACTERS = st.sampled_from([*" \n\t#:-+.,[]{}\"'\\&*!|>%@`~?0123456789eEnxaf_", "é", "\0", "\r", "\ufeff"])


@settings(max_examples=400, deadline=None)
@given(st.data())
def test_damaged_files(tmp_path_factory, data):
    """Whatever characters are replaced, put in or taken out: nothing, or the same as the long way."""
    text = TEXT
    for _ in range(data.draw(st.integers(1, 2))):
        at = data.draw(st.integers(0, len(text)))
        end = at + data.draw(st.sampled_from([0, 1, 1, 1, 2, 30]))
        text = text[:at] + "".join(data.draw(st.lists(CHARACTERS, max_size=2))) + text[end:]
    path = tmp_path_factory.getbasetemp() / "damaged.yaml"
    path.write_text(text, newline="")
    check_unless_refused(path)


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_rearranged_files(tmp_path_factory, data):
    """Whatever lines are left out, doubled, moved or indented: nothing, or the same as the long way."""
    lines = TEXT.splitlines()
    at, to = (data.draw(st.integers(2, len(lines) - 1)) for _ in range(2))
    line = lines[at]
    match data.draw(st.sampled_from(["out", "twice", "moved", "in", "back", "item"])):
        case "out":
            del lines[at]
        case "twice":
            lines.insert(to, line)
        case "moved":
            lines.insert(to, lines.pop(at))
        case "in":
            lines[at] = f"  {line}"
        case "back":
            lines[at] = line.removeprefix("  ")
        case "item":
            lines[at] = f"- {line}"
    path = tmp_path_factory.getbasetemp() / "rearranged.yaml"
    path.write_text("\n".join(lines) + "\n")
    check_unless_refused(path)


def check_unless_refused(path: Path) -> None:
    """A file that the long way refuses is none for the short way."""
    try:
        read_any(path)
    except InputError:
        assert read_quickly(path) is None
    else:
        check_same_or_none(path)


NUMBERS = st.one_of(st.integers(-(10**12), 10**12), st.floats(), st.booleans(), st.none())
SCALARS = st.one_of(NUMBERS, st.text(max_size=20), st.sampled_from(["9x6", "a: b", "2024-01-01", "", " x "]))
LISTS = st.lists(st.one_of(SCALARS, st.lists(NUMBERS, max_size=3)), max_size=4)
KEYS = st.one_of(st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,6}", fullmatch=True), st.sampled_from(["no", "y", "null", "True"]))
ITEMS = st.lists(st.dictionaries(KEYS, st.one_of(SCALARS, LISTS), min_size=1, max_size=3), max_size=3)
MAPPINGS = st.dictionaries(KEYS, st.one_of(SCALARS, LISTS, ITEMS, st.dictionaries(KEYS, st.one_of(SCALARS, ITEMS), max_size=3)))


@settings(max_examples=300, deadline=None)
@given(MAPPINGS, st.sampled_from(["", "One line.", "Two\nlines."]))
def test_plain_yaml_is_what_the_long_way_writes(mapping, heading):
    """Byte for byte, or nothing."""
    plain = plain_yaml(mapping, heading)
    assert plain is None or plain == dump_yaml(mapping, heading)


@pytest.mark.parametrize("name", ["full", "truth", "no lens", "unknown sigma"])
def test_our_own_files_are_plain(monkeypatch, name):
    """Camera files are written the short way, with the bytes of the long one."""
    short = camera_yaml(KNOWN[name])
    monkeypatch.setattr("camcal.formats.yaml_dump.dump_yaml", lambda *_: pytest.fail("not plain"))
    assert camera_yaml(KNOWN[name]) == short
    monkeypatch.undo()
    monkeypatch.setattr("camcal.formats.camera_file.plain_yaml", lambda *_: None)
    assert camera_yaml(KNOWN[name]) == short
