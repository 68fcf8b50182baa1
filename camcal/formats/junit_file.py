"""Results as JUnit XML, which every CI server shows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from camcal.formats.output import write_atomically


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
