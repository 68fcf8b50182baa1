"""What is said of files that were found and are not worked on."""

from __future__ import annotations

from camcal.formats.imaging.unread import UNREAD, advice_for
from camcal.workflows.reporting import Reporter
from camcal.workflows.undistort.inputs import Sources


def warn_of_others(found: Sources, reporter: Reporter) -> None:
    """Say in a line each: how many other files there are, how many images are not read, and which folders hold results."""
    unread = [path for path in found.others if path.suffix.lower() in UNREAD]
    others = [path for path in found.others if path.suffix.lower() not in UNREAD]
    if others:
        count = len(others)
        reporter.warn(f"{count} other {'file' if count == 1 else 'files'} passed over (first: {others[0].name}).")
    if unread:
        images = f"{len(unread)} image{'' if len(unread) == 1 else 's'}"
        reporter.warn(f"{images} of a format that is not read passed over (first: {unread[0].name}). {advice_for(unread[0])}")
    for folder in found.results:
        reporter.warn(f"{folder}: holds results of an earlier run: passed over. Name this folder to work on them again.")
