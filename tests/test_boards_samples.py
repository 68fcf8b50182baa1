"""The ready-to-print boards: what is stored is what camcal prints. Run this file to print and store them again."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from pypdf import PdfReader

from camcal import resources
from camcal.boards.printing import print_board
from camcal.boards.samples import SAMPLES
from camcal.boards.spec import parse_board
from camcal.errors import InputError
from camcal.formats.board_file import load_board, save_board

STORED = Path(__file__).resolve().parent.parent / "sample_boards"
NUMBER = re.compile(r"-?\d+\.?\d*")


def regenerate(folder: Path) -> None:
    """Print every sample board into a folder, with its YAML."""
    for sample in SAMPLES:
        board = parse_board(sample.spec)
        pdf = print_board(board, file_format="pdf", paper=sample.paper, landscape=sample.landscape)
        (folder / f"{sample.name}.pdf").write_bytes(pdf)
        save_board(folder / f"{sample.name}.yaml", board)


@pytest.fixture(scope="module")
def fresh(tmp_path_factory) -> Path:
    """A folder with the sample boards as camcal prints them now."""
    folder = tmp_path_factory.mktemp("sample_boards")
    regenerate(folder)
    return folder


def drawing(path: Path) -> tuple[list[str], list[float], str, list[float]]:
    """A PDF's drawing operators, their numbers, its text and its sheet: no dates, no versions."""
    (page,) = PdfReader(path).pages
    content = page.get_contents().get_data().decode("latin-1")
    numbers = [float(number) for number in NUMBER.findall(content)]
    return NUMBER.sub("#", content).split(), numbers, page.extract_text(), [float(side) for side in page.mediabox]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
def test_stored_pdf_is_what_is_printed(sample, fresh):
    """The same operators and text, every coordinate within a thousandth of a point."""
    stored, printed = drawing(STORED / f"{sample.name}.pdf"), drawing(fresh / f"{sample.name}.pdf")
    assert stored[0] == printed[0]
    assert stored[1] == pytest.approx(printed[1], abs=1e-3)
    assert stored[2] == printed[2]
    assert stored[3] == pytest.approx(printed[3], abs=1e-3)


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: sample.name)
def test_stored_yaml_is_the_board(sample, fresh):
    """The stored YAML holds the same data as a new one, and loads as the board of the SPEC, also by its name."""
    stored = STORED / f"{sample.name}.yaml"
    assert yaml.safe_load(stored.read_text("utf-8")) == yaml.safe_load((fresh / stored.name).read_text("utf-8"))
    assert load_board(str(stored)) == load_board(sample.name) == parse_board(sample.spec)


def test_nothing_else_is_stored_and_the_names_are_found(fresh):
    """The folder holds the table's files and no others; `resources` lists them."""
    assert {path.name for path in STORED.iterdir()} == {path.name for path in fresh.iterdir()}
    assert resources.sample_board_names() == tuple(sorted(sample.name for sample in SAMPLES))
    for name in resources.sample_board_names():
        assert resources.sample_board_path(name).read_bytes() == (STORED / f"{name}.yaml").read_bytes()


def test_names_say_kind_size_and_sheet():
    """A name is its SPEC and sheet in words."""
    for sample in SAMPLES:
        kind, size, side, *_ = sample.spec.split(":")
        assert sample.name == f"{kind}_{size}_{side}_{sample.paper}"


def test_installed_data_come_first(tmp_path, monkeypatch):
    """Inside an installed package the data folder is the place; a folder that is not there holds nothing."""
    (tmp_path / "data" / "configs").mkdir(parents=True)
    (tmp_path / "data" / "configs" / "webcam.yaml").touch()
    (tmp_path / "data" / "configs" / "notes.txt").touch()
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path)
    assert resources.config_names() == ("webcam",)
    assert resources.config_path("webcam") == tmp_path / "data" / "configs" / "webcam.yaml"
    assert resources.sample_board_names() == ()


@pytest.mark.parametrize("find", [resources.config_path, resources.sample_board_path])
@pytest.mark.parametrize("name", ["", "..", "../pyproject", "/etc/passwd", "nothing_of_the_kind"])
def test_unknown_names_are_refused(find, name):
    """Only listed names lead to a file."""
    with pytest.raises(InputError, match="none of that name"):
        find(name)


def test_a_mistyped_name_gets_the_nearest():
    """The error suggests what was meant."""
    with pytest.raises(InputError, match="Did you mean 'checkerboard_9x6_25mm_a4'"):
        resources.sample_board_path("checkerboard_9x6_25mm")


if __name__ == "__main__":
    STORED.mkdir(exist_ok=True)
    regenerate(STORED)
