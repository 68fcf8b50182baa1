"""`camcal.undistort`: nothing is replaced, lost or left half-done."""

from __future__ import annotations

import errno
import shutil
from pathlib import Path

import pytest
from undistort_files import make_images, stamps, tree

import camcal
from camcal.errors import InputError
from camcal.formats.ledger_file import LEDGER_NAME


def test_an_input_is_never_replaced(camera_file, tmp_path):
    """Neither its own input nor another, by whatever path, with force too."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png")
    (tmp_path / "link").symlink_to(photos)
    before = {name: (photos / name).read_bytes() for name in ("a.png", "b.png")}
    for output in (photos, tmp_path / "link", photos / ".", photos / "a.png"):
        with pytest.raises(InputError, match=r"would replace (its own|another) input"):
            camcal.undistort(photos / "a.png", camera_file, output, force=True)
    more = make_images(tmp_path / "more", "photos/a.png")
    with pytest.raises(InputError, match=r"would replace another input, .*photos/a\.png"):
        camcal.undistort([more, photos / "a.png"], camera_file, tmp_path, recursive=True, force=True)
    assert before == {name: (photos / name).read_bytes() for name in before}


def test_camera_files_are_never_replaced(camera_file, tmp_path):
    """Neither a calibration's, nor the one that is in use, nor the one of the target; with force too."""
    make_images(tmp_path, "a.png")
    for name in ("calib", "lone", "single", "chain"):
        (tmp_path / name).mkdir()
    chain = tmp_path / "chain/camera.yaml"
    camcal.export_camera(camera_file, "kalibr", chain)
    shutil.copy(camera_file, tmp_path / "lone/camera.yaml")
    shutil.copy(camera_file, tmp_path / "single/a.camera.yaml")
    (tmp_path / "calib/views.yaml").touch()
    image = tmp_path / "a.png"
    with pytest.raises(InputError, match="holds a calibration"):
        camcal.undistort(image, camera_file, tmp_path / "calib", force=True)
    for options in ({"camera": tmp_path / "lone"}, {"camera": camera_file, "target": tmp_path / "lone/camera.yaml"}):
        with pytest.raises(InputError, match=r"lone.*would be replaced by the camera of the results"):
            camcal.undistort(image, output=tmp_path / "lone", force=True, **options)
    with pytest.raises(InputError, match="would be replaced by the camera of the results"):
        camcal.undistort(image, f"{chain}#cam0", chain.parent, force=True)
    with pytest.raises(InputError, match=r"a\.camera\.yaml: would be replaced"):
        camcal.undistort(image, tmp_path / "single/a.camera.yaml", tmp_path / "single/a.png", force=True)
    assert (tmp_path / "lone/camera.yaml").read_bytes() == camera_file.read_bytes()


def test_what_exists_needs_force(camera_file, tmp_path):
    """A folder with something in it, a file, a camera beside it: refused; replaced with force; a file is no folder."""
    make_images(tmp_path, "a.png", "out/mine.png")
    with pytest.raises(InputError, match=r"output folder is not empty\. Choose another one, or"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "out")
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "out", force=True)
    assert tree(tmp_path / "out") == ["a.png", "camera.yaml", "mine.png", LEDGER_NAME]
    with pytest.raises(InputError, match="Go on with --resume"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "out")
    (tmp_path / "b.camera.yaml").touch()
    with pytest.raises(InputError, match=r"b\.camera\.yaml: output file exists"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "b.png")
    with pytest.raises(InputError, match="a file stands where the output folder should be"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "b.camera.yaml")


def test_a_file_for_several_inputs(camera_file, tmp_path):
    """A file name as the output of two images is refused; so is --resume with one."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png")
    with pytest.raises(InputError, match="a file for 2 inputs"):
        camcal.undistort(photos, camera_file, tmp_path / "one.png")
    with pytest.raises(InputError, match="--resume: needs a folder"):
        camcal.undistort(photos / "a.png", camera_file, tmp_path / "one.png", resume=True)


def test_results_that_are_named_like_companions(camera_file, tmp_path):
    """An image called mask.png has no place beside the mask; without a mask it has."""
    make_images(tmp_path, "mask.png")
    with pytest.raises(InputError, match=r"mask\.png: its result would be replaced"):
        camcal.undistort(tmp_path / "mask.png", camera_file, tmp_path / "o", mask=True)
    assert camcal.undistort(tmp_path / "mask.png", camera_file, tmp_path / "o").images == ("mask.png",)


def test_an_unwritable_folder(camera_file, tmp_path, monkeypatch):
    """The system's own words, before any image is read."""
    make_images(tmp_path, "a.png")

    def refuse(path, *_args, **_kwargs):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(InputError, match=r"o: cannot be written \(permission denied\)"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o")


@pytest.mark.parametrize("place", ["locked/o", "locked/sub/o", "locked/o.png", f"{'long' * 99}"])
def test_a_place_that_may_not_be_looked_into(camera_file, tmp_path, monkeypatch, place):
    """A folder without permission to search it, or a name that is too long: the system's own words."""
    make_images(tmp_path, "a.png")
    look = Path.stat

    def refuse(path, **options):
        if "locked" in path.parts:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return look(path, **options)

    monkeypatch.setattr(Path, "stat", refuse)
    with pytest.raises(InputError, match=r"cannot be written \((permission denied|file name too long)\)"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / place)


def test_a_full_disk_ends_the_run(camera_file, tmp_path, monkeypatch):
    """Only whole files are left and no camera that would say that all is there; --resume does the rest and only that."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(6)))
    write = Path.write_bytes
    written = []

    def fill_up(path, data):
        if ".tmp" in path.name and len(written) == 3:
            write(path, data[:100])
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(path)
        return write(path, data)

    monkeypatch.setattr(Path, "write_bytes", fill_up)
    with pytest.raises(InputError, match=r"3\.png: cannot be written \(no space left on device\).* go on .* with --resume"):
        camcal.undistort(photos, camera_file, tmp_path / "o", jobs=1)
    monkeypatch.undo()
    assert tree(tmp_path / "o") == ["0.png", "1.png", "2.png", LEDGER_NAME]
    before = stamps(tmp_path / "o")
    done = camcal.undistort(photos, camera_file, tmp_path / "o", resume=True)
    assert (len(done.already_done), done.images) == (3, ("3.png", "4.png", "5.png"))
    after = stamps(tmp_path / "o")
    assert before == {name: after[name] for name in before}
    assert (tmp_path / "o/camera.yaml").exists()


def test_a_run_that_comes_to_nothing_leaves_nothing(camera_file, tmp_path):
    """Neither ledger nor folders that were made for it; what was there before stays, a table of somebody's of that name too."""
    photos = make_images(tmp_path / "photos", "sub/a.png")
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / LEDGER_NAME).write_text("my,own\n")
    before = sorted(tmp_path.rglob("*"))
    for place in (tmp_path / "new/o", mine):
        with pytest.raises(InputError, match="--fill: no value"):
            camcal.undistort(photos, camera_file, place, fill=999, recursive=True, force=True)
    assert (mine / LEDGER_NAME).read_text().startswith("my,own\n")
    assert [path for path in sorted(tmp_path.rglob("*")) if path not in before] in ([], [mine / "sub"])
