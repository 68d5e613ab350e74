"""Plants and controllers of any kind: simulated against python-control, and their exact cycles
against simulation.

Prints the largest relative difference within the first 300 samples of random loops (second order,
lead, inverse response, integrator with lag; PID in four forms) with a linear valve, and how far
period and amplitude of simulated cycles of such loops with sticky valves lie from the exact ones.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from typing import Any

import control
import numpy as np

from simbench.bench.scenario.motion import motion
from simbench.detectors.judge import judge
from simbench.detectors.report.report import choose_methods
from simbench.detectors.verdict import STICTION
from simbench.loop.controller import pid_numbers
from simbench.loop.plant import polynomials
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop
from simbench.theory.cycle import cycle_start, exact_cycle
from simbench.theory.sampled import sampled_loop, ultimate_gain

SHAPES = ("second order", "lead", "inverse response", "integrator with lag")
FORMS = tuple(
    (form, windup)
    for form in ("positional", "velocity")
    for windup in ("clamping", "back-calculation")
)
SAMPLES = 300
_SETTLE, _CYCLES = 20, 60  # periods of a simulated cycle: left out, and measured


def random_loops(count: int, seed: int = 0) -> Iterator[Loop]:
    """Yield loops that keep a margin to instability: every shape of plant with every form of PID,
    in turn.
    """
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        shape, (form, windup) = SHAPES[made % 4], FORMS[made // 4 % 4]
        loop = _with_margin(_random(shape, form, windup, rng), rng.uniform(0.15, 0.4))
        if loop is not None:
            made += 1
            yield loop


def _random(shape: str, form: str, windup: str, rng: np.random.Generator) -> Loop:
    T = float(np.exp(rng.uniform(np.log(5.0), np.log(50.0))))
    other = float(rng.uniform(0.1, 1.0) * T)
    K, Td = float(np.exp(rng.uniform(-1.0, 1.0))), float(rng.uniform(0.05, 0.6) * T)
    lead = {
        "lead": rng.uniform(0.1, 0.9) * other,
        "inverse response": -rng.uniform(0.1, 0.8) * other,
    }.get(shape)
    num = [K] if lead is None else [K * float(lead), K]
    den = [T * other, T, 0.0] if shape == "integrator with lag" else [T * other, T + other, 1.0]
    if shape == "second order" and rng.random() < 0.5:  # underdamped
        den = [T * T, 2.0 * float(rng.uniform(0.3, 0.9)) * T, 1.0]
    table: dict[str, Any] = {
        "plant": {"type": "tf", "num": num, "den": den, "Td": Td},
        "controller": {
            "type": "PID",
            "Kc": 1.0,
            "Ti": float(rng.uniform(1.0, 2.0) * (3.0 * T if len(num) == 1 else T)),
            "Td": float(rng.uniform(0.05, 0.25) * T),
            "N": float(rng.uniform(5.0, 12.0)),
            "form": form,
            "anti_windup": windup,
            "b": float(rng.uniform(0.0, 1.0)),
            "c": float(rng.uniform(0.0, 1.0)),
        },
        "sampling": {"Ts": float(rng.uniform(0.02, 0.1) * T), "n": SAMPLES},
        "setpoint": {"value": 50.0, "steps": [[5.0 * T / 10.0, 50.5]]},
    }
    return Loop.from_table(table)


def _with_margin(loop: Loop, share: float) -> Loop | None:
    factor = ultimate_gain(sampled_loop(loop))
    if factor is None or not 1e-3 < factor < 1e3:
        return None
    return loop.with_("controller.Kc", share * factor)


def difference(loop: Loop) -> float:
    """Return the largest difference of PV and OP from python-control's, over their largest move."""
    record = simulate(loop).record
    assert record.sp is not None
    pv, op = by_control(loop, np.asarray(record.sp) - loop.pv0)
    ours = np.array([record.pv - loop.pv0, record.op - loop.operating_point.op0])
    return float(max(np.abs(a - b).max() / np.abs(b).max() for a, b in zip(ours, (pv, op))))


def by_control(loop: Loop, sp: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return PV and OP as deviations from rest: python-control samples plant and controller and
    closes the loop.
    """
    Ts, c = loop.sampling.Ts, loop.controller
    p = pid_numbers(c, c.sign * c.Kc, float(c.Ti or 0.0), Ts, 0.0, 0.0, 100.0)
    integral: Any = control.tf([p.Ki, 0.0], [1.0, -1.0], Ts)
    slope: Any = control.tf([p.Kc * p.kd, -p.Kc * p.kd], [1.0, -p.fade], Ts)
    of_sp, of_pv = (
        control.ss(control.tf([p.Kc * b], [1.0], Ts) + integral + d * slope)
        for b, d in ((p.b, p.c), (1.0, 1.0))
    )
    whole = _sampled_plant(loop)
    left = control.ss(
        of_sp.A, of_sp.B, of_sp.C, of_sp.D, Ts, inputs="sp", outputs="ahead", name="left"
    )
    right = control.ss(
        of_pv.A, of_pv.B, of_pv.C, of_pv.D, Ts, inputs="pv", outputs="back", name="right"
    )
    op = control.summing_junction(["ahead", "-back"], "op", name="sum")
    closed = control.interconnect([left, right, op, whole], inputs="sp", outputs=["pv", "op"])
    return tuple(control.forced_response(closed, np.arange(sp.size) * Ts, sp).outputs)  # type: ignore[return-value]


def _sampled_plant(loop: Loop) -> Any:
    """Return the plant with its dead time, whole and part of a sample, as a discrete state space of
    python-control.
    """
    Ts, Td = loop.sampling.Ts, loop.plant.Td
    G = control.ss(control.tf(*polynomials(loop.plant)))
    delay = int(np.floor(Td / Ts + 1e-9))
    old = max(Td - delay * Ts, 0.0)
    whole, new = (control.sample_system(G, h, "zoh") for h in (Ts, Ts - old))
    early: Any = (
        np.asarray(new.A) @ control.sample_system(G, old, "zoh").B
        if old > 1e-9 * Ts
        else np.zeros_like(new.B)
    )
    n, m = len(whole.A), delay + 1  # the last m inputs, newest first
    A, B, C = np.zeros((n + m, n + m)), np.zeros((n + m, 1)), np.zeros((1, n + m))
    A[:n, :n], C[0, :n] = whole.A, G.C
    A[n + 1 :, n:-1] = np.eye(m - 1)
    B[n] = 1.0
    A[:n, [n + delay]] += early
    if delay == 0:
        B[:n] += new.B
    else:
        A[:n, [n + delay - 1]] += new.B
    return control.ss(A, B, C, 0, Ts, inputs="op", outputs="pv", name="plant")


def cycle_errors(loop: Loop, S: float, J: float) -> tuple[float, float] | None:
    """Return the relative errors of the exact cycle's period and amplitude against a simulation;
    None where there is none.
    """
    table = loop.to_table() | {
        "valve": {"model": "choudhury", "S": S, "J": J},
        "setpoint": {"value": 50.0},
    }
    sticky = Loop.from_table(table)
    cycle = exact_cycle(sampled_loop(sticky))
    if cycle is None or not cycle.amplitude < 40.0 or cycle.period > 1e4 * sticky.sampling.Ts:
        return None
    per = cycle.period / sticky.sampling.Ts
    run = simulate(
        sticky.with_("sampling.n", int((_SETTLE + _CYCLES) * per)), start=cycle_start(sticky)
    )
    late = int(_SETTLE * per)
    op = run.record.op[late:]
    peaks = [np.ptp(op[int(i * per) : int((i + 1) * per)]) / 2.0 for i in range(_CYCLES - 1)]
    period = motion(run.mv[late:], 0.25 * J).period
    return abs(period / per - 1.0), abs(float(np.mean(peaks)) / cycle.amplitude - 1.0)


def cycles(count: int, seed: int = 1) -> list[tuple[float, float]]:
    """Return the errors of `count` loops with sticky valves that cycle."""
    rng, cycle = np.random.default_rng(seed), []
    for loop in random_loops(10 * count, seed):
        S = float(rng.uniform(2.0, 8.0))
        errors = cycle_errors(loop, S, S * float(rng.uniform(0.2, 1.0)))
        cycle += [errors] if errors is not None else []
        if len(cycle) == count:
            break
    return cycle


def pairs(count: int, seed: int = 2) -> Iterator[Loop]:
    """Yield cascades whose inner valve sticks: a quick inner loop, an outer one 5 to 15 times as
    slow.
    """
    rng = np.random.default_rng(seed)
    for _ in range(count):
        T, slow = float(np.exp(rng.uniform(0.0, 2.0))), float(rng.uniform(5.0, 15.0))
        K, S = float(np.exp(rng.uniform(-0.7, 0.7))), float(rng.uniform(3.0, 8.0))
        outer = {
            "plant": {
                "type": "foptd",
                "K": 1.0,
                "T": slow * T,
                "Td": float(rng.uniform(0.5, 2.0)) * T,
            },
            "controller": {"type": "PI", "Kc": float(rng.uniform(1.0, 2.5)), "Ti": slow * T},
            "noise": {"std": 0.02 * S},
            "setpoint": {"value": 50.0, "steps": [[20.0 * T, 50.0 + S]]},
        }
        yield Loop.from_table({
            "plant": {"type": "foptd", "K": K, "T": T, "Td": float(rng.uniform(0.1, 0.4)) * T},
            "controller": {"type": "PI", "Kc": 0.6 / K, "Ti": T},
            "valve": {"model": "choudhury", "S": S, "J": S * float(rng.uniform(0.3, 1.0))},
            "noise": {"std": 0.01 * K * S}, "sampling": {"Ts": 0.25 * T, "n": 3000}, "outer": outer,
        })  # fmt: skip


def found_in_pairs(count: int, methods: str = "fast") -> dict[str, tuple[float, float]]:
    """Return per method the share of pairs that it calls sticky by the inner and by the outer
    record.
    """
    inner, outer = [], []
    for i, loop in enumerate(pairs(count)):
        run = simulate(loop, i)
        assert run.outer is not None
        names = choose_methods([methods])
        for verdicts, record in ((inner, run.record), (outer, run.outer)):
            verdicts.append({v.method: v.verdict == STICTION for v in judge(record, names)})
    return {
        name: tuple(float(np.mean([v[name] for v in side])) for side in (inner, outer))
        for name in inner[0]
    }  # type: ignore[misc]


def main(loops: int = 200, sticky: int = 60, cascades: int = 40) -> int:
    """Print both comparisons; 1 where one falls short."""
    warnings.simplefilter("ignore")
    apart = np.array([difference(loop) for loop in random_loops(loops)])
    print(
        f"{loops} loops against python-control, {SAMPLES} samples: largest relative difference"
        f" {apart.max():.2e} (<= 1e-9)"
    )
    errors = np.array(cycles(sticky))
    period, amplitude = errors.max(axis=0)
    print(
        f"{len(errors)} exact cycles against simulation: period within {period:.2%} (1 %),"
        f" OP within {amplitude:.2%} (2 %)"
    )
    print(
        f"{cascades} cascades whose inner valve sticks: share called sticky by the inner and by the"
        " outer record"
    )
    for name, (inner, outer) in found_in_pairs(cascades).items():
        print(f"  {name:<18} {inner:5.2f} {outer:5.2f}")
    return int(not (apart.max() <= 1e-9 and period <= 0.01 and amplitude <= 0.02))


if __name__ == "__main__":
    sys.exit(main())
