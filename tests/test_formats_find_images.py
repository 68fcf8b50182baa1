"""Images found by the rules: folders, names, patterns, and what is passed over."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import pytest
from described_images import GREY

from camcal.errors import InputError
from camcal.formats.images import find_images, read_image


def make(folder: Path, *names: str) -> None:
    """Write the same small image under several names."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(cv2.imencode(".png", GREY)[1].tobytes())


def found_names(*inputs: str | Path) -> list[str]:
    """Names of the images found."""
    return [image.name for image in find_images(inputs).images]


def test_folder_gives_its_images_sorted(tmp_path: Path) -> None:
    """By name, whatever the case of the extension; other files are counted, folders and hidden files are not images."""
    make(tmp_path, "b.png", "a.PNG", "c.jpeg", ".hidden.png", "below/d.png")
    (tmp_path / "notes.txt").write_text("x")
    found = find_images([tmp_path])
    assert [image.name for image in found.images] == ["a.PNG", "b.png", "c.jpeg"]
    assert [image.path for image in found.images] == [tmp_path / "a.PNG", tmp_path / "b.png", tmp_path / "c.jpeg"]
    assert not any(image.named for image in found.images)
    assert [path.name for path in found.passed_over] == [".hidden.png", "notes.txt"]


def test_named_files_and_patterns(tmp_path: Path) -> None:
    """A file is named, what a pattern finds is not; a name with brackets in it is a file before it is a pattern."""
    make(tmp_path, "a1.png", "a2.png", "b1.png", "c[1].png", "deep/er/a3.png")
    (tmp_path / "a1.txt").write_text("x")
    found = find_images([tmp_path / "b1.png", str(tmp_path / "a*"), str(tmp_path / "c[1].png")])
    assert [(image.name, image.named) for image in found.images] == [
        ("a1.png", False),
        ("a2.png", False),
        ("b1.png", True),
        ("c[1].png", True),
    ]
    assert [path.name for path in found.passed_over] == ["a1.txt"]
    assert found_names(str(tmp_path / "**" / "a*.png")) == ["a1.png", "a2.png", "a3.png"]


def test_a_file_counts_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However it is reached: relative, absolute, through a folder or through a link."""
    make(tmp_path, "a.png", "b.png")
    (tmp_path / "link").symlink_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    found = find_images([tmp_path, "a.png", "./b.png", tmp_path / "link", "link/a.png"])
    assert [(image.name, image.named) for image in found.images] == [("a.png", True), ("b.png", True)]


def test_equal_file_names_are_told_apart(tmp_path: Path) -> None:
    """By the path below the folder they have in common, with forward slashes; alone, a file name is enough."""
    make(tmp_path, "run/left/0.png", "run/left/1.png", "run/right/0.png")
    assert found_names(tmp_path / "run/left", tmp_path / "run/right") == ["left/0.png", "left/1.png", "right/0.png"]
    assert found_names(tmp_path / "run/left/1.png", tmp_path / "run/right") == ["0.png", "1.png"]


@pytest.mark.skipif(os.name != "posix", reason="file names of arbitrary bytes are POSIX's")
def test_names_fit_into_text_files(tmp_path: Path) -> None:
    """Bytes that are not UTF-8 and line breaks in a file name become escapes."""
    content = cv2.imencode(".png", GREY)[1].tobytes()
    with open(os.fsencode(tmp_path) + b"/caf\xe9\n.png", "wb") as stream:  # noqa: PTH123 - a path of bytes
        stream.write(content)
    (image,) = find_images([tmp_path]).images
    assert image.name == r"caf\xe9\n.png"
    assert read_image(image.path).shape == (40, 60)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("missing", "missing: no such file"),
        ("missing.png", "missing.png: no such file"),
        ("empty", "no images in this folder (it is empty)"),
        ("texts", "no images in this folder (2 of .heic, 1 of .txt)"),
        ("above", "no images in this folder (but there are some in images/)"),
        ("texts/*", "no image matches this pattern (3 other files do)"),
        ("*.jpg", "no image matches this pattern (0 other files do)"),
        ("texts/a.txt", "a.txt: not an image (got '.txt'"),
        ("texts/zero.png", "zero.png: empty file"),
    ],
)
def test_inputs_without_an_image_are_refused(tmp_path: Path, given: str, message: str) -> None:
    """Each input must give an image; the message says what is there instead."""
    (tmp_path / "empty").mkdir()
    make(tmp_path, "above/images/a.png")
    (tmp_path / "texts").mkdir()
    for name in ("a.txt", "b.heic", "c.heic"):
        (tmp_path / "texts" / name).write_text("x")
    if given.endswith("zero.png"):
        (tmp_path / given).touch()
    with pytest.raises(InputError) as caught:
        find_images([tmp_path / "above/images", tmp_path / given])
    assert message in str(caught.value)


def test_a_folder_that_cannot_be_read_is_an_input_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So is a name that the system cannot hold."""

    def refused(self: Path) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "iterdir", refused)
    for given in (tmp_path, "x" * 5000, "x" * 5000 + "*"):
        with pytest.raises(InputError, match=r"cannot be read|no such file|no image matches"):
            find_images([given])


def test_nothing_asked_for_is_refused() -> None:
    """No inputs, no images."""
    with pytest.raises(InputError, match="images: none given"):
        find_images([])
