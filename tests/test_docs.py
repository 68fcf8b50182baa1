"""The documentation: the README's commands run and print what it shows, and docstring examples hold."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
import re
import shlex
from pathlib import Path

import pytest
from every_command import COMMANDS

import camcal
from camcal.cli import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def console_blocks() -> list[tuple[str, str]]:
    """Commands of the README's console blocks and the output shown under each."""
    blocks = re.findall(r"^ *```console\n(.*?)^ *```", README, flags=re.MULTILINE | re.DOTALL)
    pairs = []
    for block in blocks:
        command, _, output = block.partition("\n")
        pairs.append((command.strip().removeprefix("$ "), output))
    return pairs


def agree(shown: str, printed: str) -> bool:
    """Whether two texts have the same words, and numbers that agree within 1 % or one in the last digit shown."""
    words = [NUMBER.sub("#", text).split() for text in (shown, printed)]
    if words[0] != words[1]:
        return False
    for a, b in zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True):
        digits = len(a.partition(".")[2])
        if abs(float(a) - float(b)) > max(0.01 * abs(float(a)), 10.0**-digits):
            return False
    return True


def test_readme_commands_print_what_it_shows(tmp_path, monkeypatch, capsys):
    """Each console block, in order, in one folder: exit code 0 and the output shown."""
    monkeypatch.chdir(tmp_path)
    blocks = console_blocks()
    assert len(blocks) >= 5
    for command, shown in blocks:
        program, *arguments = shlex.split(command)
        assert program == "camcal"
        assert main(arguments) == 0, command
        printed = capsys.readouterr().out
        assert agree(shown, printed), f"{command}\n--- shown\n{shown}\n--- printed\n{printed}"


def test_readme_names_every_command_and_option_value():
    """The command table lists each command; the exit codes listed are those of the error classes."""
    for name in COMMANDS:
        assert f"camcal {name}" in README
    for error in (camcal.InputError, camcal.DetectionError, camcal.SolveError, camcal.QualityError):
        assert re.search(rf"^\| {error.exit_code} \|", README, flags=re.MULTILINE)


def test_readme_links_lead_somewhere():
    """Every relative link of the README is a file."""
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


def modules() -> list[str]:
    """Names of all modules of the package."""
    found = pkgutil.walk_packages(camcal.__path__, "camcal.")
    return [module.name for module in found if module.name != "camcal.__main__"]


@pytest.mark.parametrize("name", modules())
def test_docstring_examples(name):
    """Every example in a docstring prints what it shows; every module says what it is for."""
    module = importlib.import_module(name)
    assert (module.__doc__ or "").strip()
    assert doctest.testmod(module).failed == 0


def test_public_names_are_there():
    """Everything that the package lists can be imported from it, lazily or not; nothing else pretends to be there."""
    for name in camcal.__all__:
        assert getattr(camcal, name) is not None
    assert set(camcal.__all__) <= set(dir(camcal))
    with pytest.raises(AttributeError, match="nonsense"):
        _ = camcal.nonsense
