"""A run over files: planned, checked, carried out, told about, and closed by the camera of the results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path

from camcal.errors import InputError
from camcal.formats.images import EXTENSIONS
from camcal.formats.ledger_file import Ledger, Stamp
from camcal.formats.output import claim_folder
from camcal.geometry.camera import Camera
from camcal.observations import Rejected
from camcal.workflows.inputs import warn_of_each
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.companions import Companions, warn_of_doubtful
from camcal.workflows.undistort.inputs import Sources
from camcal.workflows.undistort.plan import check_named, is_there, make_jobs
from camcal.workflows.undistort.work import Finished, Job, Note, Outcome, Setting, Undistorter, carry_out_here

_TEMPORARY = ".camcal-*.tmp"


@dataclass(frozen=True, slots=True, eq=False)
class Undistortion:
    """What `undistort` wrote.

    Attributes
    ----------
    folder : Path
        Where the results are.
    camera_file : Path
        The file beside them that holds their camera.
    target : Camera
        That camera.
    outputs : tuple of Job
        What was written, each with its `source` and `target`, sorted by name; in a dry run what would have been.
    already_done : tuple of Job
        What an earlier run had finished.
    rejected : tuple of Rejected
        Files that could not be worked on, with the reason.
    warnings : tuple of str
        What was not carried over into a result, or changed in it because it had to be.
    """

    folder: Path
    camera_file: Path
    target: Camera
    outputs: tuple[Job, ...]
    already_done: tuple[Job, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def images(self) -> tuple[str, ...]:
        """Names of the images written."""
        return tuple(job.name for job in self.outputs if job.target.suffix.lower() in EXTENSIONS)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What to do with files, whichever they are.

    Attributes
    ----------
    setting : Setting
    companions : Companions
    reporter : Reporter
    threads : int or None
        Images worked on at once here; None is one per processor.
    scheduler : str or None
        Address of a cluster that does the work instead.
    is_resumable : bool
        Whether the command at work can go on from where it stopped.
    """

    setting: Setting
    companions: Companions
    reporter: Reporter
    threads: int | None = None
    scheduler: str | None = None
    is_resumable: bool = True

    def over(self, files: Sources, *, force: bool = False, resume: bool = False, dry_run: bool = False) -> Undistortion:
        """Plan, check, and unless this is a dry run, do it.

        Raises
        ------
        InputError
            If a named file cannot be used, nothing can be written, or there is no result in the end.
        """
        place = self.companions.place
        jobs, unwritable = make_jobs(files.files, place, self.companions.names)
        rejected = (*files.unreadable, *unwritable)
        ledger = Ledger(place.folder) if place.file is None else None
        keys = self._keys
        done = [job for job in jobs if ledger.is_done(job.source, job.name, keys[job.is_video])] if resume and ledger else []
        waiting = sorted(set(jobs) - set(done), key=lambda job: job.name)
        check_named(waiting, self.setting)
        place.refuse_used(force=force, resume=resume)
        if dry_run:
            return self._foreseen(waiting, done, rejected)
        with _nothing_left_of_failures(place.folder, waiting):
            place.claim()
            with nullcontext() if ledger is None else ledger.held(), self._told_how_to_go_on(ledger, waiting):
                for folder in sorted({job.target.parent for job in waiting} - {place.folder}):
                    claim_folder(folder, force=True)
                if resume:
                    sweep(jobs)
                if ledger is not None:
                    ledger.begin()
                    self._warn_of_strangers(ledger.left_over({job.name for job in jobs}, set(keys.values())))
                return self._done(waiting, done, rejected, ledger)

    @property
    def _keys(self) -> dict[bool, str]:
        """Names of the setting, for images and for videos."""
        return {is_video: self.setting.key(is_video=is_video) for is_video in (False, True)}

    def _foreseen(self, waiting: Sequence[Job], done: Sequence[Job], rejected: Sequence[Rejected]) -> Undistortion:
        """Look at what waits, and tell about it, without doing it."""
        from camcal.workflows.undistort.foresight import foresee

        outcomes = foresee(waiting, self.setting, self.threads, self.reporter)
        result = self._result(outcomes, done, rejected)
        self._tell(result, outcomes, is_named=all(job.named for job in waiting))
        return result

    def _done(
        self, waiting: Sequence[Job], done: Sequence[Job], rejected: Sequence[Rejected], ledger: Ledger | None
    ) -> Undistortion:
        """Do what waits, tell about it, and write what belongs beside it."""
        keys = self._keys

        def note(job: Job, read: Stamp | None) -> None:
            if ledger is not None and read is not None:
                ledger.add(job.source, job.name, read, keys[job.is_video])

        names = {job.name for job in (*waiting, *done)}
        warn_of_doubtful(self.companions.withdraw(ledger, self.setting.map_key, names), self.reporter)
        undistorter = Undistorter(self.setting)
        outcomes = self._carry_out(waiting, undistorter, note)
        result = self._result(outcomes, done, rejected)
        self._tell(result, outcomes, is_named=all(job.named for job in waiting))
        self.companions.write(lambda: undistorter.map)
        if ledger is not None:
            for name in self.companions.names:
                ledger.add_companion(name, self.setting.map_key)
        return result

    def _carry_out(self, jobs: Sequence[Job], undistorter: Undistorter, note: Note) -> list[Outcome]:
        """Do what is to be done, here or on a cluster."""
        if self.scheduler is None:
            return carry_out_here(jobs, undistorter, note, self.threads, self.reporter)
        from camcal.workflows.undistort.cluster import carry_out_on_cluster

        outcomes = carry_out_on_cluster(self.scheduler, jobs, self.setting, note, self.reporter)
        sweep(jobs)
        return outcomes

    @contextmanager
    def _told_how_to_go_on(self, ledger: Ledger | None, jobs: Sequence[Job]) -> Iterator[None]:
        """Say of an error in the middle of a run that what is finished stays; a ledger of nothing is taken away."""
        try:
            yield
        except InputError as error:
            nothing = not any(is_there(job.target) for job in jobs)
            came_to_nothing = ledger is None or (nothing and ledger.withdraw())
            if came_to_nothing or not self.is_resumable or "--resume" in str(error):
                raise
            raise InputError(f"{error} What is finished stays: go on from there with --resume.") from error

    def _warn_of_strangers(self, names: Sequence[str]) -> None:
        """Say which results in the folder are not those of the camera that is going to stand beside them."""
        if names:
            count = f"{len(names)} file{'' if len(names) == 1 else 's'} of another camera or other options"
            where = self.companions.place.folder
            self.reporter.warn(f"{where}: also holds {count} (first: {names[0]}). Remove what you do not need.")

    def _result(self, outcomes: Sequence[Outcome], done: Sequence[Job], rejected: Sequence[Rejected]) -> Undistortion:
        finished = [outcome for outcome in outcomes if isinstance(outcome, Finished)]
        more = [outcome for outcome in outcomes if isinstance(outcome, Rejected)]
        place = self.companions.place
        return Undistortion(
            place.folder,
            place.camera_file,
            self.companions.intrinsics.camera,
            outputs=tuple(sorted((one.job for one in finished), key=lambda job: job.name)),
            already_done=tuple(done),
            rejected=tuple(sorted((*rejected, *more), key=lambda rejection: rejection.source)),
            warnings=tuple(text for one in finished for text in one.sentences),
        )

    def _tell(self, result: Undistortion, outcomes: Sequence[Outcome], *, is_named: bool) -> None:
        """Pass on what is to be said of the files, and raise if there is no result at all."""
        nothing = bool(result.rejected) and not result.outputs and not result.already_done
        if nothing and len(result.rejected) == 1:
            only = f"{result.rejected[0].source}: {result.rejected[0].reason}"
            raise InputError(only if is_named else f"undistort: no usable image or video ({only})")
        finished = [outcome for outcome in outcomes if isinstance(outcome, Finished)]
        of_images = [(one.job.name, text) for one in finished if not one.job.is_video for text in one.warnings]
        warn_of_each(of_images, self.reporter)
        for one in finished:
            for text in one.warnings if one.job.is_video else ():
                self.reporter.warn(text)
        passed_over = ((rejection.source, f"passed over: {rejection.reason}") for rejection in result.rejected)
        warn_of_each(passed_over, self.reporter)
        if nothing:
            first = result.rejected[0]
            raise InputError(f"undistort: no usable image or video (first: {first.source}: {first.reason})")


@contextmanager
def _nothing_left_of_failures(folder: Path, jobs: Sequence[Job]) -> Iterator[None]:
    """Remove the folders that a run made if it fails with nothing in them."""
    wanted = {folder, *folder.parents, *(job.target.parent for job in jobs)}
    made = sorted((path for path in wanted if not is_there(path)), reverse=True)
    try:
        yield
    except InputError:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def sweep(jobs: Iterable[Job]) -> None:
    """Remove what killed processes left half-written where results go; nobody else may be writing there."""
    for folder in {job.target.parent for job in jobs}:
        for leftover in folder.glob(_TEMPORARY):
            with suppress(OSError):
                leftover.unlink()
