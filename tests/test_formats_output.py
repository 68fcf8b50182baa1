"""Files written whole or not at all, and never over somebody's work unasked."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from camcal.errors import InputError
from camcal.formats.output import claim_file, claim_folder, write_atomically

AS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


@pytest.mark.parametrize("content", [b"\x00\xff\r\n", "é\r\n漢\n"])
def test_content_is_written_as_it_is(tmp_path: Path, content: bytes | str) -> None:
    """Bytes as they are, text as UTF-8 with its line ends, nothing else left in the folder; readable as any new file is."""
    path = tmp_path / "file.bin"
    write_atomically(path, content)
    assert path.read_bytes() == (content if isinstance(content, bytes) else content.encode())
    assert list(tmp_path.iterdir()) == [path]
    (tmp_path / "other").touch()
    assert path.stat().st_mode == (tmp_path / "other").stat().st_mode


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, MemoryError, SystemExit])
@pytest.mark.parametrize("step", ["write_bytes", "replace"])
def test_an_interruption_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str, interruption: type[BaseException]
) -> None:
    """Ctrl-C in the middle of writing or just before renaming: the old content stays, the temporary file goes."""
    path = tmp_path / "file.txt"
    path.write_text("old")

    def interrupted(self: Path, *_: object) -> None:
        # Half of the content is on disk already.
        with self.open("w") as stream:
            stream.write("ne")
        raise interruption

    monkeypatch.setattr(Path, step, interrupted)
    with pytest.raises(interruption):
        write_atomically(path, "new")
    monkeypatch.undo()
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("file.txt", "old")]


def test_what_cannot_be_written_is_an_input_error(tmp_path: Path) -> None:
    """A missing folder, a folder in the file's place, a file in the folder's place; nothing is left behind."""
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("x")
    for place in ("missing/file.txt", "folder", "file/file.txt", "x" * 300):
        with pytest.raises(InputError, match="cannot be written"):
            write_atomically(tmp_path / place, "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_a_new_folder_is_created_with_its_parents(tmp_path: Path) -> None:
    """And is empty; claiming an empty one again is fine."""
    folder = claim_folder(tmp_path / "a" / "b")
    assert folder == tmp_path / "a" / "b"
    assert list(folder.iterdir()) == []
    assert claim_folder(str(folder)) == folder


def test_content_is_kept_unless_forced(tmp_path: Path) -> None:
    """A folder with anything in it is refused by naming --force, which takes nothing away either."""
    (tmp_path / "precious.txt").write_text("x")
    with pytest.raises(InputError, match=r"not empty.*--force"):
        claim_folder(tmp_path)
    assert claim_folder(tmp_path, force=True) == tmp_path
    assert [path.name for path in tmp_path.iterdir()] == ["precious.txt"]


@pytest.mark.parametrize("force", [False, True])
def test_a_file_in_the_way_is_never_removed(tmp_path: Path, force: bool) -> None:
    """Neither where the folder should be, nor where one of its parents should be."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="a file stands where the output folder should be"):
        claim_folder(tmp_path / "file", force)
    with pytest.raises(InputError, match="cannot be written"):
        claim_folder(tmp_path / "file" / "below", force)
    assert (tmp_path / "file").read_text() == "x"


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The attempt decides, whatever the permissions say."""

    def refused(self: Path, *_: object) -> None:
        raise PermissionError(30, "Read-only file system", str(self))

    monkeypatch.setattr(Path, "touch", refused)
    with pytest.raises(InputError, match=r"cannot be written \(read-only file system\)"):
        claim_folder(tmp_path)


@pytest.mark.skipif(AS_ROOT, reason="root may write anywhere")
def test_permissions_are_respected(tmp_path: Path) -> None:
    """A folder without write permission is refused before any work."""
    tmp_path.chmod(0o555)
    try:
        with pytest.raises(InputError, match="cannot be written"):
            claim_folder(tmp_path)
    finally:
        tmp_path.chmod(0o755)


def test_claiming_a_file(tmp_path: Path) -> None:
    """A new file gets its folder; an existing one needs --force; a folder is not a file."""
    path = claim_file(tmp_path / "new" / "board.pdf")
    assert path.parent.is_dir()
    assert not path.exists()
    path.write_text("x")
    with pytest.raises(InputError, match=r"output file exists.*--force"):
        claim_file(path)
    assert claim_file(path, force=True).read_text() == "x"
    with pytest.raises(InputError, match="a folder"):
        claim_file(tmp_path, force=True)
    with pytest.raises(InputError, match="a file stands"):
        claim_file(path / "below.pdf")
