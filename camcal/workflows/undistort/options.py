"""Options of `undistort` as they are given, checked against each other and turned into what the work takes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from camcal.errors import InputError
from camcal.formats.imaging.pixels import WRITTEN_EXTENSIONS
from camcal.nearest import did_you_mean
from camcal.undistortion.kernels import KERNELS
from camcal.undistortion.light import parse_curve
from camcal.workflows.undistort.image import ImageOptions
from camcal.workflows.undistort.inputs import VIDEOS, WRITTEN_VIDEOS, Source

if TYPE_CHECKING:
    from camcal.workflows.undistort.video import VideoOptions


@dataclass(frozen=True, slots=True, eq=False)
class FileChoice:
    """How files are to be written; `undistort` documents each field. None is what the source has.

    Raises
    ------
    InputError
        If a value is none that it may have.
    """

    interpolation: str = "linear"
    gamma: str | float | None = None
    fill: float | Sequence[float] | None = None
    file_format: str | None = None
    quality: int | None = None
    codec: str | None = None
    crf: float | None = None
    pixel_format: str | None = None
    frames: str | None = None
    preset: str | None = None
    lossless: bool | None = None
    progressive: bool = False

    def __post_init__(self) -> None:
        if self.interpolation not in KERNELS:
            known = ", ".join(KERNELS)
            raise InputError(f"--interpolation: unknown (got {self.interpolation}, expected one of {known}).")
        if self.gamma is not None:
            parse_curve(self.gamma)
        if self.fill is not None and not isinstance(self.fill, (int, float)) and len(self.fill) not in (3, 4):
            count = len(self.fill)
            raise InputError(f"--fill: not a colour (got {count} numbers, expected 1, or 3 as R,G,B, or 4 with alpha).")

    @property
    def extension(self) -> str | None:
        """The extension of the format, with its dot.

        Raises
        ------
        InputError
            If there is no format of that name that is written.
        """
        if self.file_format is None:
            return None
        extension = f".{self.file_format.lower().removeprefix('.')}"
        known = (*WRITTEN_EXTENSIONS, *WRITTEN_VIDEOS)
        if extension not in known:
            names = [other.removeprefix(".") for other in known]
            hint = did_you_mean(extension.removeprefix("."), names)
            expected = "" if hint else f", expected one of {', '.join(names)}"
            raise InputError(f"--format: not a format to write (got {self.file_format!r}{expected}).{hint}")
        return extension

    def image_options(self, most_pixels: int) -> ImageOptions:
        """Return how images are undistorted."""
        fill = 0.0 if self.fill is None else self.fill
        # In memory blue comes first.
        fill = fill if isinstance(fill, (int, float)) else (*fill[2::-1], *fill[3:])
        return ImageOptions(self.quality, most_pixels, self.interpolation, fill, self.gamma)

    def video_options(self, threads: int) -> VideoOptions:
        """Return how videos are undistorted, with so many threads; 0 is one per processor."""
        # Whoever has no videos need not wait for it.
        from camcal.formats.video.codecs import EncodingOptions
        from camcal.formats.video.trimming import FrameRange
        from camcal.workflows.undistort.video import VideoOptions

        encoding = EncodingOptions(self.codec, self.crf, self.lossless, self.pixel_format, self.preset, threads)
        frames = FrameRange() if self.frames is None else FrameRange.parse(self.frames)
        return VideoOptions(encoding, frames, self.interpolation, self.progressive)

    @property
    def only_for_images(self) -> Mapping[str, object]:
        """What was given, by the option's name, and has no meaning for videos."""
        return _given({"--fill": self.fill, "--gamma": self.gamma})

    @property
    def only_for_videos(self) -> Mapping[str, object]:
        """What was given, by the option's name, and has no meaning for images."""
        values = {
            "--codec": self.codec,
            "--crf": self.crf,
            "--pixel-format": self.pixel_format,
            "--frames": self.frames,
            "--preset": self.preset,
            "--lossless": self.lossless,
            "--progressive": self.progressive or None,
        }
        return _given(values)

    def check_kinds(self, files: Sequence[Source]) -> None:
        """Refuse options that have no meaning for the files at hand.

        Raises
        ------
        InputError
            If there are some.
        """
        videos = [file for file in files if file.is_video]
        if not videos:
            for name in self.only_for_videos:
                raise InputError(f"{name}: only for videos (there is none among the inputs). Leave it away.")
        if self.quality is not None and videos and len(videos) == len(files):
            raise InputError("--quality: only for images (there is none among the inputs). Videos have --crf.")
        for name in self.only_for_images if videos else ():
            all_are = len(videos) == len(files)
            advice = "Leave it away." if all_are else "Undistort images and videos one after the other."
            raise InputError(f"{name}: only for images (got {videos[0].path}). {advice}")
        extension = self.extension
        if extension is not None and files and all(file.is_video != (extension in VIDEOS) for file in files):
            kind, other = ("a video", "images") if extension in VIDEOS else ("an image", "videos")
            raise InputError(f"--format: {self.file_format} is for {kind} (got only {other}). Choose another format.")


def refuse_for_points(choice: FileChoice, flags: Mapping[str, object]) -> None:
    """Refuse options that have no meaning for points.

    Raises
    ------
    InputError
        If there are some.
    """
    formats = _given({"--format": choice.file_format, "--quality": choice.quality})
    for name in (*choice.only_for_images, *choice.only_for_videos, *formats, *_given(flags)):
        raise InputError(f"{name}: not for points (got a CSV file). Leave it away.")


def _given(values: Mapping[str, object]) -> Mapping[str, object]:
    """Those of the options that were given."""
    return {name: value for name, value in values.items() if value is not None and value is not False}
