"""One file undistorted, and many: the same work for threads of this process and for workers elsewhere."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from camcal import __version__
from camcal.errors import InputError
from camcal.formats.ledger_file import Stamp
from camcal.observations import Rejected
from camcal.undistortion.maps import UndistortMap
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.geometry import Cameras
from camcal.workflows.undistort.image import ImageOptions, undistort_image_file
from camcal.workflows.undistort.inputs import is_video

if TYPE_CHECKING:
    from camcal.workflows.undistort.video import VideoOptions

_LABEL = "Undistorting"
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)


@dataclass(frozen=True, slots=True)
class Job:
    """A file to read and the file to write.

    Attributes
    ----------
    source, target : Path
    name : str
        Of the target, below the output folder.
    named : bool
        Whether the user named the source itself.
    """

    source: Path
    target: Path
    name: str
    named: bool = False

    @property
    def is_video(self) -> bool:
        """Whether it is about a video."""
        return is_video(self.source)

    @property
    def label(self) -> str:
        """What to call it where it is not done: its source's name, below the folder that the user gave."""
        return str(PurePosixPath(self.name).with_name(self.source.name))

    def rejected(self, error: InputError) -> Rejected:
        """Say that it cannot be done, without naming its files twice; where a file cannot be written, that one is named."""
        reason = str(error).removeprefix(f"{self.source}: ")
        if not isinstance(error.__context__, OSError):
            reason = reason.removeprefix(f"{self.target}: ")
        return Rejected(self.label, reason)

    @property
    def format(self) -> str:
        """Format of the target, by its extension."""
        return self.target.suffix[1:].lower()


@dataclass(frozen=True, slots=True)
class Finished:
    """A job that is done.

    Attributes
    ----------
    job : Job
    warnings : tuple of str
        One clause each of an image, whole sentences of a video.
    """

    job: Job
    warnings: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """The warnings, each with the file that it is about."""
        return self.warnings if self.job.is_video else tuple(f"{self.job.name}: {text}" for text in self.warnings)


Outcome = Finished | Rejected
"""What became of a job."""

Note = Callable[[Job, Stamp | None], None]
"""Called with a finished job and what its source was like before it was read."""


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """All that a result depends on, beside its source.

    Attributes
    ----------
    cameras : Cameras
    image : ImageOptions
    video : VideoOptions or None
        None if there is no video to work on.
    exact : bool
        Whether no position is interpolated.
    distort : bool
        Whether a lens is added, not removed.
    """

    cameras: Cameras
    image: ImageOptions
    video: VideoOptions | None = None
    exact: bool = False
    distort: bool = False

    @property
    def as_progressive(self) -> bool:
        """Whether videos may be marked as interlaced."""
        return self.video is not None and self.video.as_progressive

    def key(self, *, is_video: bool) -> str:
        """Name the setting, with whatever changes an image or a video, in 16 letters."""
        own: object = replace(self.image, most_pixels=1)
        if is_video and self.video is not None:
            own = replace(self.video, encoding=replace(self.video.encoding, threads=0))
        return _digest(repr((*self._of_map, own)))

    @property
    def map_key(self) -> str:
        """Name what of the setting changes the map, in 16 letters."""
        return _digest(repr(self._of_map))

    @property
    def _of_map(self) -> tuple[object, ...]:
        cameras = (self.cameras.source, self.cameras.target)
        shared = [(camera.size, camera.intrinsic_names, camera.intrinsics.tolist()) for camera in cameras]
        return __version__, shared, self.exact


def _digest(text: str) -> str:
    """Return 64 bits that tell one text from another (FNV-1a): hashlib would take longer to import than images to read."""
    number = 0xCBF29CE484222325
    for byte in text.encode():
        number = (number ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return f"{number:016x}"


class Undistorter:
    """Does jobs of one setting, on any number of threads; the map is built when it is first needed, once."""

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self._lock = threading.Lock()
        self._map: UndistortMap | None = None

    @property
    def map(self) -> UndistortMap:
        """The map from the cameras' one to the other."""
        with self._lock:
            if self._map is None:
                self._map = self.setting.cameras.map(exact=self.setting.exact)
            return self._map

    def do(self, job: Job, advance: Callable[[], None] | None = None) -> Outcome:
        """Do a job.

        Parameters
        ----------
        job : Job
            The folder of its target exists.
        advance : callable, optional
            Called after each frame of a video.

        Returns
        -------
        Finished or Rejected
            The latter if this one file cannot be read or written.

        Raises
        ------
        InputError
            If no file can be written any more: the disk is full.
        """
        try:
            if job.is_video:
                return Finished(job, self._undistort_video(job, advance))
            return Finished(job, undistort_image_file(job.source, job.target, self.map, self.setting.image))
        except InputError as error:
            cause = error.__context__
            if isinstance(cause, OSError) and cause.errno in _FULL:
                raise
            return job.rejected(error)

    def _undistort_video(self, job: Job, advance: Callable[[], None] | None) -> tuple[str, ...]:
        # libav takes long to import, and images do not need it.
        from camcal.workflows.undistort.video import undistort_video

        what = "added" if self.setting.distort else "removed"
        note = f"Lens distortion {what} by camcal {__version__}."
        result = undistort_video(
            job.source, job.target, self.map, options=self.setting.video, force=True, advance=advance, note=note
        )
        return result.warnings


def carry_out_here(
    jobs: Sequence[Job], undistorter: Undistorter, note: Note, count: int | None, reporter: Reporter
) -> list[Outcome]:
    """Do jobs on this machine.

    Parameters
    ----------
    jobs : sequence of Job
    undistorter : Undistorter
    note : callable
        Told of each finished job, on any thread.
    count : int or None
        Images worked on at once; None is one per processor.
    reporter : Reporter

    Raises
    ------
    InputError
        If no file can be written any more; what is finished by then stays.
    """

    def work(job: Job) -> Outcome:
        read = Stamp.of(job.source)
        outcome = undistorter.do(job)
        if isinstance(outcome, Finished):
            note(job, read)
        return outcome

    images = [job for job in jobs if not job.is_video]
    # A video keeps every processor busy by itself, and Ctrl-C is to end it at once.
    videos = [job for job in jobs if job.is_video]
    return [
        *do_each(work, images, count, reporter, label=_LABEL),
        *(_do_video(job, undistorter, note, reporter) for job in videos),
    ]


def do_each(
    work: Callable[[Job], Outcome], jobs: Sequence[Job], count: int | None, reporter: Reporter, *, label: str
) -> list[Outcome]:
    """Do the same to each of some jobs, so many at once (None is one per processor), with a row of progress."""
    if not jobs:
        return []
    if len(jobs) == 1:
        with reporter.progress(label, None):
            return [work(job) for job in jobs]
    # Threads take long to import, and a single file does not need them.
    from camcal.workflows.parallel import each

    with reporter.progress(label, len(jobs)) as advance:
        return each(work, jobs, count, advance)


def _do_video(job: Job, undistorter: Undistorter, note: Note, reporter: Reporter) -> Outcome:
    from camcal.formats.video.reader import probe_video

    read = Stamp.of(job.source)
    try:
        frames = probe_video(job.source).frames
    except InputError as error:
        return job.rejected(error)
    with reporter.progress(job.name, frames) as advance:
        outcome = undistorter.do(job, advance)
    if isinstance(outcome, Finished):
        note(job, read)
    return outcome
