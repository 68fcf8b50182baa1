"""YAML documents checked against pydantic models; the first fault is told with its line, its key and what was expected."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar, get_args

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, ErrorDetails
from pydantic_core.core_schema import no_info_before_validator_function

from camcal.formats.yaml_io import Document, KeyPath, describe
from camcal.nearest import did_you_mean


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


@dataclass(frozen=True, slots=True)
class ListOf:
    """Demand a list of a fixed length, before its items are judged."""

    count: int

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Check before what the type itself demands."""
        return no_info_before_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Say so in the JSON Schema."""
        return handler(schema) | {"minItems": self.count, "maxItems": self.count}

    def _checked(self, value: Any) -> Any:
        if isinstance(value, list) and len(value) != self.count:
            raise ValueError(f"wrong length (got {describe(value)}, expected {self.count} values)")
        return value


def list_of(count: int) -> ListOf:
    """Demand a list of a fixed length, before its items are judged."""
    return ListOf(count)


def schema_only(**constraints: Any) -> Any:
    """Add to the JSON Schema of a value what camcal checks elsewhere, with words of its own."""
    return Field(json_schema_extra=constraints)


# The last of the annotations is the first to judge; limits come before it, so that they stand in the JSON Schema too.
NO_BOOL = BeforeValidator(_refuse_bool)
Number = Annotated[float, NO_BOOL]
"""A finite number."""
Positive = Annotated[float, Field(gt=0), NO_BOOL]
AnyNumber = Annotated[float, Field(allow_inf_nan=True), NO_BOOL]
"""A number, NaN or an infinity."""
Whole = Annotated[int, NO_BOOL]
Count = Annotated[int, Field(ge=0, le=10**9), NO_BOOL]
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
        limit = fault["ctx"][name]
        return f"out of range (got {got}, expected {words} {f'{limit:g}' if isinstance(limit, float) else limit})"
    expected = _EXPECTED.get(kind) or fault["msg"].removeprefix("Input should be ").removeprefix("a finite number ")
    problem = f"{_FAULTS.get(kind, 'wrong type')} (got {got}, expected {expected[:1].lower() + expected[1:]})"
    if kind != "literal_error":
        return problem
    advice = did_you_mean(str(fault["input"]), re.findall(r"'([^']*)'", fault["ctx"]["expected"]))
    return f"{problem}.{advice}" if advice else problem


def _unknown_key(fault: ErrorDetails, model: type[BaseModel]) -> str:
    """Name the known keys, and the nearest to the one that is not."""
    known = tuple(_schema_at(model, fault["loc"][:-1]).model_fields)
    return f"unknown key (expected one of {', '.join(known)}).{did_you_mean(str(fault['loc'][-1]), known)}"


def _schema_at(model: type[BaseModel], path: KeyPath) -> type[BaseModel]:
    """The model at a key path below another one."""
    for step in path:
        field = model.model_fields.get(str(step))
        if field is not None:
            model = next(models_within(field.annotation), model)
    return model


def models_within(annotation: Any) -> Any:
    """Every model within an annotation such as `list[Model] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from models_within(argument)
