"""The Python API: every public name is typed and documented."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import re
from pathlib import Path

import pytest
from every_command import COMMANDS

import camcal

ALWAYS_ANSWER = {"dense_map", "distort_points", "projection_sigma", "undistort_points", "valid_mask"}
"""Functions that fail on no input of the right shape: what has no answer is NaN, or marked."""

SHOWN_IN_THE_README = {"demo", "regress"}
"""Whole chains, which take seconds: the README shows them, and its test runs them."""

FUNCTIONS = sorted(name for name in camcal.__all__ if inspect.isfunction(getattr(camcal, name)))
CLASSES = sorted(name for name in camcal.__all__ if inspect.isclass(getattr(camcal, name)))


def sections(docstring: str) -> dict[str, str]:
    """Text of each underlined section of a numpydoc docstring, by its title."""
    parts = re.split(r"^([A-Z][a-z]+)\n-{3,}\n", inspect.cleandoc(docstring), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def named_in(section: str) -> set[str]:
    """Names that a section describes: those at the margin before a colon, separated by commas, or alone."""
    lines = [line.partition(" : ")[0] for line in section.splitlines() if line and not line[0].isspace()]
    return {name.strip() for line in lines for name in line.split(",")}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_typed_and_documented(name):
    """Every parameter has a type and a description, every result too; what is raised is told."""
    function = getattr(camcal, name)
    signature = inspect.signature(function)
    assert all(p.annotation is not p.empty for p in signature.parameters.values())
    assert signature.return_annotation is not signature.empty
    found = sections(function.__doc__)
    if signature.parameters:
        assert named_in(found["Parameters"]) == set(signature.parameters)
    assert ("Returns" in found) == (signature.return_annotation != "None")
    assert ("Raises" in found) != (name in ALWAYS_ANSWER)


@pytest.mark.parametrize("name", CLASSES)
def test_classes_are_documented(name):
    """Every class says what it is; its fields, or attributes, are described and so is each of its methods and properties."""
    kind = getattr(camcal, name)
    found = sections(kind.__doc__)
    if dataclasses.is_dataclass(kind):
        assert named_in(found["Attributes"]) == {field.name for field in dataclasses.fields(kind)}
    for member, value in vars(kind).items():
        if not member.startswith("_") and (inspect.isfunction(value) or isinstance(value, property)):
            assert inspect.getdoc(value), member


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name not in SHOWN_IN_THE_README])
def test_functions_have_an_example(name):
    """Every function shows how it is called, those that save where the same is loaded; `test_docstring_examples` runs it."""
    found = sections(getattr(camcal, name.replace("save_", "load_")).__doc__)
    assert f"{name}(" in found.get("Examples", ""), name


def test_type_checkers_see_what_python_sees():
    """The imports for type checkers, the lazy table and the list of public names say the same."""
    tree = ast.parse(Path(camcal.__file__).read_text(encoding="utf-8"))
    guarded = next(node for node in tree.body if isinstance(node, ast.If))
    homes = {alias.asname or alias.name: node.module for node in guarded.body for alias in node.names}
    assert homes == camcal._HOMES
    assert set(camcal.__all__) == {*homes, "__version__"}


def test_every_command_is_a_function():
    """What the command line does can be done from Python, under the same name unless Python has it already."""
    other = {"export": "export_camera", "import": "import_camera", "report": "make_report"}
    of_the_shell = {"completion"}
    for name in set(COMMANDS) - of_the_shell:
        assert other.get(name, name) in FUNCTIONS, name


def test_no_function_has_the_name_of_a_part_of_the_package():
    """Importing a submodule sets an attribute on the package, which would replace a function of that name."""
    parts = {path.stem for path in Path(camcal.__file__).parent.iterdir()}
    assert not parts & set(camcal.__all__)
