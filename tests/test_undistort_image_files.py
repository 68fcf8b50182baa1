"""One image file in, one out: bad files, full disks, threads and names."""

from __future__ import annotations

import errno
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
import pytest
from image_files import ALPHA, COLOUR, DEEP, FLOATS, GREY, HEIGHT, MAP, RGB, WIDTH, encoded, jpeg, tiff, undistorted
from loaded_modules import loaded_by

from camcal.errors import InputError
from camcal.workflows.undistort.image import ImageOptions, undistort_image_file

WHOLE = jpeg(COLOUR)
# Cut in the middle, with the end mark put back: nothing but decoding tells.
PATCHED = WHOLE[: len(WHOLE) // 2] + b"\xff\xd9"


@pytest.mark.parametrize(
    ("name", "content", "target", "message"),
    [
        ("a.jpg", b"", "a.jpg", "a.jpg: empty file"),
        ("a.jpg", b"not a picture", "a.jpg", "a.jpg: not an image"),
        ("a.jpg", WHOLE[: len(WHOLE) // 2], "a.jpg", "a.jpg: truncated image"),
        ("a.jpg", PATCHED, "a.jpg", "a.jpg: truncated or damaged image"),
        ("a.jpg", PATCHED, "a.png", "a.jpg: truncated or damaged image"),
        ("a.png", encoded(RGB, "PNG")[:-40], "a.png", "a.png: truncated image"),
        ("a.png", encoded(RGB, "PNG")[:-40] + bytes(40), "a.png", "a.png: damaged image"),
        ("a.tif", tiff(COLOUR)[:5000], "a.tif", "a.tif: "),
        ("a.tif", b"II*\0\x08\0\0\0", "a.tif", "a.tif: cannot be changed without loss"),
        ("a.jpg", jpeg(COLOUR[:, :160]), "a.jpg", r"a.jpg: not the camera's image size \(got 160x117, expected 163x117\)"),
        ("a.png", encoded(RGB.crop((0, 0, 163, 90)), "PNG"), "a.png", r"not the camera's image size \(got 163x90"),
    ],
)
def test_bad_input_is_an_error_of_one_line(tmp_path: Path, name: str, content: bytes, target: str, message: str) -> None:
    """Empty, cut off, damaged, no image, of another size: the file is named, and nothing is written."""
    with pytest.raises(InputError, match=message) as caught:
        undistorted(tmp_path, content, name, target)
    assert "\n" not in str(caught.value)
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("extension", [".bmp", ".ppm", ".webp", ".png", ".tif", ".jp2"])
def test_half_a_file_never_shows_the_image_before_it(tmp_path: Path, extension: str) -> None:
    """Memory that is used again still holds the last image; of a file that ends early, none of that may come out."""
    whole = cv2.imencode(extension, COLOUR)[1].tobytes()
    undistorted(tmp_path, whole, f"whole{extension}")
    with pytest.raises(InputError, match="half"):
        undistorted(tmp_path, whole[: len(whole) // 2], f"half{extension}")


def test_bombs_are_refused_before_they_are_decoded(tmp_path: Path) -> None:
    """A header that asks for 3600 million pixels; and the limit is settable."""
    content = bytearray(encoded(RGB, "BMP"))
    content[18:26] = (60_000).to_bytes(4, "little") * 2
    with pytest.raises(InputError, match=r"a.bmp: too many pixels \(got 60000x60000, expected at most 400 million\)"):
        undistorted(tmp_path, bytes(content), "a.bmp")
    with pytest.raises(InputError, match=r"a.jpg: too many pixels"):
        undistorted(tmp_path, jpeg(COLOUR), "a.jpg", most_pixels=WIDTH * HEIGHT - 1)
    undistorted(tmp_path, jpeg(COLOUR), "a.jpg", most_pixels=WIDTH * HEIGHT)


def test_an_image_is_never_replaced_by_its_result(tmp_path: Path) -> None:
    """Under its own name or another one."""
    source = tmp_path / "a.jpg"
    source.write_bytes(jpeg(COLOUR))
    (tmp_path / "link.jpg").symlink_to(source)
    (tmp_path / "hard.jpg").hardlink_to(source)
    for target in (source, tmp_path / "link.jpg", tmp_path / "hard.jpg"):
        with pytest.raises(InputError, match="would replace its own input"):
            undistort_image_file(source, target, MAP)
    assert source.read_bytes() == jpeg(COLOUR)


def test_missing_and_unreadable_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file that cannot be read or written is named."""
    with pytest.raises(InputError, match=r"missing.jpg: no such file"):
        undistort_image_file(tmp_path / "missing.jpg", tmp_path / "a.jpg", MAP)
    (tmp_path / "b.jpg").write_bytes(jpeg(COLOUR))
    with pytest.raises(InputError, match=r"nowhere.a.jpg: cannot be written \(no such file or directory\)"):
        undistort_image_file(tmp_path / "b.jpg", tmp_path / "nowhere/a.jpg", MAP)

    def refused(self: Path, *_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", refused)
    with pytest.raises(InputError, match=r"b.jpg: cannot be read \(permission denied\)"):
        undistort_image_file(tmp_path / "b.jpg", tmp_path / "a.jpg", MAP)


def test_a_full_disk_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither half a file nor a temporary one; an earlier result stays."""
    path, _ = undistorted(tmp_path, jpeg(COLOUR), "a.jpg")
    before = path.read_bytes()
    write = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        if self.parent.name == "out":
            write(self, data[: len(data) // 2])
            raise OSError(errno.ENOSPC, "No space left on device", str(self))
        return write(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(InputError, match=r"a.jpg: cannot be written \(no space left on device\)"):
        undistorted(tmp_path, jpeg(GREY), "a.jpg")
    assert [entry.name for entry in path.parent.iterdir()] == ["a.jpg"]
    assert path.read_bytes() == before


def test_the_same_bytes_on_any_thread_in_any_order(tmp_path: Path) -> None:
    """Memory that is used again, on two threads and for images of many kinds, changes nothing."""
    contents = {
        "grey.jpg": jpeg(GREY),
        "fine.jpg": jpeg(COLOUR, "444"),
        "a.jpg": WHOLE,
        "a.png": encoded(RGB, "PNG"),
        "deep.png": cv2.imencode(".png", DEEP)[1].tobytes(),
        "alpha.png": cv2.imencode(".png", np.dstack([COLOUR, ALPHA]))[1].tobytes(),
        "grey.png": cv2.imencode(".png", GREY)[1].tobytes(),
        "a.bmp": encoded(RGB, "BMP"),
        "floats.tif": cv2.imencode(".tif", FLOATS)[1].tobytes(),
    }
    single = {name: undistorted(tmp_path, content, name)[0].read_bytes() for name, content in contents.items()}
    (tmp_path / "both").mkdir()

    def again(index: int) -> bool:
        name = list(contents)[index % len(contents)]
        target = tmp_path / "both" / f"{index}_{name}"
        undistort_image_file(tmp_path / "in" / name, target, MAP)
        return target.read_bytes() == single[name]

    with ThreadPoolExecutor(2) as pool:
        assert all(pool.map(again, np.random.default_rng(5).permutation(5 * len(contents)).tolist()))


@pytest.mark.parametrize("name", ["ä b.png", "名.jpg"])
def test_any_file_name_will_do(tmp_path: Path, name: str) -> None:
    """Names that OpenCV cannot open everywhere are read all the same."""
    content = jpeg(COLOUR) if name.endswith("jpg") else encoded(RGB, "PNG")
    path, warnings = undistorted(tmp_path, content, name)
    assert warnings == ()
    assert path.exists()


@pytest.mark.parametrize("options", [{"quality": 0}, {"quality": 101}, {"most_pixels": 0}])
def test_options_out_of_range_are_refused(options: dict[str, int]) -> None:
    """The message names the option."""
    with pytest.raises(InputError, match=r"--(quality|most-pixels): "):
        ImageOptions(**options)


def test_nothing_heavy_is_imported_before_it_is_needed() -> None:
    """A PNG needs neither FFmpeg nor Pillow nor pydantic."""
    heavy = {"av", "simplejpeg", "PIL", "pydantic", "tifffile"}
    assert not heavy & loaded_by("import camcal.workflows.undistort.image")
