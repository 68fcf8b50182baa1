"""CPU of undistorting a 1080p H.264 video beside decoding and encoding it: `python benchmarks/undistort_video.py`.

All run as processes of their own, turn by turn, with the same encoder settings, on files in memory; the figures are the
medians over the runs of what each whole process took. "in place" moves every sample to where it was: it encodes the same
pictures as the codec alone does, while those of "undistort" may be dearer or cheaper to encode. Leaves with 1 if a ratio of
CPU time is above the limit.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from fractions import Fraction
from pathlib import Path

import numpy as np

LIMIT, STRETCH = 1.4, 1.2
SIZE = (1920, 1080)
RATE = 30
LENS = [-0.28, 0.09, 0.0005, -0.0003, -0.01]
K = [[1400, 0, 962.3], [0, 1402, 536.1], [0, 0, 1]]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=300, help="length of the video")
    parser.add_argument("--runs", type=int, default=5, help="runs of each kind")
    parser.add_argument("--alpha", type=float, default=0.0, help="0: only valid pixels; 1: all of the source")
    parser.add_argument("--pixels", default="yuv420p", help="pixel format of the video, as yuv420p10le")
    parser.add_argument("--job", choices=tuple(JOBS), help=argparse.SUPPRESS)
    parser.add_argument("--folder", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.job:
        JOBS[given.job](Path(given.folder), given.alpha)
        print(peak_bytes())
        return
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as folder:
        make_video(Path(folder) / "source.mp4", given.frames, given.pixels)
        compare(Path(folder), given)


def compare(folder: Path, given: argparse.Namespace) -> None:
    """Run both, turn by turn, and print the medians."""
    spent: dict[str, list[tuple[float, float, int]]] = {job: [] for job in JOBS}
    for _ in range(given.runs):
        for job, runs in spent.items():
            runs.append(measure(folder, job, given.alpha))
    print(f"{given.frames} frames of {SIZE[0]}x{SIZE[1]} {given.pixels}, H.264, alpha {given.alpha:g}, {given.runs} runs")
    print(f"{'':<12}{'CPU ms/frame':>13}{'wall ms/frame':>15}{'peak MB':>9}{'file MB':>9}")
    medians = {}
    for job, runs in spent.items():
        cpu, wall, peak = (statistics.median(column) for column in zip(*runs, strict=True))
        medians[job] = cpu
        size = (folder / f"{job}.mp4").stat().st_size
        per_frame = 1000 / given.frames
        print(f"{job:<12}{cpu * per_frame:>13.2f}{wall * per_frame:>15.2f}{peak / 1e6:>9.0f}{size / 1e6:>9.1f}")
    ratios = {job: cpu / medians["codec"] for job, cpu in medians.items() if job != "codec"}
    for job, ratio in ratios.items():
        print(f"CPU ratio {job}: {ratio:.3f} (limit {LIMIT}, stretch {STRETCH})")
    sys.exit(0 if max(ratios.values()) <= LIMIT else 1)


def measure(folder: Path, job: str, alpha: float) -> tuple[float, float, int]:
    """CPU seconds, wall seconds and peak memory in bytes of one process."""
    command = [sys.executable, __file__, "--job", job, "--folder", str(folder), "--alpha", str(alpha)]
    start = time.perf_counter()
    before = os.times()
    answer = subprocess.run(command, check=True, capture_output=True, text=True)
    after = os.times()
    cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
    return cpu_s, time.perf_counter() - start, int(answer.stdout)


def peak_bytes() -> int:
    """Most memory that this process has held at a time; 0 where the system does not tell."""
    status = Path("/proc/self/status")
    lines = status.read_text().splitlines() if status.exists() else []
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM")), 0)


def codec_only(folder: Path, _alpha: float) -> None:
    """Decode and encode, with the settings that the other run chooses, and nothing else."""
    import av

    from camcal.formats.video.codecs import ENCODERS

    encoder = ENCODERS["libx264"]
    with av.open(str(folder / "source.mp4")) as source, av.open(str(folder / "codec.mp4"), "w") as target:
        video = source.streams.video[0]
        video.thread_type = "AUTO"
        options = {encoder.quality: f"{encoder.default:g}"}
        made = target.add_stream("libx264", rate=video.average_rate, width=SIZE[0], height=SIZE[1], options=options)
        made.pix_fmt = video.pix_fmt
        made.codec_context.time_base = video.time_base
        for frame in source.decode(video):
            target.mux(made.encode(frame))
        target.mux(made.encode(None))


def undistort(folder: Path, alpha: float) -> None:
    """Undistort with the defaults."""
    from camcal.geometry.camera import Camera
    from camcal.undistortion.maps import undistort_map
    from camcal.undistortion.target import target_camera
    from camcal.workflows.undistort.video import undistort_video

    camera = Camera(SIZE, K, LENS)
    maps = undistort_map(camera, target_camera(camera, alpha))
    undistort_video(folder / "source.mp4", folder / "undistort.mp4", maps, force=True)


def in_place(folder: Path, _alpha: float) -> None:
    """Move every sample to where it was."""
    from camcal.geometry.camera import Camera
    from camcal.undistortion.maps import undistort_map
    from camcal.workflows.undistort.video import undistort_video

    camera = Camera(SIZE, K, LENS)
    undistort_video(folder / "source.mp4", folder / "in place.mp4", undistort_map(camera, camera), force=True)


JOBS = {"codec": codec_only, "in place": in_place, "undistort": undistort}


def make_video(path: Path, frames: int, pixels: str) -> None:
    """Write what the lens makes of a pan over a picture with the spectrum of natural ones, with a sensor's noise on top."""
    import av
    import cv2

    from camcal.geometry.camera import Camera

    picture = natural_picture((2 * SIZE[1], 2 * SIZE[0]))
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = Camera(SIZE, K, LENS).unproject(np.stack([columns, rows], axis=-1))
    seen = (Camera(SIZE, K).project(rays) + np.array(SIZE) / 2).astype(np.float32)
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 1, (SIZE[1] + 64, SIZE[0] + 64)).astype(np.float32)
    with av.open(str(path), "w") as target:
        video = target.add_stream("libx264", rate=RATE, width=SIZE[0], height=SIZE[1], options={"crf": "17", "preset": "fast"})
        video.pix_fmt = pixels
        for index in range(frames):
            pan = np.array([120 * np.sin(index / 40), 90 * np.cos(index / 55)], np.float32)
            view = cv2.remap(picture, seen[..., 0] + pan[0], seen[..., 1] + pan[1], cv2.INTER_LINEAR)
            down, along = rng.integers(0, 64, 2)
            view += noise[down : down + SIZE[1], along : along + SIZE[0], None]
            frame = av.VideoFrame.from_ndarray(np.clip(view, 0, 255).astype(np.uint8), format="rgb24")
            frame.pts, frame.time_base = index, Fraction(1, RATE)
            target.mux(video.encode(frame))
        target.mux(video.encode(None))


def natural_picture(shape: tuple[int, int]) -> np.ndarray:
    """Colour picture (height, width, 3), float32, whose amplitudes fall off as one over the frequency."""
    rng = np.random.default_rng(0)
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None])
    frequency[0, 0] = 1
    layers = []
    for _ in range(3):
        spectrum = np.exp(2j * np.pi * rng.random(frequency.shape)) / frequency
        spectrum[0, 0] = 0
        layers.append(np.fft.irfft2(spectrum, shape))
    gray = layers[0] / layers[0].std()
    tints = [gray + 0.4 * layer / layer.std() for layer in (layers[1], layers[2], -layers[1])]
    return np.stack([np.clip(128 + 45 * tint, 0, 255) for tint in tints], axis=-1).astype(np.float32)


if __name__ == "__main__":
    main()
