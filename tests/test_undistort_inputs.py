"""`camcal.undistort`: what is found, and where it goes."""

from __future__ import annotations

import errno
import logging
import os
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from undistort_files import SIZE, make_images, picture, tree

import camcal
from camcal.errors import InputError
from camcal.formats.ledger_file import LEDGER_NAME


def test_folders_within_folders(camera_file, tmp_path):
    """With `recursive` the structure is kept; hidden files and folders, and the output itself, are not looked at."""
    photos = make_images(tmp_path / "photos", "a.png", "day 1/a.png", "day 1/deep/b.jpg", ".thumbs/t.png", ".hidden.png")
    (photos / "day 1/notes.txt").write_text("x")
    for _ in range(2):
        done = camcal.undistort(photos, camera_file, photos / "flat", recursive=True, force=True)
        assert done.images == ("a.png", "day 1/a.png", "day 1/deep/b.jpg")
    assert tree(photos / "flat") == ["a.png", "camera.yaml", "day 1/a.png", "day 1/deep/b.jpg", LEDGER_NAME]
    assert camcal.undistort(photos, camera_file, tmp_path / "top").images == ("a.png",)


def test_linked_folders_are_followed_once(camera_file, tmp_path):
    """A linked folder counts, a link that leads back does not go round for ever, and one file counts once."""
    photos = make_images(tmp_path / "photos", "a.png")
    elsewhere = make_images(tmp_path / "elsewhere", "b.png")
    (photos / "link").symlink_to(elsewhere)
    (photos / "loop").symlink_to(photos)
    (photos / "again.png").symlink_to(photos / "a.png")
    done = camcal.undistort(photos, camera_file, tmp_path / "flat", recursive=True)
    assert done.images == ("a.png", "link/b.png")


def test_the_same_name_twice(camera_file, tmp_path):
    """Two files of one name keep their paths below the folder that they share."""
    make_images(tmp_path, "left/a.png", "right/a.png")
    done = camcal.undistort([tmp_path / "left/a.png", tmp_path / "right/a.png"], camera_file, tmp_path / "flat")
    assert done.images == ("left/a.png", "right/a.png")


def test_two_results_of_one_name(camera_file, tmp_path):
    """Two sources in one folder that a new format would make one file: refused, both named."""
    photos = make_images(tmp_path / "photos", "a.png", "a.jpg")
    with pytest.raises(InputError, match=r"a\.(png|jpg): its result would replace that of .*a\.(png|jpg) \(both a\.tif\)"):
        camcal.undistort(photos, camera_file, tmp_path / "flat", file_format="tif")


def test_patterns_and_lists(camera_file, tmp_path):
    """A pattern names nothing; of a list, what cannot be used is rejected, what is no image is counted."""
    make_images(tmp_path, "img_1.png", "img_2.png", "other.png")
    (tmp_path / "img_3.txt").write_text("x")
    assert camcal.undistort(str(tmp_path / "img_*"), camera_file, tmp_path / "a").images == ("img_1.png", "img_2.png")
    listed = [tmp_path / "img_1.png", tmp_path / "gone.png", tmp_path / "img_3.txt"]
    done = camcal.undistort([], camera_file, tmp_path / "b", listed=listed)
    assert done.images == ("img_1.png",)
    assert [(one.source, one.reason) for one in done.rejected] == [(str(listed[1]), "no such file. Check the path.")]


def test_other_files_are_one_warning(camera_file, tmp_path, caplog):
    """However many: one line with their number; pipes and devices are among them, and nobody waits for one."""
    photos = make_images(tmp_path / "photos", "a.png")
    for name in ("notes.txt", "b.xmp", "z"):
        (photos / name).write_text("x")
    os.mkfifo(photos / "pipe.png")
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.undistort(photos, camera_file, tmp_path / "flat")
    assert [record.message for record in caplog.records] == ["4 other files passed over (first: b.xmp)."]


def test_names_that_are_no_text(camera_file, tmp_path):
    """Bytes that are not UTF-8, and commas, quotes and line breaks, stay as they are, also in the ledger."""
    names = ["caf\udce9.png", 'a "b", c.png', "two\nlines.png"]
    photos = make_images(tmp_path / "photos", "a.png")
    for name in names:
        shutil.copy(photos / "a.png", photos / name)
    assert sorted(camcal.undistort(photos, camera_file, tmp_path / "o").images) == sorted([*names, "a.png"])
    assert all((tmp_path / "o" / name).exists() for name in names)
    assert camcal.undistort(photos, camera_file, tmp_path / "o", resume=True).images == ()


@pytest.mark.parametrize(
    ("make", "match"),
    [
        (lambda _: "gone.png", "gone.png: no such file"),
        (lambda f: (f / "empty").mkdir() or "empty", "empty: no images or videos in this folder"),
        (lambda f: make_images(f, "up/down/a.png") and "up", r"but there are some in down/\). .*--recursive"),
        (lambda _: "*.png", "no image or video matches this pattern"),
        (lambda f: (f / "notes.txt").write_text("x") and "notes.txt", "neither image nor video"),
        (lambda f: (f / "a.png").touch() or "a.png", "empty file"),
        (lambda f: (f / "a.png").write_text("no image") and "a.png", "not an image"),
        (lambda f: os.mkfifo(f / "a.png") or "a.png", "device or pipe"),
        (lambda f: make_images(f, "a.png", size=(48, 64)) and "a.png", "got 48x64, expected 64x48.*turned by 90°"),
        (lambda f: (make_images(f, "a.png") / "a.png").rename(f / "a.gif").name, "no format that an image is"),
    ],
)
def test_a_named_input_of_no_use_is_refused_at_once(camera_file, tmp_path, monkeypatch, make, match):
    """Missing, empty, of another kind or size: an error before anything is written, also beside good inputs."""
    monkeypatch.chdir(tmp_path)
    name = make(tmp_path)
    good = make_images(tmp_path / "good", "good.png")
    with pytest.raises(InputError, match=match):
        camcal.undistort([good / "good.png", name], camera_file, "out")
    assert not Path("out").exists()


def test_one_of_many_is_of_no_use(camera_file, tmp_path, caplog):
    """Torn, of another size, of a format that is not written, too large: each is named, and all others are done."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(9)))
    (photos / "torn.png").write_bytes((photos / "0.png").read_bytes()[:1000])
    make_images(photos, "small.png", size=(10, 10))
    cv2.imwrite(str(photos / "still.gif"), picture())
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(photos, camera_file, tmp_path / "flat", jobs=2)
    assert done.images == tuple(f"{i}.png" for i in range(9))
    assert [one.source for one in done.rejected] == ["small.png", "still.gif", "torn.png"]
    assert "Choose one with --format" in done.rejected[1].reason
    assert all(f"{name}: passed over: " in caplog.text for name in ("small.png", "still.gif", "torn.png"))
    assert (tmp_path / "flat/camera.yaml").exists()


def test_a_limit_for_traps(camera_file, tmp_path):
    """An image with more pixels than allowed is refused by its header."""
    make_images(tmp_path, "a.png")
    with pytest.raises(InputError, match="too many pixels"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", most_pixels=100)


def test_a_folder_that_cannot_be_looked_into(camera_file, tmp_path, monkeypatch):
    """Within a folder it is rejected by name; named, it is an error."""
    photos = make_images(tmp_path / "photos", "a.png", "locked/b.png")
    scan = os.scandir

    def refuse(path):
        if Path(path).name == "locked":
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", refuse)
    done = camcal.undistort(photos, camera_file, tmp_path / "o", recursive=True)
    assert done.images == ("a.png",)
    assert [(one.source, one.reason) for one in done.rejected] == [
        (str(photos / "locked"), "cannot be read (permission denied)")
    ]
    with pytest.raises(InputError, match=r"locked: cannot be read \(permission denied\)"):
        camcal.undistort(photos / "locked", camera_file, tmp_path / "p")


def test_results_within_are_not_undistorted_again(camera_file, tmp_path, caplog):
    """A folder of an earlier run's results inside the input is passed over with a word; named, it is worked on."""
    photos = make_images(tmp_path / "photos", "a.png", "sub/b.png")
    camcal.undistort(photos, camera_file, photos / "flat", recursive=True)
    with caplog.at_level(logging.WARNING, logger="camcal"):
        done = camcal.undistort(photos, camera_file, photos / "other", recursive=True)
    assert done.images == ("a.png", "sub/b.png")
    assert f"{photos / 'flat'}: holds results of an earlier run: passed over" in caplog.text
    again = camcal.undistort(photos / "flat", camera_file, tmp_path / "again", recursive=True)
    assert again.images == ("a.png", "sub/b.png")


def test_a_list_of_other_things(camera_file, tmp_path):
    """The error says what there was instead."""
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(InputError, match=r"no images or videos given \(but .*notes\.txt\)"):
        camcal.undistort([], camera_file, tmp_path / "o", listed=[tmp_path / "notes.txt"])


def test_images_of_formats_that_are_not_read(camera_file, tmp_path, caplog):
    """They are images to whoever has them: said so, with what to do first, and never taken for the name of a folder."""
    photos = tmp_path / "photos"
    photos.mkdir()
    for name in ("a.HEIC", "b.nef"):
        (photos / name).write_bytes(b"some")
    with pytest.raises(InputError, match=r"but a\.HEIC, of a format that is not read\)\. Convert to JPEG or TIFF first"):
        camcal.undistort(photos, camera_file, tmp_path / "o")
    with pytest.raises(InputError, match=r"b\.nef: an image of a format that is not read .*\. Develop to TIFF first"):
        camcal.undistort(photos / "b.nef", camera_file, tmp_path / "o")
    make_images(photos, "c.png")
    with pytest.raises(InputError, match=r"c\.heic: not a format to write"):
        camcal.undistort(photos / "c.png", camera_file, tmp_path / "c.heic")
    with caplog.at_level(logging.WARNING, logger="camcal"):
        assert camcal.undistort(photos, camera_file, tmp_path / "o").images == ("c.png",)
    assert "2 images of a format that is not read passed over (first: a.HEIC). Convert to JPEG or TIFF first." in caplog.text


def test_what_is_not_done_has_the_name_that_the_user_gave(camera_file, tmp_path):
    """Not that of the result that there is not, and only once."""
    photos = make_images(tmp_path / "photos", "a.png")
    tifffile.imwrite(photos / "b.tif", np.zeros(SIZE[::-1], np.float32))
    done = camcal.undistort(photos, camera_file, tmp_path / "o", file_format="png")
    assert [(one.source, one.reason.split(" (")[0]) for one in done.rejected] == [("b.tif", "pixels that .png cannot hold")]
    with pytest.raises(InputError, match=r"^b\.tif: pixels that \.png cannot hold .* Write \.tiff instead\.$"):
        camcal.undistort(photos / "b.tif", camera_file, tmp_path / "p", file_format="png")
