"""What a piece of Python loads."""

from __future__ import annotations

import subprocess
import sys


def loaded_by(code: str, *arguments: object) -> set[str]:
    """Names of all modules that are loaded once some code has run in a fresh interpreter, which says nothing on stderr."""
    command = [sys.executable, "-c", f"import sys\n{code}\nprint(*sys.modules)", *map(str, arguments)]
    finished = subprocess.run(command, capture_output=True, text=True, check=True)
    assert finished.stderr == ""
    return set(finished.stdout.splitlines()[-1].split())
