"""The first independent plant simulator of the blind test, with its own valve physics, controllers,
archive and faults.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from results.studies.withheld.world import Item, TestPlan, operated
from results.studies.worlds.own import loops
from results.studies.worlds.own.drawing import baseline_table
from results.studies.worlds.own.faults import FOREIGN, NEEDS_PLANT, fault
from results.studies.worlds.own.items import draw_item
from results.studies.worlds.own.loops import TrueLoop
from simbench.detectors.errors import ParameterError

__all__ = ["FOREIGN", "TITLE", "Item", "draw", "simulate", "test"]

TITLE = (
    "loops of a plant: stems with friction by force balance, velocity and position PI, a historian"
)


def draw(seed: int, index: int, entry: dict[str, Any]) -> Item:
    """Draw a record that holds what the entry asks for.

    Parameters
    ----------
    seed : int
        Root of the item's random stream.
    index : int
        Number of the item in its set.
    entry : dict
        What the item must hold: its effects and the kind of loop.

    Returns
    -------
    Item
        The record, the baseline handed out with it, and the truth.
    """
    drawn = draw_item(seed, index, entry)
    return Item(_columns(drawn.case, drawn.signals), baseline_table(drawn.case), drawn.answer)


def simulate(
    answer: Mapping[str, Any],
    effects: Sequence[Mapping[str, Any]],
    seed: int,
    nominal: bool = False,
) -> dict[str, np.ndarray]:
    """Run the loop of an answer again with other effects in place of the true one.

    Parameters
    ----------
    answer : mapping
        Answer of an item that `draw` returned.
    effects : sequence of mapping
        Effects to simulate, each with its name under effect and its parameters.
    seed : int
        Root of the noise and the loads.
    nominal : bool
        With the plant that the baseline states in place of the true one.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Signals by name: t (s), sp and pv (PV units), op (%), mv (%) where it is recorded.
    """
    case, acts = _faulty(answer, effects, nominal)
    return _columns(case, loops.simulate(case, seed, acts))


def test(
    answer: Mapping[str, Any], effects: Sequence[Mapping[str, Any]], seed: int, plan: TestPlan
) -> dict[str, np.ndarray]:
    """Run a test of the menu on the loop of an answer: columns as recorded, mode and lab where the
    plan has them.

    Parameters
    ----------
    answer : mapping
        Answer of an item that `draw` returned.
    effects : sequence of mapping
        Effects to simulate, each with its name under effect and its parameters.
    seed : int
        Root of the noise and the loads.
    plan : TestPlan
        The test: its kind, size and length.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        Signals as `simulate` returns them.
    """
    case, acts = _faulty(answer, effects, False)
    signals, true = loops.test(case, seed, acts, plan)
    timed = replace(case, n=plan.n, Ts=case.Ts / plan.faster, mv=case.mv or plan.mv)
    return operated(_columns(timed, signals), true, plan, seed)


def _faulty(
    answer: Mapping[str, Any], effects: Sequence[Mapping[str, Any]], nominal: bool
) -> tuple[TrueLoop, tuple[loops.Fault, ...]]:
    case = TrueLoop.from_dict(dict(answer["case"]))
    case = case.as_nominal() if nominal else case
    for each in effects:
        plant = NEEDS_PLANT.get(each["effect"], case.plant)
        if plant != case.plant:
            raise ParameterError(
                f"withheld: {each['effect']} acts on a {plant} plant only; this one is {case.plant}"
            )
        case = _from_baseline(case, each["effect"])
    return case, tuple(fault(each["effect"], each["parameters"]) for each in effects)


def _columns(case: TrueLoop, s: loops.Signals) -> dict[str, np.ndarray]:
    columns = {"t": np.arange(case.n) * case.Ts, "sp": s.sp, "op": s.op, "pv": s.pv}
    return columns | ({"mv": s.mv} if case.mv else {})


def _from_baseline(case: TrueLoop, effect: str) -> TrueLoop:
    K, T, Td = case.nominal
    if effect == "gain_mismatch":
        return replace(case, K=K)
    if effect == "time_constant_mismatch":
        return replace(case, T=T)
    return (
        replace(case, Td=Td + case.Ts * case.log_is_late)
        if effect == "dead_time_mismatch"
        else case
    )
