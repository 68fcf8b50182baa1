"""Results as JUnit XML, which every CI server shows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from camcal.formats.output import claim_remade, write_atomically

_JUNIT = re.compile(rb"(\xef\xbb\xbf)?\s*(<\?xml.*?\?>\s*)?(<!--.*?-->\s*)*<testsuites?[\s/>]", re.DOTALL)


def claim_junit(path: str | Path) -> Path:
    """Make sure that results may be written, before any work is done; those of an earlier run are replaced.

    Raises
    ------
    InputError
        If a file that is not JUnit's is there, or it cannot be written.
    """
    return claim_remade(path, lambda start: _JUNIT.match(start) is not None, "a JUnit file")


def save_junit(path: str | Path, cases: Sequence[tuple[str, float, Sequence[str]]]) -> None:
    """Write one test case per scenario.

    Parameters
    ----------
    path : path
    cases : sequence of (name, seconds, problems)
        A case without problems has passed.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    failures = sum(bool(problems) for _, _, problems in cases)
    total = f"{sum(seconds for _, seconds, _ in cases):.3f}"
    suite = ElementTree.Element("testsuite", name="camcal regress", tests=str(len(cases)), failures=str(failures), time=total)
    for name, seconds, problems in cases:
        case = ElementTree.SubElement(suite, "testcase", classname="camcal.regress", name=name, time=f"{seconds:.3f}")
        if problems:
            failure = ElementTree.SubElement(case, "failure", message=problems[0])
            failure.text = "\n".join(problems)
    ElementTree.indent(suite)
    write_atomically(path, ElementTree.tostring(suite, encoding="unicode", xml_declaration=True) + "\n")
