"""What would become of jobs, as far as their files tell without being decoded: for a dry run."""

from __future__ import annotations

from collections.abc import Sequence

from camcal.errors import InputError
from camcal.formats.imaging.foretold import foretold_pixels
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.image import refuse_size, refuse_unstorable, useful_content
from camcal.workflows.undistort.probe import size_of_source
from camcal.workflows.undistort.work import Finished, Job, Outcome, Setting, do_each


def foresee(jobs: Sequence[Job], setting: Setting, count: int | None, reporter: Reporter) -> list[Outcome]:
    """Look into the files of jobs, and tell which of them would be rejected.

    Parameters
    ----------
    jobs : sequence of Job
    setting : Setting
    count : int or None
        Files looked into at once; None is one per processor.
    reporter : Reporter

    Returns
    -------
    list of Finished or Rejected
        One for each job, in their order; nothing is written.
    """

    def look(job: Job) -> Outcome:
        try:
            _refuse_useless(job, setting)
        except InputError as error:
            return job.rejected(error)
        return Finished(job)

    return do_each(look, jobs, count, reporter, label="Looking")


def _refuse_useless(job: Job, setting: Setting) -> None:
    """Raise what doing the job would raise before, and right after, its file is decoded."""
    expected, most_pixels = setting.cameras.source.size, setting.image.most_pixels
    if job.is_video:
        size = size_of_source(job.source, most_pixels, as_progressive=setting.as_progressive)
        refuse_size(job.source, size, expected)
        return
    pixels = foretold_pixels(useful_content(job.source, expected, most_pixels))
    if pixels is not None:
        refuse_unstorable(job.target, *pixels)
