"""Re-simulate what an answer claims: the generator's loop with the claimed effect and parameters in place of the true fault."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from simbench.blind.alike import Facts, indistinguishable
from simbench.blind.score import claimed_shrinkage
from simbench.blind.worlds.own.distance import cloud, features
from simbench.blind.worlds.own.faults import fault
from simbench.blind.worlds.own.loops import Case, Signals, simulate
from simbench.blind.worlds.own.oracle import RESOLVABLE
from simbench.loop.effects import EFFECTS, Choice

SEEDS = 10
CANDIDATES = 5


def true_shrinkages(
    truth: Mapping[str, Any], found: Mapping[str, Any], record: pd.DataFrame, facts: Facts
) -> list[dict[str, Any]]:
    """Return claimed and true shrinkage of the answer's best candidates.

    Before: the true loop without its fault. After: the same with the claimed effect; a claimed mismatch counts from the
    baseline's value.

    Parameters
    ----------
    truth : mapping
        A row of answers.csv with `case`, `seed` and `effect`, as this generator writes it.
    found : mapping
        The answer's JSON.
    record : pandas.DataFrame
        The record's columns sp, op, pv.
    facts : Facts

    Returns
    -------
    list of dict
        One per candidate: effect, right (in the true effect's group), claimed, true. Empty without a resolvable gap.
    """
    case, seed = Case.from_dict(truth["case"]), int(truth["seed"])
    seeds = [seed + 5000 + i for i in range(SEEDS)]
    sp, op, pv = (record[c].to_numpy(float) for c in ("sp", "op", "pv"))
    values = features(Signals(sp, op, pv, op), case)[0]
    before = cloud([simulate(case, s) for s in seeds], case)
    if before.distance(values) < RESOLVABLE * before.floor:
        return []
    ranked = sorted(found.get("ranking") or [], key=lambda r: -(r.get("probability") or 0.0))
    group = indistinguishable(str(truth["effect"]), facts)
    rows = []
    for candidate in [r for r in ranked if r["effect"] in EFFECTS and r.get("parameters")][:CANDIDATES]:
        claimed = claimed_shrinkage(candidate, found)
        if claimed is None:
            continue
        effect = str(candidate["effect"])
        act = fault(effect, _inside(effect, candidate["parameters"]))
        changed = _from_baseline(case, effect)
        after = cloud([simulate(changed, s, (act,)) for s in seeds], case)
        # one yardstick for both arms, the claimed arm's own
        start, floor = after._replace(mean=before.mean).distance(values), after.floor
        true = 1.0 - max(after.distance(values) - floor, 0.0) / (start - floor) if start > floor else 0.0
        rows.append({"effect": effect, "right": effect in group, "claimed": claimed, "true": float(np.clip(true, -1.0, 1.0))})
    return rows


def _inside(effect: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The claimed parameters, cut to their bounds, the missing ones at their identity."""
    whole: dict[str, Any] = {}
    for name, quantity in EFFECTS[effect].parameters.items():
        if isinstance(quantity, Choice):
            word = parameters.get(name, quantity.names[0])
            whole[name] = word if word in quantity.names else quantity.names[0]
        elif name in parameters or name != "c":
            value = parameters.get(name)
            whole[name] = float(np.clip(quantity.identity if value is None else float(value), quantity.low, quantity.high))
    return whole


def _from_baseline(case: Case, effect: str) -> Case:
    K, T, Td = case.nominal
    if effect == "gain_mismatch":
        return replace(case, K=K)
    if effect == "time_constant_mismatch":
        return replace(case, T=T)
    return replace(case, Td=Td + case.Ts * case.log_is_late) if effect == "dead_time_mismatch" else case
