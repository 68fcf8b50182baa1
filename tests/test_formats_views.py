"""views.yaml: poses bit for bit, and every image's fate by name."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from camcal.errors import InputError
from camcal.formats.views_file import load_views, save_views
from camcal.geometry.pose import Pose
from camcal.records import ViewRecord

TEXT = st.text(st.characters(exclude_categories=("C", "Zl", "Zp")), min_size=1, max_size=30)
ANGLES = st.lists(st.floats(-3, 3), min_size=3, max_size=3)
LENGTHS = st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3)


@st.composite
def records(draw: st.DrawFn) -> ViewRecord:
    """Any view, used or rejected."""
    source, corners = draw(TEXT), draw(st.integers(0, 1000))
    if draw(st.booleans()):
        return ViewRecord(source, reason=draw(TEXT), corners=corners)
    pose = Pose.from_rvec(draw(ANGLES), draw(LENGTHS))
    rms_px = draw(st.floats(0, 10) | st.just(math.nan))
    return ViewRecord(source, "", pose, rms_px, corners, tuple(draw(st.lists(TEXT, max_size=2))))


@settings(deadline=None)
@given(st.lists(records(), max_size=5, unique_by=lambda record: record.source))
def test_round_trip_is_bit_exact(tmp_path_factory: pytest.TempPathFactory, given_: list[ViewRecord]) -> None:
    """Names of any characters, reasons, notes and the bits of every pose come back, in order."""
    path = tmp_path_factory.mktemp("views") / "views.yaml"
    save_views(path, given_)
    found = load_views(path)
    assert len(found) == len(given_)
    for one, other in zip(found, given_, strict=True):
        assert (one.source, one.reason, one.corners, one.notes) == (other.source, other.reason, other.corners, other.notes)
        assert (one.rms_px == other.rms_px) or (math.isnan(one.rms_px) and math.isnan(other.rms_px))
        assert (one.T_cam_board is None) == (other.T_cam_board is None)
        if one.T_cam_board is not None and other.T_cam_board is not None:
            assert one.T_cam_board.R.tobytes() == other.T_cam_board.R.tobytes()
            assert one.T_cam_board.t.tobytes() == other.T_cam_board.t.tobytes()


def test_layout_for_people_and_other_programs(tmp_path: Path) -> None:
    """A quarter turn about z, one metre away: R by rows, t in metres, rvec (0, 0, π/2); a rejected view has only its reason."""
    pose = Pose(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0, 0, 1]))
    name = "my board: #1 é 漢 😀.png"
    save_views(tmp_path / "views.yaml", [ViewRecord(name, "", pose, 0.25, 54), ViewRecord("b.png", "no board found")])
    used, rejected = yaml.safe_load((tmp_path / "views.yaml").read_text(encoding="utf-8"))["views"]
    assert (used["file"], used["status"], used["rms_px"], used["corners"]) == (name, "used", 0.25, 54)
    assert used["R"] == [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    assert used["t"] == [0.0, 0.0, 1.0]
    # One rounding each in the square root, the arc tangent and the product.
    assert used["rvec"] == pytest.approx([0.0, 0.0, math.pi / 2], rel=4 * np.finfo(float).eps)
    assert (rejected["status"], rejected["reason"]) == ("rejected", "no board found")
    assert not {"R", "t", "rvec"} & set(rejected)

    storage = cv2.FileStorage(str(tmp_path / "views.yaml"), cv2.FILE_STORAGE_READ)
    views = storage.getNode("views")
    assert views.at(0).getNode("file").string() == name
    assert views.at(0).getNode("R").at(0).at(1).real() == -1.0
    assert views.at(1).getNode("reason").string() == "no board found"


def test_rotation_matrix_is_what_is_read(tmp_path: Path) -> None:
    """An rvec that a person has changed changes nothing."""
    path = tmp_path / "views.yaml"
    save_views(path, [ViewRecord("a.png", "", Pose.identity(), 0.1, 9)])
    path.write_text(path.read_text().replace("rvec: [0.0, 0.0, 0.0]", "rvec: [1.0, 0.0, 0.0]"))
    (record,) = load_views(path)
    assert record.T_cam_board is not None
    assert record.T_cam_board.R.tolist() == np.eye(3).tolist()


def test_folder_stands_for_its_views_file(tmp_path: Path) -> None:
    """A folder is read by its views.yaml."""
    with pytest.raises(InputError, match=r"views\.yaml: no such file"):
        load_views(tmp_path)
    save_views(tmp_path / "views.yaml", [])
    assert load_views(tmp_path) == ()
