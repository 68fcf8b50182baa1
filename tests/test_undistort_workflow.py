"""`camcal.undistort`: images and videos together, and many of them."""

from __future__ import annotations

import logging
import shutil
import threading

import pytest
from undistort_files import make_images, tree
from videos import make_video, read_video

import camcal
from camcal.errors import InputError
from camcal.formats.ledger_file import LEDGER_NAME
from camcal.workflows.undistort import work as undistort_work


def test_a_folder_with_images_and_a_video(camera_file, tmp_path):
    """Both are undistorted, with one camera; on resume the video is left alone too, however many threads there are."""
    photos = make_images(tmp_path / "photos", "a.png")
    make_video(photos / "clip.mkv", codec="ffv1", frames=3)
    done = camcal.undistort(photos, camera_file, tmp_path / "o", codec="ffv1")
    assert [job.name for job in done.outputs] == ["a.png", "clip.mkv"]
    assert done.images == ("a.png",)
    assert len(read_video(tmp_path / "o/clip.mkv").frames) == 3
    again = camcal.undistort(photos, camera_file, tmp_path / "o", codec="ffv1", resume=True, jobs=1)
    assert (again.outputs, len(again.already_done)) == ((), 2)
    other = camcal.undistort(photos, camera_file, tmp_path / "o", codec="ffv1", frames="0:2", resume=True)
    assert [job.name for job in other.outputs] == ["clip.mkv"]


def test_a_video_of_another_container(camera_file, tmp_path):
    """A container that is not written is rejected with the way out, which works; a torn video does not stop the others."""
    folder = tmp_path / "clips"
    folder.mkdir()
    make_video(folder / "good.mkv", codec="ffv1", frames=2)
    (folder / "torn.mp4").write_bytes((folder / "good.mkv").read_bytes()[:300])
    shutil.copy(folder / "good.mkv", folder / "old.mpg")
    done = camcal.undistort(folder, camera_file, tmp_path / "o")
    assert [one.source for one in done.rejected] == ["old.mpg", "torn.mp4"]
    assert "no format that a video is written in (got '.mpg'" in done.rejected[0].reason
    done = camcal.undistort(folder / "old.mpg", camera_file, tmp_path / "p", file_format="mkv")
    assert [job.name for job in done.outputs] == ["old.mkv"]


def test_options_of_images_are_not_for_videos(camera_file, tmp_path):
    """What a video cannot have is refused, not passed over in silence."""
    make_video(tmp_path / "clip.mkv", codec="ffv1", frames=2)
    for options in ({"fill": 5}, {"gamma": "srgb"}):
        with pytest.raises(InputError, match=r"only for images \(got .*clip\.mkv\)"):
            camcal.undistort(tmp_path / "clip.mkv", camera_file, tmp_path / "o", **options)


def test_the_map_is_built_once(camera_file, tmp_path, monkeypatch):
    """However many images and threads."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(8)))
    built = []
    build = undistort_work.Cameras.map

    def count(self, *, exact=False):
        built.append(threading.get_ident())
        return build(self, exact=exact)

    monkeypatch.setattr(undistort_work.Cameras, "map", count)
    camcal.undistort(photos, camera_file, tmp_path / "o", jobs=4)
    assert len(built) == 1


def test_threads_change_nothing(camera_file, tmp_path):
    """One thread or several: the same bytes, but for the ledger's order and times."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(6)), "j.jpg")
    for jobs in (1, 4):
        camcal.undistort(photos, camera_file, tmp_path / str(jobs), jobs=jobs)
    for name in set(tree(tmp_path / "1")) - {LEDGER_NAME}:
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "4" / name).read_bytes()


def test_results_of_calibrate_are_known_as_such(dataset, tmp_path, caplog):
    """Those of an earlier calibration that stay beside the new ones are counted, and none is undistorted again."""
    images = sorted((dataset / "images").iterdir())
    assert len(images) == 8
    calib = tmp_path / "calib"
    camcal.calibrate(images, "checkerboard:7x6:20mm", calib, undistort=True, report=False)
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.calibrate(images[:6], "checkerboard:7x6:20mm", calib, undistort=True, report=False, force=True)
    assert f"undistorted: also holds 2 files of another camera or other options (first: {images[6].name})" in caplog.text
    with pytest.raises(InputError, match=r"calib: no images or videos in this folder"):
        camcal.undistort(calib, calib, tmp_path / "again", recursive=True)
