"""Is a grid fair? Balance of its positives, and whether its settings alone give the label away."""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass

import numpy as np

from scenarios.grid import Grid, grid_names, load_grid
from scenarios.spec import Scenario
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import CYCLED, NO, YES, simulate_with_truth
from simbench.usage import exit_code

MOST_AUC = 0.55
BALANCE = (0.45, 0.55)
FEATURES = ("noise std", "n", "Ts", "set-point steps", "size of the step", "time of the step", "K", "T")


@dataclass(frozen=True)
class Fairness:
    """What a grid gives away.

    Parameters
    ----------
    counts : dict
        Scenarios by `cycled`.
    positives : float
        Share of yes among yes and no.
    auc : dict of str to float
        Cross-validated AUC of predicting yes from `FEATURES`, by classifier; cells stay whole in "... by cell".
    """

    counts: dict[str, int]
    positives: float
    auc: dict[str, float]

    @property
    def fair(self) -> bool:
        """Balanced, and no classifier better than `MOST_AUC`."""
        return BALANCE[0] <= self.positives <= BALANCE[1] and max(self.auc.values()) <= MOST_AUC

    def as_text(self) -> str:
        """Return one line per number."""
        lines = [f"{answer:10s}{self.counts.get(answer, 0)}" for answer in CYCLED]
        lines += [f"positives {self.positives:.3f} (allowed {BALANCE[0]} to {BALANCE[1]})"]
        lines += [f"AUC {auc:.3f} {name} (at most {MOST_AUC})" for name, auc in self.auc.items()]
        return "\n".join(lines)


def features(scenario: Scenario) -> list[float]:
    """Return what must not tell the label, in the order of `FEATURES`."""
    loop = scenario.loop
    steps = loop.setpoint.steps
    size = steps[0][1] - loop.setpoint.value if steps else 0.0
    small = 1e-9
    return [
        float(np.log10(loop.noise.std + small)),
        float(np.log10(loop.sampling.n)),
        float(np.log10(loop.sampling.Ts)),
        float(len(steps)),
        float(np.sign(size) * np.log10(1.0 + abs(size))),
        float(steps[0][0]) if steps else -1.0,
        float(np.sign(loop.plant.K) * np.log10(1.0 + abs(loop.plant.K))),
        float(np.log10(loop.plant.T or small)),
    ]


def fairness(grid: Grid, every: int = 1) -> Fairness:
    """Simulate a grid, or every so many-th group of it, and try to tell its labels from its settings.

    Parameters
    ----------
    grid : Grid
        The grid.
    every : int
        1 = all groups.

    Returns
    -------
    Fairness

    Notes
    -----
    Gradient boosting and logistic regression, five folds, labels `cycled` yes against no. With few scenarios the AUC has an
    error of about 0.5/sqrt(n); not for grids of one loop.
    """
    X, label, cell, counts = [], [], [], Counter()
    for index in range(0, grid.group_count, every):
        for scenario in resolve(grid.group(index)):
            answer = simulate_with_truth(scenario.loop, scenario.seed)[1].answer
            counts[answer] += 1
            if answer in (YES, NO):
                X.append(features(scenario))
                label.append(answer == YES)
                # scenarios that share every setting make one cell
                cell.append(tuple(X[-1]))
    cell = np.unique(np.array(cell), axis=0, return_inverse=True)[1]
    return Fairness(dict(counts), float(np.mean(label)), predictability(np.array(X), np.array(label), cell))


def predictability(X: np.ndarray, label: np.ndarray, cell: np.ndarray) -> dict[str, float]:
    """Return the cross-validated AUC of two classifiers.

    Parameters
    ----------
    X : ndarray, shape (n, m)
        Settings.
    label : ndarray of bool, shape (n,)
        What they must not tell.
    cell : ndarray of int, shape (n,)
        Rows of one group share a number.

    Returns
    -------
    dict of str to float

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> X, label = rng.normal(size=(200, 2)), rng.random(200) < 0.5
    >>> max(predictability(np.column_stack([X, label]), label, np.arange(200)).values()) > 0.95
    True
    """
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.linear_model import LogisticRegression
    from sklearn.metrics import roc_auc_score
    from sklearn.model_selection import GroupKFold, StratifiedKFold, cross_val_predict
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    models = {
        "gradient boosting": HistGradientBoostingClassifier(max_iter=100, random_state=0),
        "logistic": make_pipeline(StandardScaler(), LogisticRegression()),
    }
    folds = {
        "by scenario": StratifiedKFold(5, shuffle=True, random_state=0),
        "by cell": GroupKFold(5, shuffle=True, random_state=0),
    }
    found = {}
    for name, model in models.items():
        for how, split in folds.items():
            parts = list(split.split(X, label, cell if how == "by cell" else None))
            guess = cross_val_predict(model, X, label, cv=parts, method="predict_proba")[:, 1]
            found[f"{name}, {how}"] = float(roc_auc_score(label, guess))
    return found


def main(arguments: list[str] | None = None) -> int:
    """Check grids: exit code 1 when one is unbalanced or gives its labels away.

    Parameters
    ----------
    arguments : list of str, optional
        In place of sys.argv.

    Returns
    -------
    int
    """
    parser = argparse.ArgumentParser(prog="python -m results.studies.leak", description=__doc__)
    parser.add_argument("grid", nargs="*", default=grid_names(), help="names or files (default: all grids)")
    parser.add_argument("--every", type=int, default=1, help="look at every so many-th group only")
    chosen = parser.parse_args(arguments)
    bad = 0
    for name in chosen.grid:
        found = fairness(load_grid(name), chosen.every)
        print(f"{name}\n{found.as_text()}")
        bad += not found.fair
    return int(bad > 0)


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
