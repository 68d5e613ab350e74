"""Drawing the set point's plan and the archive's chain: how a loop's life was led and how it was
written down.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from results.studies.worlds.mill.nature import SETPOINTS
from results.studies.worlds.mill.rig import Case, Rig


def draw_set_point(rng: np.random.Generator, case: Case, pace: float) -> dict[str, Any]:
    """Draw a plan for the set point: half of all loops hold it, the others step, ramp or follow a
    cascade's master.
    """
    span = case["span"]
    zero = 0.0 if rng.random() < 0.5 else float(np.round(rng.uniform(-2.0, 4.0) * span))
    value = float(f"{zero + span * rng.uniform(0.25, 0.75):.4g}")
    kind = str(rng.choice(SETPOINTS, p=[0.5, 0.22, 0.13, 0.15]))
    plan: dict[str, Any] = {"kind": kind, "value": value}
    gain = abs(case["plant"]["K"]) if case["plant"]["type"] == "foptd" else np.inf
    largest = min(12.0 * gain, 12.0 / case["controller"]["Kc"])
    size = min(span * float(np.exp(rng.uniform(np.log(0.01), np.log(0.06)))), largest)
    length = case["n"] * case["Ts"]
    if kind == "cascade":
        tau = pace * float(np.exp(rng.uniform(np.log(2.0), np.log(15.0))))
        return plan | {"tau": tau, "std": 0.4 * size, "seed": int(rng.integers(2**31))}
    if kind == "constant":
        return plan
    # a step is given time to settle, at least eight times T + Td on average
    count = (
        int(rng.integers(2, max(3, min(11, length / (8.0 * pace)))))
        if kind == "steps"
        else int(rng.integers(2, 6))
    )
    starts = np.sort(rng.uniform(-0.05, 0.97, count)) * length
    lasts = np.zeros(count) if kind == "steps" else rng.uniform(0.03, 0.15, count) * length
    moves, level = [], value
    for start, last in zip(starts, lasts):
        level = float(
            f"{value + size * rng.uniform(0.4, 1.0) * (-1.0 if level > value else 1.0):.6g}"
        )
        moves.append([float(start), float(start + last), level])
    # ramps that would overlap run one after the other
    for before, after in pairwise(moves):
        before[1] = min(before[1], after[0])
    return plan | {"moves": moves}


def draw_archive(rng: np.random.Generator, case: Case) -> None:
    """Draw transmitter, output card and archive into a case; every step of theirs is a fifth of the
    noise at most.
    """
    std, value = case["noise"]["std"], abs(case["setpoint"]["value"])
    if rng.random() < 0.35:  # 10 to 16 bits over the span, wherever the first count lies
        counts = case["span"] / 2.0 ** np.arange(10, 17)
        fine = counts[counts <= std / 5.0]
        if len(fine):
            count = float(rng.choice(fine))
            case["transmitter"] = {"count": count, "count_at": float(rng.uniform(0.0, count))}
    moves = np.concatenate([np.diff(Rig.of(case).record(seed)["op"]) for seed in (1, 2)])
    moving = float(np.std(moves))
    cards = np.array([0.0, 100 / 2**16, 100 / 2**14, 0.01, 100 / 2**12, 0.05])
    case["controller"]["resolution"] = float(rng.choice(cards[cards <= moving / 5.0]))
    pv = []
    if rng.random() < 0.12:
        pv.append({"stage": "average"})
    if rng.random() < 0.15:
        pv.append({"stage": "exception", "band": float(std * rng.uniform(0.05, 0.25))})
    pv.append(_printed(rng, value, std / 5.0))
    case["archive"] = {
        "pv": pv,
        "sp": [pv[-1]],
        "op": [_printed(rng, 50.0, moving / 5.0)],
        "mv": [_printed(rng, 50.0, max(moving / 5.0, 0.01))],
        "op_late": bool(rng.random() < 0.2),
    }


def _printed(rng: np.random.Generator, value: float, finest: float) -> dict[str, Any]:
    """3 to 8 significant digits, or fixed decimals, whose step at `value` is at most `finest`."""
    needed = int(np.ceil(-np.log10(finest)))  # decimals
    if rng.random() < 0.55:
        least = needed + 1 + int(np.floor(np.log10(max(value, finest))))
        return {"stage": "digits", "digits": int(rng.integers(max(3, min(least, 8)), 9))}
    return {"stage": "decimals", "decimals": int(rng.integers(needed, needed + 4))}
