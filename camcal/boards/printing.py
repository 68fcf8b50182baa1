"""Boards as printable files at true scale: PDF, SVG and PNG, as bytes."""

from __future__ import annotations

import io
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from camcal.boards.base import Board
from camcal.boards.fields import parse_choice
from camcal.boards.page import Anchor, Page, lay_out
from camcal.errors import InputError
from camcal.geometry.arrays import FloatArray

FileFormat = Literal["pdf", "svg", "png"]

_POINTS_PER_MM = 72 / 25.4
_MM_PER_INCH = 25.4
_DPI_LIMITS = (50, 2400)
_MOST_PIXELS = 150_000_000
# A cell of fewer pixels is off by more than an eighth of its side when its edges are rounded to whole pixels.
_FEWEST_PIXELS_PER_CELL = 4
_SVG = "http://www.w3.org/2000/svg"


def print_board(
    board: Board, *, file_format: FileFormat, paper: str = "auto", landscape: bool = False, dpi: int = 300
) -> bytes:
    """Draw a board on a sheet of paper at true scale, with a ruler to check the print and a caption that names the board.

    Parameters
    ----------
    board : Board
    file_format : {"pdf", "svg", "png"}
    paper : str
        A sheet's name (a4, a3, a2, a1, a0, letter, legal, tabloid), `WxHmm`, or "auto": the smallest of the A series,
        upright or turned, that the board fits.
    landscape : bool
        Whether the longer side of the sheet lies across.
    dpi : int
        Pixels per inch of a PNG; the other formats have no pixels.

    Returns
    -------
    bytes
        The file; the same bytes for the same input and the same versions of the libraries.

    Raises
    ------
    InputError
        If the board does not fit the sheet (names the one it would fit), or the format, the paper or the resolution
        makes no sense.
    """
    try:
        parse_choice(file_format, ("pdf", "svg", "png"), "file format")
    except ValueError as error:
        raise InputError(str(error)) from None
    page = lay_out(board, paper=paper, landscape=landscape)
    if file_format == "pdf":
        return _pdf(page)
    if file_format == "svg":
        return _svg(page)
    _check_resolution(board, page, dpi)
    return _png(page, dpi)


def _pdf(page: Page) -> bytes:
    """One page of vector rectangles; asks the viewer not to scale it."""
    from reportlab.pdfgen.canvas import Canvas

    out = io.BytesIO()
    size = (page.width_mm * _POINTS_PER_MM, page.height_mm * _POINTS_PER_MM)
    canvas = Canvas(out, pagesize=size, invariant=1, pageCompression=1)
    canvas.setTitle(page.spec)
    canvas.setCreator("camcal")
    canvas.setSubject("Calibration target at true scale: print at 100 %")
    canvas.setViewerPreference("PrintScaling", "None")
    canvas.setFillGray(0)
    for bars in (page.ink_mm, page.ruler_mm):
        # One path, because viewers show hairlines between neighbours that are filled one by one.
        path = canvas.beginPath()
        for left, top, right, bottom in (bars * _POINTS_PER_MM).tolist():
            path.rect(left, size[1] - bottom, right - left, bottom - top)
        canvas.drawPath(path, stroke=0, fill=1)
    draw = {Anchor.START: canvas.drawString, Anchor.MIDDLE: canvas.drawCentredString, Anchor.END: canvas.drawRightString}
    for text in page.texts:
        canvas.setFont("Helvetica", text.size_mm * _POINTS_PER_MM)
        draw[text.anchor](text.x_mm * _POINTS_PER_MM, size[1] - text.baseline_mm * _POINTS_PER_MM, text.text)
    canvas.showPage()
    canvas.save()
    return out.getvalue()


def _svg(page: Page) -> bytes:
    """Millimetres as user units; the board is one path and the ruler another."""
    ElementTree.register_namespace("", _SVG)
    width, height = _number(page.width_mm), _number(page.height_mm)
    size = {"width": f"{width}mm", "height": f"{height}mm", "viewBox": f"0 0 {width} {height}"}
    root = ElementTree.Element(f"{{{_SVG}}}svg", size)
    _element(root, "title", {}, page.spec)
    _element(root, "desc", {}, "Calibration target at true scale, made by camcal: print at 100 %")
    _element(root, "rect", {"width": width, "height": height, "fill": "#fff"})
    _element(root, "path", {"id": "board", "d": _svg_path(page.ink_mm)})
    _element(root, "path", {"id": "ruler", "d": _svg_path(page.ruler_mm)})
    group = _element(root, "g", {"font-family": "Helvetica, Arial, sans-serif"})
    for text in page.texts:
        place = {"x": _number(text.x_mm), "y": _number(text.baseline_mm)}
        _element(group, "text", place | {"font-size": _number(text.size_mm), "text-anchor": text.anchor}, text.text)
    ElementTree.indent(root)
    written: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return written + b"\n"


def _element(parent: ElementTree.Element, tag: str, attributes: dict[str, str], text: str | None = None) -> ElementTree.Element:
    """Append an SVG element."""
    child = ElementTree.SubElement(parent, f"{{{_SVG}}}{tag}", attributes)
    child.text = text
    return child


def _svg_path(bars: FloatArray) -> str:
    """Closed rectangles with absolute coordinates, so that no rounding adds up."""
    rows = ([_number(value) for value in bar] for bar in bars.tolist())
    return "".join(f"M{left} {top}H{right}V{bottom}H{left}Z" for left, top, right, bottom in rows)


def _number(value: float) -> str:
    """A coordinate in mm to the nanometre, without zeros at the end."""
    return f"{value:.6f}".rstrip("0").rstrip(".")


def _check_resolution(board: Board, page: Page, dpi: int) -> None:
    """Refuse a resolution that is absurd, too coarse for the board's cells, or too fine for memory."""
    low, high = _DPI_LIMITS
    if not low <= dpi <= high:
        raise InputError(f"dpi: absurd resolution (got {dpi:g}, expected {low} to {high})")
    pixels = page.width_mm * page.height_mm * (dpi / _MM_PER_INCH) ** 2
    if pixels > _MOST_PIXELS:
        most = int(dpi * (_MOST_PIXELS / pixels) ** 0.5)
        raise InputError(
            f"dpi: too many pixels (got {pixels / 1e6:.0f} million at {dpi} dpi, expected at most "
            f"{_MOST_PIXELS / 1e6:.0f} million). Use at most {most} dpi, or PDF."
        )
    edges = (board.pattern.x_edges_m, board.pattern.y_edges_m)
    smallest_mm = 1e3 * float(min(np.diff(e).min() for e in edges))
    if smallest_mm * dpi / _MM_PER_INCH < _FEWEST_PIXELS_PER_CELL:
        least = int(np.ceil(_FEWEST_PIXELS_PER_CELL * _MM_PER_INCH / smallest_mm))
        raise InputError(
            f"dpi: too coarse for cells of {smallest_mm:.3g} mm (got {dpi}, expected at least {least}). Use more, or PDF."
        )


def _png(page: Page, dpi: int) -> bytes:
    """Greyscale pixels; every edge is rounded from its exact place, so that errors never add up."""
    from PIL import Image, ImageDraw, ImageFont
    from PIL.PngImagePlugin import PngInfo

    per_mm = dpi / _MM_PER_INCH
    width, height = round(page.width_mm * per_mm), round(page.height_mm * per_mm)
    pixels = np.full((height, width), 255, dtype=np.uint8)
    bars = np.rint(np.concatenate([page.ink_mm, page.ruler_mm]) * per_mm).astype(np.int64)
    # A line thinner than a pixel is still drawn.
    bars[:, 2:] = np.maximum(bars[:, 2:], bars[:, :2] + 1)
    for left, top, right, bottom in bars.tolist():
        pixels[top:bottom, left:right] = 0
    image = Image.fromarray(pixels)
    draw = ImageDraw.Draw(image)
    anchors = {Anchor.START: "ls", Anchor.MIDDLE: "ms", Anchor.END: "rs"}
    for text in page.texts:
        font = ImageFont.load_default(size=text.size_mm * per_mm)
        draw.text((text.x_mm * per_mm, text.baseline_mm * per_mm), text.text, fill=0, font=font, anchor=anchors[text.anchor])
    info = PngInfo()
    info.add_text("Title", page.spec)
    info.add_text("Description", "Calibration target at true scale: print at 100 %")
    info.add_text("Software", "camcal")
    out = io.BytesIO()
    image.save(out, format="PNG", dpi=(dpi, dpi), pnginfo=info)
    return out.getvalue()
