"""Is a grid fair? Balance of its positives, and whether settings, sampling and design alone give the label away."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass

import numpy as np

from detectors.prepared import prepare
from scenarios.grid import Grid, grid_names, load_grid
from scenarios.spec import Scenario
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import CYCLED, NO, YES, simulate_with_truth
from simbench.bench.score.folds import BLIND, out_of_fold
from simbench.bench.statistics import auc
from simbench.usage import exit_code

BALANCE = (0.45, 0.55)
MOST_SETTINGS = 0.55
MOST_BLIND = {"plant": 0.62}  # other grids: 0.60
JUDGED = ("chapter", "ci", "own-ground", "plant")
SETTINGS = ("noise std", "n", "set-point steps", "size of the step", "time of the step", "K", "T")


@dataclass(frozen=True)
class Fairness:
    """What a grid gives away."""

    counts: dict[str, int]  # scenarios by `cycled`
    positives: float  # share of yes among yes and no
    settings: float  # AUC of `SETTINGS`, all loops
    blind: float  # AUC of `BLIND`, loops that oscillate
    shape: dict[str, float]  # AUC with regularity and the saturation flag beside them, and of each alone: printed, not judged
    oscillating: int  # loops that oscillate
    most: float = 0.60  # allowed for `blind`

    @property
    def fair(self) -> bool:
        """Balanced, and no classifier better than it may be."""
        return BALANCE[0] <= self.positives <= BALANCE[1] and self.settings <= MOST_SETTINGS and self.blind <= self.most

    def as_text(self) -> str:
        """Return one line per number."""
        lines = [f"{answer:10s}{self.counts.get(answer, 0)}" for answer in CYCLED]
        lines += [f"positives {self.positives:.3f} (allowed {BALANCE[0]} to {BALANCE[1]})"]
        lines += [f"AUC {self.settings:.3f} {', '.join(SETTINGS)} (at most {MOST_SETTINGS})"]
        lines += [f"AUC {self.blind:.3f} {', '.join(BLIND)}; {self.oscillating} that oscillate (at most {self.most})"]
        return "\n".join([*lines, *(f"AUC {value:.3f} {name} (not judged)" for name, value in self.shape.items())])


def settings_of(scenario: Scenario) -> list[float]:
    """Return what must not tell the label of any loop, in the order of `SETTINGS`."""
    loop = scenario.loop
    steps = loop.setpoint.steps
    size = steps[0][1] - loop.setpoint.value if steps else 0.0
    first = steps[0][0] / (loop.sampling.Ts * loop.sampling.n) if steps else -1.0
    return [loop.noise.std, loop.sampling.n, len(steps), size, first, loop.plant.K or 0.0, loop.plant.T or 0.0]


def fairness(grid: Grid, every: int = 1) -> Fairness:
    """Simulate a grid, or every so many-th group of it, and try to tell its labels from what is not a signal.

    Gradient boosting, five folds, groups whole, labels `cycled` yes against no. With few scenarios the AUC has an error of
    about 0.58/sqrt(n); not for grids of one loop.
    """
    settings, blind, shape, label, group, counts = [], [], [], [], [], Counter()
    for index in range(0, grid.group_count, every):
        for scenario in resolve(grid.group(index)):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            counts[cycled.answer] += 1
            if cycled.answer not in (YES, NO):
                continue
            loop, seen = scenario.loop, prepare(run.record.without_mv())
            period = seen.oscillation.period_s if seen.oscillation.sustained else np.nan
            Ts, n = loop.sampling.Ts, loop.sampling.n
            blind.append([period / Ts, n * Ts / period, n, Ts, loop.noise.std, loop.plant.type == "integrating"])
            shape.append([seen.oscillation.regularity, "saturated" in seen.flags])
            settings.append(settings_of(scenario))
            label.append(cycled.answer == YES)
            group.append(index)
    X, more, y, g = np.array(blind, dtype=float), np.array(shape, dtype=float), np.array(label), np.array(group)
    going = np.isfinite(X[:, 0])
    tried = {"regularity": more[:, :1], "saturation flag": more[:, 1:], "all of these": np.column_stack([X, more])}
    return Fairness(
        dict(counts),
        float(np.mean(y)),
        predictability(np.array(settings, dtype=float), y, g),
        predictability(X[going], y[going], g[going]),
        {name: predictability(part[going], y[going], g[going]) for name, part in tried.items()},
        int(going.sum()),
        MOST_BLIND.get(grid.name, Fairness.most),
    )


def predictability(X: np.ndarray, label: np.ndarray, group: np.ndarray) -> float:
    """Return the AUC of a classifier judged on other groups than it learned on."""
    return auc(out_of_fold(X, label, group), label).value


def main(arguments: list[str] | None = None) -> int:
    """Check grids: exit code 1 when one is unbalanced or gives its labels away."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.leak", description=__doc__)
    parser.add_argument("grid", nargs="*", default=JUDGED, help=f"names or files, of {', '.join(grid_names())} or own")
    parser.add_argument("--every", type=int, default=1, help="look at every so many-th group only")
    chosen = parser.parse_args(arguments)
    bad = 0
    for name in chosen.grid:
        found = fairness(load_grid(name), chosen.every)
        print(f"{name}\n{found.as_text()}\n{'fair' if found.fair else 'NOT FAIR'}", flush=True)
        bad += not found.fair
    return int(bad > 0)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
