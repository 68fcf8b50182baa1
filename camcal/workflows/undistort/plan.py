"""What an undistortion is going to do: every file to read with the one to write, checked before any work is done."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from camcal.errors import InputError
from camcal.formats.camera_file import CAMERA_FILE_NAME, split_choice
from camcal.formats.images import EXTENSIONS
from camcal.formats.imaging.pixels import WRITTEN_EXTENSIONS
from camcal.formats.imaging.unread import UNREAD
from camcal.formats.ledger_file import LEDGER_NAME
from camcal.formats.output import claim_file, claim_folder
from camcal.formats.text import file_in, unreadable
from camcal.nearest import did_you_mean
from camcal.observations import Rejected
from camcal.workflows.undistort.image import refuse_size
from camcal.workflows.undistort.inputs import VIDEOS, WRITTEN_VIDEOS, Source
from camcal.workflows.undistort.probe import size_of_source
from camcal.workflows.undistort.work import Job, Setting

_CALIBRATION_FILES = ("views.yaml", "corners.csv")


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where results go.

    Attributes
    ----------
    folder : Path
    file : Path or None
        The only result, if the user named it.
    """

    folder: Path
    file: Path | None = None

    @property
    def camera_file(self) -> Path:
        """The camera of the results."""
        return self.companion(CAMERA_FILE_NAME)

    def companion(self, name: str) -> Path:
        """Return a file beside the results; beside a single one it has that one's name in front."""
        return self.folder / name if self.file is None else self.file.with_name(f"{self.file.stem}.{name}")

    def refuse_used(self, *, force: bool, resume: bool) -> None:
        """Refuse a place that holds something already, unless it may be written into; nothing is written to find out.

        Raises
        ------
        InputError
            If it does, and neither `force` nor, in a folder that an earlier run began, `resume` allows it.
        """
        if self.file is not None:
            if resume:
                raise InputError(f"--resume: needs a folder of results (got the file {self.file}). Name a folder with -o.")
            for file in () if force else (self.file, self.camera_file):
                if is_there(file):
                    raise InputError(f"{file}: output file exists. Choose another name, or replace it with --force.")
        elif is_there(self.folder) and not self.folder.is_dir():
            raise InputError(f"{self.folder}: a file stands where the output folder should be. Choose another folder.")
        elif not (force or (resume and self.has_ledger)) and _is_used(self.folder):
            advice = "Go on with --resume, choose another one" if self.has_ledger else "Choose another one"
            raise InputError(f"{self.folder}: output folder is not empty. {advice}, or write into it with --force.")

    def claim(self) -> None:
        """Make sure that results can be written.

        Raises
        ------
        InputError
            If not.
        """
        if self.file is None:
            claim_folder(self.folder, force=True)
        else:
            claim_file(self.file, force=True)

    @property
    def has_ledger(self) -> bool:
        """Whether the folder holds what an earlier run began."""
        return is_there(self.folder / LEDGER_NAME)


def is_there(path: Path) -> bool:
    """Tell whether a file or folder is to be seen; if the system does not let us look, an attempt to write tells why."""
    try:
        return path.exists()
    except OSError:
        return False


def choose_place(output: str | Path, files: Sequence[Source], extension: str | None) -> Place:
    """Tell whether the output is a folder or, for a single input, a file.

    Raises
    ------
    InputError
        If a file is named for several inputs, or one of another format than asked for, or an extension is mistyped.
    """
    path = Path(output)
    if is_file_name(output, UNREAD):
        raise InputError(
            f"{path}: not a format to write (got '{path.suffix}'). Name a file such as {path.stem}.tif, or a folder."
        )
    if not is_file_name(output, EXTENSIONS | VIDEOS):
        if len(files) == 1 and files[0].named:
            refuse_mistyped(output, WRITTEN_VIDEOS if files[0].is_video else WRITTEN_EXTENSIONS)
        return Place(path)
    if len(files) > 1:
        raise InputError(f"{path}: a file for {len(files)} inputs (expected a folder). Name a folder with -o.")
    if extension is not None and path.suffix.lower() != extension.lower():
        raise InputError(f"--format: not that of the output file (got {extension}, expected {path.suffix}). Leave it away.")
    return Place(path.parent, path)


def refuse_mistyped(output: str | Path, extensions: Iterable[str]) -> None:
    """Refuse an output that does not exist and looks as if it was to be a file: that name would become a folder.

    Raises
    ------
    InputError
        If it ends almost like one of the extensions, and not with a slash.
    """
    path = Path(output)
    ending = path.suffix.lower().removeprefix(".")
    # Names such as results.tmp are a folder's; who mistypes an extension begins it right.
    known = [extension[1:] for extension in extensions if extension[1:2] == ending[:1]]
    hint = "" if _is_folder(output) or is_there(path) else did_you_mean(ending, known)
    if hint:
        raise InputError(f"{path}: not a format to write (got '{path.suffix}').{hint} A folder of this name ends with a slash.")


def _is_folder(output: str | Path) -> bool:
    """Tell whether an output is a folder that is there, or ends with a slash."""
    path = Path(output)
    return str(output).endswith(("/", os.sep)) or (is_there(path) and path.is_dir())


def _is_used(folder: Path) -> bool:
    """Tell whether a folder holds something, beside the ledger of a run that came to nothing."""
    try:
        return is_there(folder) and any(path.name != LEDGER_NAME for path in folder.iterdir())
    except OSError as error:
        raise unreadable(folder, error) from None


def is_file_name(output: str | Path, extensions: Collection[str]) -> bool:
    """Tell whether an output is the name of a file with one of the extensions, and no folder."""
    return Path(output).suffix.lower() in extensions and not _is_folder(output)


def make_jobs(files: Sequence[Source], place: Place, beside: Collection[str]) -> tuple[tuple[Job, ...], tuple[Rejected, ...]]:
    """Say what to write for each file.

    Parameters
    ----------
    files : sequence of Source
    place : Place
    beside : collection of str
        Names of what else is written into the folder.

    Returns
    -------
    jobs : tuple of Job
    rejected : tuple of Rejected
        Files whose format is not written, unless the user named them.

    Raises
    ------
    InputError
        If a named file's format is not written, or a result would replace an input or what stands beside the results.
    """
    jobs, rejected = [], []
    for source in files:
        target = place.file or place.folder / source.name
        problem = _format_problem(source, target)
        if problem and source.named:
            raise InputError(f"{source.path}: {problem}")
        if problem:
            rejected.append(Rejected(source.name, problem))
        else:
            jobs.append(Job(source.path, target, target.name if place.file else source.name, source.named))
        if place.file is None and source.name in beside:
            raise InputError(f"{source.path}: its result would be replaced by the {source.name} beside the results. Rename it.")
    refuse_replacing(jobs)
    return tuple(jobs), tuple(rejected)


def _format_problem(source: Source, target: Path) -> str:
    """Say why a result cannot be written under its name; nothing if it can."""
    extension = target.suffix.lower()
    known = WRITTEN_VIDEOS if source.is_video else WRITTEN_EXTENSIONS
    if extension in known:
        return ""
    kind = "a video" if source.is_video else "an image"
    expected = ", ".join(known)
    return f"no format that {kind} is written in (got '{extension}', expected one of {expected}). Choose one with --format."


def refuse_replacing(jobs: Sequence[Job]) -> None:
    """Refuse a result that would replace an input.

    Raises
    ------
    InputError
        If one would, its own or another.
    """
    inputs = {os.path.realpath(job.source): job.source for job in jobs}
    folders: dict[Path, str] = {}
    for job in jobs:
        folder = job.target.parent
        if folder not in folders:
            folders[folder] = os.path.realpath(folder)
        replaced = inputs.get(os.path.join(folders[folder], job.target.name))  # noqa: PTH118 - text is ten times as fast
        if replaced is not None:
            whose = "its own input" if replaced == job.source else f"another input, {replaced}"
            raise InputError(f"{job.target}: output would replace {whose}. Choose another folder or file with -o.")


def refuse_lost_cameras(place: Place, cameras: Iterable[Path | None]) -> None:
    """Refuse a place where the new camera would replace a calibration, or a camera file that is in use.

    Raises
    ------
    InputError
        If so.
    """
    if place.file is None and any(is_there(place.folder / name) for name in _CALIBRATION_FILES):
        raise InputError(
            f"{place.folder}: holds a calibration, whose camera.yaml would be replaced. Choose another folder with -o."
        )
    mine = os.path.realpath(place.camera_file)
    for camera in cameras:
        if camera is not None and os.path.realpath(file_in(split_choice(camera)[0], CAMERA_FILE_NAME)) == mine:
            raise InputError(f"{camera}: would be replaced by the camera of the results. Choose another folder with -o.")


def check_named(jobs: Iterable[Job], setting: Setting) -> None:
    """Refuse files that the user named and that are seen, from their headers, to be of no use.

    Raises
    ------
    InputError
        If one cannot be read, is no image or video, is too large, of another size than the camera's, or interlaced.
    """
    for job in jobs:
        if job.named:
            size = size_of_source(job.source, setting.image.most_pixels, as_progressive=setting.as_progressive)
            refuse_size(job.source, size, setting.cameras.source.size)


def first_size(files: Iterable[Source], most_pixels: int) -> tuple[Path, tuple[int, int]] | None:
    """Find the first file that tells its (width, height) in pixels; None if none does.

    Raises
    ------
    InputError
        If a file that the user named cannot be used.
    """
    for source in files:
        try:
            size = size_of_source(source.path, most_pixels)
        except InputError:
            if source.named:
                raise
            continue
        if size is not None:
            return source.path, size
    return None
