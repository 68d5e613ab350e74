"""Test an effect against its contract: description, ranges, no change at zero strength, and change
only where it claims to act.
"""

import math
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from simbench.contract.band import band_fault
from simbench.contract.rules import schema_faults, shown
from simbench.detectors.contract.engine import ContractRules
from simbench.detectors.contract.watch import Guarded, call_guarded
from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap.effects import PLUGINS as RECOGNISERS
from simbench.loop.effects import BLOCKS, PLUGINS
from simbench.loop.parameters import Choice, Number
from simbench.loop.resolve import resolve_loop
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_EFFECT_LOOP: dict[str, Any] = {
    "plant": {"type": "foptd", "K": 1.5, "T": 20.0, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 18.0},
    "sampling": {"Ts": 1.0, "n": 400},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[60, 53], [200, 48]]},
    "disturbance": [{"type": "random_walk", "amplitude": 2.0, "period": 200.0}],
}
_LEVEL = {
    **_EFFECT_LOOP,
    "plant": {"type": "integrating", "K": 0.05, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 2.0, "Ti": 60.0},
}
# shares of the way from no strength to the end of the range; times its size where there is no
# end
_SHARES, _TIMES = (0.04, 0.3, 0.48, 0.9, 0.99, 0.9999, 1.0 - 1e-7), (0.5, 5.0, 50.0)


_NOT_DIAGNOSED = (
    "simulated, but not diagnosed: no file under simbench.recognised says how it is recognised"
)


def _description(name: str, module: ModuleType) -> Iterator[str]:
    if ": " not in (module.__doc__ or "").strip().partition("\n\n")[0]:
        yield 'the file does not begin with "Name: what it does."'
    if not str(module.SOURCE).strip():
        yield "SOURCE is empty"
    for word, value, allowed in (
        ("BLOCK", module.BLOCK, BLOCKS),
        ("ACTS", module.ACTS, ("loop", "record")),
    ):
        if value not in allowed:
            yield f"{word} = {value!r}, allowed: {', '.join(allowed)}"
    faults = list(schema_faults(module.PARAMETERS))
    yield from faults
    if not faults and not module.PARAMETERS:
        yield "PARAMETERS is empty: an effect without strength cannot be switched off"
    for key, rule in () if faults else module.PARAMETERS.items():
        if isinstance(rule, Number) and not rule.low <= rule.identity <= rule.high:
            allowed = f"{rule.low:g}..{rule.high:g}"
            yield (
                f"parameter {key}: identity = {rule.identity:g}; a value in {allowed} that does"
                " nothing is needed"
            )


def no_strength(module: ModuleType) -> dict[str, float | str]:
    """Return the parameters under which an effect does nothing."""
    return {
        k: r.names[0] if isinstance(r, Choice) else r.identity for k, r in module.PARAMETERS.items()
    }


def strengths(module: ModuleType) -> Iterator[dict[str, float | str]]:
    """Yield parameters ever further away from those under which an effect does nothing, upwards
    first.
    """
    none = no_strength(module)
    for up in (True, False):
        for i in range(len(_SHARES)):
            table = {
                k: none[k] if isinstance(r, Choice) else _away(r, i, up)
                for k, r in module.PARAMETERS.items()
            }
            if table != none:
                yield table


def _away(rule: Number, i: int, up: bool) -> float:
    end = (
        rule.high
        if up and rule.high > rule.identity
        else rule.low
        if rule.low < rule.identity
        else rule.high
    )
    if math.isfinite(end):
        return rule.identity + _SHARES[i] * (end - rule.identity)
    return rule.identity + math.copysign(
        _TIMES[min(i, len(_TIMES) - 1)] * max(abs(rule.identity), 1.0), end
    )


def _no_strength(name: str, module: ModuleType, case: object) -> Iterator[str]:
    for table in (_EFFECT_LOOP, _LEVEL):
        answer, plain = (
            _run(name, no_strength(module), table),
            simulate(Loop.from_table(table), seed=3).record,
        )
        where = table["plant"]["type"]
        if answer.faults:
            yield from answer.at(f"at no strength ({where} plant)")
        elif answer.refusal is None and not _same(answer.value, plain):
            yield (
                "is not the identity at no strength: the record changes at"
                f" {shown(no_strength(module))} ({where} plant)"
            )


def _some_strength(name: str, module: ModuleType, case: object) -> Iterator[str]:
    plain, refused = simulate(Loop.from_table(_EFFECT_LOOP), seed=3).record, ""
    for table in strengths(module):
        answer = _run(name, table)
        if answer.faults:
            yield from answer.at(f"at {shown(table)}")
            return
        refused = str(answer.refusal or "")
        if answer.refusal is not None or _same(answer.value, plain):
            continue
        if not _same(answer.value, _run(name, table).value):
            yield (
                f"is not deterministic: the same seed gives another record at {shown(table)}; draw"
                " from apply's rng"
            )
        if np.array_equal(answer.value.op, plain.op) != (module.ACTS == "record"):
            moved = "stays as it was" if module.ACTS == "loop" else "changes too"
            yield f"says ACTS = {module.ACTS!r}, but OP {moved} at {shown(table)}"
        yield from _label(name, table)
        short = _run(name, table, {**_EFFECT_LOOP, "sampling": {"Ts": 1.0, "n": 3}})
        yield from short.at("in a loop of 3 samples")
        return
    yield f"does nothing at any strength tried{': ' + refused if refused else ''}"


def _label(name: str, table: dict[str, float | str]) -> Iterator[str]:
    """Hold what the effect's valve stage does against what it maps on, where it brings one."""
    plain = resolve_loop(Loop.from_table(_EFFECT_LOOP), 3).valves
    setup = resolve_loop(_loop(name, table), 3)
    stages = [stage for stage in setup.valves if not any(stage[0] is module for module, _ in plain)]
    if len(stages) == 1:
        S, J = setup.bands[setup.valves.index(stages[0])]
        if fault := band_fault(stages, S, J):
            yield f"brings a valve stage that {fault}, at {shown(table)}"


def _loop(
    name: str, parameters: dict[str, float | str], table: dict[str, Any] = _EFFECT_LOOP
) -> Loop:
    return Loop.from_table({**table, "effect": [{"name": name, **parameters}]})


def _run(
    name: str, parameters: dict[str, float | str], table: dict[str, Any] = _EFFECT_LOOP
) -> Guarded:
    answer = call_guarded(lambda: simulate(_loop(name, parameters, table), seed=3).record)
    if isinstance(answer.refusal, RecordError):  # what the effect made of the signals is none
        answer.faults.append(f"makes a record that is none ({answer.refusal})")
    return answer


def _same(a: LoopRecord, b: LoopRecord) -> bool:
    return all(np.array_equal(getattr(a, s), getattr(b, s)) for s in ("op", "pv", "mv", "sp"))


EFFECT_RULES = ContractRules(
    "effect",
    PLUGINS,
    (_description,),
    (_no_strength, _some_strength),
    notes=lambda name, module: [] if name in RECOGNISERS.names() else [_NOT_DIAGNOSED],
)
