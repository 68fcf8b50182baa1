"""`camcal board`: pages in each format, on the paper they fit."""

from __future__ import annotations

from messages import one_line


def test_board_landscape(run, tmp_path):
    """--landscape turns A4 onto its long side."""
    for flags, size, name in (((), "210 x 297 mm", "p.svg"), (("--landscape",), "297 x 210 mm", "l.svg")):
        code, out, _ = run("board", "checkerboard:5x4:25mm", "-o", tmp_path / name, "--paper", "a4", *flags)
        assert code == 0
        assert size in out
        width, height = size.split(" mm")[0].split(" x ")
        page = (tmp_path / name).read_text()
        assert f'width="{width}mm"' in page
        assert f'height="{height}mm"' in page


def test_board_pages(run, tmp_path):
    """A page in each format; an existing file needs --force; a board too big for the paper names one that fits."""
    for suffix in ("pdf", "svg", "png"):
        code, out, _ = run("board", "checkerboard:9x6:25mm", "-o", tmp_path / f"b.{suffix}", "--dpi", "72")
        assert code == 0
        assert "--board checkerboard:9x6:25mm" in out
        assert (tmp_path / f"b.{suffix}").stat().st_size > 500
    assert "--force" in one_line(run("board", "checkerboard:9x6:25mm", "-o", tmp_path / "b.pdf")[2])
    assert run("board", "checkerboard:9x6:25mm", "-o", tmp_path / "b.pdf", "--force")[0] == 0
    code, _, err = run("board", "aprilgrid:6x6:30mm:0.3", "-o", tmp_path / "c.pdf", "--paper", "a4")
    assert code == 2
    assert "a3" in one_line(err)
    assert not (tmp_path / "c.pdf").exists()
    assert run("board", "checkerboard:9x6:25mm", "-o", tmp_path / "b.doc")[0] == 2
