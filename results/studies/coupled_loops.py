"""Two coupled loops, one sticky valve: each gain is changed in turn, and the culprit is the one
whose gain sets the period.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.confirm.expected import Phase, measure
from simbench.confirm.gain_change import (
    LONGEST,
    NUDGES,
    PERIODS,
    gain_factors,
    resolve_lengthened,
    settled_parts,
    shift_of,
)
from simbench.confirm.rig import run_rig
from simbench.detectors.errors import ParameterError
from simbench.scenarios.spec import Loop
from simbench.usage import exit_code

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# change of the period by which a loop's gain is said to set it, for a gain change of 30 to 50 %
# (Choudhury et al. 2005)
SHIFT = 0.10


@dataclass(frozen=True, eq=False)
class Culprit:
    """Which of several coupled loops makes them all oscillate."""

    culprit: int | None  # index of the loop; None when no gain, or more than one, sets the period
    reason: str  # why, in one sentence
    # per loop, its OP before and after the change of its gain
    phases: tuple[tuple[Phase, Phase], ...]
    # per loop, |P2/P1 - 1| after the change of its gain; NaN without an oscillation
    shifts: tuple[float, ...]
    Ts: float  # sampling period (s)
    changed: int  # sample at which the gain changed
    # (loops, loops, n) [i, j]: OP (%) of loop j in the run in which the gain of loop i changed
    op: np.ndarray

    def as_json(self) -> dict[str, Any]:
        """Return the outcome without its signals."""
        shifts = [None if np.isnan(s) else s for s in self.shifts]
        return {"culprit": self.culprit, "shifts": shifts, "reason": self.reason}

    def plot(self) -> Figure:
        """Draw OP of every loop (columns) under a change of every gain (rows)."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9, 4.5), layout="constrained")
        t = np.arange(self.op.shape[2]) * self.Ts
        for i, row in enumerate(figure.subplots(*self.op.shape[:2], sharex=True, squeeze=False)):
            for j, axes in enumerate(row):
                axes.plot(t, self.op[i, j], linewidth=0.9)
                axes.axvline(self.changed * self.Ts, color="0.4", linestyle="--", linewidth=0.8)
                axes.set_title(f"OP {j + 1} (%), Kc {i + 1} changed", fontsize=8, loc="left")
        figure.supxlabel("time (s)", fontsize=9)
        return figure


def find_culprit(
    loops: Sequence[Loop], influence: np.ndarray, factor: float = 0.6, seed: int = 0
) -> Culprit:
    """Change the gain of each coupled loop in a separate run and name the loop that sets the
    period.

    `influence[i, j]`: load (%) at the input of plant i per unit by which PV of loop j is off its
    rest value; `factor`: new Kc over old; loop i takes the seed `seed` + i. An oscillation that
    enters a loop from its neighbour keeps its period when that loop's gain changes (Thornhill et
    al. 2003; the chapter's main use of the gain change). Where several gains move the period, the
    loop whose gain moves it at least twice as far as any other is named. Loops at rest are nudged
    by load steps, as in `gain_change`. ParameterError when fewer than two loops are given, or
    `influence` does not fit them.
    """
    count = len(loops)
    if count < 2 or np.shape(influence) != (count, count):
        raise ParameterError(
            f"coupled loops: {count} loops and influence {np.shape(influence)}; two or more and a"
            " square are needed"
        )
    for nudge in NUDGES:
        moving = _with_nudge(loops, influence, factor, seed, nudge)
        if not np.isnan(moving.shifts).all():
            break
    return moving


def _with_nudge(
    loops: Sequence[Loop], influence: np.ndarray, factor: float, seed: int, nudge: float
) -> Culprit:
    count, Ts = len(loops), loops[0].sampling.Ts
    changed = max(loops[0].sampling.n, 300)
    while True:
        n = int((1 + 1 / min(factor, 1.0)) * changed)  # a slower cycle needs more time
        step = gain_factors(n, changed, factor)
        op = np.empty((count, count, n))
        for i in range(count):
            setups = [resolve_lengthened(loop, seed + j, n, nudge) for j, loop in enumerate(loops)]
            traces = run_rig(
                setups, gain=[step if j == i else None for j in range(count)], influence=influence
            )
            op[i] = [trace.op for trace in traces]
        phases = [_phases(op[i, i], changed, Ts, factor) for i in range(count)]
        short = any(changed * Ts < 1.5 * PERIODS * p.period for pair in phases for p in pair)
        if not short or 2 * n > LONGEST:
            break
        changed *= 2
    shifts = tuple(shift_of(*pair) for pair in phases)
    culprit, reason = _named(shifts)
    return Culprit(culprit, reason, tuple(phases), shifts, Ts, changed, op)


def _phases(op: np.ndarray, changed: int, Ts: float, factor: float) -> tuple[Phase, Phase]:
    first, second = settled_parts(op, changed)
    return measure(first, Ts, 1.0), measure(second, Ts, factor)


def _named(shifts: Sequence[float]) -> tuple[int | None, str]:
    changes = ", ".join(
        f"loop {i + 1}: {'no oscillation' if np.isnan(s) else f'{100 * s:.1f} %'}"
        for i, s in enumerate(shifts)
    )
    known = np.nan_to_num(np.asarray(shifts), nan=0.0)
    first, *rest = np.argsort(-known)
    if np.isnan(shifts).all():
        return None, "the loops have no sustained oscillation to confirm"
    if known[first] <= SHIFT:
        return (
            None,
            f"no gain moves the period ({changes}): the oscillation comes from outside these loops",
        )
    if known[first] < 2 * known[rest[0]]:
        return None, f"more than one gain moves the period ({changes})"
    return int(first), f"the gain of loop {first + 1} sets the period ({changes})"


def drawn_pair(rng: np.random.Generator, sticky: int) -> tuple[list[Loop], np.ndarray]:
    """Draw two flow-like loops that push each other, of which only loop `sticky` has stiction.

    `rng`: of the draw: T 5..20 s, Td/T 0.1..0.5, Kc 0.2..0.5 of the ultimate gain, Ti/T 0.7..1.5,
    J/S 0.2..1, load of either PV on the other plant 0.2..0.6 % per %, noise 0.02.
    """
    loops = []
    for i in range(2):
        T = rng.uniform(5, 20)
        Td = T * rng.uniform(0.1, 0.5)
        Kc = rng.uniform(0.2, 0.5) * (0.5 * np.pi * T / Td)  # about the ultimate gain
        valve = (
            {"model": "choudhury", "S": 5.0, "J": 5.0 * rng.uniform(0.2, 1.0)}
            if i == sticky
            else {"model": "ideal"}
        )
        table = {
            "plant": {"type": "foptd", "K": 1.0, "T": T, "Td": Td},
            "controller": {"type": "PI", "Kc": Kc, "Ti": T * rng.uniform(0.7, 1.5)},
            "valve": valve,
            "noise": {"std": 0.02},
            "sampling": {"Ts": 1.0, "n": 1000},
        }
        loops.append(Loop.from_table(table))
    there, back = rng.uniform(0.2, 0.6, 2)
    return loops, np.array([[0.0, there], [back, 0.0]])


def main() -> None:
    """Name the culprit in random pairs and print how often it was right."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    rng = np.random.default_rng(asked.seed)
    right = 0
    for pair in range(asked.pairs):
        sticky = int(rng.integers(2))
        culprit = find_culprit(*drawn_pair(rng, sticky), seed=pair)
        right += culprit.culprit == sticky
        print(f"pair {pair + 1}: loop {sticky + 1} sticks; {culprit.reason}")
    print(f"culprit named in {right} of {asked.pairs} pairs")


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
