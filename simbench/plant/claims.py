"""Do trust's claims hold? `python -m simbench.plant.claims FOLDER` asks it about loops of grid `plant` whose truth is known."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from detectors.report import choose_methods
from detectors.verdict import NO_STICTION, STICTION
from scenarios.spec import Part, Scenario
from simbench.bench.statistics import mcnemar, wilson
from simbench.loop.setup import plain_setup
from simbench.loop.simulate import simulate
from simbench.plant.indices import judged
from simbench.plant.learn import TESTING, answers, loops

RUNS = 10  # of the true loop, sticky and healthy each
PLAIN, BURIED = 0.8, 0.3  # found less false alarms by the best method: plainly visible above, buried below
BINS = 4  # of probability, for its calibration


def main(arguments: list[str] | None = None) -> int:
    """Ask trust about simulated loops, run the same loops again and again, and print claims beside what was measured."""
    parser = argparse.ArgumentParser(prog="python -m simbench.plant.claims", description=__doc__)
    parser.add_argument("out", metavar="FOLDER", help="Where the answers are kept; goes on where it stopped.")
    parser.add_argument("-n", type=int, default=40, help="Loops to ask about [40].")
    chosen = parser.parse_args(arguments)
    rows = {row["scenario"]: row for row in answers(Path(chosen.out), chosen.n, TESTING)}
    methods = choose_methods(["all"])
    pairs = [(rows[s.id], measured(s, methods)) for s in loops(chosen.n, TESTING) if s.id in rows]
    print("\n".join([*_claims(pairs, methods), *_probability(pairs), *_visible(pairs), *_chosen(pairs)]))
    return 0


def measured(scenario: Scenario, methods: list[str]) -> dict[str, Any]:
    """Return how often every method calls the true loop stiction, with its own valve and, if that sticks, with a sound one.

    Parameters
    ----------
    scenario : Scenario
    methods : list of str

    Returns
    -------
    dict
        healthy, sticky: dict of method to share, sticky None for a sound loop; S, J (%).
    """
    S, J = max(plain_setup(scenario.loop, 0).bands)
    sound = scenario.loop if S <= 0 else scenario.loop.model_copy(update={"valve": Part(name="ideal")})
    return {
        "S": S, "J": J, "healthy": _shares(sound, scenario.seed, methods),
        "sticky": _shares(scenario.loop, scenario.seed, methods) if S > 0 else None,
    }  # fmt: skip


def _shares(loop: Any, seed: int, methods: list[str]) -> dict[str, float]:
    called = [
        [v.verdict == STICTION for v in judged(simulate(loop, seed + 1000 + i).record.blind(), methods)] for i in range(RUNS)
    ]
    return dict(zip(methods, np.mean(called, axis=0).tolist()))


def _claims(pairs: list[tuple[dict[str, Any], dict[str, Any]]], methods: list[str]) -> list[str]:
    lines = [
        f"{len(pairs)} loops, {RUNS} runs each with and without friction; claimed on twins, then measured on the loop itself"
    ]
    lines.append(f"{'method':<18} {'false alarms':>14} {'off by':>7}   {'power':>14} {'off by':>7}")
    for m in methods:
        said, true = [], []
        power: list[tuple[float, float]] = []
        for row, now in pairs:
            claim = next(r for r in row["answer"]["methods"] if r["method"] == m)
            said.append(claim["false_alarms"])
            true.append(now["healthy"][m])
            if now["sticky"] is not None:
                power.append((_at(claim["power"], now["S"], now["J"]), now["sticky"][m]))
        a, b = np.array(said), np.array(true)
        c = np.array(power).reshape(-1, 2)
        lines.append(
            f"{m:<18} {a.mean():>6.2f} {b.mean():>7.2f} {np.abs(a - b).mean():>7.2f}   "
            f"{c[:, 0].mean():>6.2f} {c[:, 1].mean():>7.2f} {np.abs(c[:, 0] - c[:, 1]).mean():>7.2f}"
        )
    return lines


def _at(cells: list[dict[str, float]], S: float, J: float) -> float:
    """Return the share found in the cell nearest to (S, J) in logarithms."""
    ratio = max(J, 0.05 * S) / S
    return min(cells, key=lambda c: abs(np.log(c["S"] / S)) + abs(np.log(c["J"] / c["S"] / ratio)))["found"]


def _probability(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> list[str]:
    p = np.array([row["answer"]["probability"] for row, _ in pairs])
    sticky = np.array([row["sticky"] for row, _ in pairs])
    lines, error = ["", "probability of stiction: claimed, share sticky, loops"], 0.0
    for i in range(BINS):
        here = (p >= i / BINS) & ((p < (i + 1) / BINS) | (i == BINS - 1))
        if here.any():
            lo, hi = wilson(sticky[here].sum(), here.sum())
            gap = p[here].mean() - sticky[here].mean()
            error += here.mean() * abs(gap)
            lines.append(f"{p[here].mean():.2f}  {sticky[here].mean():.2f} ({lo:.2f} to {hi:.2f})  {here.sum()}")
    brier = float(np.mean((p - sticky) ** 2))
    return [*lines, f"expected calibration error {error:.3f}, Brier score {brier:.3f} (even odds: 0.250)"]


def _visible(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> list[str]:
    counts = {"buried": [0, 0], "plainly visible": [0, 0]}
    for row, now in pairs:
        if now["sticky"] is None:
            continue
        best = max(now["sticky"][m] - now["healthy"][m] for m in now["sticky"])
        kind = "plainly visible" if best >= PLAIN else "buried" if best <= BURIED else None
        if kind is None:
            continue
        seen = row["answer"]["smallest_visible"]
        counts[kind][0] += seen is None or now["S"] < seen["S"]
        counts[kind][1] += 1
    return ["", *(f"said that friction of its size cannot be seen: {k} of {n} {kind} ones" for kind, (k, n) in counts.items())]


def _chosen(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> list[str]:
    right: dict[str, list[bool]] = {}
    picked = []
    for row, _ in pairs:
        said = {r["method"]: _right(r["verdict"], row["sticky"]) for r in row["answer"]["methods"]}
        for m, ok in said.items():
            right.setdefault(m, []).append(ok)
        picked.append(said[row["answer"]["best"]])
    best = max(right, key=lambda m: sum(right[m]))
    lost = sum(a and not b for a, b in zip(right[best], picked))
    won = sum(b and not a for a, b in zip(right[best], picked))
    answer = [(row["answer"]["probability"] > 0.5) == row["sticky"] for row, _ in pairs]
    return [
        "",
        f"right: detector picked per loop {np.mean(picked):.2f}, best overall in hindsight ({best}) {np.mean(right[best]):.2f} "
        f"({won} won, {lost} lost, p = {mcnemar(lost, won):.2f}); probability above one half {np.mean(answer):.2f}",
    ]


def _right(verdict: str, sticky: bool) -> bool:
    return verdict == (STICTION if sticky else NO_STICTION)


if __name__ == "__main__":
    sys.exit(main())
