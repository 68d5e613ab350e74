"""Simulate a simple control loop with a sticky valve, to try a detector on without the simulator of
simbench.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from simbench.detectors.record import LoopRecord


class ExampleLoop(NamedTuple):
    """What `example_loop` may be told; times in s, K in PV units per %."""

    S: float = 5.0  # % of OP
    J: float = 2.0  # % of OP
    process: str = "self-regulating"
    K: float = 1.0
    T: float = 10.0
    Td: float = 2.0
    Kc: float = 1.0
    Ti: float = 10.0
    Ts: float = 1.0
    n: int = 1500  # samples
    noise: float = 0.0  # standard deviation, PV units
    load: np.ndarray | None = None  # at the plant's input, shape (n,), %
    kick: float = 4.0  # of OP at the start, %
    seed: int = 0
    kind: str | None = None  # of the loop: flow, level, ...


def example_loop(**settings: Any) -> LoopRecord:
    """Run a PI loop about OP = PV = 50 whose valve sticks as Choudhury's two-parameter model does.

    `settings` are the fields of `ExampleLoop`. For trying detectors; `simbench` simulates every
    other loop, faster and with everything a plant has.

    >>> example_loop(S=4.0, J=1.0, noise=0.1, n=600).op.shape
    (600,)
    """
    S, J, process, K, T, Td, Kc, Ti, Ts, n, noise, load, kick, seed, kind = ExampleLoop(**settings)

    # Noise and load, the sampled plant, and the valve's two bands
    random = np.random.default_rng(seed).standard_normal(n) * noise
    if load is None:
        load = np.zeros(n)
    if process == "self-regulating":
        pole = math.exp(-Ts / T)
        gain = K * (1.0 - pole)
    else:
        pole = 1.0
        gain = K * Ts
    delay = round(Td / Ts)
    fs = (S + J) / 2.0
    fd = (S - J) / 2.0

    # The state of plant, valve and controller at rest at 50 %
    x = 0.0
    valve = 50.0
    way = 0
    moving = False
    before = 50.0
    integral = kick
    op = np.empty(n)
    pv = np.empty(n)
    mv = np.empty(n)

    # Sample by sample: PI controller with anti-windup, valve, plant
    for k in range(n):
        pv[k] = 50.0 + x + random[k]
        error = 50.0 - pv[k]
        integral += Kc * Ts / Ti * error
        wanted = 50.0 + Kc * error + integral
        u = min(max(wanted, 0.0), 100.0)
        integral += u - wanted

        # The valve stops where OP turns, and slips once OP has crossed the stick band
        if moving and (u - before) * way <= 0:
            moving = False
        if not moving and abs(u - valve) > fs:
            if u > valve:
                way = 1
                moving = True
            else:
                way = -1
                moving = True
        if moving:
            valve = u - way * fd

        # The plant answers to the valve one dead time ago
        before = u
        op[k] = u
        mv[k] = valve
        late = k - delay
        x = pole * x + (gain * (mv[late] - 50.0 + load[late]) if late >= 0 else 0.0)
    return LoopRecord(
        op=op,
        pv=pv,
        mv=mv,
        Ts=Ts,
        process=process,
        kind=kind,
        op_span=(0.0, 100.0),
        tag="plain loop",
    )


# OP a triangle, PV a rounded square, the two together close to an ellipse; a level: PV a triangle
_OBVIOUS = {
    "self-regulating": {
        "T": 6.0,
        "Td": 6.0,
        "Kc": 0.25,
        "Ti": 5.0,
        "noise": 0.1,
        "n": 2500,
        "kind": "flow",
    },
    "integrating": {
        "process": "integrating",
        "K": 0.1,
        "Td": 1.0,
        "Kc": 1.5,
        "Ti": 30.0,
        "noise": 0.05,
        "n": 2000,
    },
}


@cache
def example_record(case: str, process: str) -> LoopRecord:
    """Return one of three records about whose valve nobody can be in doubt: "stiction" (a sticky
    valve cycling in plain sight), "healthy" (the same loop with an ideal valve under a wandering
    load), "constant" (nothing ever moves).
    """
    if case == "stiction":
        return example_loop(**_OBVIOUS[process])
    if case == "healthy":
        load = 0.2 * np.cumsum(np.random.default_rng(3).standard_normal(2500))
        return example_loop(**{**_OBVIOUS[process], "S": 0.0, "J": 0.0, "load": load})
    kind = "flow" if process == "self-regulating" else "level"
    op = np.full(2000, 50.0)
    pv = np.full(2000, 3.0)
    return LoopRecord(op=op, pv=pv, mv=op, Ts=1.0, process=process, kind=kind)
