"""YAML read with its lines and written for three loaders."""

from __future__ import annotations

import math
import struct
import time
import tracemalloc
from pathlib import Path
from typing import Any

import cv2
import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from camcal.errors import InputError
from camcal.formats.validation import Number, Schema, validate
from camcal.formats.yaml_dump import dump_yaml
from camcal.formats.yaml_io import load_yaml

# Text as FileStorage can hold it: printable, and shorter than its 4096 bytes.
TEXT = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), max_size=60)
KEYS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,20}", fullmatch=True)
FLOATS = st.floats()
LEAVES = st.one_of(FLOATS, st.integers(-(2**31), 2**31 - 1), TEXT, st.booleans(), st.none())
NESTED = st.recursive(
    LEAVES, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4), max_leaves=20
)


def read(tmp_path: Path, text: str) -> dict[str, Any]:
    """Content of a YAML text."""
    path = tmp_path / "some.yaml"
    path.write_text(text, encoding="utf-8")
    return load_yaml(path).data


def same(one: Any, other: Any) -> bool:
    """Whether two pieces of plain data are equal, types and the bits of floats (any NaN for any NaN) included."""
    if type(one) is not type(other):
        return False
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):
        return (math.isnan(one) and math.isnan(other)) or struct.pack("d", one) == struct.pack("d", other)
    return bool(one == other)


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    """Every key path knows the line it stands on; one that is not there has the line of what is around it."""
    path = tmp_path / "lines.yaml"
    path.write_text("# comment\na: 1\nb:\n  - x: [1,\n        2]\n  - y: 2\n")
    document = load_yaml(path)
    assert document.data == {"a": 1, "b": [{"x": [1, 2]}, {"y": 2}]}
    expected = {("a",): 2, ("b",): 3, ("b", 0): 4, ("b", 0, "x", 0): 4, ("b", 0, "x", 1): 5, ("b", 1, "y"): 6, ("b", 1, "z"): 6}
    assert {key: document.line(key) for key in expected} == expected
    assert str(document.error(("b", 0, "x", 1), "wrong")) == f"{path}:5: b[0].x[1]: wrong"


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-5", 1e-5),
        ("-1.5E+3", -1500.0),
        (".5", 0.5),
        ("5.", 5.0),
        ("+7", 7),
        ("010", 10),
        (".nan", math.nan),
        ("-.inf", -math.inf),
        ("9x6", "9x6"),
        ("12:30", "12:30"),
        ("2024-05-01", "2024-05-01"),
        ("yes", "yes"),
        ("'5'", "5"),
        ('"1e-5"', "1e-5"),
        ("!!str 5", "5"),
        ("!!float 5", 5),
        ("~", None),
        ("", None),
        ("True", True),
        ("9" * 5000, math.inf),
    ],
)
def test_scalars_resolve_by_the_core_schema(tmp_path: Path, text: str, value: object) -> None:
    """Numbers are numbers however they are written; what only YAML 1.1 takes for something else stays text."""
    assert same(read(tmp_path, f"a: {text}\n")["a"], value)


def test_aliases_are_written_out(tmp_path: Path) -> None:
    """An alias to a complete value reads as that value."""
    assert read(tmp_path, "a: &k [1, 2]\nb: *k\nc: {d: *k}\n") == {"a": [1, 2], "b": [1, 2], "c": {"d": [1, 2]}}


def test_byte_order_mark_and_crlf_are_tolerated(tmp_path: Path) -> None:
    """Files saved on Windows read the same."""
    path = tmp_path / "windows.yaml"
    path.write_bytes(b"\xef\xbb\xbfa: 1\r\nb: x\r\n")
    assert load_yaml(path).data == {"a": 1, "b": "x"}


def test_opencv_4_header_and_tags_are_tolerated(tmp_path: Path) -> None:
    """What OpenCV 4 writes is no YAML, but its meaning is plain."""
    text = "%YAML:1.0\n---\nK: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: d\n   data: [ 1., 2. ]\n"
    assert read(tmp_path, text) == {"K": {"rows": 1, "cols": 2, "dt": "d", "data": [1.0, 2.0]}}


@pytest.mark.parametrize(
    "text",
    [
        "a: [" + "1," * 4_000_000 + "]\n",
        "a: " + "[" * 4_000_000,
        "a: " + "{b: " * 1_000_000,
        "a:\n" + "".join(" " * depth + "-\n" for depth in range(1, 2000)),
        "? " * 1_000_000,
        "a: 'x\n" * 500_000,
        "&a " * 100_000,
        "a: " + "!x " * 100_000,
        "".join(f"k{i}: 1\n" for i in range(600_000)),
    ],
    ids=["long", "open lists", "open mappings", "blocks", "complex keys", "quotes", "anchors", "tags", "keys"],
)
def test_hostile_files_are_refused_quickly(tmp_path: Path, text: str) -> None:
    """Millions of brackets, values or keys end in one message, not in a crash, and within seconds."""
    path = tmp_path / "hostile.yaml"
    path.write_text(text)
    started = time.process_time()
    with pytest.raises(InputError, match=r"hostile\.yaml:\d+: "):
        load_yaml(path)
    # The values that are allowed take 2 s on a loaded machine; reading on to the end, many times that.
    assert time.process_time() - started < 10


def test_too_big_a_file_is_not_even_read(tmp_path: Path) -> None:
    """A file of a gigabyte is refused by its size."""
    path = tmp_path / "big.yaml"
    with path.open("wb") as stream:
        stream.truncate(1_000_000_000)
    tracemalloc.start()
    with pytest.raises(InputError, match="too big"):
        load_yaml(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 1_000_000


@pytest.mark.parametrize("name", ["missing.yaml", ".", "a/b/c.yaml", "x" * 300])
def test_unreadable_paths_are_input_errors(tmp_path: Path, name: str) -> None:
    """Missing files, folders and impossible names are told as such."""
    with pytest.raises(InputError, match=r"no such file|a folder|cannot be read"):
        load_yaml(tmp_path / name)


class Inner(Schema):
    """A nested model."""

    tilt_deg: Number = 0.0


class Outer(Schema):
    """A model."""

    count: int
    inner: list[Inner] = []  # noqa: RUF012 - pydantic copies it


def test_misspelt_key_is_told_before_the_missing_one(tmp_path: Path) -> None:
    """A typo in a nested list is told with its line and the nearest key; numeric text is a number."""
    path = tmp_path / "typo.yaml"
    path.write_text("coun: 1\ninner:\n  - tilt_deg: '1e-5'\n  - tilt_dgs: 2\n")
    with pytest.raises(InputError, match=r"typo.yaml:1: coun: unknown key .* Did you mean 'count'\? \(and 2 more\)$"):
        validate(load_yaml(path), Outer)
    path.write_text("count: '3'\ninner:\n  - tilt_deg: '1e-5'\n  - tilt_dgs: 2\n")
    with pytest.raises(InputError, match=r":4: inner\[1\]\.tilt_dgs: unknown key .* Did you mean 'tilt_deg'\?$"):
        validate(load_yaml(path), Outer)
    path.write_text("count: '3'\ninner:\n  - tilt_deg: '1e-5'\n")
    assert validate(load_yaml(path), Outer).inner[0].tilt_deg == 1e-5


@settings(deadline=None)
@given(st.dictionaries(KEYS, NESTED, max_size=5))
def test_what_is_written_is_read_back(tmp_path_factory: pytest.TempPathFactory, content: dict[str, Any]) -> None:
    """Our reader and PyYAML's safe loader both return what was written, floats bit for bit."""
    text = dump_yaml(content, "A heading: with a colon\nand a second line")
    assert same(yaml.safe_load(text), content)
    assert same(read(tmp_path_factory.mktemp("yaml"), text), content)


@settings(deadline=None)
@example(values=[0.0], text="\xa0\U0001f600 '\" \\ #: - ", entries=[0.0])
@given(values=st.lists(FLOATS, min_size=1, max_size=20), text=TEXT, entries=st.lists(FLOATS, min_size=1, max_size=3))
def test_file_storage_reads_what_is_written(values: list[float], text: str, entries: list[float]) -> None:
    """cv2.FileStorage reads floats bit for bit, text as it was, nothing as nothing, and lists of mappings."""
    content = {
        "values": values,
        "rows": [values, values],
        "text": text,
        "nothing": None,
        "empty": [],
        "none": {},
        "flag": True,
        "views": [{"file": text, "rms_px": value, "R": [[value]]} for value in entries],
    }
    storage = cv2.FileStorage(dump_yaml(content, "heading: x"), cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    node = storage.getNode("values")
    assert same([node.at(i).real() for i in range(node.size())], values)
    assert same([storage.getNode("rows").at(1).at(i).real() for i in range(len(values))], values)
    assert storage.getNode("text").string() == text
    assert storage.getNode("nothing").isNone()
    assert storage.getNode("empty").size() == 0
    assert storage.getNode("none").size() == 0
    views = storage.getNode("views")
    assert [views.at(i).getNode("file").string() for i in range(views.size())] == [text] * len(entries)
    assert same([views.at(i).getNode("rms_px").real() for i in range(views.size())], entries)
    assert same([views.at(i).getNode("R").at(0).at(0).real() for i in range(views.size())], entries)


def test_layout_is_what_the_loaders_need() -> None:
    """Header, no tags, quoted text, lists on one line or indented under their key, floats with a point."""
    text = dump_yaml({"a": "0001.png", "b": [1e-05, (1, 2)], "c": [{"d": None}], "e": {"f": True}}, "for people")
    assert text == (
        "%YAML 1.2\n---\n# for people\n"
        'a: "0001.png"\nb: [1.0e-05, [1, 2]]\nc:\n  - d: null\ne:\n  f: true\n'
    )  # fmt: skip


def test_equal_lists_are_not_aliased() -> None:
    """A list that appears twice is written twice: FileStorage knows no aliases."""
    row = [1.0, 2.0]
    assert "&" not in dump_yaml({"a": row, "b": row})


@pytest.mark.parametrize("key", ["two words", "1st", "a-b", "", "é"])
def test_keys_must_be_identifiers(key: str) -> None:
    """A key that FileStorage could not read is a mistake of ours."""
    with pytest.raises(ValueError, match="identifiers"):
        dump_yaml({key: 1})
