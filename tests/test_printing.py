"""Printed boards read back: true to scale in every format, the same bytes each time, and refused with advice."""

from __future__ import annotations

import io
import re
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from PIL import Image
from pypdf import PdfReader

from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.base import Board
from camcal.boards.checkerboard import Checkerboard
from camcal.boards.printing import print_board
from camcal.errors import InputError

CHECKERBOARD = Checkerboard(9, 6, 0.025)
APRILGRID = AprilGrid(6, 6, 0.024, 0.0072)
MM_PER_POINT = 25.4 / 72
# Where the first square or tag stands on its sheet, by hand: 297 mm less 10 squares of 25, halved; half a square from the top.
# 210 mm less 6 tags of 24 and 7 gaps of 7.2, halved, plus a gap; 297 mm less the same, halved, plus a gap.
CHECKERBOARD_ORIGIN_MM = np.array([23.5 + 25, 12.5 + 25])
APRILGRID_ORIGIN_MM = np.array([7.8 + 7.2, 51.3 + 7.2])


def pdf_rectangles_mm(data: bytes) -> tuple[np.ndarray, tuple[float, float]]:
    """Left, top, right, bottom in mm of every rectangle of a PDF's only page, y down, and the page's size in mm."""
    (page,) = PdfReader(io.BytesIO(data)).pages
    width, height = (float(v) * MM_PER_POINT for v in page.mediabox[2:])
    content = page.get_contents().get_data().decode("latin-1")
    found = re.findall(r"([-\d.]+) ([-\d.]+) ([-\d.]+) ([-\d.]+) re\b", content)
    x, y, w, h = np.array(found, dtype=float).T * MM_PER_POINT
    return np.stack([x, height - y - h, x + w, height - y], axis=1), (width, height)


def svg_rectangles_mm(data: bytes, path_id: str) -> np.ndarray:
    """Left, top, right, bottom in mm of every rectangle of one path of an SVG."""
    path = ElementTree.fromstring(data).find(f".//{{*}}path[@id='{path_id}']")
    found = re.findall(r"M([-\d.]+) ([-\d.]+)H([-\d.]+)V([-\d.]+)H\1Z", path.get("d"))
    assert len(found) == path.get("d").count("M")
    return np.array(found, dtype=float)


def covers(rectangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """How many rectangles (N, 4) hold each of the points (M, 2)."""
    left, top, right, bottom = rectangles.T[:, :, None]
    x, y = points.T
    return ((x >= left) & (x < right) & (y >= top) & (y < bottom)).sum(axis=0)


def a4(board: Board, file_format: str, **options) -> bytes:
    """The board on the A4 sheet that its hand-worked origin belongs to."""
    return print_board(board, file_format=file_format, paper="a4", landscape=isinstance(board, Checkerboard), **options)


def test_pdf_squares_are_25_mm_where_they_belong():
    """35 black squares of 25 mm on a lying A4, the first at (23.5, 12.5) mm, then a 100 mm ruler in the bottom strip."""
    rectangles, sheet = pdf_rectangles_mm(a4(CHECKERBOARD, "pdf"))
    assert sheet == pytest.approx((297, 210), abs=0.01)
    squares, base_line = rectangles[:35], rectangles[35]
    sides = np.stack([squares[:, 2] - squares[:, 0], squares[:, 3] - squares[:, 1]])
    assert sides == pytest.approx(np.full((2, 35), 25.0), abs=0.01)
    steps = (squares[:, :2] - [23.5, 12.5]) / 25
    assert steps == pytest.approx(np.rint(steps), abs=0.01 / 25)
    assert sorted(map(tuple, np.rint(steps).astype(int).tolist())) == [
        (i, j) for i in range(10) for j in range(7) if (i + j) % 2 == 0
    ]
    assert base_line[2] - base_line[0] == pytest.approx(100, abs=0.01)


def test_pdf_ruler_has_a_tick_each_millimetre():
    """101 ticks, one millimetre apart from end to end of the base line; labels 0 to 100 and the unit."""
    data = a4(CHECKERBOARD, "pdf")
    rectangles, _ = pdf_rectangles_mm(data)
    base_line, ticks = rectangles[35], rectangles[36:]
    middle = (ticks[:, 0] + ticks[:, 2]) / 2
    assert middle == pytest.approx(base_line[0] + np.arange(101), abs=0.01)
    lines = PdfReader(io.BytesIO(data)).pages[0].extract_text().split()
    assert [str(n) for n in range(0, 101, 10)] == [line for line in lines if line.isdigit()][:11]


@pytest.mark.parametrize("board", [CHECKERBOARD, APRILGRID])
@pytest.mark.parametrize("file_format", ["pdf", "svg"])
def test_vector_files_are_black_exactly_where_the_pattern_is(board, file_format):
    """At random points of the board every file is inked where the pattern says so, and never twice."""
    data = a4(board, file_format)
    rectangles = pdf_rectangles_mm(data)[0] if file_format == "pdf" else svg_rectangles_mm(data, "board")
    origin = CHECKERBOARD_ORIGIN_MM if isinstance(board, Checkerboard) else APRILGRID_ORIGIN_MM
    quiet = board.pattern.x_edges_m[1] - board.pattern.x_edges_m[0]
    left, top, right, bottom = board.pattern.extent_m
    points = np.random.default_rng(1).uniform((left + quiet, top + quiet), (right - quiet, bottom - quiet), (20_000, 2))
    # Points closer to a line than the written coordinates are exact (1e-6 points or mm) tell nothing.
    lines = (board.pattern.x_edges_m, board.pattern.y_edges_m)
    clear = np.all([np.abs(points[:, axis, None] - lines[axis]).min(axis=1) > 1e-8 for axis in (0, 1)], axis=0)
    assert (covers(rectangles, points[clear] * 1e3 + origin) == board.pattern.ink_at(points[clear])).all()


def test_svg_is_in_millimetres():
    """Size with unit, one user unit a millimetre, ruler of 100, title and caption with the SPEC."""
    data = a4(CHECKERBOARD, "svg")
    root = ElementTree.fromstring(data)
    assert (root.get("width"), root.get("height"), root.get("viewBox")) == ("297mm", "210mm", "0 0 297 210")
    ruler = svg_rectangles_mm(data, "ruler")
    assert ruler[0, 2] - ruler[0, 0] == pytest.approx(100, abs=1e-6)
    assert root.findtext("{*}title") == "checkerboard:9x6:25mm"
    texts = [element.text for element in root.iterfind(".//{*}text")]
    assert "camcal calibrate IMAGES --board checkerboard:9x6:25mm" in texts


def test_pdf_asks_not_to_be_scaled_and_names_its_board():
    """Title, print preference and caption."""
    reader = PdfReader(io.BytesIO(a4(APRILGRID, "pdf")))
    assert reader.metadata.title == "aprilgrid:6x6:24mm:0.3"
    assert reader.trailer["/Root"]["/ViewerPreferences"]["/PrintScaling"] == "/None"
    text = reader.pages[0].extract_text()
    assert "--board aprilgrid:6x6:24mm:0.3" in text
    assert "Print at 100 %" in text
    assert "measure 100 mm" in text


def test_png_says_its_resolution_and_board():
    """300 dpi is 11811 pixels a metre; A4 lying is 3508 x 2480 pixels."""
    data = a4(CHECKERBOARD, "png")
    place = data.index(b"pHYs") + 4
    assert data[place : place + 9] == (11811).to_bytes(4, "big") * 2 + b"\x01"
    image = Image.open(io.BytesIO(data))
    assert image.size == (3508, 2480)
    assert image.text["Title"] == "checkerboard:9x6:25mm"


def test_png_edges_never_drift():
    """At 110 dpi a square is 108.27 pixels; every edge of the last row stays within half a pixel of its exact place."""
    pixels = np.asarray(Image.open(io.BytesIO(a4(CHECKERBOARD, "png", dpi=110))))
    per_mm = 110 / 25.4
    row = pixels[round((12.5 + 6.5 * 25) * per_mm)] < 128
    edges = np.flatnonzero(np.diff(row.astype(int))) + 1
    assert edges.size == 10
    assert np.abs(edges - (23.5 + 25 * np.arange(10)) * per_mm).max() <= 0.5


def test_opencv_finds_the_printed_checkerboard_in_place():
    """At 254 dpi every edge is a whole pixel: corners stand in place within four times cornerSubPix's .018 px floor."""
    image = cv2.imdecode(np.frombuffer(a4(CHECKERBOARD, "png", dpi=254), np.uint8), cv2.IMREAD_GRAYSCALE)
    small = cv2.resize(image, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    found, corners = cv2.findChessboardCorners(small, (9, 6))
    assert found
    start = (corners.reshape(-1, 1, 2) + 0.5) * 4 - 0.5
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    seen = cv2.cornerSubPix(image, start.astype(np.float32), (15, 15), (-1, -1), criteria).reshape(-1, 2)
    seen = seen if seen[0].sum() < seen[-1].sum() else seen[::-1]
    truth = (CHECKERBOARD.object_points[:, :2] * 1e3 + CHECKERBOARD_ORIGIN_MM) * 10 - 0.5
    assert np.abs(seen - truth).max() < 4 * 0.018


@pytest.mark.parametrize(
    ("board", "origin_mm"),
    [
        (APRILGRID, APRILGRID_ORIGIN_MM),
        (AprilGrid(6, 6, 0.024, 0.0072, first="top-left", border_bits=1, squares=False), APRILGRID_ORIGIN_MM),
        (AprilGrid(6, 6, 0.024, 0.0072, family="tag36h10", border_bits=1), APRILGRID_ORIGIN_MM),
    ],
)
def test_opencv_reads_the_printed_aprilgrid_in_place(board, origin_mm):
    """Every tag is read with its id, and its corners BR, BL, TL, TR stand at their features: nearer than half a gap."""
    dpi = 127
    image = cv2.imdecode(np.frombuffer(a4(board, "png", dpi=dpi), np.uint8), cv2.IMREAD_GRAYSCALE)
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = board.border_bits
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_APRILTAG_{board.family[3:]}"))
    corners, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(image)
    assert sorted(np.ravel(ids)) == list(range(36))
    features = 4 * np.ravel(ids)[:, None] + [1, 0, 3, 2]
    truth = (board.object_points[features][..., :2] * 1e3 + origin_mm) * dpi / 25.4 - 0.5
    half_gap_px = 3.6 * dpi / 25.4
    assert np.abs(np.reshape(corners, (-1, 4, 2)) - truth).max() < half_gap_px


def test_saddles_of_the_printed_aprilgrid_stand_in_place():
    """Tag corners that touch corner squares refine to their features, within four times cornerSubPix's .024 px."""
    image = cv2.imdecode(np.frombuffer(a4(APRILGRID, "png", dpi=254), np.uint8), cv2.IMREAD_GRAYSCALE)
    truth = (APRILGRID.object_points[:, :2] * 1e3 + APRILGRID_ORIGIN_MM) * 10 - 0.5
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    start = np.add(truth, [2.0, -1.5]).astype(np.float32).reshape(-1, 1, 2)
    seen = cv2.cornerSubPix(image, start, (10, 10), (-1, -1), criteria).reshape(-1, 2)
    assert np.abs(seen - truth).max() < 4 * 0.024


@pytest.mark.parametrize("file_format", ["pdf", "svg", "png"])
def test_the_same_board_is_the_same_bytes(file_format):
    """No clock and no random number gets into a file."""
    assert a4(CHECKERBOARD, file_format) == a4(CHECKERBOARD, file_format)


@pytest.mark.parametrize(
    ("board", "options", "problem"),
    [
        (
            CHECKERBOARD,
            {"paper": "a4"},
            r"does not fit 210 x 297 mm .it needs 275x210mm.*Use --paper a4 --landscape\.$",
        ),
        (AprilGrid(6, 6, 0.03, 0.009), {"paper": "a4"}, r"Use --paper a3\.$"),
        (AprilGrid(6, 6, 0.03, 0.009), {"paper": "letter"}, r"Use --paper tabloid\.$"),
        (Checkerboard(90, 60, 0.02), {"paper": "a4"}, r"Use --paper 1840x1250mm\.$"),
        (Checkerboard(9, 6, 1.0), {}, r"fits no sheet of the A series .*Use a smaller board\.$"),
        (CHECKERBOARD, {"paper": "leter"}, "Did you mean 'letter'"),
        (CHECKERBOARD, {"paper": "10x10mm"}, "absurd size"),
        (CHECKERBOARD, {"paper": "297x210"}, "e.g. 210x297mm"),
        (CHECKERBOARD, {"file_format": "jpg"}, "expected one of pdf, svg, png"),
        (CHECKERBOARD, {"file_format": "png", "dpi": 0}, "dpi: absurd resolution"),
        (CHECKERBOARD, {"file_format": "png", "dpi": 100_000}, "dpi: absurd resolution"),
        (CHECKERBOARD, {"file_format": "png", "dpi": 2400}, r"too many pixels .*Use at most 1245 dpi"),
        (Checkerboard(9, 6, 0.0005), {"file_format": "png", "dpi": 150}, "too coarse .*at least 204"),
    ],
)
def test_what_cannot_be_printed_is_refused_with_advice(board, options, problem):
    """Each refusal names what is wrong and what to take instead."""
    with pytest.raises(InputError, match=problem):
        print_board(board, **({"file_format": "pdf"} | options))


def test_the_finest_resolution_it_names_is_accepted():
    """1245 dpi on A4 stays under the limit of 150 million pixels: 297 x 210 / 25.4² x 1245² = 149.8 million."""
    with pytest.raises(InputError, match="too many pixels"):
        a4(CHECKERBOARD, "png", dpi=1246)
    assert 297 * 210 / 25.4**2 * 1245**2 < 150e6
