"""Progress on a terminal: rows that fit and leave nothing behind, warnings whole above them; silence everywhere else."""

from __future__ import annotations

import re
import subprocess
import sys
import time

import pytest
from terminals import COLUMNS, run_on_terminal

from camcal.cli.console import ConsoleReporter
from camcal.cli.progress import Step, clock, rate
from camcal.workflows.reporting import LogReporter, ProgressOnly, SilentReporter

BEGIN = """
import sys, threading, time
from camcal.cli import progress
from camcal.cli.console import ConsoleReporter, say
progress._PATIENCE_S = 0.05
reporter = ConsoleReporter()
"""

NESTED = """
with reporter.progress("Twins of a capture with a long name.mp4", 100000) as outer:
    for index in range(4):
        with reporter.progress("Detecting", 123456) as advance:
            for _ in range(6):
                time.sleep(0.03)
                threading.Thread(target=advance).start()
            reporter.warn(f"view {index} " + "is rejected, and that is a long story " * 4 + "that ends here")
        with reporter.progress("Solving", None):
            time.sleep(0.1)
        outer()
say("the result")
"""

QUICK = """
progress._PATIENCE_S = 60
with reporter.progress("Detecting", 3) as advance:
    advance()
    reporter.warn("careful")
say("the result")
"""


def run(script: str, **environment: str):
    """Run a script on a terminal."""
    return run_on_terminal([sys.executable, "-c", BEGIN + script], **environment)


def test_rows_fit_and_leave_nothing_behind():
    """Two rows at once with labels, counts and totals as long as they get; warnings from within; then the result."""
    session = run(NESTED)
    assert session.code == 0
    assert 40 < session.widest <= COLUMNS
    for label in ("Twins of a…", "Detecting", "Solving", "/123456", "left"):
        assert label in session.raw
    assert max(map(len, session.screen)) <= COLUMNS
    *warnings, result = re.sub(r"\n  (?=\S)", " ", "\n".join(session.screen)).splitlines()
    assert result == "the result"
    story = " ".join(["is rejected, and that is a long story"] * 4)
    assert warnings == [f"camcal: warning: view {index} {story} that ends here" for index in range(4)]
    assert session.cursor_is_shown


def test_quick_steps_show_no_row():
    """Nobody could read it: no row, no escape sequence but that of a colour."""
    session = run(QUICK)
    assert session.screen == ["camcal: warning: careful", "the result"]
    assert "Detecting" not in session.raw
    assert "\x1b[?25" not in session.raw


@pytest.mark.parametrize("environment", [{"TERM": "dumb"}, {"TERM": "unknown"}])
def test_dumb_terminals_get_lines_only(environment):
    """No row and no escape sequence at all."""
    session = run(NESTED, **environment)
    assert "\x1b" not in session.raw
    assert session.screen[-1] == "the result"
    assert len(session.screen) == 5


def test_rows_without_colours():
    """With NO_COLOR they are drawn in the terminal's own."""
    session = run(NESTED, NO_COLOR="1")
    assert "Detecting" in session.raw
    assert not re.search(r"\x1b\[[\d;]*3[0-8][\d;]*m", session.raw)


def test_silent_in_a_pipe():
    """No row where stderr is no terminal; warnings are there, and stdout has the result alone."""
    finished = subprocess.run([sys.executable, "-c", BEGIN + NESTED], capture_output=True, text=True, check=True)
    assert finished.stdout == "the result\n"
    assert len(finished.stderr.splitlines()) == 4
    assert "Detecting" not in finished.stderr


def test_stdout_stays_stdout_while_a_row_is_shown(tmp_path):
    """What is written to a file while a row is on the terminal goes to that file."""
    script = """
sys.stdout = open(sys.argv[1], "w")
with reporter.progress("Detecting", 9):
    time.sleep(0.5)
    print("data")
sys.stdout.close()
"""
    session = run_on_terminal([sys.executable, "-c", BEGIN + script, str(tmp_path / "out")])
    assert session.code == 0
    assert "Detecting" in session.raw
    assert session.screen == []
    assert (tmp_path / "out").read_text() == "data\n"


def test_a_failure_within_a_step_leaves_no_row():
    """The row goes before the error is told."""
    session = run('with reporter.progress("Detecting", 9):\n    time.sleep(0.4)\n    sys.exit(3)')
    assert session.code == 3
    assert "Detecting" in session.raw
    assert session.screen == []
    assert session.cursor_is_shown


def test_ctrl_c_on_a_terminal(dataset, tmp_path):
    """In the middle of a row: exit 130, one line, no traceback, nothing half-written, and a cursor."""
    for index in range(400):
        (tmp_path / f"{index:03d}.png").hardlink_to(dataset / "images/view_0000.png")
    command = [sys.executable, "-m", "camcal", "calibrate", str(tmp_path), "--board", str(dataset / "board.yaml")]
    session = run_on_terminal([*command, "-o", str(tmp_path / "calib"), "-j", "1"], interrupt_when=lambda raw: "left" in raw)
    assert session.code == 130
    assert session.screen == ["camcal: interrupted; every file that was written is whole."]
    assert session.cursor_is_shown
    assert list((tmp_path / "calib").iterdir()) == []


def test_pace(monkeypatch):
    """Rate and remaining time from what is done so far: 30 of 120 in 10 s are 3 a second, and 30 s are left."""
    now = time.monotonic()
    step = Step("Detecting", 120, started_s=now, done=30)
    monkeypatch.setattr(time, "monotonic", lambda: now + 10.0)
    assert (step.count, step.pace) == ("30/120", "3.0/s, 0:30 left")
    assert (Step("Solving", None, started_s=now).count, Step("Solving", None, started_s=now).pace) == ("", "0:10")
    assert Step("Detecting", 120, started_s=now).pace == "0:10"


@pytest.mark.parametrize(
    ("count", "seconds", "written"),
    [(1000, 1.0, "1000/s"), (99, 10.0, "9.9/s"), (1, 90.0, "90.0 s each"), (1, 0.0, "1000000/s")],
)
def test_rate(count, seconds, written):
    """Many, a few, less than one in a second; and what took no time."""
    assert rate(count, seconds) == written


def test_clock():
    """Whole seconds; minutes and hours carry."""
    assert [clock(s) for s in (0, 59.4, 59.6, 3599.6, 86400)] == ["0:00", "0:59", "1:00", "1:00:00", "24:00:00"]


def test_reporters(caplog):
    """The logger hears warnings and details, a silent one nothing, and a step within another passes its progress on."""
    caplog.set_level("INFO", logger="camcal")
    steps = []

    class Outer(SilentReporter):
        def progress(self, label, total):
            steps.append((label, total))
            return super().progress(label, total)

    for reporter in (LogReporter(), SilentReporter(), ProgressOnly(Outer()), ConsoleReporter()):
        with reporter.progress("Detecting", None) as advance:
            advance()
    for reporter in (LogReporter(), SilentReporter(), ProgressOnly(LogReporter())):
        reporter.warn("careful")
        reporter.detail("so it is")
    assert steps == [("Detecting", None)]
    assert [(record.levelname, record.message) for record in caplog.records] == [("WARNING", "careful"), ("INFO", "so it is")]
