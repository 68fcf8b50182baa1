"""Colours: on terminals and on demand only, and never the only sign of anything."""

from __future__ import annotations

import io
import re
import sys

import pytest
from terminals import run_on_terminal

from camcal.cli import style
from camcal.cli.summary import print_verdict
from camcal.verdict import LEVELS, WORDS, Finding, Verdict

ESCAPE = re.compile(r"\x1b\[[\d;]*m")
SWITCHES = ("NO_COLOR", "FORCE_COLOR", "CLICOLOR_FORCE", "TERM")


class Stream(io.StringIO):
    """A stream that is a terminal or not."""

    def __init__(self, terminal: bool) -> None:
        super().__init__()
        self.terminal = terminal

    def isatty(self) -> bool:
        """Tell which."""
        return self.terminal


@pytest.fixture(autouse=True)
def plain_environment(monkeypatch):
    """No switch is set."""
    for name in SWITCHES:
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")


@pytest.mark.parametrize(
    ("environment", "on_a_terminal", "in_a_pipe"),
    [
        ({}, True, False),
        ({"NO_COLOR": "1"}, False, False),
        ({"NO_COLOR": "0"}, False, False),
        ({"NO_COLOR": ""}, True, False),
        ({"FORCE_COLOR": "1"}, True, True),
        ({"FORCE_COLOR": ""}, True, False),
        ({"CLICOLOR_FORCE": "1"}, True, True),
        ({"CLICOLOR_FORCE": "0"}, True, False),
        ({"FORCE_COLOR": "1", "NO_COLOR": "1"}, False, False),
        ({"TERM": "dumb"}, False, False),
        ({"TERM": "unknown"}, False, False),
        ({"TERM": "dumb", "FORCE_COLOR": "1"}, True, True),
    ],
)
def test_who_gets_colours(environment, on_a_terminal, in_a_pipe, monkeypatch):
    """As no-color.org, force-color.org and bixense.com/clicolors have it: any value but the empty one, and no beats force."""
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert style.in_colour(Stream(True)) == on_a_terminal
    assert style.in_colour(Stream(False)) == in_a_pipe


def test_a_closed_stream_is_no_terminal():
    """It cannot even be asked."""
    stream = Stream(True)
    stream.close()
    closed = io.StringIO()
    closed.close()
    assert not style.in_colour(closed)


@pytest.mark.parametrize(
    "arguments", [("verify", "CALIB", "--truth", "DATA"), ("verify", "CALIB", "--truth", "nowhere"), ("calibrate", "--help")]
)
def test_colours_change_no_word(run, arguments, dataset, calibrated, monkeypatch):
    """Results, failures and help say the same with colours and without; with NO_COLOR the bytes are those of a pipe."""
    arguments = [{"CALIB": str(calibrated), "DATA": str(dataset)}.get(word, word) for word in arguments]
    printed = {}
    for name in ("", "FORCE_COLOR", "NO_COLOR"):
        for switch in SWITCHES[:2]:
            monkeypatch.delenv(switch, raising=False)
        if name:
            monkeypatch.setenv(name, "1")
        _, out, err = run(*arguments)
        printed[name] = out + err
    assert "\x1b" not in printed[""]
    assert printed["NO_COLOR"] == printed[""]
    assert ESCAPE.search(printed["FORCE_COLOR"])
    assert ESCAPE.sub("", printed["FORCE_COLOR"]) == printed[""]


def test_json_has_no_colours(run, dataset, calibrated, monkeypatch):
    """Not even if they are demanded."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    code, out, _ = run("verify", calibrated, "--truth", dataset, "--json")
    assert code == 0
    assert "\x1b" not in out


def test_verdicts_and_findings_have_words_and_colours(monkeypatch, capsys):
    """The word of the verdict and the level of each finding stand there as words, each in the colour of its level."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    colours = set()
    for level in LEVELS:
        print_verdict(Verdict((Finding("code", level, 1.0, f"it is {level} for a reason", "Do something."),)))
        out = capsys.readouterr().out
        word = "good" if level == "note" else level
        assert f"verdict: {word}\n- {level}: it is {level} for a reason. Do something." in ESCAPE.sub("", out)
        marked = re.search(rf"- (\x1b\[\d+m\x1b\[1m){level}\x1b\[0m: ", out)
        assert marked, out
        colours.add((level, marked.group(1)))
        assert re.search(rf"\x1b\[\d+m\x1b\[1m{word}\x1b\[0m", out)
    assert {style.level(word) for word in WORDS} >= {style.level("good"), style.level("rejected")}
    shades = dict(colours)
    assert shades["usable"] != shades["rejected"] != shades["note"]


def test_colours_on_a_real_terminal(dataset, calibrated):
    """Headings are bold, a warning's word is yellow, and words are what a pipe has."""
    command = [sys.executable, "-m", "camcal", "verify", str(calibrated), "--truth", str(dataset), "--max-diff", "1e-9"]
    session = run_on_terminal(command)
    assert session.code == 5
    assert "\x1b[1mParameters" in session.raw
    assert "\x1b[31m\x1b[1mcamcal:\x1b[0m verify: --max-diff" in session.raw
    assert "\x1b" not in run_on_terminal(command, NO_COLOR="1").raw
    assert "\x1b" not in run_on_terminal(command, TERM="dumb").raw
