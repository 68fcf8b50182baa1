"""What reading and writing must not wait for: pydantic takes longer to import than most files to read."""

from __future__ import annotations

import pytest
from loaded_modules import loaded_by

WRITING = """
from camcal.formats.camera_file import camera_yaml
from camcal.formats.views_file import save_views
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
camera_yaml(Intrinsics(Camera((4, 3), [[1, 0, 0], [0, 1, 0], [0, 0, 1]])))
"""


@pytest.mark.parametrize(
    ("code", "absent"),
    [
        ("import camcal.formats.corners_file", {"pydantic", "yaml", "cv2"}),
        ("import camcal.formats.images", {"pydantic", "yaml", "PIL"}),
        ("import camcal.formats.output", {"pydantic", "yaml", "cv2", "numpy"}),
        ("from camcal.formats.board_file import load_board; load_board('checkerboard:9x6:25mm')", {"pydantic", "yaml", "cv2"}),
        (WRITING, {"pydantic", "cv2"}),
    ],
    ids=["corners", "images", "output", "one-liner", "writing"],
)
def test_heavy_imports_wait_until_they_are_needed(code: str, absent: set[str]) -> None:
    """A fresh interpreter has not loaded what the work at hand does not need."""
    assert not absent & loaded_by(code)
