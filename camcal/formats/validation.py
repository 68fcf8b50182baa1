"""YAML documents checked against pydantic models; the first fault is told with its line, its key and what was expected."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails

from camcal.formats.yaml_io import Document, KeyPath, describe


class Schema(BaseModel):
    """Base of every file's model: unknown keys and numbers that are not finite are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)


SchemaType = TypeVar("SchemaType", bound=Schema)


def _refuse_bool(value: Any) -> Any:
    """Keep `true` from being read as 1."""
    if isinstance(value, bool):
        # pydantic reports a ValueError only.
        raise ValueError(  # noqa: TRY004
            f"wrong type (got {str(value).lower()}, expected a number)"
        )
    return value


def list_of(count: int) -> BeforeValidator:
    """Demand a list of a fixed length, before its items are judged."""

    def check(value: Any) -> Any:
        if isinstance(value, list) and len(value) != count:
            raise ValueError(f"wrong length (got {describe(value)}, expected {count} values)")
        return value

    return BeforeValidator(check)


Number = Annotated[float, BeforeValidator(_refuse_bool)]
"""A finite number."""
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
AnyNumber = Annotated[float, Field(allow_inf_nan=True), BeforeValidator(_refuse_bool)]
"""A number, NaN or an infinity."""
Whole = Annotated[int, BeforeValidator(_refuse_bool)]
Count = Annotated[Whole, Field(ge=0, le=10**9)]
Text = Annotated[str, Field(max_length=2000)]
Name = Annotated[str, Field(min_length=1, max_length=1000)]

_FAULTS = {
    "missing": "missing",
    "literal_error": "unknown",
    "finite_number": "not finite",
    "string_too_short": "too short",
    "string_too_long": "too long",
}
# The name of the limit in pydantic's context, and how to say it.
_LIMITS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_EXPECTED = {
    "float_type": "a number",
    "float_parsing": "a number",
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a smaller whole number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "text (in quotes if it looks like a number)",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
}


def validate(document: Document, model: type[SchemaType], path: KeyPath = ()) -> SchemaType:
    """Check a document, or the part of it at a key path, against a model.

    Parameters
    ----------
    document : Document
    model : type of Schema
    path : tuple
        Key path of the part; it must be there.

    Returns
    -------
    Schema
        The model's instance.

    Raises
    ------
    InputError
        For the fault that comes first in the file: `file:line: key: problem (and N more)`.
    """
    part: Any = document.data
    for step in path:
        part = part[step]
    try:
        return model.model_validate(part)
    except ValidationError as error:
        faults = [(document.line((*path, *fault["loc"])), fault) for fault in error.errors(include_url=False)]
    # A key that is missing often stands there misspelt: that is the fault to tell.
    _, first = min(faults, key=lambda pair: (pair[1]["type"] == "missing", pair[0]))
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    raise document.error((*path, *first["loc"]), _problem(first, model) + more)


def _problem(fault: ErrorDetails, model: type[BaseModel]) -> str:
    """Put pydantic's fault in camcal's words."""
    kind, got = fault["type"], describe(fault["input"])
    if kind == "missing":
        return "missing (expected this key). Add it."
    if kind == "extra_forbidden":
        return _unknown_key(fault, model)
    if kind == "value_error":
        return fault["msg"].removeprefix("Value error, ")
    if kind in _LIMITS:
        name, words = _LIMITS[kind]
        return f"out of range (got {got}, expected {words} {fault['ctx'][name]})"
    expected = _EXPECTED.get(kind) or fault["msg"].removeprefix("Input should be ").removeprefix("a finite number ")
    return f"{_FAULTS.get(kind, 'wrong type')} (got {got}, expected {expected[:1].lower() + expected[1:]})"


def _unknown_key(fault: ErrorDetails, model: type[BaseModel]) -> str:
    """Name the known keys, and the nearest to the one that is not."""
    known = tuple(_schema_at(model, fault["loc"][:-1]).model_fields)
    near = difflib.get_close_matches(str(fault["loc"][-1]), known, n=1)
    advice = f" Did you mean '{near[0]}'?" if near else ""
    return f"unknown key (expected one of {', '.join(known)}).{advice}"


def _schema_at(model: type[BaseModel], path: KeyPath) -> type[BaseModel]:
    """The model at a key path below another one."""
    for step in path:
        field = model.model_fields.get(str(step))
        if field is not None:
            model = next(_schemas(field.annotation), model)
    return model


def _schemas(annotation: Any) -> Any:
    """Every model within an annotation such as `list[Model] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _schemas(argument)
