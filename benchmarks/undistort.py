"""CPU, wall time and memory of undistorting files, beside naive OpenCV: `python benchmarks/undistort.py [--count N]`.

Every figure is of whole processes, which run in turn, A B A B ..., on files in memory where there is such a folder; ratios
are medians of pairs. Ends with exit code 1 if a limit is missed. Other work on the machine spoils it: the memory that
threads share is what resampling needs most.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import cv2
import numpy as np
from processes import Run, alternating, measured, ratio

from camcal.formats.camera_file import save_intrinsics
from camcal.geometry.arrays import FloatArray
from camcal.geometry.camera import Camera
from camcal.records import Intrinsics

LARGE = Camera((4000, 3000), [[3200.0, 0, 2010], [0, 3210, 1490], [0, 0, 1]], [-0.2, 0.05, 0, 0, 0, 0, 0, 0])
MEDIUM = Camera((1920, 1080), [[1536.0, 0, 965], [0, 1541, 536], [0, 0, 1]], [-0.2, 0.05, 0, 0, 0, 0, 0, 0])
SMALL = Camera((640, 480), [[512.0, 0, 322], [0, 514, 238], [0, 0, 1]], [-0.2, 0.05, 0, 0, 0, 0, 0, 0])
IMAGES = {"jpegs": (LARGE, ".jpg"), "few": (LARGE, ".jpg"), "pngs": (MEDIUM, ".png"), "one": (SMALL, ".png")}
WORKERS = 2
DIFFERENT_IMAGES = 4
MEGABYTE = 1e6


@dataclass(frozen=True, slots=True)
class Row:
    """A figure and the limit it must keep: at most, or at least."""

    name: str
    value: float
    limit: float
    at_least: bool = False

    @property
    def holds(self) -> bool:
        """Whether the limit is kept."""
        return self.value >= self.limit if self.at_least else self.value <= self.limit


def main() -> None:
    """Print a line per figure; leave with 1 if a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100, help="files per run (default: 100)")
    parser.add_argument("--runs", type=int, default=5, help="runs of each command (default: 5)")
    parser.add_argument("--work", nargs=4, metavar=("WHAT", "FROM", "TO", "NUMBER"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        what, source, target, number = given.work
        WORK[what](Path(source), Path(target), int(number))
        return
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        print(f"{'':<58}{'measured':>10}{'limit':>10}")
        missed = sum(not report(row) for row in rows(Path(folder), given.count, given.runs))
    print(f"{missed} limits missed." if missed else "All limits hold.")
    sys.exit(bool(missed))


def rows(folder: Path, count: int, runs: int) -> Iterator[Row]:
    """Measure row by row."""
    jpegs, few, pngs, one = (folder / kind for kind in IMAGES)
    (folder / "out").mkdir()
    for made, number in ((jpegs, count), (few, max(count // 5, 1)), (pngs, count), (one, 1)):
        # In a process of its own: the peak memory of a child begins with that of its parent.
        measured([sys.executable, __file__, "--work", "make", str(made), str(made), str(number)])
    two, naive = alternating([ours(jpegs, WORKERS), other("naive", jpegs)], runs)
    yield Row("12 MP JPEG: CPU / naive loop", ratio(two, naive, "cpu_s"), 0.60)
    yield Row("12 MP JPEG: wall speed / naive loop", ratio(naive, two, "wall_s"), 2.2, at_least=True)
    one_worker, codec, opencv = alternating([ours(jpegs), other("codec", jpegs), other("opencv", jpegs)], runs)
    yield Row("12 MP JPEG: CPU / its own codec alone", ratio(one_worker, codec, "cpu_s"), 1.5)
    yield Row("12 MP JPEG: CPU / imread + imwrite alone", ratio(one_worker, opencv, "cpu_s"), 1.5)
    (short,) = alternating([ours(few)], runs)
    yield Row("12 MP JPEG: peak memory per worker, MB", peak(two) / WORKERS, 150)
    yield Row("12 MP JPEG: memory that five times the files take, MB", peak(one_worker) - peak(short), 10)
    lossless, stock = alternating([ours(pngs), other("opencv", pngs)], runs)
    yield Row("2 MP PNG: CPU / imread + imwrite alone", ratio(lossless, stock, "cpu_s"), 1.15)
    start, imports = alternating([ours(one), [sys.executable, "-c", "import cv2, numpy"]], 2 * runs)
    yield Row("start: CPU of one small image / import of cv2 and numpy", ratio(start, imports, "cpu_s"), 1.3)
    gain = quality_gain(jpegs / "0.jpg")
    yield Row("12 MP JPEG: PSNR against exact floats, dB over naive loop", gain, 0.0, at_least=True)


def report(row: Row) -> bool:
    """Print a figure; whether its limit holds."""
    sign = "≥" if row.at_least else "≤"
    print(f"{row.name:<58}{row.value:>10.2f}{sign:>5}{row.limit:>5g}{'' if row.holds else '  missed'}", flush=True)
    return row.holds


def make_images(folder: Path, _target: Path, count: int) -> None:
    """Write images like photographs, a few different ones under many names, and their camera beside the folder."""
    camera, extension = IMAGES[folder.name]
    folder.mkdir()
    save_intrinsics(folder.with_suffix(".yaml"), Intrinsics(camera))
    pictures = (photograph(camera.size, seed) for seed in range(min(count, DIFFERENT_IMAGES)))
    contents = [cv2.imencode(extension, picture)[1].tobytes() for picture in pictures]
    for index in range(count):
        (folder / f"{index}{extension}").write_bytes(contents[index % len(contents)])


def photograph(size: tuple[int, int], seed: int) -> np.ndarray:
    """Make a picture whose spectrum falls like that of photographs, with sharp edges and a sensor's noise."""
    rng = np.random.default_rng(seed)
    width, height = size
    light, warm, green = (_clouds(rng, size, slope) for slope in (1.35, 1.6, 1.6))
    image = 128 + 45 * light[..., None] + 20 * np.stack([warm, np.zeros_like(warm), green], axis=-1)
    image = np.ascontiguousarray(image, np.float32)
    for _ in range(100):
        triangle = rng.uniform(0, size, 2) + rng.uniform(-0.06, 0.06, (3, 2)) * width
        cv2.fillPoly(image, [triangle.astype(np.int32)], rng.uniform(20, 235, 3).tolist(), cv2.LINE_AA)
    image += cv2.GaussianBlur(rng.normal(0, 4, (height, width, 3)).astype(np.float32), (0, 0), 0.7)
    return np.clip(image, 0, 255).astype(np.uint8)


def _clouds(rng: np.random.Generator, size: tuple[int, int], slope: float) -> FloatArray:
    """Noise whose amplitude falls with the frequency to the power of a slope, standard deviation 1."""
    width, height = size
    spectrum = np.fft.rfft2(rng.normal(size=(height, width)))
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width))
    frequency[0, 0] = np.inf
    noise = np.fft.irfft2(spectrum / frequency**slope, s=(height, width))
    scaled: FloatArray = noise / noise.std()
    return scaled


def ours(folder: Path, workers: int = 1) -> list[str]:
    """Camcal's own command for the files of a folder."""
    options = [
        "--camera",
        str(folder.with_suffix(".yaml")),
        "-o",
        str(folder.parent / f"ours_{folder.name}"),
        "--jobs",
        str(workers),
    ]
    return [sys.executable, "-m", "camcal", "undistort", *map(str, sorted(folder.iterdir())), *options, "--force"]


def other(what: str, folder: Path) -> list[str]:
    """Command that does something else with the files of a folder."""
    return [sys.executable, __file__, "--work", what, str(folder), str(folder.parent / "out"), "1"]


def peak(runs: Iterable[Run]) -> float:
    """Median of the peak memory in MB."""
    return median(run.peak_bytes for run in runs) / MEGABYTE


def undistort_naively(folder: Path, target: Path, _workers: int) -> None:
    """Undistort as many scripts do."""
    camera, _ = IMAGES[folder.name]
    for file in sorted(folder.iterdir()):
        cv2.imwrite(str(target / file.name), cv2.undistort(cv2.imread(str(file)), camera.K, camera.dist))


def recode_as_camcal(folder: Path, target: Path, _workers: int) -> None:
    """Decode and encode as camcal does, and nothing between."""
    from camcal.formats.imaging.fidelity import coding_like
    from camcal.formats.imaging.pixels import decode_into, encode

    image = None
    for file in sorted(folder.iterdir()):
        content = file.read_bytes()
        image, _ = decode_into(file, content, image)
        (target / file.name).write_bytes(encode(file, image, coding_like(content, file, None)))


def recode(folder: Path, target: Path, _workers: int) -> None:
    """Decode and encode by OpenCV."""
    cv2.setNumThreads(1)
    for file in sorted(folder.iterdir()):
        cv2.imwrite(str(target / file.name), cv2.imread(str(file)))


WORK: dict[str, Callable[[Path, Path, int], None]] = {
    "make": make_images,
    "naive": undistort_naively,
    "codec": recode_as_camcal,
    "opencv": recode,
}


def quality_gain(path: Path) -> float:
    """How much closer than the naive loop a result is to floats resampled exactly: difference in PSNR, dB, at one quality."""
    from camcal.formats.imaging.fidelity import GOOD_QUALITY
    from camcal.undistortion.maps import dense_map, undistort_map, valid_mask
    from camcal.workflows.undistort.image import undistort_image_file

    maps = undistort_map(LARGE, Camera(LARGE.size, LARGE.K))
    source = cv2.imread(str(path))
    exact = cv2.remap(source.astype(np.float32), *dense_map(maps), cv2.INTER_LINEAR)
    result = path.with_name("quality.jpg")
    levels = []
    for naive in (False, True):
        if naive:
            undistorted = cv2.undistort(source, LARGE.K, LARGE.dist)
            cv2.imwrite(str(result), undistorted, [cv2.IMWRITE_JPEG_QUALITY, GOOD_QUALITY])
        else:
            undistort_image_file(path, result, maps)
        error = (cv2.imread(str(result)) - exact)[valid_mask(maps) == 255].astype(np.float64)
        levels.append(-10 * np.log10(np.mean(error**2)))
    result.unlink()
    return float(levels[0] - levels[1])


if __name__ == "__main__":
    main()
