"""Lists of files on the standard input of `camcal undistort`."""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from messages import one_line


def test_a_list_on_standard_input(undistort, monkeypatch):
    """Lines or NUL-separated, beside other inputs; an entry that cannot be used is reported in the end with exit code 2."""
    for content in (b"photos/a.png\r\nphotos/b.png\n\n", b"photos/a.png\0photos/b.png\0"):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(content)))
        assert undistort("-", "photos/c.png", "-o", "flat", "--force")[:2] == (
            0,
            "flat: 3 undistorted images and their camera.yaml.\n",
        )
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"photos/a.png\ngone.png\n")))
    code, out, err = undistort("-", "-o", "some")
    assert (code, out) == (2, "some: 1 undistorted image and its camera.yaml.\n")
    assert err.splitlines() == [
        "camcal: warning: gone.png: passed over: no such file. Check the path.",
        "camcal: undistort: 1 of 2 files passed over (first: gone.png: no such file. Check the path.)",
    ]
    for stdin in (None, SimpleNamespace(buffer=io.BytesIO(b""))):
        monkeypatch.setattr(sys, "stdin", stdin)
        code, _, err = undistort("-", "-o", "none")
        assert (code, one_line(err)) == (
            2,
            "camcal: undistort: no images or videos given. Name some, or a folder that holds some.",
        )


@pytest.mark.parametrize("missing", ["photos/lost", "photos/lost.txt", "photos/b.png", "gone/", "photos/link.png"])
def test_a_list_with_something_that_is_not_there(undistort, monkeypatch, missing):
    """Whatever its name ends in, and a link that leads nowhere: named, with exit code 2; so it is in a dry run."""
    Path("photos/link.png").symlink_to("nowhere.png")
    Path("photos/b.png").unlink()
    for options in ((), ("--dry-run", "--force")):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(f"photos/a.png\n{missing}\n".encode())))
        code, _, err = undistort("-", "-o", "some", *options)
        assert code == 2
        assert err.splitlines() == [
            f"camcal: warning: {missing.rstrip('/')}: passed over: no such file. Check the path.",
            f"camcal: undistort: 1 of 2 files passed over (first: {missing.rstrip('/')}: no such file. Check the path.)",
        ]


def test_a_list_from_an_editor(undistort, monkeypatch):
    """A byte order mark, blanks behind a name and lines of blanks mean nothing; a name that ends in a blank does."""
    shutil.copy("photos/b.png", "photos/b.png ")
    lines = b"\xef\xbb\xbfphotos/a.png \t\r\n  \nphotos/c.png  \nphotos/b.png \n"
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(lines)))
    code, out, err = undistort("-", "-o", "flat")
    assert (code, out) == (0, "flat: 2 undistorted images and their camera.yaml.\n")
    assert err == "camcal: warning: 1 other file passed over (first: b.png ).\n"
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BytesIO(b"photos/a.png \0")))
    assert undistort("-", "-o", "none")[0] == 2
