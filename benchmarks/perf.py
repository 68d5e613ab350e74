"""Ratios of interleaved runs by CPU time: the compiled loop against C, against plain Python and
against python-control.
"""

import sys
import time
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from c_loop import build

from simbench.loop import controller, kernel, sensor
from simbench.loop.linear import parts_of, plant_start
from simbench.loop.resolve import resolve_loop
from simbench.loop.response import valve_response
from simbench.scenarios.spec import Loop

N = 5000
ROUNDS = 9


FOPTD = {"type": "foptd", "K": 1, "T": 10, "Td": 2.5}
SECOND = {"type": "tf", "num": [1], "den": [20, 12, 1], "Td": 2.5}


def loop_file(n: int = N, plant: dict = FOPTD) -> Loop:
    return Loop.from_table(
        {
            "plant": plant,
            "controller": {"type": "PI", "Kc": 1, "Ti": 10},
            "valve": {"model": "choudhury", "S": 5, "J": 2},
            "sampling": {"Ts": 1, "n": n},
            "noise": {"std": 0.1},
            "setpoint": {"value": 50, "steps": [[10, 55]]},
        }
    )


class Case:
    """One resolved loop, ready to be run by every contender."""

    def __init__(self, n: int = N, plant: dict = FOPTD) -> None:
        self.setup = resolve_loop(loop_file(n, plant), seed=1)
        self.parts = parts_of(self.setup)
        self.delay = self.parts.sampled.delay
        self.out = [np.empty(n) for _ in range(3)]
        self.w = np.empty(n + self.delay + 1)
        self.v = tuple(tuple(map(float, m.start(self.setup.op0, p))) for m, p in self.setup.valves)
        steps = self.parts.steps, self.parts.stages, self.parts.classes
        self.compiled, self.plain = kernel.compiled(*steps), kernel.bind(*steps)
        self.start = (
            controller.pi_start(self.setup.op0, 0.0),
            self.v,
            sensor.plain_start(self.setup.pv0),
            self.parts.bare,
        )
        self.x = plant_start(self.setup, self.parts, self.setup.pv0)
        if plant is not FOPTD:
            return
        self.in_c = build()
        plant, control, _, _, ((S, J, _),) = self.parts.numbers
        s = self.setup
        self.c_arguments = [
            n,
            self.delay + 1,
            *(a.ctypes.data for a in (s.sp, s.load_in, s.load_out, s.pv_add)),
            s.op0,
            self.w.ctypes.data,
            *plant,
            control.Kc,
            control.Ki,
            S,
            J,
            *(a.ctypes.data for a in self.out),
        ]

    def run(self, function) -> list[np.ndarray]:
        s = self.setup
        self.w[: self.delay + 1] = 0.0
        function(
            s.sp,
            s.load_in,
            s.load_out,
            s.pv_add,
            s.op_moves,
            s.op0,
            self.w,
            self.x,
            *self.start,
            *self.out,
        )
        return self.out

    def run_c(self) -> list[np.ndarray]:
        self.w[: self.delay + 1] = 0.0
        self.in_c(*self.c_arguments)
        return self.out


def python_control(n: int):
    """The same loop, noise and all, as python-control's user draws it: blocks joined by
    `interconnect`.
    """
    import control

    case = Case(n)
    s = case.setup
    sampled, (_, pi, _, _, (p,)) = case.parts.sampled, case.parts.numbers
    step, lag, Ts = s.valves[0][0].step, case.delay + 1, s.Ts
    # a block's output may depend on its input in the same sample: output and next state come from
    # the same step
    pi_block = control.nlsys(
        lambda t, x, u, _: np.array(controller.pi_step(u[0], 0.0, (x[0], x[1]), pi)),
        lambda t, x, u, _: np.array(controller.pi_step(u[0], 0.0, (x[0], x[1]), pi)[:1]),
        inputs="e", outputs="op", states=2, dt=Ts, name="pi",
    )  # fmt: skip
    valve = control.nlsys(
        lambda t, x, u, _: np.array(step(u[0], tuple(x), p)),
        lambda t, x, u, _: np.array(step(u[0], tuple(x), p)[:1]) - s.op0,
        inputs="op", outputs="w", states=4, dt=Ts, name="valve",
    )  # fmt: skip
    # x = [PV, w(k-1) ... w(k-lag)]: the first-order plant after its dead time
    A = np.diag(np.ones(lag), -1)
    A[1, 0] = 0.0
    A[0, 0], A[0, lag], B = sampled.A[0, 0], sampled.B_old[0], np.zeros((lag + 1, 1))
    if lag > 1:
        A[0, lag - 1] += sampled.B_new[0]
    else:
        B[0] = sampled.B_new[0]
    B[1] = 1.0
    plant = control.ss(A, B, np.eye(1, lag + 1), 0, Ts, inputs="w", outputs="y", name="plant")
    pv = control.summing_junction(["y", "base", "noise"], "pv", name="sensor")
    error = control.summing_junction(["sp", "-pv"], "e", name="error")
    loop = control.interconnect(
        [pi_block, valve, plant, pv, error], inputs=["sp", "base", "noise"], outputs=["op", "pv"]
    )
    x0 = np.concatenate([[s.op0, 0.0], case.v[0], np.zeros(lag + 1)])
    t, u = np.arange(n) * Ts, np.array([s.sp, np.full(n, s.pv0), s.pv_add])
    return case, lambda: control.input_output_response(loop, t, u, x0).outputs


def interleaved(*functions, repeats: list[int]) -> list[list[float]]:
    """Return CPU seconds per call of the functions, run in turn, `ROUNDS` times `repeats` calls
    each.
    """
    times: list[list[float]] = [[] for _ in functions]
    for f in functions:
        f()
    for _ in range(ROUNDS):
        for series, f, repeat in zip(times, functions, repeats, strict=True):
            start = time.process_time()
            for _ in range(repeat):
                f()
            series.append((time.process_time() - start) / repeat)
    return times


def table(title: str, rows: list[tuple[str, list[float], list[float], float]]) -> int:
    """Print slow / fast with the bar of each row; return 1 when a minimum falls short."""
    good = True
    print(f"{title}: CPU time of {ROUNDS} interleaved rounds; all outputs checked equal first")
    for name, slow, fast, bar in rows:
        least, median = min(slow) / min(fast), float(np.median(slow) / np.median(fast))
        good &= least >= bar
        print(
            f"{name:<58} min {least:9.2f}  median {median:9.2f}   wanted >= {bar:g}  "
            f" {'ok' if least >= bar else 'SHORT'}"
        )
    return 0 if good else 1


def main() -> int:
    warnings.simplefilter("ignore")
    case = Case()
    ours, plain = lambda: case.run(case.compiled), lambda: case.run(case.plain)
    rows = []
    if case.in_c is not None:
        expected = [a.copy() for a in case.run_c()]
        assert all(np.array_equal(a, b) for a, b in zip(expected, ours(), strict=True)), (
            "C and compiled loop differ"
        )
        c, o = interleaved(case.run_c, ours, repeats=[200, 200])
        rows.append(("C (gcc -O3) / compiled loop", c, o, 1.0))
    expected = [a.copy() for a in plain()]
    assert all(np.array_equal(a, b) for a, b in zip(expected, ours(), strict=True)), (
        "plain and compiled loop differ"
    )
    p, o = interleaved(plain, ours, repeats=[1, 100])
    rows.append(("plain Python twin / compiled loop", p, o, 40.0))
    second = Case(plant=SECOND)
    o, s = interleaved(ours, lambda: second.run(second.compiled), repeats=[200, 200])
    rows.append(("foptd / tf of order 2 (at most 1.3 times the cost)", o, s, 1.0 / 1.3))
    short, control_run = python_control(1000)
    theirs, mine = control_run(), short.run(short.compiled)
    same = np.abs(theirs[:, :300] - np.array(mine[:2])[:, :300]).max()
    assert same < 1e-9, f"python-control differs by {same} within 300 samples"
    p, o = interleaved(control_run, lambda: short.run(short.compiled), repeats=[1, 300])
    rows.append(("python-control input_output_response / compiled loop", p, o, 10_000.0))
    op = np.clip(50.0 + np.cumsum(np.random.default_rng(0).normal(0.0, 2.0, 2000)), 0.0, 100.0)
    exact = {"S": 5.0, "J": 2.0}
    p, o = interleaved(
        lambda: valve_response("coulomb", op, {**exact, "substep": 1e-4}, 1.0),
        lambda: valve_response("coulomb", op, exact, 1.0),
        repeats=[1, 20],
    )
    rows.append(("a valve with friction in substeps of 0.1 ms / exactly", p, o, 100.0))
    return table(f"one loop of {N} samples", rows)


if __name__ == "__main__":
    sys.exit(main())
