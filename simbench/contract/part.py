"""Test a part of a loop (valve, effect, plant, controller): it loads and says what it is, gives the
same finite signals twice, and refuses parameters outside the ranges that it states.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from itertools import product
from types import ModuleType
from typing import Any

import numpy as np

from simbench.detectors.contract.engine import ContractRules
from simbench.detectors.contract.watch import call_guarded
from simbench.detectors.errors import UserError
from simbench.detectors.plugins.registry import PluginFolder
from simbench.gap.effects import PLUGINS as RECOGNISERS
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import (
    CONTROLLER_PLUGINS,
    PLANT_PLUGINS,
    VALVES,
    Choice,
    Number,
    valve_parameters,
)
from simbench.loop.resolve import resolve_loop
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_LOOP: dict[str, Any] = {
    "plant": {"type": "foptd", "K": 1.5, "T": 20.0, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 18.0},
    "sampling": {"Ts": 1.0, "n": 400},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[60, 53], [200, 48]]},
}
# how far into the ranges of the first and of the last parameter, those between in even steps: the
# first that the part takes
_SHARES = (0.08, 0.04, 0.3, 0.6)
_OPEN_END = 250.0  # what stands for the width of a range without an end


def _description(name: str, module: ModuleType) -> Iterator[str]:
    if not (module.__doc__ or "").strip():
        yield "the file does not begin with a sentence on what the part does"
    if not str(module.SOURCE).strip():
        yield "SOURCE is empty"
    for key, rule in module.PARAMETERS.items():
        if not rule.says:
            yield f"parameter {key} does not say what it is"
        if isinstance(rule, Number) and not rule.low < rule.high:
            yield f"parameter {key} has no range: {rule.low:g} to {rule.high:g}"


def _value_inside(rule: Number | Choice, share: float) -> float | str:
    """Return a value of a parameter, so far into its range."""
    if isinstance(rule, Choice):
        return rule.names[-1]
    low = rule.low if math.isfinite(rule.low) else 0.0
    width = rule.high - low if math.isfinite(rule.high) else _OPEN_END
    return low + share * width


def _loop(kind: str, name: str, parameters: dict[str, Any]) -> Loop:
    """Return a loop of which the part is one."""
    if kind == "effect":
        return Loop.from_table({**_LOOP, "effect": [{"name": name, **parameters}]})
    key = "model" if kind == "valve" else "type"
    delay = {"Td": 2.3} if kind == "plant" else {}
    return Loop.from_table({**_LOOP, kind: {key: name, **parameters, **delay}})


def _accepted_parameters(kind: str, name: str, module: ModuleType) -> tuple[dict[str, Any], str]:
    """Return parameters that the part takes (of an effect all, of others those without a default,
    and S and J), and why it refused the last ones where it takes none.
    """
    wanted = {
        key: rule
        for key, rule in module.PARAMETERS.items()
        if kind == "effect" or rule.default is None or key in ("S", "J")
    }
    refused = ""
    # one parameter may have to be below the next, or above it
    for first, last in product(_SHARES, repeat=2):
        shares = np.linspace(first, last, len(wanted)).tolist()
        table = {key: _value_inside(wanted[key], s) for key, s in zip(wanted, shares, strict=True)}
        try:
            resolve_loop(_loop(kind, name, table), 1)
            return table, ""
        except (UserError, ValueError) as error:
            refused = str(error)
    return {}, refused


def _takes_its_ranges(kind: str, name: str, module: ModuleType) -> Iterator[str]:
    answer = call_guarded(partial(_accepted_parameters, kind, name, module))
    if faults := answer.unanswered():
        yield from faults
    elif answer.value[1]:
        yield f"refuses the parameters of its own ranges: {answer.value[1]}"


def _runs(kind: str, name: str, module: ModuleType, case: object) -> Iterator[str]:
    """Simulate the same loop twice: the signals are finite and have the same bits."""
    loop = _loop(kind, name, _accepted_parameters(kind, name, module)[0])
    records = []
    for _ in range(2):
        answer = call_guarded(lambda: simulate(loop, seed=3).record)
        if faults := answer.unanswered():
            yield from faults
            return
        records.append(answer.value)
    one, other = records
    if not all(np.array_equal(getattr(one, s), getattr(other, s)) for s in ("op", "pv", "mv")):
        yield "is not deterministic: the same loop and seed give another record the second time"


def _refuses(kind: str, name: str, module: ModuleType, case: object) -> Iterator[str]:
    """Ask for values beyond each range, and for a parameter that there is not."""
    table = _accepted_parameters(kind, name, module)[0]
    wrong: dict[str, Any] = {"no_such_parameter": 1.0}
    for key, rule in module.PARAMETERS.items():
        if isinstance(rule, Choice):
            wrong[key] = "no such word"
        elif math.isfinite(rule.high):
            wrong[key] = rule.high + abs(rule.high) + 1.0
        elif math.isfinite(rule.low):
            wrong[key] = rule.low - abs(rule.low) - 1.0
    for key, value in wrong.items():
        try:
            resolve_loop(_loop(kind, name, {**table, key: value}), 1)
        except (UserError, ValueError):
            continue
        yield f"takes {key} = {value!r}, which it does not state"


def _states_its_band(name: str, module: ModuleType, case: object) -> Iterator[str]:
    """Hold what a valve maps on, which is the label of a loop, against its FRICTION."""
    if not hasattr(module, "mapped_SJ"):
        if module.FRICTION:
            yield (
                "has friction, but no mapped_SJ(p) that says which S and J (% of travel) it stands"
                " for"
            )
        return
    table = _accepted_parameters("valve", name, module)[0]
    answer = call_guarded(lambda: module.mapped_SJ(valve_parameters(module, table, 1.0)))
    value = answer.value
    if answer.faults or not isinstance(value, tuple) or len(value) != 2:
        what = answer.faults[0] if answer.faults else f"is {value!r}, two numbers are needed"
        yield f"mapped_SJ {what}"
    elif (value[0] > 0.0) != module.FRICTION:
        yield f"says FRICTION = {module.FRICTION} and maps on S = {value[0]:g}"


def _not_recognised(name: str, module: ModuleType) -> Iterator[str]:
    if name not in RECOGNISERS.every_name():
        yield (
            "simulated, but not diagnosed: no file under simbench.recognised says how it is"
            " recognised"
        )


def _rules(kind: str, folder: PluginFolder) -> ContractRules:
    return ContractRules(
        kind,
        folder,
        (_description, partial(_takes_its_ranges, kind)),
        (
            partial(_runs, kind),
            partial(_refuses, kind),
            *[_states_its_band] * (kind == "valve"),
        ),
        notes=_not_recognised if kind == "effect" else lambda name, module: (),
    )


# an effect may hold a valve's steps too: the kind of which most is there, the first of equals
PART_RULES = tuple(
    _rules(folder.kind, folder) for folder in (EFFECTS, VALVES, PLANT_PLUGINS, CONTROLLER_PLUGINS)
)
