"""Ratios of interleaved runs by CPU time: many loops abreast against C and against one `simulate` after the other."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from c_loop import build
from perf import interleaved, table

from scenarios.spec import Loop
from simbench.loop import abreast, batch
from simbench.loop.resolve import resolve_loop
from simbench.loop.setup import parts_of
from simbench.loop.simulate import simulate

LOOPS = 256
# samples, and the least ratios: to C, to `simulate`, to `simulate` with runs made of both. Longer records wait for memory
BARS = {1000: (2.5, 8.0, 1.0), 4000: (2.0, 5.5, 0.8)}


def random_loops(noise: float, n: int) -> list[Loop]:
    """Return loops that share nothing but their kind."""
    rng = np.random.default_rng(1)

    def one() -> Loop:
        S = rng.uniform(2.0, 8.0)
        return Loop.from_table({
            "plant": {"type": "foptd", "K": 1, "T": float(rng.uniform(8, 12)), "Td": float(rng.uniform(0.5, 4))},
            "controller": {"type": "PI", "Kc": float(rng.uniform(0.6, 1.2)), "Ti": 10},
            "valve": {"model": "choudhury", "S": S, "J": float(rng.uniform(0, S))},
            "sampling": {"Ts": 1, "n": n},
            "noise": {"std": noise},
            "setpoint": {"value": 50, "steps": [[10, 55]]},
        })  # fmt: skip

    return [one() for _ in range(LOOPS)]


def in_c(loops: list[Loop], outputs: list[np.ndarray]):
    """Return a function that runs the loops in C one after the other, each into its (3, n) output; None without gcc."""
    function, calls, kept = build(), [], []
    if function is None:
        return None
    for loop, out in zip(loops, outputs, strict=True):
        s = resolve_loop(loop, 0)
        parts = parts_of(s)
        process, control, _, _, ((S, J, _),) = parts.numbers
        lag = parts.sampled.delay + 1
        w = np.zeros(loop.sampling.n + lag)
        signals = [s.sp, s.load_in, s.load_out, s.pv_add]
        kept += [*signals, w]
        calls.append([
            loop.sampling.n, lag, *(a.ctypes.data for a in signals), s.op0, w.ctypes.data, *process, control.Kc, control.Ki,
            S, J, *(a.ctypes.data for a in out),
        ])  # fmt: skip

    def run(kept: list = kept) -> None:
        for arguments in calls:
            function(*arguments)

    return run


def kernel_alone(loops: list[Loop]):
    """Return a function that repeats what `simulate_batch` asks of the compiled loop, and nothing else."""
    calls, compiled = [], abreast.compiled

    def noted(*kind):
        function = compiled(*kind)

        def call(*arguments):
            # the scratch arrays are shared between calls: keep what they held
            arguments = tuple(a.copy() if isinstance(a, np.ndarray) and a is not arguments[-1] else a for a in arguments)
            calls.append((function, arguments))
            function(*arguments)

        return call

    abreast.compiled = noted
    try:
        kept = batch.simulate_batch(loops, range(len(loops)))
    finally:
        abreast.compiled = compiled

    def run(kept: batch.Batch = kept) -> None:
        for function, arguments in calls:
            function(*arguments)

    return run


def compare(n: int) -> list[tuple[str, list[float], list[float], float]]:
    """Return a row for each comparison at a record length."""
    quiet, noisy, seeds = random_loops(0.0, n), random_loops(0.1, n), list(range(LOOPS))
    outputs = [np.empty((3, n)) for _ in quiet]
    c, rows, (to_c, to_one, made) = in_c(quiet, outputs), [], BARS[n]
    if c is not None:
        c()
        found = batch.simulate_batch(quiet, seeds)
        assert all(np.array_equal(found.signals(i), out) for i, out in enumerate(outputs)), "C and the batch differ"
        times = interleaved(c, kernel_alone(quiet), repeats=[2, 2])
        rows.append((f"{n} samples: C (-O3 -march=native) / abreast, no noise", *times, to_c))

    def alone() -> list:
        return [simulate(loop, seed) for loop, seed in zip(noisy, seeds)]

    times = interleaved(alone, lambda: batch.simulate_batch(noisy, seeds), repeats=[1, 1])
    rows.append((f"{n} samples: simulate() / simulate_batch(), noise", *times, to_one))
    times = interleaved(alone, lambda: list(batch.simulate_batch(noisy, seeds)), repeats=[1, 1])
    rows.append((f"{n} samples: simulate() / simulate_batch() made runs", *times, made))
    return rows


def main() -> int:
    return table(f"{LOOPS} random loops", [row for n in BARS for row in compare(n)])


if __name__ == "__main__":
    sys.exit(main())
