"""Simulate what an answer claims: the independent simulator's loop with the claimed effect in place
of the true one.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from results.studies.withheld.distance import RESOLVABLE, Scale, Signals, cloud, features
from results.studies.withheld.score import claimed_shrinkage
from results.studies.withheld.world import WORLD_EFFECTS
from results.studies.worlds import load_world
from simbench.detectors.errors import ParameterError
from simbench.loop.effects import FOLLOWS, Choice
from simbench.loop.effects._alike import Circumstances, indistinguishable

_SEEDS = 10
_CANDIDATES = 5


def true_shrinkages(
    truth: Mapping[str, Any],
    answer: Mapping[str, Any],
    record: pd.DataFrame,
    baseline: Mapping[str, Any],
    here: Circumstances,
    world: str,
) -> list[dict[str, Any]]:
    """Return claimed and true shrinkage of the answer's best candidates, and of the named one
    whether its interval covers the true one.

    Before: the true loop without its effect. After: the same with the claimed one; what no world
    draws is passed over.
    """
    simulate, scale = (
        load_world(world).simulate,
        _scale_of(baseline, bool(np.ptp(record["sp"]) > 0.0)),
    )
    seeds = [int(truth["seed"]) + 5000 + i for i in range(_SEEDS)]

    def runs(effects: list[dict[str, Any]]) -> list[Signals]:
        return [_signals(simulate(truth, effects, s)) for s in seeds]

    values = features(_signals(record), scale)[0]
    before = cloud(runs([]), scale)
    if before.distance(values) < RESOLVABLE * before.floor:
        return []
    ranked = sorted(answer.get("ranking") or [], key=lambda r: -(r.get("probability") or 0.0))
    group = indistinguishable(str(truth["effect"]), here)
    rows = []
    for candidate in [r for r in ranked if r["effect"] in WORLD_EFFECTS and r.get("parameters")][
        :_CANDIDATES
    ]:
        claimed = claimed_shrinkage(candidate, answer)
        if claimed is None:
            continue
        effect = str(candidate["effect"])
        try:
            after = cloud(
                runs([{"effect": effect, "parameters": _inside(effect, candidate["parameters"])}]),
                scale,
            )
        except ParameterError:
            continue
        # one yardstick for both, that of the claimed loop
        start, floor = after._replace(mean=before.mean).distance(values), after.floor
        true = (
            1.0 - max(after.distance(values) - floor, 0.0) / (start - floor)
            if start > floor
            else 0.0
        )
        rows.append(
            {
                "effect": effect,
                "right": effect in group,
                "claimed": claimed,
                "true": (true := float(np.clip(true, -1.0, 1.0))),
                "covered": _covered(effect, true, answer),
            }
        )
    return rows


def _covered(effect: str, true: float, answer: Mapping[str, Any]) -> bool | None:
    """Return whether the interval that is claimed of the named effect alone holds the true share;
    None of any other.
    """
    interval = answer.get("shrinkage")
    if [e["effect"] for e in answer.get("effects") or []] != [effect] or not interval:
        return None
    return bool(interval["lo"] <= true <= interval["hi"])


def _scale_of(baseline: Mapping[str, Any], sp_moves: bool) -> Scale:
    """Return what the records of a loop are measured in, by its baseline."""
    plant, control = baseline["plant"], baseline["controller"]
    K, Kc, Ts = abs(float(plant["K"])), float(control["Kc"]), float(baseline["sampling"]["Ts"])
    # lambda tuning: the gain that was chosen shows how fast the loop was meant to be
    speed = float(plant.get("T", 1.0)) / (K * Kc)
    noise = float(baseline.get("noise", {}).get("std", 0.0))
    step_unit = float(plant["K"]) if "T" in plant else 1.0 / Kc
    return Scale(Ts, max(speed, Ts), K if "T" in plant else 1.0 / Kc, noise, step_unit, sp_moves)


def _signals(columns: Mapping[str, Any] | pd.DataFrame) -> Signals:
    sp, op, pv = (np.asarray(columns[name], dtype=float) for name in ("sp", "op", "pv"))
    return Signals(sp, op, pv, op)


def _inside(effect: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """The claimed parameters, cut to their bounds, the missing ones at their identity."""
    whole: dict[str, Any] = {}
    for name, quantity in WORLD_EFFECTS[effect].parameters.items():
        if isinstance(quantity, Choice):
            word = parameters.get(name, quantity.names[0])
            whole[name] = word if word in quantity.names else quantity.names[0]
        elif name in parameters or quantity.default is not FOLLOWS:
            value = parameters.get(name)
            whole[name] = float(
                np.clip(
                    quantity.identity if value is None else float(value),
                    quantity.low,
                    quantity.high,
                )
            )
    return whole
