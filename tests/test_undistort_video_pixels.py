"""Pixels of undistorted videos: every sample of every plane goes where the cameras say, in every format of pixels."""

from __future__ import annotations

import numpy as np
import pytest
from undistorted_videos import CAMERA, INNER, MAP, OUTER, sampled, undistort
from videos import SIZE, make_video, read_video

from camcal.errors import InputError
from camcal.formats.video.pixels import planar_layout
from camcal.geometry.camera import Camera
from camcal.undistortion.maps import undistort_map
from camcal.workflows.undistort.video import undistort_video


def expected_plane(
    plane: np.ndarray, new: Camera, step: tuple[int, int], offset: tuple[float, float], black: int
) -> np.ndarray:
    """What a plane becomes, from the cameras alone; NaN within a pixel of where the source ends."""
    height, width = -(-new.size[1] // step[1]), -(-new.size[0] // step[0])
    samples = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
    seen = CAMERA.project(new.unproject(samples * step + offset))
    values = sampled(plane, np.nan_to_num((seen - offset) / step))
    inside, near = CAMERA.contains(seen, margin_px=1.5), CAMERA.contains(seen, margin_px=-0.5)
    return np.where(inside, values, np.where(near, np.nan, black))


FORMATS = {
    "yuv420p": ((2, 2), (0.0, 0.5), (16, 128, 128)),
    "yuv422p": ((2, 1), (0.0, 0.0), (16, 128, 128)),
    "yuv444p": ((1, 1), (0.0, 0.0), (16, 128, 128)),
    "yuv420p10le": ((2, 2), (0.0, 0.5), (64, 512, 512)),
    "yuv444p16le": ((1, 1), (0.0, 0.0), (4096, 32768, 32768)),
    "gray": ((1, 1), (0.0, 0.0), (0,)),
    "yuva420p": ((2, 2), (0.0, 0.5), (16, 128, 128, 0)),
}


@pytest.mark.parametrize("new", [INNER, OUTER], ids=["inner", "outer"])
@pytest.mark.parametrize("pixels", FORMATS)
def test_every_plane_goes_where_the_cameras_say(tmp_path, pixels, new):
    """Each sample of each plane is interpolated where its ray meets the source's plane; what sees nothing is video black.

    float32 coordinates and a map accurate to 2e-4 pixels move a value by 2e-4 of the steepest slope (some 25 levels of 256
    a pixel), rounding by half a level: together below one level of 8 bits, 2 of 10, 6 of 16.
    """
    source = make_video(tmp_path / "in.mkv", codec="ffv1", pixels=pixels, frames=6)
    result = undistort(source, new=new)
    before, after = read_video(source), read_video(result.path)
    step, offset, blacks = FORMATS[pixels]
    bound = {8: 0.6, 10: 0.6, 16: 6.0}[before.frames[0].format.components[0].bits]
    assert after.frames[0].format.name == pixels
    assert len(after.planes) == 6
    for old, made in zip(before.planes, after.planes, strict=True):
        for index, black in enumerate(blacks):
            coarse = index in (1, 2)
            expected = expected_plane(old[index], new, step if coarse else (1, 1), offset if coarse else (0.0, 0.0), black)
            known = np.isfinite(expected)
            assert known.mean() > 0.8
            assert np.abs(made[index] - expected)[known].max() <= bound


def test_nothing_turns_gray_at_the_edges(tmp_path):
    """Where every pixel sees the source, a picture of one colour keeps that colour to its last sample."""
    red = lambda _, size: np.full((size[1], size[0], 3), (200, 30, 40), np.uint8)  # noqa: E731
    source = make_video(tmp_path / "in.mkv", codec="ffv1", frames=2, picture=red)
    before, after = read_video(source), read_video(undistort(source).path)
    for old, new in zip(before.planes[0], after.planes[0], strict=True):
        assert old.min() == old.max()
        assert (new == old[0, 0]).all()


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
def test_frames_are_the_same_in_any_company(tmp_path, count):
    """However many frames are moved together, each becomes what it becomes alone."""
    every = make_video(tmp_path / "in.mkv", codec="ffv1", frames=9)
    together = read_video(undistort(every).path).planes
    few = make_video(tmp_path / "few.mkv", codec="ffv1", frames=count)
    alone = read_video(undistort_video(few, tmp_path / "little.mkv", MAP).path).planes
    assert len(alone) == count
    for one, other in zip(alone, together, strict=False):
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_straight_edge_is_straight(tmp_path):
    """An edge that the lens bends by more than a pixel is straight to 0.02 pixels afterwards."""
    size = (320, 240)
    camera = Camera(size, [[250, 0, 155.3], [0, 251, 122.7], [0, 0, 1]], CAMERA.dist)
    new = Camera(size, [[290, 0, 159.5], [0, 291, 119.5], [0, 0, 1]])
    slope, start = 0.15, 60.0

    def edge(_index, _size):
        ideal = new.project(camera.unproject(np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1])), axis=-1)))
        profile = 0.5 + 0.5 * np.tanh((ideal[..., 0] - start - slope * ideal[..., 1]) / 2.5)
        return np.repeat((30 + 190 * profile).round().astype(np.uint8)[..., None], 3, axis=-1)

    source = make_video(tmp_path / "in.mkv", codec="ffv1", pixels="gray", frames=1, size=size, picture=edge)
    made = read_video(undistort(source, camera=camera, new=new).path).planes[0][0].astype(float)
    rows = np.arange(10, 230)
    assert np.abs(straightness(read_video(source).planes[0][0].astype(float), rows)).max() > 1
    # Rounding to levels (standard deviation 0.29) over a slope of 38 levels a pixel: 0.0076 pixels per row.
    residuals = straightness(made, rows)
    assert residuals.std() <= 0.02
    fit = np.polyfit(rows, residuals, 2)[0] * 110**2
    assert abs(fit) <= 0.02


def straightness(image: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """How far an upright edge's half-way crossings lie from the straight line through them, pixels per row."""
    crossings = []
    for row in image[rows]:
        right = int(np.argmax(row > 125))
        crossings.append(right - (row[right] - 125) / (row[right] - row[right - 1]))
    return np.array(crossings) - np.polyval(np.polyfit(rows, crossings, 1), rows)


@pytest.mark.parametrize("pixels", ["bgr0", "bgra"])
def test_packed_rgb_is_moved_too(tmp_path, pixels):
    """Pixels that lie side by side come back as they were where nothing moves."""
    source = make_video(tmp_path / "in.mkv", codec="ffv1", pixels=pixels, frames=3)
    still = Camera(SIZE, CAMERA.K)
    result = undistort_video(source, tmp_path / "out.mkv", undistort_map(still, still))
    assert result.pixel_format == pixels
    for old, new in zip(read_video(source).frames, read_video(result.path).frames, strict=True):
        assert old.format.name == new.format.name
        np.testing.assert_array_equal(*(frame.reformat(format="rgba").to_ndarray() for frame in (old, new)))


@pytest.mark.parametrize("codec", ["libx264", "ffv1"])
def test_a_lens_that_does_nothing_changes_nothing(tmp_path, codec):
    """Without a lens, a lossless video comes back sample by sample."""
    options = {"qp": "0"} if codec == "libx264" else {}
    source = make_video(tmp_path / "in.mkv", codec=codec, options=options)
    still = Camera(SIZE, CAMERA.K)
    result = undistort_video(source, tmp_path / "out.mkv", undistort_map(still, still))
    for old, new in zip(read_video(source).planes, read_video(result.path).planes, strict=True):
        for a, b in zip(old, new, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("codec", "suffix"), [("ffv1", ".mkv"), ("libvpx-vp9", ".webm"), ("mjpeg", ".mov")])
def test_odd_sizes(tmp_path, codec, suffix):
    """Half a chroma sample at the edges is no hindrance where the codec has a place for it."""
    size = (63, 47)
    pixels = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    options = {"cpu-used": "8", "b": "0", "crf": "10"} if codec == "libvpx-vp9" else {}
    source = make_video(tmp_path / f"in{suffix}", codec=codec, pixels=pixels, options=options, size=size, frames=3)
    camera, new = (Camera(size, one.K, one.dist) for one in (CAMERA, INNER))
    made = read_video(undistort(source, camera=camera, new=new).path)
    assert (made.frames[0].width, made.frames[0].height) == size
    assert len(made.frames) == 3


def test_jpeg_chroma_lies_in_the_middle_of_its_pixels(tmp_path):
    """Chroma of motion JPEG is moved from where it lies; half a pixel beside it, it would not be this."""
    source = make_video(tmp_path / "in.mov", codec="mjpeg", pixels="yuvj420p", options={"q": "1"}, frames=2)
    result = undistort(source, ".mkv", codec="ffv1", pixel_format="yuv420p")
    before, after = read_video(source), read_video(result.path)
    errors = []
    for offset in ((0.5, 0.5), (0.0, 0.5)):
        expected = expected_plane(before.planes[0][1], INNER, (2, 2), offset, 128)
        errors.append(np.nanmax(np.abs(after.planes[0][1] - expected)))
    assert errors[0] <= 0.6
    assert errors[1] > 1.2
    assert read_video(undistort(source, ".mp4", codec="h264").path).frames[0].color_range == 2


LAYOUTS = {
    "yuv420p": ("yuv420p", 8, [(1, 1), (2, 2), (2, 2)], [16, 128, 128]),
    "yuvj422p": ("yuv422p", 8, [(1, 1), (2, 1), (2, 1)], [0, 128, 128]),
    "nv12": ("yuv420p", 8, [(1, 1), (2, 2), (2, 2)], [16, 128, 128]),
    "p010le": ("yuv420p10le", 10, [(1, 1), (2, 2), (2, 2)], [64, 512, 512]),
    "yuyv422": ("yuv422p", 8, [(1, 1), (2, 1), (2, 1)], [16, 128, 128]),
    "yuv411p": ("yuv411p", 8, [(1, 1), (4, 1), (4, 1)], [16, 128, 128]),
    "yuva444p12le": ("yuva444p12le", 12, [(1, 1)] * 4, [256, 2048, 2048, 0]),
    "gray10le": ("gray10le", 10, [(1, 1)], [0]),
    "rgb48be": ("gbrp16le", 16, [(1, 1)] * 3, [0, 0, 0]),
    "pal8": ("gbrap", 8, [(1, 1)] * 4, [0, 0, 0, 0]),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_are_libav_s(name):
    """Planar name, depth, steps and black of each kind of format, written down by hand."""
    layout = planar_layout(name)
    planes = [plane.step for plane in layout.planes], [plane.black for plane in layout.planes]
    assert (layout.name, layout.depth, *planes) == LAYOUTS[name]


@pytest.mark.parametrize("name", ["gbrpf32le", "bayer_rggb8", "xyz12le", "ya8"])
def test_other_samples_are_refused(name):
    """Floats, mosaics, XYZ and gray with alpha."""
    with pytest.raises(InputError, match=f"pixel format {name}: not worked on"):
        planar_layout(name)
