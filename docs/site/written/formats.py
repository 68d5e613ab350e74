"""Loop file and grid file: every key with what is allowed, from the schemas that check them."""

from __future__ import annotations

import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel
from pydantic_core import PydanticUndefined
from text import heading, plain, table

from simbench.loop import echo, resampled
from simbench.loop.disturbance import PARAMETERS as LOADS
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS, VALVES, Choice, Number
from simbench.scenarios import cell, grid_check, grid_file, spec, toml_table
from simbench.scenarios.parts import Part

GRIDS = Path(grid_file.__file__).parent / "grids"
WORD = {float: "number", int: "whole number", str: "text", bool: "true or false", dict: "table"}
SIGN = {Ge: ">=", Gt: ">", Le: "<=", Lt: "<"}
EXAMPLE = Path(__file__).parents[2] / "example" / "loop.toml"


def loop_page() -> str:
    """Return the page on loop files: sections, then the parameters of each valve, load and
    effect.
    """
    introduction = (
        "TOML; unknown keys are refused with the nearest known one. Times are in s, OP and MV in %."
    )
    lines = [*heading("Loop file"), introduction, ""]
    lines += [
        ".. code-block:: toml",
        "",
        *(f"   {line}" for line in EXAMPLE.read_text(encoding="utf-8").splitlines()),
        "",
    ]
    for name, field in spec.Loop.model_fields.items():
        for model in (field.annotation, *typing.get_args(field.annotation)):
            if isinstance(model, type) and issubclass(model, BaseModel) and model is not Part:
                lines += _section(f"[{name}]", model)
    for title, key, parts in (
        ("Further plants", "type", {n: PLANT_PLUGINS.load(n) for n in PLANT_PLUGINS.names()}),
        (
            "Further controllers",
            "type",
            {n: CONTROLLER_PLUGINS.load(n) for n in CONTROLLER_PLUGINS.names()},
        ),
        ("[valve]", "model", {n: VALVES.load(n) for n in VALVES.names()}),
        (
            "[[disturbance]]",
            "type",
            {**dict.fromkeys(LOADS), echo.NAME: echo, resampled.RESAMPLED: resampled},
        ),
        ("[[effect]]", "name", {n: EFFECTS.load(n) for n in EFFECTS.names()}),
    ):
        lines += [
            *heading(title, "-"),
            f"``{key}`` is its name; the other keys are its parameters.",
            "",
        ]
        for part, module in parts.items():
            lines += [
                *heading(part, "~"),
                plain((module.__doc__ or "").strip().split("\n\n")[0]) if module else "",
                "",
            ]
            own = module in (None, echo, resampled)
            lines += _parameters(LOADS[part] if own else module.PARAMETERS)
    return "\n".join(lines)


def grid_page() -> str:
    """Return the page on grid files."""
    lines = [
        *heading("Grid file"),
        plain(grid_file.GridFile.__doc__),
        "",
        *_fields(grid_file.GridFile),
    ]
    for title, model in (
        ("[disturbances.NAME]", grid_file.Disturbance),
        ("[valves.NAME] and [effects.NAME]", grid_file.More),
        ("[[block]]", grid_file.Block), ("[[block.member]]", grid_file.Member),
    ):  # fmt: skip
        lines += _section(title, model)
    lines += [
        *heading("Axes and drawn values", "-"),
        "Keys of ``[block.axes]``, ``[draw]`` and ``[block.draw]``:",
        "",
    ]
    limits = {
        key: "{:g} to {:g}".format(*grid_check.SETTING_LIMITS[key])
        if key in grid_check.SETTING_LIMITS
        else ""
        for key in cell.SETTINGS
    }
    lines += table(
        ("key", "what it is", "limits"),
        [(f"``{k}``", plain(meaning), limits[k]) for k, meaning in cell.SETTINGS.items()],
    )
    lines += [
        *heading("The smallest grid that comes with the package", "-"),
        ".. code-block:: toml",
        "",
    ]
    lines += [
        f"   {line}".rstrip()
        for line in (GRIDS / "smoke.toml").read_text(encoding="utf-8").splitlines()
    ]
    return "\n".join([*lines, ""])


def _section(title: str, model: type[BaseModel]) -> list[str]:
    return [*heading(title, "-"), plain(model.__doc__), "", *_fields(model)]


def _fields(model: type[BaseModel]) -> list[str]:
    rows = []
    for name, field in model.model_fields.items():
        default = field.get_default(call_default_factory=True)
        shown = (
            "needed"
            if default is PydanticUndefined
            else ""
            if default in (None, (), {}, "")
            else f"``{default}``"
        )
        rows.append((f"``{name}``", plain(allowed(field.annotation, tuple(field.metadata))), shown))
    return table(("key", "what is allowed", "default"), rows)


def allowed(kind: Any, limits: tuple = ()) -> str:
    """Return in words what a key's type and limits allow."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        return allowed(parts[0], (*parts[1:], *limits))
    if origin is typing.Literal:
        return " or ".join(f'"{word}"' for word in parts)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(
            dict.fromkeys(allowed(part, limits) for part in parts if part is not type(None))
        )
    if origin is tuple:
        return (
            f"list of {allowed(parts[0])}"
            if parts[-1] is Ellipsis
            else f"[{', '.join(allowed(p) for p in parts)}]"
        )
    if origin is dict:
        return f"table of {allowed(parts[1])}"
    if kind is Any:
        return "any value"
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return f"table as below ({kind.__name__})"
    bounds = [_bound(limit) for limit in _flat(limits)]
    return " ".join(
        [WORD.get(kind, getattr(kind, "__name__", str(kind))), ", ".join(b for b in bounds if b)]
    ).strip()


def _flat(limits: tuple) -> list[Any]:
    return [x for limit in limits for x in (getattr(limit, "metadata", None) or [limit])]


def _bound(limit: Any) -> str:
    for kind, sign in SIGN.items():
        if isinstance(limit, kind):
            value = float(getattr(limit, kind.__name__.lower()))
            return "" if abs(value) >= toml_table.LARGEST_NUMBER else f"{sign} {value:g}"
    return ""


def _parameters(rules: Mapping[str, Number | Choice]) -> list[str]:
    if not rules:
        return ["No parameters.", ""]
    rows = []
    for name, rule in rules.items():
        if isinstance(rule, Choice):
            rows.append(
                (
                    f"``{name}``",
                    "",
                    plain(" or ".join(rule.names)),
                    rule.default or "needed",
                    plain(rule.says),
                )
            )
            continue
        least, most = (abs(x) < toml_table.LARGEST_NUMBER for x in (rule.low, rule.high))
        low = f"{'>' if rule.positive else '>='} {rule.low:g}" if least else ""
        limits = ", ".join(x for x in (low, f"<= {rule.high:g}" if most else "") if x)
        default = (
            "needed"
            if rule.default is None
            else "follows"
            if rule.default != rule.default
            else f"{rule.default:g}"
        )
        rows.append((f"``{name}``", plain(rule.unit), limits, default, plain(rule.says)))
    return table(("key", "unit", "limits", "default", "what it is"), rows)
