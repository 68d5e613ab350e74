"""Write a grid extended by the effects that a plant's loops have."""

from __future__ import annotations

import re
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.files import whole_file
from simbench.plant.study.result import Contribution, Study
from simbench.plant.study.strengths import FRICTION_EFFECT, scales
from simbench.scenarios.grid import grid_names, load_grid
from simbench.scenarios.spec import read_toml

_PLACES = 20  # entries of the list that a loop's effect is drawn from


class NoGrid(ParameterError):
    """The study has no effect that a grid can draw."""


def write_grid(study: Study, path: str | Path) -> list[str]:
    """Write the study's grid with its effects, in their shares and strengths."""
    base = (
        Path(str(files("simbench.scenarios") / "grids" / f"{study.grid}.toml"))
        if study.grid in grid_names()
        else Path(study.grid)
    )
    # a grid's valves have their friction from the grid
    usable = [
        e
        for e in study.effects
        if e.effect not in FRICTION_EFFECT and scales(e.effect, e.strengths[0]) is not None
    ]
    if not usable:
        raise NoGrid(f"no grid is written to {path}: the study has no effect that a grid can draw")
    text, present = (
        base.read_text(encoding="utf-8"),
        read_toml(base).get("draw", {}).get("effect", ["none"]),
    )
    line = f"effect = {_toml(_places(usable, present if isinstance(present, list) else [present]))}"
    kept = re.sub(r"(?m)^effect = \[[^\]]*\]$", "", text)
    kept = re.sub(r"(?m)^\[draw\]$", f"[draw]\n{line}", kept, count=1)
    if "[draw]" not in text:
        kept += f"\n[draw]\n{line}\n"
    blocks = "".join(_block(e) for e in usable)
    with whole_file(path) as f:
        f.write(
            f"# {base.stem}, with the effects found in {study.loops} loops of a"
            f" plant\n{kept.rstrip()}\n{blocks}"
        )
    load_grid(path)
    return [e.effect for e in study.effects if e not in usable]


def _places(effects: Sequence[Contribution], present: Sequence[str]) -> list[str]:
    """Return the list an effect is drawn from: each effect by its share, what the grid had for
    the rest.
    """
    share = sum(e.share for e in effects)
    fit = min(1.0, 1.0 / share)
    new = [
        f"found_{e.effect}" for e in effects for _ in range(max(round(_PLACES * fit * e.share), 1))
    ]
    rest = max(_PLACES - len(new), 0)
    return new + [present[i * len(present) // rest] for i in range(rest)]


def _block(e: Contribution) -> str:
    ranges: dict[str, Any] = {}
    for name in e.strengths[0]:
        values = [s[name] for s in e.strengths if name in s]
        if isinstance(values[0], str):
            ranges[name] = list(dict.fromkeys(values))
        else:
            lo, hi = np.quantile(values, [0.1, 0.9])
            ranges[name] = (
                [float(f"{lo:.3g}"), float(f"{hi:.3g}")] if hi > lo else float(f"{lo:.3g}")
            )
    lines = [f"\n[effects.found_{e.effect}]", f'name = "{e.effect}"']
    lines.append(
        "parameters = { " + ", ".join(f"{k} = {_toml(v)}" for k, v in ranges.items()) + " }"
    )
    by = scales(e.effect, e.strengths[0]) or {}
    if by:
        lines.append("scale = { " + ", ".join(f'{k} = "{v}"' for k, v in by.items()) + " }")
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return f'"{value}"' if isinstance(value, str) else repr(value)
