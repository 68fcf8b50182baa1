"""Every file of tests/data/invalid is refused on the right line, at the right key, in one sentence."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from camcal.errors import InputError
from camcal.formats.board_file import load_board
from camcal.formats.camera_file import load_intrinsics
from camcal.formats.corners_file import load_corners
from camcal.formats.images import find_images, read_gray, read_image
from camcal.formats.scenario_file import load_scenario
from camcal.formats.views_file import load_views
from camcal.formats.yaml_io import load_yaml

FOLDER = Path(__file__).parent / "data" / "invalid"

LOADERS: dict[str, Callable[[Path], Any]] = {
    "yaml": load_yaml,
    "camera": load_intrinsics,
    "views": load_views,
    "board": lambda path: load_board(str(path)),
    "scenario": load_scenario,
    "corners": load_corners,
    "image": read_image,
}

# Name of the file: what follows its path in the message, as `:line: key: start of the problem` (both are left out where
# a whole file is at fault).
EXPECTED = {
    "board_border.yaml": ":6: border_bits: not a border that tags are printed with",
    "board_few_rows.yaml": ":3: rows: too few (got 1, expected at least 3)",
    "board_fraction_columns.yaml": ":2: columns: wrong type (got 9.5, expected a whole number)",
    "board_huge.yaml": ":3: rows: too many (got 1000000, expected at most 100)",
    "board_kalibr_circles.yaml": ":1: target_type: unknown kind of board (got 'circlegrid', expected checkerboard "
    "or aprilgrid). Circles are not detected",
    "board_kalibr_no_size.yaml": ":1: tagSize: missing (expected this key). Add it.",
    "board_kalibr_oblong.yaml": ":5: colSpacingMeters: squares must be square",
    "board_kalibr_offset.yaml": ":6: codeOffset: unknown (got 4, expected 0)",
    "board_kalibr_spacing.yaml": ":5: tagSpacing: absurd",
    "board_negative_square.yaml": ":4: square_m: must be positive (got -0.025 m)",
    "board_no_gap.yaml": ":1: gap_m: missing (expected this key). Add it.",
    "board_no_type.yaml": ":1: type: missing",
    "board_square_in_mm.yaml": ":4: square_m: absurd size",
    "board_square_typo.yaml": ":4: sqare_m: unknown key",
    "board_text_square.yaml": ":4: square_m: wrong type (got '25mm', expected a number)",
    "board_too_many_tags.yaml": ":2: columns: more tags than tag36h11 has",
    "board_type_list.yaml": ":1: type: unknown kind of board",
    "board_unknown_family.yaml": ":6: family: unknown",
    "board_unknown_type.yaml": ":1: type: unknown kind of board",
    "camera_bad_projection.yaml": ":25: projection_matrix.cols: wrong shape (got 3x3, expected 3x4)",
    "camera_bool_size.yaml": ":4: image_width: wrong type (got true, expected a number)",
    "camera_camcal_not_mapping.yaml": ":28: camcal: wrong type (got 1, expected a mapping)",
    "camera_correlations_asymmetric.yaml": ":36: camcal.correlations: not correlations",
    "camera_correlations_shape.yaml": ":36: camcal.correlations: wrong shape",
    "camera_fisheye.yaml": ":7: distortion_model: unsupported lens model",
    "camera_fraction_size.yaml": ":4: image_width: wrong type (got 1280.5, expected a whole number)",
    "camera_missing_matrix.yaml": ":4: camera_matrix: missing (expected this key). Add it.",
    "camera_nan.yaml": ":12: camera_matrix.data[2]: not finite",
    "camera_negative_focal.yaml": ":12: camera_matrix.data: not an intrinsic matrix",
    "camera_negative_sigma.yaml": ":33: camcal.standard_deviations: fy is out of range",
    "camera_negative_views.yaml": ":38: camcal.views: out of range (got -1, expected at least 0)",
    "camera_no_version.yaml": ":28: camcal.format_version: missing (expected this key). Add it.",
    "camera_overflow.yaml": ":17: distortion_coefficients.data[0]: not finite",
    "camera_ros_equidistant.yaml": ":8: distortion_model: unsupported lens model",
    "camera_ros_no_size.yaml": ":1: image_width: missing (expected this key). Add it.",
    "camera_short_data.yaml": ":12: camera_matrix.data: wrong number of values",
    "camera_sigma_missing.yaml": ":33: camcal.standard_deviations: not the free intrinsics",
    "camera_text_number.yaml": ":12: camera_matrix.data[2]: wrong type",
    "camera_too_many_coefficients.yaml": ":17: distortion_coefficients.data: wrong number of coefficients for plumb_bob",
    "camera_transposed.yaml": ":12: camera_matrix.data: not an intrinsic matrix",
    "camera_verdict_without_its_findings.yaml": ":41: camcal.verdict: contradicts its findings",
    "camera_typo.yaml": ":5: image_heigth: unknown key",
    "camera_unknown_free.yaml": ":32: camcal.free: not names of intrinsics in their order",
    "camera_unknown_key.yaml": ":39: camcal.weather: unknown key",
    "camera_unknown_lens.yaml": ":7: distortion_model: unsupported lens model",
    "camera_version_text.yaml": ":29: camcal.format_version: another version of the format",
    "camera_wrong_rows.yaml": ":9: camera_matrix.rows: wrong shape (got 2x3, expected 3x3)",
    "camera_wrong_version.yaml": ":29: camcal.format_version: another version of the format",
    "camera_zero_size.yaml": ":4: image_width: not an image size (got 0, expected 1 to 1000000)",
    "corners_bad_used.csv": ":2: used: not 1 or 0 (got 'maybe')",
    "corners_column_twice.csv": ":1: x: column given twice. Remove one of the two.",
    "corners_duplicate.csv": ":4: id: corner 0 of this image again (it is on line 2 already)",
    "corners_empty.csv": ": empty file (0 bytes). Write or copy it again.",
    "corners_empty_cell.csv": ":3: y: missing (expected a number)",
    "corners_fraction_id.csv": ":2: id: out of range",
    "corners_infinite.csv": ":2: y: out of range (got 'inf', expected a number of pixels)",
    "corners_missing_column.csv": ":1: y: missing column",
    "corners_missing_size.csv": ":1: width: missing column",
    "corners_nan.csv": ":2: x: out of range (got 'nan', expected a number of pixels)",
    "corners_negative_id.csv": ":2: id: out of range",
    "corners_no_header.csv": ":1: image: missing column",
    "corners_no_image.csv": ":2: image: missing (expected the image's name)",
    "corners_not_utf8.csv": ":2: not UTF-8 text (byte 0xe9). Save it as UTF-8.",
    "corners_only_header.csv": ": no corners (only a header). Write at least three views into it.",
    "corners_open_quote.csv": ":2: not valid CSV (unexpected end of data). Check the quotes.",
    "corners_ragged.csv": ":3: wrong number of cells (got 5, expected 6)",
    "corners_semicolons.csv": ":1: columns not separated by commas",
    "corners_text_number.csv": ":3: x: not a number (got 'left')",
    "corners_two_sizes.csv": ":3: width: another size of the same image (line 2 has another)",
    "corners_utf16.csv": ":1: not UTF-8 text (byte 0xff). Save it as UTF-8.",
    "corners_zero_sigma.csv": ":2: sigma: out of range",
    "corners_zero_width.csv": ":2: width: out of range",
    "image_flipped_bit.png": ": damaged image",
    "image_header_only.jpg": ": truncated image (it ends after 30 bytes). Copy it again.",
    "image_header_only.png": ": truncated image (it ends after 20 bytes). Copy it again.",
    "image_int32.tif": ": unsupported pixels",
    "image_text.png": ": not an image",
    "image_text.txt": ": not an image",
    "image_truncated.bmp": ": truncated or damaged image (2075 bytes). Copy it again.",
    "image_truncated.jpg": ": truncated image (it ends after 745 bytes). Copy it again.",
    "image_truncated.png": ": truncated image (it ends after 664 bytes). Copy it again.",
    "image_truncated.tif": ": truncated or damaged image (741 bytes). Copy it again.",
    "image_zero_bytes.png": ": empty file (0 bytes). Write or copy it again.",
    "scenario_board_file_missing.yaml": ":10: board: ",
    "scenario_board_number.yaml": ":10: board: wrong type",
    "scenario_board_spec.yaml": ":10: board: board 'checkerboard:9x6:25': square: no unit",
    "scenario_both_blurs.yaml": ":22: sensor.defocus_radius_px: a second blur",
    "scenario_camera_missing.yaml": ":1: camera: missing (expected this key). Add it.",
    "scenario_fill_over_one.yaml": ":15: views.fill: out of range",
    "scenario_huge_size.yaml": ":4: camera.size[1]: out of range (got 200000, expected at most 20000)",
    "scenario_infinite_focal.yaml": ":5: camera.fx: not finite (got inf, expected a finite number)",
    "scenario_negative_light.yaml": ":18: light.white: out of range (got -0.86, expected at least 0)",
    "scenario_negative_seed.yaml": ":2: seed: out of range (got -1, expected at least 0)",
    "scenario_no_contrast.yaml": ":19: light.black: no contrast",
    "scenario_no_seed.yaml": ":1: seed: missing (expected this key). Add it.",
    "scenario_no_views.yaml": ":12: views.count: out of range (got 0, expected at least 1)",
    "scenario_partial_checkerboard.yaml": ":16: views.partial: not with a checkerboard, which is found only as a whole",
    "scenario_partial_text.yaml": ":16: views.partial: wrong type",
    "scenario_size_of_one.yaml": ":4: camera.size: wrong length (got a list of 1, expected 2 values)",
    "scenario_size_of_three.yaml": ":4: camera.size: wrong length (got a list of 3, expected 2 values)",
    "scenario_size_text.yaml": ":4: camera.size: wrong type (got '1280x720', expected a list)",
    "scenario_text_seed.yaml": ":2: seed: wrong type (got 'today', expected a whole number)",
    "scenario_tilt_past_edge.yaml": ":13: views.tilt_deg: out of range",
    "scenario_tilt_reversed.yaml": ":13: views.tilt_deg: not an interval",
    "scenario_tilt_typo.yaml": ":13: views.tilt_degrees: unknown key",
    "scenario_tiny_size.yaml": ":4: camera.size[1]: out of range (got 0, expected at least 16)",
    "scenario_too_many_views.yaml": ":12: views.count: out of range (got 100000, expected at most 10000)",
    "scenario_twelve_bits.yaml": ":22: sensor.bits: unknown (got 12, expected 8 or 16)",
    "scenario_two_faults.yaml": ":2: seed: out of range (got -1, expected at least 0) (and 1 more)",
    "scenario_unknown_coefficient.yaml": ":9: camera.distortion.k7: unknown key",
    "scenario_zero_focal.yaml": ":5: camera.fx: out of range (got 0, expected more than 0)",
    "views_duplicate_file.yaml": ":15: views[1].file: a second view of 'a.png' (the first is on line 7)",
    "views_mapping.yaml": ":2: views: wrong type (got a mapping, expected a list)",
    "views_mirrored.yaml": ":9: views[0].R: not a rotation matrix",
    "views_missing.yaml": ":1: views: missing (expected this key). Add it.",
    "views_no_translation.yaml": ":7: views[0]: half a pose (expected both R and t, or neither)",
    "views_not_a_rotation.yaml": ":9: views[0].R: not a rotation matrix",
    "views_rejected_without_reason.yaml": ":16: views[1].status: contradicts reason",
    "views_short_row.yaml": ":9: views[0].R[1]: wrong length (got a list of 2, expected 3 values)",
    "views_unknown_status.yaml": ":16: views[1].status: unknown",
    "views_unquoted_number.yaml": ":15: views[1].file: wrong type",
    "views_used_with_reason.yaml": ":16: views[1].status: contradicts reason",
    "views_wrong_version.yaml": ":5: format_version: another version of the format",
    "yaml_bad_indent.yaml": ":2: not valid YAML",
    "yaml_billion_laughs.yaml": ":6: f: too many values (more than 500000, aliases written out)",
    "yaml_binary.yaml": ":2: not a text file (it has the character '\\x00')",
    "yaml_custom_tag.yaml": ":1: a: unsupported tag",
    "yaml_deep_blocks.yaml": ":3: b: nested too deeply (more than 40 levels)",
    "yaml_deep_nesting.yaml": ":2: b: nested too deeply (more than 40 levels)",
    "yaml_duplicate_key.yaml": ":4: camera.fx: duplicate key",
    "yaml_empty.yaml": ": empty file (0 bytes). Write or copy it again.",
    "yaml_list.yaml": ":1: not a mapping (got a list of 2, expected `key: value` lines)",
    "yaml_list_as_key.yaml": ":2: a key that is not plain text",
    "yaml_not_utf8.yaml": ":2: not UTF-8 text (byte 0xe9). Save it as UTF-8.",
    "yaml_only_comments.yaml": ": empty file (expected YAML). Write it again.",
    "yaml_python_name.yaml": ":2: a.b: unsupported tag",
    "yaml_python_object.yaml": ":2: b: unsupported tag",
    "yaml_recursive_alias.yaml": ":2: b[1]: alias *b",
    "yaml_scalar.yaml": ":1: not a mapping (got 'just some text', expected `key: value` lines)",
    "yaml_tab.yaml": ":2: not valid YAML",
    "yaml_tagged_key.yaml": ":2: unsupported tag",
    "yaml_two_documents.yaml": ":3: a second document",
    "yaml_unclosed.yaml": ":3: not valid YAML",
    "yaml_unknown_alias.yaml": ":1: a: alias *nothing",
    "yaml_version_2.yaml": ":1: not valid YAML",
    "yaml_white_space.yaml": ": empty file (only white space). Write or copy it again.",
}


@pytest.mark.parametrize("path", sorted(FOLDER.iterdir()), ids=lambda path: path.name)
def test_invalid_file_is_refused_in_one_sentence(path: Path) -> None:
    """The message says the file, the line, the key and the problem, on one line; the exit code is 2; it takes no time."""
    assert path.name in EXPECTED, f"{path.name}: say in EXPECTED how it is to be refused"
    started = time.process_time()
    with pytest.raises(InputError) as caught:
        LOADERS[path.name.partition("_")[0]](path)
    # Refusing the widest of them takes .2 s here; a bomb that goes off takes minutes.
    assert time.process_time() - started < 5
    message = str(caught.value)
    assert message.startswith(str(path) + EXPECTED[path.name])
    assert caught.value.exit_code == 2
    assert message.isprintable()
    assert len(message) < len(str(path)) + 400


def test_every_expectation_has_its_file() -> None:
    """No expectation outlives its file."""
    assert set(EXPECTED) == {path.name for path in FOLDER.iterdir()}


@pytest.mark.parametrize("path", sorted(FOLDER.glob("image_*")), ids=lambda path: path.name)
def test_invalid_image_is_refused_by_every_reader(path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """A bad image is refused in grey as well, without a word from the codecs on the terminal."""
    with pytest.raises(InputError, match=re.escape(str(path))):
        read_gray(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("image_*.[pj][np]g")), ids=lambda path: path.name)
def test_named_invalid_image_is_refused_before_any_work(path: Path) -> None:
    """An image that is named and visibly bad is refused while images are being looked for."""
    with pytest.raises(InputError, match=re.escape(str(path))):
        find_images([path])
