"""Shell completion: the script for each shell, what it is answered, and a real shell where there is one."""

from __future__ import annotations

import shutil
import subprocess
import sys

import pytest
from every_command import COMMANDS

from camcal.resources import config_names, sample_board_names

SHELLS = ("bash", "zsh", "fish")


def complete(shell: str, line: str) -> list[tuple[str, str]]:
    """Answer as that shell would be answered for a line whose last word is incomplete: kinds and values."""
    *before, incomplete = line.split(" ")
    words = {"bash": (line, str(len(before))), "zsh": (line, str(len(before))), "fish": (line, incomplete)}[shell]
    variables = {"_CAMCAL_COMPLETE": f"{shell}_complete", "COMP_WORDS": words[0], "COMP_CWORD": words[1]}
    script = f"import os, sys; os.environ.update({variables!r}); from camcal.cli import main; sys.exit(main([]))"
    finished = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert finished.stderr == ""
    lines = finished.stdout.splitlines()
    if shell == "zsh":  # kind, value and help, a line each
        return list(zip(lines[::3], lines[1::3], strict=True))
    return [tuple(answer.split("\t")[0].split(",", 1)) for answer in lines if answer]


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("camcal cal", [("plain", "calibrate")]),
        ("camcal calibrate --bo", [("plain", "--board")]),
        ("camcal calibrate ph", [("file", "ph")]),
        ("camcal calibrate photos --board ", [("plain", name) for name in sample_board_names()]),
        ("camcal calibrate photos --board aprilgrid_6x6_2", [("plain", "aprilgrid_6x6_24mm_a4")]),
        ("camcal calibrate photos --board my_bo", [("file", "my_bo")]),
        ("camcal calibrate photos --refine s", [("plain", "saddle")]),
        ("camcal calibrate photos -o cal", [("dir", "cal")]),
        ("camcal board check", [("plain", name) for name in sample_board_names() if name.startswith("check")]),
        ("camcal synth ", [("plain", name) for name in config_names()]),
        ("camcal regress webcam_720p w", [("plain", "webcam_720p"), ("plain", "wide_action")]),
        ("camcal undistort photos --interpolation c", [("plain", "cubic")]),
        ("camcal undistort photos --camera c", [("file", "c")]),
        ("camcal verify calib --truth d", [("file", "d")]),
        ("camcal -q completion ", [("plain", shell) for shell in SHELLS]),
    ],
)
def test_answers(shell, line, expected):
    """Commands, options, choices, shipped names, files and folders, asked for as each shell's script does."""
    assert complete(shell, line) == expected


@pytest.mark.parametrize("shell", SHELLS)
def test_script(run, shell):
    """It asks camcal with the variable that camcal looks for, and the help says how to install it."""
    code, script, _ = run("completion", shell)
    assert code == 0
    assert f"_CAMCAL_COMPLETE={shell}_complete" in script
    code, out, _ = run("completion", "--help")
    assert code == 0
    assert f"camcal completion {shell}" in out


def test_every_argument_that_is_text_can_be_completed():
    """An argument, and an option that takes a file or a folder, has a type that completes something, whoever wrote it."""
    for name, command in COMMANDS.items():
        for parameter in command.params:
            shown = parameter.metavar or ""
            if parameter.param_type_name == "argument" or "FILE" in shown or "DIR" in shown:
                with command.make_context(name, [], resilient_parsing=True) as context:
                    assert parameter.shell_complete(context, ""), (name, parameter.name)


def in_shell(shell: str, arguments: list[str], script: str, tmp_path) -> str:
    """Run a script in a real shell whose PATH has camcal, with its completion loaded."""
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    program = tmp_path / "bin/camcal"
    program.parent.mkdir()
    program.write_text(f"#!{sys.executable}\nimport sys\nfrom camcal.cli import main\nsys.exit(main())\n")
    program.chmod(0o755)
    environment = {"PATH": f"{program.parent}:/usr/local/bin:/usr/bin:/bin", "HOME": str(tmp_path)}
    finished = subprocess.run(
        [shell, *arguments, "-c", script], capture_output=True, text=True, check=True, env=environment, cwd=tmp_path
    )
    assert finished.stderr == ""
    return finished.stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["camcal", "und"], ["undistort"]),
        (["camcal", "calibrate", "--ana"], ["--anamorphic"]),
        (["camcal", "synth", "wi"], ["wide_action"]),
        (["camcal", "synth", "nowhere"], ["default"]),
        (["camcal", "demo", "-o", "x"], ["dirnames"]),
    ],
)
def test_bash(words, expected, tmp_path):
    """Bash itself: names it puts in by itself, files and folders are left to its own completion."""
    script = f"""
compopt() {{ echo "$2"; }}
eval "$(camcal completion bash)"
complete -p camcal >/dev/null
COMP_WORDS=({" ".join(words)}); COMP_CWORD={len(words) - 1}
_camcal_completion camcal
printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    assert in_shell("bash", ["--norc"], script, tmp_path).split() == expected


def test_zsh(tmp_path):
    """Zsh takes the script."""
    script = 'autoload -Uz compinit; compinit -u -d "$HOME/dump"; eval "$(camcal completion zsh)"; echo $_comps[camcal]'
    assert in_shell("zsh", ["-f"], script, tmp_path).strip() == "_camcal_completion"


def test_fish(tmp_path):
    """Fish itself."""
    script = "camcal completion fish | source; complete --do-complete 'camcal und'"
    assert in_shell("fish", ["--no-config"], script, tmp_path).split()[0] == "undistort"
