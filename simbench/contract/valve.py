"""Test a valve model or stage against its contract: description, step function, and the stick band
that it states.

The band is measured under an OP that creeps to and fro, with two sets of parameters, and held
against `mapped_SJ`: what a benchmark calls sticky is what the valve maps on, so a wrong label there
falsifies every score.
"""

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from simbench.contract.band import band_fault
from simbench.contract.rules import both_ways, head_faults, inside, schema_faults, shown, walked
from simbench.detectors.contract.engine import ContractRules
from simbench.detectors.contract.watch import call_guarded
from simbench.detectors.errors import UserError
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.loop.response import valve_response

_AT_REST = 1e-6  # % of travel by which MV may settle where it starts


def _example_tables(module: ModuleType) -> tuple[list[dict[str, Any]], str]:
    """Return two sets of parameters that a valve takes, and why it refused others.

    >>> _example_tables(VALVES.load("deadband"))[0]
    [{'S': 4.0}, {'S': 7.0}]
    """
    tables, refused = [], ""
    for percent, band in ((4.0, {"S": 4.0, "J": 2.0}), (7.0, {"S": 7.0, "J": 1.0})):
        table = {
            key: inside(rule, percent)
            for key, rule in module.PARAMETERS.items()
            if rule.default is None
        }
        if set(band) <= set(module.PARAMETERS):
            table |= band
        try:
            valve_parameters(module, table, 1.0)
            tables.append(table)
        except UserError as error:
            refused = str(error)
    return [t for i, t in enumerate(tables) if t not in tables[:i]], refused


def _description(name: str, module: ModuleType) -> Iterator[str]:
    yield from head_faults("valve", module, "FRICTION")
    yield from schema_faults(module.PARAMETERS)
    if module.FRICTION is True and not hasattr(module, "mapped_SJ"):
        yield (
            "has friction, but no mapped_SJ(p) that says which S and J (% of travel) it stands for"
        )


def _takes_its_ranges(name: str, module: ModuleType) -> Iterator[str]:
    tables, refused = _example_tables(module)
    if not tables:
        yield f"refuses the parameters of its own ranges: {refused}"


def _step_faults(name: str, module: ModuleType, table: dict[str, Any]) -> Iterator[str]:
    """Take a few samples by hand: the state is a tuple of floats of one length, and a function of
    what is given.
    """
    p = valve_parameters(module, table, 1.0)
    (first, faults), (second, _) = (
        walked(
            lambda: module.start(40.0, p),
            lambda u, v: module.step(u, v, p),
            (40.0, 60.0, 55.0, 120.0, -5.0),
            "in start or step",
        )
        for _ in range(2)
    )
    yield from faults
    odd = [x for state in first[1:] for x in state if type(x) is not float]
    if odd:
        yield (
            f"gives the state {odd[0]!r} ({type(odd[0]).__name__}); floats are needed, compiled"
            " states hold nothing else"
        )
    elif first != second:
        yield "is not deterministic: the same OP gives another MV the second time"


def _run_faults(name: str, module: ModuleType, table: dict[str, Any]) -> Iterator[str]:
    rng = np.random.default_rng(1)
    op = np.clip(50.0 + np.cumsum(rng.normal(0.0, 8.0, 80) * (rng.random(80) > 0.25)), -10.0, 110.0)
    given = op.copy()
    answers, faults = both_ways(lambda plain: valve_response(name, op, table, 0.5, plain=plain))
    yield from faults
    if faults:
        return
    slow, fast = answers
    if not np.array_equal(op, given):
        yield "writes into the OP it was given"
    if not np.array_equal(slow, fast):
        yield (
            "gives other numbers compiled than in plain Python from sample"
            f" {int(np.argmax(slow != fast))} on"
        )
    if slow.min() < 0.0 or slow.max() > 100.0:
        yield f"leaves its travel: MV from {slow.min():.4g} to {slow.max():.4g} %"
    rest, begun = (
        valve_response(name, np.full(50, 37.5), table),
        module.start(37.5, valve_parameters(module, table, 1.0))[0],
    )
    if np.any(np.abs(rest - begun) > _AT_REST):
        yield (
            f"does not stay at rest: MV goes from {begun:.6g} to {rest[-1]:.6g} % under a"
            " constant OP"
        )


def _label_faults(name: str, module: ModuleType, table: dict[str, Any]) -> Iterator[str]:
    p = valve_parameters(module, table, 1.0)
    answer = call_guarded(
        lambda: module.mapped_SJ(p) if hasattr(module, "mapped_SJ") else (0.0, 0.0)
    )
    if answer.faults or not isinstance(answer.value, tuple) or len(answer.value) != 2:
        words = (
            answer.faults[0]
            if answer.faults
            else f"is {answer.value!r}, two numbers (S, J) are needed"
        )
        yield f"mapped_SJ {words}"
        return
    S, J = (float(x) for x in answer.value)
    if not (0.0 <= S <= 100.0 and 0.0 <= J <= 200.0):
        yield f"maps on S = {S:g}, J = {J:g}; % of travel are needed"
    elif (S > 0.0) != module.FRICTION:
        yield f"says FRICTION = {module.FRICTION} and maps on S = {S:g}"
    elif fault := band_fault([(module, p)], S, J):
        yield fault


VALVE_RULES = ContractRules(
    "valve",
    VALVES,
    (_description, _takes_its_ranges),
    (_step_faults, _run_faults, _label_faults),
    cases=lambda module: _example_tables(module)[0],
    where=lambda table: f"with {shown(table)}",
    first_alone=True,
)
