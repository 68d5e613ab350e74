"""A table of a file as a frozen object, and one sentence for all that is wrong with it."""

from __future__ import annotations

from datetime import date, time
from typing import Annotated, Any, Self, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from simbench.scenarios.errors import SpecError, suggestion

_MOST_CLAUSES = 12  # complaints in one sentence
LARGEST_NUMBER = 1e60  # beyond it a record's statistics leave the range of double numbers
M = TypeVar("M", bound=BaseModel)


def _check_number(value: Any) -> Any:
    if isinstance(value, (bool, str)):  # which would be read as 1.0, or as the number it spells
        raise ValueError("a number is needed")
    return value


Real = Annotated[float, BeforeValidator(_check_number)]
Whole = Annotated[int, BeforeValidator(_check_number)]
Finite = Annotated[Real, Field(ge=-LARGEST_NUMBER, le=LARGEST_NUMBER, allow_inf_nan=False)]
Positive = Annotated[Real, Field(gt=0, le=LARGEST_NUMBER, allow_inf_nan=False)]
Flag = Annotated[Whole, Field(ge=0, le=1)]
NonNegative = Annotated[Real, Field(ge=0, le=LARGEST_NUMBER, allow_inf_nan=False)]


class TomlTable(BaseModel):
    """A table of a loop or grid file, of which every number is checked when it is read."""

    model_config = ConfigDict(extra="forbid", frozen=True, ser_json_inf_nan="constants")

    def replace(self, **changes: Any) -> Self:
        """Return the table with some of its fields changed; every rule of it is checked again.

        Parameters
        ----------
        **changes
            New values by field, as a loop file has them or as the objects that they become.

        Returns
        -------
        table of the same class
            A new one; this one stays as it is.

        Raises
        ------
        SpecError
            As `Loop.from_table`.
        """
        return checked(
            type(self), {**self._stated_fields(), **changes}, type(self).__name__.lower()
        )

    def _stated_fields(self) -> dict[str, Any]:
        """Return the fields that are set, without what follows from others."""
        return self.model_dump(exclude_none=True)


# The key that names the plug-in in each table of a loop file.
NAME_KEY = {"valve": "model", "disturbance": "type", "effect": "name"}


def checked(model: type[M], table: dict[str, Any], where: str) -> M:
    """Validate a table against a model; all complaints become one sentence."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        raise SpecError(f"{where}: {_yield_sentences(model, error.errors(), table)}") from None
    except RecursionError:
        raise SpecError(
            f"{where}: its values are nested too deeply; some ten levels are allowed"
        ) from None


def _yield_sentences(model: type[BaseModel], errors: list[Any], table: Any) -> str:
    """One clause per key; where several forms are allowed, each complains of the same key."""
    # Errors by the key at which they stand
    by_key: dict[tuple, list[Any]] = {}
    for error in errors:
        by_key.setdefault(
            _key_of_place(error["loc"], table, error["type"] == "missing"), []
        ).append(error)

    # One error has its own sentence; several are of a value that fits no form
    clauses = []
    for key, found in by_key.items():
        if len(found) == 1:
            clauses.append(_sentence_of(model, found[0]))
        else:
            value = table
            for step in key:
                value = value[step]
            clauses.append(
                f"{'.'.join(map(str, key))} = {shorten(value)}; a number, [lo, hi] or names are"
                " needed"
            )

    # Few clauses fit on a screen
    return "; ".join(clauses[:_MOST_CLAUSES]) + (
        "; and more" if len(clauses) > _MOST_CLAUSES else ""
    )


def _key_of_place(loc: tuple, table: Any, missing: bool) -> tuple:
    """The part of an error's place that stands in the table; what follows names the form that did
    not fit.
    """
    key = []
    for step in loc:
        try:
            table = table[step]
        except (KeyError, IndexError, TypeError):
            # a key that is missing is a place of its own
            if missing and isinstance(table, dict):
                return (*key, step)
            return tuple(key)
        key.append(step)
    return tuple(key)


def _sentence_of(model: type[BaseModel], error: Any) -> str:
    # The place as a file writes it
    path = []
    for p in error["loc"]:
        if isinstance(p, (str, int)):
            path.append(p)
    if path[1:] and path[-1] == "name":  # the file's own word for it
        path[-1] = NAME_KEY.get(str(path[0]), "name")
    place = ".".join(str(p) for p in path)

    # A key too many, or missing
    kind = error["type"]
    value = error.get("input")
    if kind == "extra_forbidden":
        return f"unknown key {place!r}: {suggestion(str(path[-1]), _field_names(model, path[:-1]))}"
    if kind == "missing":
        return f"{'key' if len(path) > 1 else 'section'} {place!r} is missing, which is needed"

    # The message of the model, where it has one
    message = str(error["msg"]).removeprefix("Value error, ")
    if kind == "value_error" and message == "a number is needed":
        return f"{place} = {shorten(value)}; {message}"
    if kind == "value_error":
        if place:
            return f"[{place}] {message}"
        return message
    if kind == "literal_error":
        allowed = []
        for w in str(error["ctx"]["expected"]).replace(" or ", ",").split(","):
            allowed.append(w.strip(" '"))
        return f"{place} = {shorten(value)} is unknown; {suggestion(str(value), allowed)}"
    return f"{place} = {shorten(value)}; {message[0].lower()}{message[1:]}"


def shorten(value: Any) -> str:
    """Return a value as a sentence quotes it, at most 60 characters."""
    try:
        if isinstance(value, (date, time)):
            text = value.isoformat()
        else:
            text = repr(value)
    except (ValueError, RecursionError):  # more digits than Python writes, tables within tables
        return "a value too long to show"
    if len(text) <= 60:
        return text
    return f"{text[:57]}..."


def _field_names(model: type[BaseModel], path: list[Any]) -> list[str]:
    for step in path:
        field = model.model_fields.get(str(step))
        if (
            field is not None
            and isinstance(field.annotation, type)
            and issubclass(field.annotation, BaseModel)
        ):
            model = field.annotation
    return list(model.model_fields)
