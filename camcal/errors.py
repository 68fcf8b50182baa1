"""The error tree: every expected failure is a `CamcalError` that carries its exit code.

A message is one line that says *where: what is wrong (got X, expected Y). What to do.* The command line prints it as it
stands and leaves with the code; anything else that escapes is a bug of ours and keeps its traceback (exit code 1).
"""

from __future__ import annotations


class CamcalError(Exception):
    """Base of every expected failure.

    Attributes
    ----------
    exit_code : int
        What the command line leaves with.
    """

    exit_code = 1


class InputError(CamcalError):
    """Files, YAML, images, sizes or options that cannot be used as they are."""

    exit_code = 2


class DetectionError(CamcalError):
    """Too few usable views: says which images failed and the likely cause."""

    exit_code = 3


class SolveError(CamcalError):
    """The solve is degenerate, did not converge or is not finite."""

    exit_code = 4


class QualityError(CamcalError):
    """A result exists (and is written, marked as such) but must not be trusted."""

    exit_code = 5


INTERRUPTED_EXIT_CODE = 130
"""What the command line leaves with after Ctrl-C (SIGINT)."""

TERMINATED_EXIT_CODE = 143
"""What it leaves with after SIGTERM, cleaned up as after Ctrl-C."""
