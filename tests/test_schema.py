"""The JSON Schemas of the YAML files: valid themselves, and of one mind with the readers, up to what only code can know.

Run as a program it writes them to `docs/schemas/`.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from camcal import resources
from camcal.boards.spec import parse_board
from camcal.cli import main
from camcal.errors import InputError
from camcal.formats.board_file import board_yaml, load_board
from camcal.formats.camera_file import save_intrinsics
from camcal.formats.json_schema import KINDS, field_docs, json_schema, schema_text
from camcal.formats.yaml_io import load_yaml
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics
from camcal.workflows.export_board import export_board

jsonschema = pytest.importorskip("jsonschema")

STORED = Path(__file__).resolve().parents[1] / "docs" / "schemas"
INVALID = Path(__file__).parent / "data" / "invalid"
FILES = {"board": "board_*.yaml", "camera": "camera_*.yaml", "synth": "scenario_*.yaml", "views": "views_*.yaml"}

BEYOND_SHAPE = {
    # One value against another.
    "board_kalibr_oblong.yaml",
    "board_too_many_tags.yaml",
    "camera_correlations_asymmetric.yaml",
    "camera_correlations_shape.yaml",
    "camera_sigma_missing.yaml",
    "camera_verdict_without_its_findings.yaml",
    "scenario_both_blurs.yaml",
    "scenario_fill_over_one.yaml",
    "scenario_no_contrast.yaml",
    "scenario_tilt_reversed.yaml",
    "views_duplicate_file.yaml",
    "views_mirrored.yaml",
    "views_not_a_rotation.yaml",
    # What the text of a board says, and whether its file is there.
    "scenario_board_file_missing.yaml",
    "scenario_board_spec.yaml",
    "scenario_partial_checkerboard.yaml",
    # JSON knows neither NaN nor infinity, and a JSON Schema has no word for them.
    "camera_nan.yaml",
    "camera_overflow.yaml",
    "scenario_infinite_focal.yaml",
}
"""Files that are wrong in a way that only camcal's own code can know."""


def faults(kind: str, path: Path) -> list[str]:
    """What the schema says against a file."""
    checker = jsonschema.Draft202012Validator(json_schema(kind))
    return [error.message for error in checker.iter_errors(load_yaml(path).data)]


@pytest.mark.parametrize("kind", KINDS)
def test_each_is_a_valid_schema_that_stands_alone(kind):
    """By the meta-schema of draft 2020-12; every reference leads to a part of the file itself; a title and an id."""
    schema = json_schema(kind)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["$schema"] == "https://json-schema.org/draft/2020-12/schema"
    assert (schema["$id"], bool(schema["title"])) == (f"urn:camcal:schema:{kind}", True)
    text = schema_text(kind)
    assert json.loads(text) == schema
    references = {line.split('"')[3] for line in text.splitlines() if '"$ref"' in line}
    assert references
    assert references <= {f"#/$defs/{name}" for name in schema["$defs"]}


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_says_what_it_is(kind):
    """Each key of each mapping has a description, each mapping too, and lengths their unit."""
    for name, part in json_schema(kind)["$defs"].items():
        assert part["description"], name
        for key, value in part["properties"].items():
            assert value.get("description"), f"{name}.{key}"
            for ending, unit in (("_m", "metres"), ("_deg", "degrees"), ("_px", "pixels")):
                assert not key.endswith(ending) or unit in value["description"], f"{name}.{key}"


@pytest.mark.parametrize("kind", KINDS)
def test_the_published_files_are_these(kind):
    """docs/schemas holds them; `python tests/test_schema.py` writes them anew."""
    assert json.loads((STORED / f"{kind}.json").read_text("utf-8")) == json_schema(kind)
    assert {path.name for path in STORED.iterdir()} == {f"{one}.json" for one in KINDS}


def test_what_is_shipped_is_valid():
    """Every config and every sample board."""
    configs = [resources.config_path(name) for name in resources.config_names()]
    boards = [resources.sample_board_path(name) for name in resources.sample_board_names()]
    assert len(configs) >= 6
    assert len(boards) >= 4
    for kind, paths in (("synth", configs), ("board", boards)):
        for path in paths:
            assert faults(kind, path) == [], path


def test_what_is_written_is_valid(dataset, calibrated, tmp_path):
    """The files of a calibration and of a rendered truth; a rational lens; boards of every option; Kalibr's targets."""
    for folder in (dataset, calibrated):
        for kind in ("camera", "views", "board"):
            assert faults(kind, folder / f"{kind}.yaml") == []
    for dist in ([], [0.1, 0.01, 0.001, 0.002, 0.1, 0.3, 0.1, 0.01]):
        save_intrinsics(
            tmp_path / "camera.yaml", Intrinsics(Camera((640, 480), [[500, 1, 320], [0, 500, 240], [0, 0, 1]], dist))
        )
        assert faults("camera", tmp_path / "camera.yaml") == []
    for spec in ("checkerboard:9x6:25mm", "aprilgrid:5x4:20mm:0.25:family=tag36h10:first=top-left:border=1:squares=no"):
        (tmp_path / "board.yaml").write_text(board_yaml(parse_board(spec)))
        assert faults("board", tmp_path / "board.yaml") == []
    for spec in ("checkerboard:9x6:25mm", "aprilgrid:6x6:88mm:0.3"):
        export_board(spec, tmp_path / "target.yaml", force=True)
        assert faults("board", tmp_path / "target.yaml") == []


def test_a_camera_info_of_ros_is_valid(tmp_path):
    """Without the mapping that only camcal writes, and with keys that are ROS's; its matrices have their shapes."""
    info = {
        "image_width": 640,
        "image_height": 480,
        "camera_name": "head",
        "distortion_model": "plumb_bob",
        "camera_matrix": {"rows": 3, "cols": 3, "data": [500.0, 0, 320, 0, 500, 240, 0, 0, 1]},
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.1, 0, 0, 0, 0]},
        "projection_matrix": {"rows": 3, "cols": 4, "data": [500.0, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0]},
        "binning_x": 1,
    }
    path = tmp_path / "info.yaml"
    path.write_text(yaml.safe_dump(info))
    assert faults("camera", path) == []
    info["projection_matrix"]["data"].pop()  # type: ignore[index]
    path.write_text(yaml.safe_dump(info))
    assert faults("camera", path) != []


@pytest.mark.parametrize(
    ("kind", "name"), [(kind, path.name) for kind, form in FILES.items() for path in sorted(INVALID.glob(form))]
)
def test_what_has_the_wrong_shape_is_refused_by_the_schema_too(kind, name):
    """Every file that the reader refuses, but for those that are wrong in a way that only code can know."""
    assert bool(faults(kind, INVALID / name)) == (name not in BEYOND_SHAPE)


@pytest.mark.parametrize(
    ("spec", "key", "inside", "outside"),
    [
        ("checkerboard:9x6:25mm", "columns", (3, 100), (2, 101)),
        ("checkerboard:9x6:25mm", "square_m", (1e-5, 10.0), (0.9e-5, 10.1, 0, -1)),
        ("aprilgrid:9x6:25mm:0.3", "rows", (2, 60), (1, 101)),
        ("aprilgrid:9x6:25mm:0.3", "border_bits", (1, 2), (0, 3)),
        ("aprilgrid:9x6:25mm:0.3", "first", ("top-left", "bottom-left"), ("top", "bottom-right")),
        ("aprilgrid:9x6:25mm:0.3", "family", ("tag36h10", "tag36h11"), ("tag36h12",)),
    ],
)
def test_limits_are_where_the_boards_have_them(tmp_path, spec, key, inside, outside):
    """At each limit of the schema the board can be built; just beyond it both refuse."""
    path = tmp_path / "board.yaml"
    content = yaml.safe_load(board_yaml(parse_board(spec)))
    for value in (*inside, *outside):
        path.write_text(yaml.safe_dump(content | {key: value}))
        assert (faults("board", path) == []) == (value in inside), value
        if value in inside:
            load_board(str(path))
        else:
            with pytest.raises(InputError):
                load_board(str(path))


def test_descriptions_are_inherited_and_overridden():
    """A camera file has those of a camera_info, and its own."""
    from camcal.formats.camera_layout import CameraFile, CameraInfo

    docs = field_docs(CameraFile)
    assert set(docs) == set(CameraFile.model_fields)
    assert docs["image_width"] == field_docs(CameraInfo)["image_width"] == "Width of the images, pixels."


def test_the_command_prints_and_writes(tmp_path, capsys):
    """On stdout, or to a file with the line that an editor needs; an existing file is kept."""
    assert main(["schema", "synth"]) == 0
    assert json.loads(capsys.readouterr().out) == json_schema("synth")
    file = tmp_path / "board.schema.json"
    assert main(["schema", "board", "-o", str(file)]) == 0
    assert f"# yaml-language-server: $schema={file}" in capsys.readouterr().out
    assert json.loads(file.read_text("utf-8")) == json_schema("board")
    assert main(["schema", "board", "-o", str(file)]) == 2


@pytest.mark.parametrize(("kind", "meant"), [("bord", "board"), ("view", "views"), ("sinth", "synth"), ("camra", "camera")])
def test_a_mistyped_kind_gets_the_nearest(kind, meant, capsys):
    """On the command line and in the API."""
    assert main(["schema", kind]) == 2
    assert f"Did you mean '{meant}'?" in capsys.readouterr().err
    with pytest.raises(InputError, match=f"Did you mean '{meant}'"):
        json_schema(kind)


if __name__ == "__main__":
    STORED.mkdir(exist_ok=True)
    for one in KINDS:
        (STORED / f"{one}.json").write_text(schema_text(one), encoding="utf-8")
