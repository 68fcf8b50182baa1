"""Synth configs: read in full, with the defaults of the scenario's own types."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from camcal import resources
from camcal.boards.aprilgrid import AprilGrid
from camcal.boards.checkerboard import Checkerboard
from camcal.errors import InputError
from camcal.formats.board_file import save_board
from camcal.formats.scenario_file import load_scenario
from camcal.synthesis.scenario import Light, PoseSampling, Scenario, Sensor

SHORT = """\
name: short
seed: 7
camera: {size: [1280, 720], fx: 900, fy: 901, cx: 640.5, cy: 359.5}
board: "checkerboard:9x6:25mm"
"""
FULL = """\
name: full
seed: 18446744073
camera:
  size: [640, 480]
  fx: 500.5
  fy: 5.015e2
  cx: 320
  cy: 240
  skew: 1e-1
  distortion: {k1: -0.1, k2: 0.02, p1: 1e-4, p2: -1e-4, k3: 0.003, k4: 0.4, k5: 0.05, k6: 0.006}
board: "aprilgrid:6x6:88mm:0.3"
views: {count: 3, tilt_deg: [1, 2], roll_deg: [-3, 4], fill: [0.5, 1.6], partial: yes}
light: {white: 0.9, black: 0.1, background: 0.5, vignetting: 0.3, gradient: -0.2, gradient_direction_deg: 45}
sensor:
  blur_sigma_px: 1.5
  defocus_radius_px: 0
  read_noise_levels: 3
  full_well_electrons: 20000
  gamma: 2.2
  bits: 16
"""


def load(tmp_path: Path, text: str) -> Scenario:
    """Scenario of a YAML text."""
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    return load_scenario(path)


def test_what_is_left_out_has_the_defaults_of_the_types(tmp_path: Path) -> None:
    """Name, seed, camera and board are enough."""
    found = load(tmp_path, SHORT)
    assert (found.name, found.seed, found.board) == ("short", 7, Checkerboard(9, 6, 0.025))
    assert found.camera.K.tolist() == [[900, 0, 640.5], [0, 901, 359.5], [0, 0, 1]]
    assert (found.camera.size, found.camera.dist.any()) == ((1280, 720), False)
    assert (found.views, found.light, found.sensor) == (PoseSampling(), Light(), Sensor())


def test_every_key_is_read(tmp_path: Path) -> None:
    """Each value lands in its own field, the coefficients in OpenCV's order."""
    found = load(tmp_path, FULL)
    assert found.camera.K.tolist() == [[500.5, 0.1, 320], [0, 501.5, 240], [0, 0, 1]]
    assert found.camera.dist.tolist() == [-0.1, 0.02, 1e-4, -1e-4, 0.003, 0.4, 0.05, 0.006]
    assert found.board == AprilGrid(6, 6, 0.088, 0.0264)
    assert found.views == PoseSampling(3, (1, 2), (-3, 4), (0.5, 1.6), True)
    assert found.light == Light(0.9, 0.1, 0.5, 0.3, -0.2, 45)
    assert found.sensor == Sensor(1.5, 0, 3, 20000, 2.2, 16)


def test_every_field_of_the_types_is_in_the_full_example() -> None:
    """No field can be added to a scenario without its key."""
    for kind in (PoseSampling, Light, Sensor):
        for field in dataclasses.fields(kind):
            assert f"{field.name}: " in FULL


def test_defocus_takes_the_place_of_the_blur_that_is_not_asked_for(tmp_path: Path) -> None:
    """One of the two is used: asking for a disc alone switches the Gaussian off."""
    assert load(tmp_path, SHORT + "sensor: {defocus_radius_px: 2}\n").sensor == Sensor(0.0, 2.0)
    assert load(tmp_path, SHORT + "sensor: {defocus_radius_px: 2, blur_sigma_px: 0}\n").sensor == Sensor(0.0, 2.0)


def test_a_board_file_is_relative_to_the_config(tmp_path: Path) -> None:
    """A dataset can carry its board."""
    (tmp_path / "boards").mkdir()
    save_board(tmp_path / "boards" / "mine.yaml", Checkerboard(7, 5, 0.03))
    assert load(tmp_path, SHORT.replace("checkerboard:9x6:25mm", "boards/mine.yaml")).board == Checkerboard(7, 5, 0.03)


def test_a_fault_in_the_board_file_names_both_files(tmp_path: Path) -> None:
    """The config's line leads to the board's line."""
    (tmp_path / "mine.yaml").write_text("type: checkerboard\ncolumns: 9\nrows: 6\nsquare_m: 25\n")
    with pytest.raises(InputError, match=r"scene\.yaml:4: board: .*mine\.yaml:4: square_m: absurd size"):
        load(tmp_path, SHORT.replace("checkerboard:9x6:25mm", "mine.yaml"))


@pytest.mark.parametrize("name", resources.config_names())
def test_shipped_configs_load(name: str) -> None:
    """Every shipped config is valid and called as its file is."""
    assert load_scenario(resources.config_path(name)).name == name
