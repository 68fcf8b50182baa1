"""The twin against what it should say: on a clean render the error made is the predicted one, and the look the rendered one.

For every shipped scenario named (by default a small one, 9 views of 640x480): the look measured beside the one rendered with,
then the error that N twins made beside the predicted one, with the bound on the ratio's standard deviation, 1 / √(2 N). With
--photos, a folder of photographs and its board: what their twins say, without a truth.

    python benchmarks/twin.py [--count 20]
    python benchmarks/twin.py --count 5 --photos FOLDER SPEC [--refine opencv]
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np

from camcal.cli.twin_table import print_twin
from camcal.formats.board_file import load_board
from camcal.formats.images import find_images
from camcal.formats.scenario_file import load_scenario
from camcal.observations import Calibration
from camcal.refinement.look import Look
from camcal.synthesis.bound import sensor_noise_levels
from camcal.synthesis.scenario import Scenario
from camcal.workflows.calibrate import calibrate
from camcal.workflows.looks import measured_looks
from camcal.workflows.reporting import SilentReporter
from camcal.workflows.synth import IMAGES, scenario_file, synth
from camcal.workflows.twin import run_twins

SCENE = """
name: small
seed: 5
camera: {size: [640, 480], fx: 520.0, fy: 523.0, cx: 322.0, cy: 236.0, distortion: {k1: 0.0612, k2: -0.1730, k3: 0.0815}}
board: "checkerboard:9x6:25mm"
views: {count: 9, tilt_deg: [0, 45], roll_deg: [-30, 30], fill: [0.45, 0.85]}
light: {white: 0.86, black: 0.154, background: 0.35, vignetting: 0.1, gradient: 0.05, gradient_direction_deg: 20.0}
sensor: {blur_sigma_px: 0.7, read_noise_levels: 2.0}
"""


def seen(folder: Path, *, spec: str, refine: str) -> Calibration:
    """Calibrate a folder of images from their pixels."""
    return calibrate([folder], spec, refine=refine, reporter=SilentReporter()).calibration


def print_looks(looks: tuple[Look, ...], scenario: Scenario | None) -> None:
    """Print the median of what was measured, beside what was rendered."""
    true = {}
    if scenario is not None:
        light, sensor = scenario.light, scenario.sensor
        step = 255 / (2**sensor.bits - 1)
        variance = sensor_noise_levels(np.array([light.black, light.white]), sensor) ** 2 - step**2 / 12
        true = {"blur_sigma_px": sensor.blur_sigma_px, "ink": light.black, "paper": light.white}
        true["noise"] = float(np.sqrt(variance.mean())) / 255
    for name in ("blur_sigma_px", "overshoot", "noise", "unexplained", "ink", "paper", "gradient"):
        median = statistics.median(getattr(look, name) for look in looks)
        print(f"  {name:16}{median:10.4f}" + (f"   rendered {true[name]:.4f}" if name in true else ""))


def report(images: Path, spec: str, count: int, refine: str, scenario: Scenario | None = None) -> None:
    """Calibrate images, measure their look, run their twins."""
    again = partial(seen, spec=spec, refine=refine)
    start = time.perf_counter()
    calibration = again(images)
    alone = time.perf_counter() - start
    board, found = load_board(spec), find_images([images]).images
    start = time.perf_counter()
    print_looks(measured_looks(calibration, board, found, None), scenario)
    looking = time.perf_counter() - start
    start = time.perf_counter()
    twin = run_twins(calibration, board, found, again, count)
    each = (time.perf_counter() - start - looking) / count
    print(f"  calibration {alone:.1f} s, looks {looking:.1f} s, each twin {each:.1f} s")
    print_twin(twin)
    if twin.errors is not None:
        print(f"made over claimed by the twins themselves: {twin.errors.honesty:.2f}")


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("configs", nargs="*", help="shipped scenarios or scenario files")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--refine", default="warped")
    parser.add_argument("--photos", nargs=2, metavar=("FOLDER", "SPEC"))
    asked = parser.parse_args()
    if asked.photos:
        report(Path(asked.photos[0]), asked.photos[1], asked.count, asked.refine)
        return
    with tempfile.TemporaryDirectory() as name:
        small = Path(name) / "small.yaml"
        small.write_text(SCENE)
        for config in map(scenario_file, asked.configs or [small]):
            scenario = load_scenario(config)
            data = Path(name) / scenario.name
            synth(config, data, reporter=SilentReporter())
            print(f"{scenario.name}:")
            report(data / IMAGES, str(data / "board.yaml"), asked.count, asked.refine, scenario)


if __name__ == "__main__":
    main()
