"""Test a plant or controller plug-in against its contract: description, state at rest, and a step
function without hidden state.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import repeat
from types import ModuleType
from typing import Any

import numpy as np

from simbench.contract.rules import both_ways, head_faults, inside, schema_faults, shown, walked
from simbench.detectors.contract.engine import ContractRules
from simbench.detectors.errors import UserError
from simbench.detectors.plugins.registry import PluginFolder
from simbench.loop import kernel
from simbench.loop.parameters import CONTROLLER_PLUGINS, PLANT_PLUGINS
from simbench.loop.plant import sample
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.setup import Setup
from simbench.scenarios.spec import Loop

_LOOP: dict[str, Any] = {
    "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.3},
    "controller": {"type": "PI", "Kc": 0.5, "Ti": 10.0},
    "valve": {"model": "choudhury", "S": 3.0, "J": 1.0},
    "sampling": {"Ts": 1.0, "n": 200},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[5, 55], [100, 45]]},
}
_KEPT = {
    "plant": ("type", "Td", "Ts", "op0", "pv0"),
    "controller": ("type", "direction", "sign", "Ts", "op0", "pv0", "lo", "hi"),
}
_AT_REST = 1e-9  # PV units or % by which what is at rest may move
_SAME = 1e-6  # share of its answer by which a plant may miss its claimed transfer function
_LONG = 20_000  # samples under a constant error


def _table(module: ModuleType) -> dict[str, Any]:
    """Return a value of every parameter that a loop file must state."""
    return {
        key: inside(rule, 2.0) for key, rule in module.PARAMETERS.items() if rule.default is None
    }


def _setup(kind: str, name: str, module: ModuleType) -> Setup:
    """Return the loop in which a plug-in is asked."""
    table = {"type": name, **_table(module), **({"Td": 2.3} if kind == "plant" else {})}
    return resolve_loop(Loop.from_table({**_LOOP, kind: table}), 1)


def _takes_its_parameters(kind: str, name: str, module: ModuleType) -> Iterator[str]:
    try:
        _setup(kind, name, module)
    except (UserError, ValueError) as error:
        yield f"refuses the parameters {shown(_table(module))}: {error}"


def _description(kind: str, name: str, module: ModuleType) -> Iterator[str]:
    yield from head_faults(kind, module, "INTEGRATING" if kind == "plant" else "INTEGRAL")
    faults = list(schema_faults(module.PARAMETERS))
    yield from faults
    for key in _KEPT[kind] if not faults else ():
        if key in module.PARAMETERS:
            yield (
                f"parameter {key} is what every {kind} has: it arrives in p, and needs no place in"
                " PARAMETERS"
            )


def _firsts(
    what: str, start: Callable[[], Any], step: Callable[[float, Any], Any], size: float, count: int
) -> tuple[np.ndarray, list[str]]:
    """Return the first number of every state from `start` over some steps under a constant input,
    and what is wrong with them.
    """
    what = what.format(size)
    states, faults = walked(start, step, repeat(size, count), what)
    first = np.array([s[0] for s in states], dtype=float)
    if not np.isfinite(first).all():
        faults = [f"gives values that are not finite, {what}"]
    return first, faults


def _plant_faults(name: str, module: ModuleType, case: object) -> Iterator[str]:
    setup = _setup("plant", name, module)
    assert setup.plant_plugin is not None
    p = setup.plant_plugin[1]

    under = partial(
        _firsts,
        "with MV {:g} % off rest",
        lambda: module.start(p),
        lambda w, s: module.step(w, w, s, p),
    )
    rest, faults = under(0.0, 100)
    up, more = under(1.0, 400)
    yield from (*faults, *more)
    if faults or more:
        return
    if np.abs(rest).max() > _AT_REST:
        yield (f"does not stay at rest: PV moves by {np.abs(rest).max():.3g} under a constant MV")
    if np.ptp(up) <= _AT_REST:
        yield "does not answer: PV stays under an MV of 1 % off rest"
    if not np.array_equal(up, under(1.0, 400)[0]):
        yield "is not deterministic: the same MV gives another PV the second time"
    if hasattr(module, "linear"):
        g = sample(setup.num, setup.den, 0.0, setup.Ts)
        x, expected = np.zeros(g.order), [0.0]
        for _ in range(400):
            x = g.A @ x + g.B_old + g.B_new
            expected.append(float(g.C @ x))
        if np.abs(up - expected).max() > _SAME * np.abs(expected).max():
            yield (
                "says linear(p), but its step response differs from it by up to"
                f" {np.abs(up - expected).max():.3g}"
            )


def _controller_faults(name: str, module: ModuleType, case: object) -> Iterator[str]:
    setup = _setup("controller", name, module)
    assert setup.control_plugin is not None
    p = setup.control_plugin[1]

    under = partial(
        _firsts,
        "under an error of {:g}",
        lambda: module.start(p),
        lambda e, s: module.step(e, setup.pv0, s, p),
    )
    rest, faults = under(0.0, 100)
    pushed, more = under(1.0, _LONG)
    yield from (*faults, *more)
    if faults or more:
        return
    if np.abs(rest - setup.op0).max() > _AT_REST:
        moved = np.abs(rest - setup.op0).max()
        yield f"does not stay at rest: OP moves by {moved:.3g} % without an error"
    if pushed.min() < p.lo or pushed.max() > p.hi:
        yield (
            f"leaves its limits: OP from {pushed.min():.4g} to {pushed.max():.4g}, within"
            " p.lo..p.hi is needed"
        )
    moves = abs(pushed[-1] - pushed[1]) > _AT_REST and (
        pushed[-1] in (p.lo, p.hi) or abs(pushed[-1] - pushed[_LONG // 2]) > _AT_REST
    )
    if moves != module.INTEGRAL:
        yield (
            f"says INTEGRAL = {module.INTEGRAL}, and under a constant error OP"
            f" {'moves on' if moves else 'comes to rest'}"
        )


def _loop_faults(kind: str, name: str, module: ModuleType, case: object) -> Iterator[str]:
    records, faults = both_ways(
        lambda plain: run_setup(_setup(kind, name, module), plain=plain).record
    )
    yield from faults
    if records and any(
        not np.array_equal(*(getattr(record, s) for record in records)) for s in ("pv", "op")
    ):
        yield "gives other numbers compiled than in plain Python"


def _rules(kind: str, folder: PluginFolder, answers: Callable[..., Iterator[str]]) -> ContractRules:
    return ContractRules(
        kind,
        folder,
        (partial(_description, kind), partial(_takes_its_parameters, kind)),
        (answers, partial(_loop_faults, kind)),
        cases=lambda module: [_table(module)],
        where=lambda table: f"at {shown(table)}",
        notes=lambda name, module: filter(None, [kernel.runs_plainly(module.step)]),
    )


PLANT_RULES = _rules("plant", PLANT_PLUGINS, _plant_faults)
CONTROLLER_RULES = _rules("controller", CONTROLLER_PLUGINS, _controller_faults)
