"""Milliseconds per record of 4000 samples for each detector and for the two budgets: minima and
medians of interleaved runs.
"""

import sys
import time

import numpy as np

from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

ROUNDS = 9
BARS = {"fast": 20.0, "full": 150.0}


def records() -> list:
    """Return sticky and healthy loops, with noise and a load, 4000 samples each."""
    table = {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "sampling": {"Ts": 1, "n": 4000},
        "noise": {"std": 0.05},
        "setpoint": {"value": 50, "steps": [[10, 55]]},
    }
    valves = [
        {"model": "choudhury", "S": 5, "J": 2},
        {"model": "choudhury", "S": 5, "J": 5},
        {"model": "ideal"},
    ]
    load = [{"type": "sine", "amplitude": 3.0, "period": 60.0, "at": "input"}]
    return [
        simulate(
            Loop.from_table({**table, "valve": v, "disturbance": load if i == 2 else []})
        ).record
        for i, v in enumerate(valves)
    ]


def main() -> int:
    names = methods.names()
    budget = {n: methods.load(n).METHOD.budget for n in names}
    sets = {"fast": [n for n in names if budget[n] == "fast"], "full": names}
    some = records()
    contenders = {**{n: [n] for n in names}, **sets}
    times: dict[str, list[float]] = {n: [] for n in contenders}
    for round_ in range(ROUNDS + 1):
        for name, group in contenders.items():
            start = time.process_time()
            for record in some:
                judge(record, group, raw=True)
            if round_:  # the first compiles
                times[name].append((time.process_time() - start) / len(some) * 1e3)
    print(
        f"CPU ms per record of 4000 samples, front end included, minimum and median of {ROUNDS}"
        " interleaved rounds"
    )
    for name in names:
        print(f"{name:<20} {min(times[name]):8.2f} {np.median(times[name]):8.2f}   {budget[name]}")
    good = True
    for name, bar in BARS.items():
        value = min(times[name])
        good &= value <= bar
        mark = "ok" if value <= bar else "SHORT"
        print(
            f"budget {name:<13} {value:8.2f} {np.median(times[name]):8.2f}   wanted <= {bar:g}  "
            f" {mark}"
        )
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
