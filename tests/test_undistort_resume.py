"""`camcal.undistort`: going on where an earlier run stopped."""

from __future__ import annotations

import csv
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import pytest
from undistort_files import CAMERA, make_images, picture, stamps, tree

import camcal
from camcal.errors import InputError
from camcal.formats.camera_file import save_intrinsics
from camcal.formats.ledger_file import LEDGER_NAME
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.workflows.undistort import work as undistort_work


def test_resume_after_a_crash(camera_file, tmp_path, monkeypatch):
    """A run that dies between writing a result and noting it: that one is done again, the noted ones are not."""
    photos = make_images(tmp_path / "photos", *(f"{i}.png" for i in range(5)))

    class Crash(BaseException):
        pass

    def crash(job, read):
        if job.name == "2.png":
            raise Crash
        return note(job, read)

    carry_out, note = undistort_work.carry_out_here, None

    def carry_out_and_crash(jobs, undistorter, noting, *rest):
        nonlocal note
        note = noting
        return carry_out(jobs, undistorter, crash, *rest)

    monkeypatch.setattr("camcal.workflows.undistort.run.carry_out_here", carry_out_and_crash)
    with pytest.raises(Crash):
        camcal.undistort(photos, camera_file, tmp_path / "o", jobs=1)
    monkeypatch.undo()
    (tmp_path / "o/.camcal-0123456789abcdef.tmp").write_bytes(b"half")
    with (tmp_path / "o" / LEDGER_NAME).open("a") as ledger:
        ledger.write("torn,12,3")
    assert "2.png" in tree(tmp_path / "o")
    done = camcal.undistort(photos, camera_file, tmp_path / "o", resume=True)
    assert [job.name for job in done.already_done] == ["0.png", "1.png"]
    assert done.images == ("2.png", "3.png", "4.png")
    assert tree(tmp_path / "o") == [*(f"{i}.png" for i in range(5)), "camera.yaml", LEDGER_NAME]
    assert camcal.undistort(photos, camera_file, tmp_path / "o", resume=True).images == ()


def test_resume_passes_over_only_what_is_the_same(camera_file, tmp_path, caplog):
    """A source or a result that changed, another camera, another option: done again. A larger limit or more threads: not."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png", "c.png")
    run = lambda **options: camcal.undistort(photos, camera_file, tmp_path / "o", **{"resume": True, **options}).images  # noqa: E731
    assert run(resume=False) == ("a.png", "b.png", "c.png")
    assert run() == ()
    assert run(jobs=2, most_pixels=10**6) == ()
    os.utime(photos / "a.png", ns=(1, 1))
    assert run() == ("a.png",)
    cv2.imwrite(str(photos / "b.png"), picture(99))
    assert run() == ("b.png",)
    (tmp_path / "o/c.png").write_bytes(b"touched")
    assert run() == ("c.png",)
    (tmp_path / "o/c.png").unlink()
    assert run() == ("c.png",)
    make_images(photos, "d.png")
    assert run() == ("d.png",)
    assert run(quality=90) == ("a.png", "b.png", "c.png", "d.png")
    assert run(quality=90, alpha=0.1) == ("a.png", "b.png", "c.png", "d.png")
    assert not caplog.records
    (photos / "a.png").unlink()
    with caplog.at_level(logging.WARNING, logger="camcal"):
        assert run() == ("b.png", "c.png", "d.png")
    assert "also holds 1 file of another camera or other options (first: a.png)" in caplog.text


def test_resume_passes_over_any_name(camera_file, tmp_path):
    """A line break, a backslash or a quote in a name: done once, and not again, even behind a torn line."""
    photos = make_images(tmp_path / "photos", "plain.png")
    names = [
        os.fsencode(tmp_path / "photos") + b"/" + name
        for name in (b"two\nlines\n.png", b"back\\n.png", b'quo"te.png', b"\xff\n.png")
    ]
    for name in names:
        shutil.copy(photos / "plain.png", name)
    camcal.undistort(photos, camera_file, tmp_path / "o")
    ledger = tmp_path / "o" / LEDGER_NAME
    ledger.write_bytes(ledger.read_bytes() + b'"torn\n')
    done = camcal.undistort(photos, camera_file, tmp_path / "o", resume=True)
    assert done.images == ()
    assert len(done.already_done) == 1 + len(names)


def test_two_runs_in_one_folder(camera_file, tmp_path, monkeypatch):
    """While one run writes into a folder, another that would is refused, whatever it may overwrite; then it may."""
    photos = make_images(tmp_path / "photos", "a.png", "b.png")
    into = tmp_path / "o"
    real, refusals = undistort_work.undistort_image_file, []

    def meanwhile(*arguments):
        if not refusals:
            command = [sys.executable, "-m", "camcal", "undistort", photos, "--camera", camera_file, "-o", into, "--force"]
            refusals.append(subprocess.run(command, capture_output=True, text=True, check=False))
        return real(*arguments)

    monkeypatch.setattr(undistort_work, "undistort_image_file", meanwhile)
    camcal.undistort(photos, camera_file, into, jobs=1)
    assert (refusals[0].returncode, refusals[0].stdout) == (2, "")
    assert f"{into}: another run is writing into this folder" in refusals[0].stderr
    assert tree(into) == ["a.png", "b.png", "camera.yaml", LEDGER_NAME]
    assert camcal.undistort(photos, camera_file, into, resume=True).images == ()


def test_resume_begins_where_nothing_is(camera_file, tmp_path):
    """The first run may have --resume too; a folder that no run began is not written into."""
    make_images(tmp_path, "a.png")
    assert camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", resume=True).images == ("a.png",)
    make_images(tmp_path, "mine/x.png")
    with pytest.raises(InputError, match="not empty"):
        camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "mine", resume=True)


def test_the_ledger_has_one_line_for_each_result(camera_file, tmp_path):
    """Written by many threads: a header, then each result once, with its source and what both files were."""
    photos = make_images(tmp_path / "photos", *(f"{i:02}.png" for i in range(30)))
    camcal.undistort(photos, camera_file, tmp_path / "o", jobs=8)
    with (tmp_path / "o" / LEDGER_NAME).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert sorted(row["output"] for row in rows) == [f"{i:02}.png" for i in range(30)]
    for row in rows:
        source, result = Path(row["input"]).stat(), (tmp_path / "o" / row["output"]).stat()
        assert Path(row["input"]) == photos / row["output"]
        assert (int(row["input_size"]), int(row["input_mtime_ns"])) == (source.st_size, source.st_mtime_ns)
        assert (int(row["output_size"]), int(row["output_mtime_ns"])) == (result.st_size, result.st_mtime_ns)
    assert len({row["settings"] for row in rows}) == 1


def test_a_camera_that_no_longer_belongs_is_withdrawn_first(camera_file, tmp_path, monkeypatch):
    """While results of another camera are being made, no camera says that it belongs to them."""
    make_images(tmp_path, "a.png")
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o")
    seen = []
    do = undistort_work.Undistorter.do

    def look(self, job, advance=None):
        seen.append((tmp_path / "o/camera.yaml").exists())
        return do(self, job, advance)

    monkeypatch.setattr(undistort_work.Undistorter, "do", look)
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", force=True)
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", force=True, alpha=1)
    assert seen == [True, False]


MAPS = ["maps.npz", "maps.tiff", "mask.png"]


@pytest.mark.parametrize("go_on", [{"resume": True}, {"force": True}])
def test_a_mask_and_maps_that_no_longer_belong_are_withdrawn(camera_file, tmp_path, caplog, go_on):
    """They stay beside results of the same map, whatever else changes, and go with those of another, unless made anew."""
    make_images(tmp_path, "a.png")
    into = tmp_path / "o"
    run = lambda **options: camcal.undistort(tmp_path / "a.png", camera_file, into, **options)  # noqa: E731
    run(mask=True, maps=True)
    before = [(into / name).read_bytes() for name in MAPS]
    run(**go_on)
    run(**go_on, quality=90)
    assert [(into / name).read_bytes() for name in MAPS] == before
    run(**go_on, alpha=1, mask=True)
    assert tree(into) == ["a.png", "camera.yaml", "mask.png", LEDGER_NAME]
    assert (cv2.imread(str(into / "mask.png"), cv2.IMREAD_UNCHANGED) == 0).any()
    run(**go_on, alpha=0.5)
    assert tree(into) == ["a.png", "camera.yaml", LEDGER_NAME]
    assert not caplog.records


def test_maps_of_another_lens_with_the_same_camera_of_results(camera_file, tmp_path):
    """The camera of the results stays, what depends on the lens goes."""
    make_images(tmp_path, "a.png")
    save_intrinsics(tmp_path / "target.yaml", Intrinsics(Camera(CAMERA.size, CAMERA.K)))
    save_intrinsics(tmp_path / "other.yaml", Intrinsics(Camera(CAMERA.size, CAMERA.K, [-0.1])))
    target = tmp_path / "target.yaml"
    camcal.undistort(tmp_path / "a.png", camera_file, tmp_path / "o", target=target, maps=True)
    camcal.undistort(tmp_path / "a.png", tmp_path / "other.yaml", tmp_path / "o", target=target, resume=True)
    assert tree(tmp_path / "o") == ["a.png", "camera.yaml", LEDGER_NAME]


def test_a_mask_that_no_run_wrote_is_left_alone(camera_file, tmp_path, caplog):
    """It is named: the user's own, one that was changed since, and one beside a single result, where no ledger proves it."""
    photos = make_images(tmp_path / "photos", "a.png", "mask.png")
    make_images(tmp_path, "o/mask.png")
    own, into = (tmp_path / "o/mask.png").read_bytes(), tmp_path / "o"
    says = f"{into}: mask.png may be of another camera. Remove it, or write a new one."
    with caplog.at_level(logging.WARNING, logger="camcal"):
        camcal.undistort(photos / "a.png", camera_file, into, force=True)
        assert (into / "mask.png").read_bytes() == own
        assert [record.message for record in caplog.records] == [says]
        caplog.clear()
        camcal.undistort(photos / "a.png", camera_file, into, resume=True, mask=True, maps=True)
        (into / "mask.png").write_bytes(own)
        camcal.undistort(photos / "a.png", camera_file, into, resume=True, alpha=1)
        assert (into / "mask.png").read_bytes() == own
        assert [record.message for record in caplog.records] == [says]
        caplog.clear()
        single = tmp_path / "single.png"
        camcal.undistort(photos / "a.png", camera_file, single, mask=True, maps=True)
        camcal.undistort(photos / "a.png", camera_file, single, force=True)
        assert not caplog.records
        camcal.undistort(photos / "a.png", camera_file, single, force=True, alpha=1)
        assert (tmp_path / "single.mask.png").exists()
        names = "single.mask.png and single.maps.npz and single.maps.tiff"
        assert [record.message for record in caplog.records] == [
            f"{tmp_path}: {names} may be of another camera. Remove them, or write new ones."
        ]
        caplog.clear()
        # A result of that name is none.
        camcal.undistort(photos, camera_file, tmp_path / "p")
        camcal.undistort(photos, camera_file, tmp_path / "p", resume=True, alpha=1)
        assert tree(tmp_path / "p") == ["a.png", "camera.yaml", "mask.png", LEDGER_NAME]
        assert not caplog.records


def test_a_dry_run_writes_nothing(camera_file, tmp_path):
    """It says what would be done, of what is left to do, and refuses what would be refused."""
    photos = make_images(tmp_path / "photos", "a.png", "sub/b.png")
    before = tree(tmp_path)
    options = {"recursive": True, "file_format": "jpg", "size": (32, 24), "dry_run": True}
    plan = camcal.undistort(photos, camera_file, tmp_path / "o", **options)
    assert [(job.source, job.target, job.format) for job in plan.outputs] == [
        (photos / "a.png", tmp_path / "o/a.jpg", "jpg"),
        (photos / "sub/b.png", tmp_path / "o/sub/b.jpg", "jpg"),
    ]
    assert plan.target.size == (32, 24)
    assert tree(tmp_path) == before
    assert not (tmp_path / "o").exists()
    camcal.undistort(photos, camera_file, tmp_path / "o")
    before = stamps(tmp_path / "o")
    plan = camcal.undistort(photos, camera_file, tmp_path / "o", recursive=True, resume=True, dry_run=True)
    assert ([job.name for job in plan.already_done], plan.images) == (["a.png"], ("sub/b.png",))
    with pytest.raises(InputError, match="not empty"):
        camcal.undistort(photos, camera_file, tmp_path / "o", dry_run=True)
    assert stamps(tmp_path / "o") == before
