"""Building maps and resampling with them against OpenCV: CPU at 12 megapixels, memory, and what the planes of a JPEG lose.

python benchmarks/undistort_maps.py [--runs N] [--size WIDTHxHEIGHT]

Runs alternate between the variants, one thread; figures are medians of CPU milliseconds and ratios to OpenCV's function.
"""

from __future__ import annotations

import argparse
import statistics
import time
import tracemalloc
from collections.abc import Callable, Sequence

import cv2
import numpy as np

from camcal.geometry.camera import Camera
from camcal.threads import single_threaded
from camcal.undistortion.maps import UndistortMap, dense_map, undistort_image, undistort_map
from camcal.undistortion.planes import plane_map
from camcal.undistortion.target import target_camera

Image = np.ndarray
Jobs = dict[str, Callable[[], object]]


def camera_of(size: tuple[int, int]) -> Camera:
    """A camera of 71° behind a lens with barrel and tangential distortion."""
    width, height = size
    K = [[0.7 * width, 0, 0.5013 * width], [0, 0.7015 * width, 0.4967 * height], [0, 0, 1]]
    return Camera(size, K, [-0.2, 0.05, 0.0003, -0.0002, -0.005])


def cpu_ms(jobs: Jobs, runs: int) -> dict[str, float]:
    """Median CPU milliseconds of each job; in every run each job has its turn."""
    taken: dict[str, list[float]] = {name: [] for name in jobs}
    for run in range(runs + 1):
        for name, job in jobs.items():
            began = time.process_time()
            job()
            if run:
                taken[name].append(1e3 * (time.process_time() - began))
    return {name: statistics.median(times) for name, times in taken.items()}


def show(title: str, figures: dict[str, float]) -> None:
    """Print figures, and their ratio to the first."""
    print(f"\n{title}")
    first = next(iter(figures.values()))
    for name, figure in figures.items():
        print(f"  {name:52}{figure:9.1f} ms{figure / first:8.2f}")


def picture(size: tuple[int, int], channels: int, dtype: str, blur_px: float = 2.0) -> Image:
    """Blurred noise in full colour."""
    noise = np.random.default_rng(0).integers(0, 256, (size[1], size[0], channels), dtype=np.uint8)
    smooth = cv2.GaussianBlur(noise, (0, 0), blur_px)
    smooth = np.clip((smooth.astype(np.float32) - 128) * 6 + 128, 0, 255).astype(np.uint8)
    factor = {"uint8": 1, "uint16": 257, "float32": 1}[dtype]
    image = smooth.astype(dtype) * np.array(factor, dtype)
    return image.reshape(size[1], size[0], channels) if channels > 1 else image.reshape(size[1], size[0])


def measure_building(camera: Camera, runs: int) -> None:
    """Maps and targets."""
    target = target_camera(camera)
    ideal, covering = target_camera(camera, 1.0), target_camera(camera, 1.0)
    cv_map = lambda kind: cv2.initUndistortRectifyMap(camera.K, camera.dist, None, target.K, target.size, kind)  # noqa: E731
    jobs: Jobs = {
        "cv2.initUndistortRectifyMap, float32": lambda: cv_map(cv2.CV_32FC1),
        "cv2.initUndistortRectifyMap, 16SC2": lambda: cv_map(cv2.CV_16SC2),
        "undistort_map, alpha 0": lambda: undistort_map(camera, target),
        "undistort_map, alpha 1": lambda: undistort_map(camera, covering),
        "the other way (distort)": lambda: undistort_map(ideal, camera),
        "dense_map (two float32 images)": lambda: dense_map(undistort_map(camera, target)),
        "target_camera, alpha 0": lambda: target_camera(camera),
        "target_camera, alpha 1": lambda: target_camera(camera, 1.0),
        "cv2.getOptimalNewCameraMatrix": lambda: cv2.getOptimalNewCameraMatrix(camera.K, camera.dist, camera.size, 0.0),
    }
    show("Building a map", cpu_ms(jobs, runs))
    tracemalloc.start()
    undistort = undistort_map(camera, target)
    kept, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    expected = cv2.initUndistortRectifyMap(camera.K, camera.dist, None, target.K, target.size, cv2.CV_32FC1)
    error = max(np.abs(ours - theirs).max() for ours, theirs in zip(dense_map(undistort), expected, strict=True))
    floats = 8e-6 * np.prod(camera.size)
    print(f"  memory: {kept / 1e6:.1f} MB kept, {peak / 1e6:.1f} MB at most; two float32 images: {floats:.0f} MB")
    print(f"  largest difference to OpenCV's float32 map: {error:.1e} px")


def measure_resampling(camera: Camera, runs: int) -> None:
    """Linear interpolation for each depth and number of channels."""
    target = target_camera(camera)
    undistort = undistort_map(camera, target)
    maps = cv2.initUndistortRectifyMap(camera.K, camera.dist, None, target.K, target.size, cv2.CV_32FC1)
    fixed = cv2.convertMaps(*maps, cv2.CV_16SC2)
    for dtype in ("uint8", "uint16", "float32"):
        for channels in (1, 3, 4):
            image = picture(camera.size, channels, dtype)
            if channels == 4:
                image[..., 3] = 200
            out = np.empty_like(image)
            jobs: Jobs = {
                "cv2.remap, float32 maps": lambda i=image, o=out: cv2.remap(i, *maps, cv2.INTER_LINEAR, dst=o),
                "cv2.remap, 16SC2 maps": lambda i=image, o=out: cv2.remap(i, *fixed, cv2.INTER_LINEAR, dst=o),
                "cv2.undistort": lambda i=image, o=out: cv2.undistort(i, camera.K, camera.dist, o, target.K),
                "undistort_image": lambda i=image, o=out: undistort_image(i, undistort, out=o),
            }
            show(f"Linear, {dtype}, {channels} channels", cpu_ms(jobs, runs))


def measure_options(camera: Camera, runs: int) -> None:
    """Finer interpolation, light, alpha, smaller results, planes."""
    undistort = undistort_map(camera, target_camera(camera))
    covering = undistort_map(camera, target_camera(camera, 1.0))
    quarter = undistort_map(camera, target_camera(camera, scale=0.25))
    chroma = plane_map(undistort, (2, 2))
    maps = dense_map(undistort)
    image, alpha = picture(camera.size, 3, "uint8"), picture(camera.size, 4, "uint8")
    width, height = camera.size
    planes = [picture((width // n, height // n), 1, "uint8") for n in (1, 2, 2)]
    out, plane_out = np.empty_like(image), [np.empty_like(plane) for plane in planes]
    jobs: Jobs = {
        "undistort_image, linear": lambda: undistort_image(image, undistort, out=out),
        "linear, alpha 1 (filled around)": lambda: undistort_image(image, covering, out=out),
        "planes of 4:2:0": lambda: by_planes(planes, undistort, chroma, plane_out),
        "cubic": lambda: undistort_image(image, undistort, interpolation="cubic", out=out),
        "cv2.remap, INTER_CUBIC": lambda: cv2.remap(image, *maps, cv2.INTER_CUBIC, dst=out),
        "lanczos": lambda: undistort_image(image, undistort, interpolation="lanczos", out=out),
        "cv2.remap, INTER_LANCZOS4": lambda: cv2.remap(image, *maps, cv2.INTER_LANCZOS4, dst=out),
        "linear light (srgb)": lambda: undistort_image(image, undistort, gamma="srgb", out=out),
        "4 channels, alpha that varies": lambda: undistort_image(alpha, undistort),
        "scale 0.25, 4 x 4 samples a pixel": lambda: undistort_image(image, quarter),
    }
    show("Options, uint8, 3 channels", cpu_ms(jobs, max(runs // 2, 2)))


def by_planes(
    planes: Sequence[Image], undistort: UndistortMap, chroma: UndistortMap, out: Sequence[Image | None] = (None, None, None)
) -> list[Image]:
    """Resample Y, Cb and Cr each by itself."""
    maps = (undistort, chroma, chroma)
    return [undistort_image(plane, used, out=new) for plane, used, new in zip(planes, maps, out, strict=True)]


def ycc(bgr: Image) -> list[Image]:
    """Y, Cb, Cr of JPEG, float64."""
    blue, green, red = np.moveaxis(bgr.astype(np.float64), -1, 0)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    return [luma, (blue - luma) / 1.772 + 128, (red - luma) / 1.402 + 128]


def bgr_of(luma: Image, cb: Image, cr: Image) -> Image:
    """The inverse; chroma of half size is brought up linearly."""
    cb, cr = (cv2.resize(c.astype(np.float64), luma.shape[::-1], interpolation=cv2.INTER_LINEAR) for c in (cb, cr))
    red, blue = luma + 1.402 * (cr - 128), luma + 1.772 * (cb - 128)
    return np.stack([blue, (luma - 0.299 * red - 0.114 * blue) / 0.587, red], axis=-1)


def halved(plane: Image) -> Image:
    """Means of 2 x 2 pixels."""
    return plane.reshape(plane.shape[0] // 2, 2, plane.shape[1] // 2, 2).mean(axis=(1, 3))


def rounded(values: Image) -> Image:
    """To uint8."""
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def measure_planes_quality() -> None:
    """PSNR against the float BGR of the decoded 4:2:0 image, resampled: by planes, and by 8-bit BGR put back into 4:2:0."""
    camera = camera_of((1280, 960))
    undistort: UndistortMap = undistort_map(camera, target_camera(camera))
    chroma = plane_map(undistort, (2, 2))
    print("\nPSNR to float BGR, dB        planes of 4:2:0   8-bit BGR, back to 4:2:0")
    for blur_px in (1.0, 2.0, 4.0):
        luma, cb, cr = ycc(picture(camera.size, 3, "uint8", blur_px))
        planes = [rounded(luma), rounded(halved(cb)), rounded(halved(cr))]
        decoded = bgr_of(*planes)
        truth = undistort_image(decoded.astype(np.float32), undistort)
        from_planes = bgr_of(*by_planes(planes, undistort, chroma))
        luma, cb, cr = ycc(undistort_image(rounded(decoded), undistort))
        by_bgr = bgr_of(rounded(luma), rounded(halved(cb)), rounded(halved(cr)))
        psnr = [10 * np.log10(255**2 / ((image - truth) ** 2).mean()) for image in (from_planes, by_bgr)]
        print(f"  colour noise, blur {blur_px:3.0f} px  {psnr[0]:13.1f}{psnr[1]:18.1f}")


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--size", default="4000x3000")
    options = parser.parse_args()
    width, height = (int(side) for side in options.size.split("x"))
    camera = camera_of((width, height))
    with single_threaded():
        measure_building(camera, options.runs)
        measure_resampling(camera, options.runs)
        measure_options(camera, options.runs)
        measure_planes_quality()


if __name__ == "__main__":
    main()
