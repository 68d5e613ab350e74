"""What does a grid give away? How well a loop's label follows from its record without the waveform,
on loops that oscillate; and from what was learned on another grid, where several are named.

The features are those of the reference rows `no_waveform` and `rhythm`: one list each, in
`simbench.bench.score`.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from simbench.bench.execute.settle_group import settled
from simbench.bench.scenario.truth import CYCLED, NO, YES, simulate_with_truth
from simbench.bench.score.no_waveform import (
    EXTREMES,
    FEATURE_SETS,
    FEATURES,
    features_without_waveform,
    folds_of,
    out_of_fold,
)
from simbench.bench.score.rhythm import RHYTHM, rhythm_features
from simbench.bench.statistics import auc
from simbench.detectors.prepared import prepare
from simbench.scenarios.expansion import Grid
from simbench.scenarios.grid import load_grid
from simbench.scenarios.packaged import grid_names
from simbench.usage import exit_code

BALANCE = (0.45, 0.55)  # share of cycling loops
# areas under the ROC curve
MOST_ALONE, MOST_OF_SET, MOST_OF_RHYTHM, MOST_OF_ALL = 0.57, 0.60, 0.56, 0.62
WITH_RHYTHM = {**FEATURE_SETS, "rhythm": RHYTHM}
NAMES, WITHOUT_SHAPE = (*FEATURES, *EXTREMES, *RHYTHM), (*FEATURES, *RHYTHM)
# accuracy of a tree of depth 3 on two features over the share of the more frequent label
MOST_OF_TREE = 0.05
MOST_UNMATCHED = 0.10  # share of the loops that are left out, as their sibling does not cycle
# not own-ground: its healthy loops have no corners and little noise, so that roughness is shape
JUDGED = ("chapter", "ci", "plant", "families")


@dataclass(frozen=True)
class Leak:
    """What a grid gives away."""

    counts: dict[str, int]  # scenarios by `cycled`
    unmatched: int  # loops left out
    oscillating: int  # loops that oscillate and have a clear label
    majority: float  # share of the more frequent label among these
    alone: dict[str, float]  # AUC of each feature
    sets: dict[str, float]  # AUC of each set of features
    together: float  # AUC of all features but the extremes
    # accuracy of the best tree on two features, and their names
    tree: tuple[float, tuple[str, str]]

    @property
    def positives(self) -> float:
        """Share of cycling loops among those with a clear label."""
        return self.counts.get(YES, 0) / max(self.counts.get(YES, 0) + self.counts.get(NO, 0), 1)

    @property
    def problems(self) -> list[str]:
        """What is beyond its limit, one clause each."""
        share = self.unmatched / max(sum(self.counts.values()) + self.unmatched, 1)
        messages = [
            f"AUC {value:.3f} of {name}" for name, value in self.alone.items() if value > MOST_ALONE
        ]
        messages += [
            f"AUC {value:.3f} of the set {name}"
            for name, value in self.sets.items()
            if value > (MOST_OF_RHYTHM if name == "rhythm" else MOST_OF_SET)
        ]
        messages += [f"AUC {self.together:.3f} of all together"] * (self.together > MOST_OF_ALL)
        messages += [f"a tree on {' and '.join(self.tree[1])}"] * (
            self.tree[0] > self.majority + MOST_OF_TREE
        )
        messages += [f"{self.positives:.3f} of the loops cycle"] * (
            not BALANCE[0] <= self.positives <= BALANCE[1]
        )
        return messages + [f"{share:.3f} of the loops are left out"] * (share > MOST_UNMATCHED)

    def as_text(self) -> str:
        """Return one line per set of features, and one per other number."""
        known = ", ".join(f"{answer} {self.counts.get(answer, 0)}" for answer in CYCLED)
        lines = [f"cycled: {known}; left out as unmatched: {self.unmatched}"]
        lines += [
            f"share of loops that cycle {self.positives:.3f} ({BALANCE[0]:.2f} to {BALANCE[1]:.2f})"
        ]
        lines += [
            f"{self.oscillating} loops oscillate; AUC on these (alone at most {MOST_ALONE}, a set"
            f" {MOST_OF_SET:.2f}):"
        ]
        for name, members in {**WITH_RHYTHM, "extremes": EXTREMES}.items():
            whole = f"{self.sets[name]:.3f}" if name in self.sets else "     "
            lines.append(
                f"  {name:17s}{whole}  "
                + ", ".join(f"{member} {self.alone[member]:.3f}" for member in members)
            )
        lines += [f"  all but extremes {self.together:.3f} (at most {MOST_OF_ALL})"]
        best, names = self.tree
        lines += [
            f"best tree of depth 3 on two features: right on {best:.3f} ({' and '.join(names)}), "
            f"at most {self.majority + MOST_OF_TREE:.3f}"
        ]
        return "\n".join(
            [*lines, "; ".join(["LEAKS", *self.problems]) if self.problems else "tells nothing"]
        )


class Seen(NamedTuple):
    """The oscillating loops of a grid that have a clear label, and what was left out."""

    X: np.ndarray  # (n, features) in the order of `NAMES`
    y: np.ndarray  # (n,) whether the valve makes the loop cycle
    groups: np.ndarray  # (n,)
    counts: dict[str, int]  # scenarios by `cycled`
    unmatched: int

    def part(self, of: Sequence[str]) -> np.ndarray:
        """Return some features."""
        return self.X[:, [NAMES.index(name) for name in of]]


def seen(grid: Grid, every: int = 1) -> Seen:
    """Simulate a grid, or every so many-th group of it, and describe its loops without the
    waveform.
    """
    rows, label, groups, counts, planned = [], [], [], Counter(), 0
    for index in range(0, grid.group_count, every):
        planned += grid.size(index)
        for scenario, error in settled(grid.group(index)):
            if error is not None:
                raise ValueError(f"group {index}: {error}")
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            counts[cycled.answer] += 1
            oscillation = prepare(run.record.without_mv()).oscillation
            ranked = scenario.tags.get("ranked") != 0.0
            if oscillation.sustained and ranked and cycled.answer in (YES, NO):
                both = (features_without_waveform, rhythm_features)
                rows.append(np.concatenate([f(run.record, oscillation.period_s) for f in both]))
                label.append(cycled.answer == YES)
                groups.append(index)
    X, y, g = np.array(rows), np.array(label), np.array(groups)
    return Seen(X, y, g, dict(counts), planned - sum(counts.values()))


def leak(of: Seen) -> Leak:
    """Try to tell the labels of a grid's loops without the waveform.

    Gradient boosting and trees, five folds, groups whole, labels `cycled` yes against no. With few
    scenarios the AUC has an error of about 0.58/sqrt(n); not for grids of one loop.
    """

    def auc_of(names: tuple[str, ...]) -> float:
        return auc(out_of_fold(of.part(names), of.y, of.groups), of.y).value

    return Leak(
        of.counts,
        of.unmatched,
        of.y.size,
        max(float(of.y.mean()), 1.0 - float(of.y.mean())),
        {name: auc_of((name,)) for name in NAMES},
        {name: auc_of(members) for name, members in WITH_RHYTHM.items()},
        auc_of(WITHOUT_SHAPE),
        best_tree(of.part(FEATURES), of.y, of.groups),
    )


def learned_elsewhere(grids: Mapping[str, Seen]) -> Iterator[str]:
    """Yield what is learned on one grid and judged on another: AUC, and share of wrong answers."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    for (one, here), (other, there) in permutations(grids.items(), 2):
        told = []
        for what, names in (("rhythm", RHYTHM), ("all but extremes", WITHOUT_SHAPE)):
            model = HistGradientBoostingClassifier(random_state=0).fit(here.part(names), here.y)
            chance = model.predict_proba(there.part(names))[:, 1]
            wrong = float(np.mean((chance > 0.5) != there.y))
            told.append(f"{what} AUC {auc(chance, there.y).value:.3f}, cost {wrong:.3f}")
        yield f"learned on {one}, judged on {other}: {'; '.join(told)}"


def best_tree(
    X: np.ndarray, label: np.ndarray, groups: np.ndarray
) -> tuple[float, tuple[str, str]]:
    """Return the accuracy of the best tree of depth 3 on two of `FEATURES`, judged on other groups
    than it learned on.
    """
    from sklearn.tree import DecisionTreeClassifier

    fold, best = folds_of(groups), (0.0, ("", ""))
    for pair in combinations(range(X.shape[1]), 2):
        right = 0
        for k in np.unique(fold):
            there, here = fold != k, fold == k
            tree = DecisionTreeClassifier(max_depth=3, random_state=0).fit(
                X[there][:, pair], label[there]
            )
            right += int((tree.predict(X[here][:, pair]) == label[here]).sum())
        best = max(best, (right / label.size, (FEATURES[pair[0]], FEATURES[pair[1]])))
    return best


def main(arguments: list[str] | None = None) -> int:
    """Check grids: exit code 1 when one gives its labels away."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.leak", description=__doc__)
    parser.add_argument(
        "grid",
        nargs="*",
        default=JUDGED,
        help=f"names ({', '.join(grid_names())}) or files of grids",
    )
    parser.add_argument("--every", type=int, default=1, help="look at every so many-th group only")
    parser.add_argument("--seed", type=int, help="seed in place of that of the grid")
    chosen = parser.parse_args(arguments)
    bad, grids = 0, {}
    for name in chosen.grid:
        grid = load_grid(name, {} if chosen.seed is None else {"seed": chosen.seed})
        grids[name] = seen(grid, chosen.every)
        result = leak(grids[name])
        print(f"{name}\n{result.as_text()}", flush=True)
        bad += bool(result.problems)
    for line in learned_elsewhere(grids):
        print(line, flush=True)
    return int(bad > 0)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
