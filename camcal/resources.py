"""The configs and boards that camcal ships, found in the installed package as well as in the source tree."""

from __future__ import annotations

from pathlib import Path

from camcal.errors import InputError
from camcal.nearest import did_you_mean

_PACKAGE = Path(__file__).resolve().parent


def config_names() -> tuple[str, ...]:
    """Names of the shipped synth configs, sorted."""
    return _names("configs")


def config_path(name: str) -> Path:
    """Path of the YAML of a shipped synth config.

    Raises
    ------
    InputError
        If there is none of that name; says which there are.
    """
    return _path("configs", name, "config")


def sample_board_names() -> tuple[str, ...]:
    """Names of the ready-to-print boards, sorted."""
    return _names("sample_boards")


def sample_board_path(name: str) -> Path:
    """Path of the YAML of a ready-to-print board; its PDF stands beside it.

    Raises
    ------
    InputError
        If there is none of that name; says which there are.
    """
    return _path("sample_boards", name, "sample board")


def _folder(kind: str) -> Path:
    """Where a kind of data is: inside the package once installed, beside it in the source tree."""
    installed = _PACKAGE / "data" / kind
    return installed if installed.is_dir() else _PACKAGE.parent / kind


def _names(kind: str) -> tuple[str, ...]:
    """Names without suffix of the YAML files of a kind, sorted; none if the folder is not there."""
    return tuple(sorted(path.stem for path in _folder(kind).glob("*.yaml")))


def _path(kind: str, name: str, what: str) -> Path:
    """Path of one YAML file; only names that are listed lead anywhere."""
    known = _names(kind)
    if name not in known:
        raise InputError(
            f"{what} {name!r}: there is none of that name (got {name!r}, expected one of {', '.join(known)})."
            + did_you_mean(name, known)
        )
    return _folder(kind) / f"{name}.yaml"
