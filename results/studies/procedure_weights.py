"""What is learned on simulated loops: the weights of the procedure, and the bounds on scores and
log-odds that have no source.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.detectors.evidence import EVIDENCE, IndexWeight
from simbench.detectors.judge import judge_one
from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared, prepare
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

PENALTY = 1 / 3  # on squared weights, in loops: a weight needs support from many
BOUNDED = (
    "hammerstein",
    "stenman",
    "horch_isaksson",
)  # whose score_low and score_high no source gives
_TRIED = 60  # quantiles of the scores that are tried as bounds


def collect(grid: str, seed: int, every: int = 1) -> dict[bool, tuple[np.ndarray, np.ndarray]]:
    """Judge the oscillating loops of a grid and keep the indices that the procedure weighs.

    `seed`: in place of the grid's seed, so that no loop of a benchmark is trained on.

    By integrating: x (loops, indices) as the procedure counts them before weighting, and y,
    cycling.
    """
    content = load_grid(grid, {"seed": seed, "repeats": 1})
    rows: dict[bool, list[tuple[list[float], bool]]] = {False: [], True: []}
    for index in range(0, content.group_count, every):
        for scenario in resolve(content.group(index)):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            prepared = prepare(run.record.without_mv())
            if (
                cycled.answer in ("yes", "no")
                and prepared.oscillation.sustained
                and "saturated" not in prepared.flags
            ):
                case = prepared.integrating
                rows[case].append((centred(prepared, EVIDENCE[case]), cycled.answer == "yes"))
    return {
        case: (np.array([x for x, _ in r]), np.array([y for _, y in r])) for case, r in rows.items()
    }


def scores(
    names: Sequence[str], grid: str, seed: int, every: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    """Return the scores of methods on the oscillating loops of a grid, shape (methods, loops), and
    cycling, shape (loops,).
    """
    content, columns, cycling = load_grid(grid, {"seed": seed, "repeats": 1}), [], []
    modules = [methods.load(name) for name in names]
    for index in range(0, content.group_count, every):
        for scenario in resolve(content.group(index)):
            run, cycled = simulate_with_truth(scenario.loop, scenario.seed)
            prepared = prepare(run.record.without_mv())
            if cycled.answer in ("yes", "no") and prepared.oscillation.sustained:
                asked = zip(names, modules, strict=True)
                columns.append(
                    [judge_one(n, m, prepared, True, m.METHOD.defaults()).score for n, m in asked]
                )
                cycling.append(cycled.answer == "yes")
    return np.array(columns).T, np.array(cycling)


def bound(score: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Return the bound at or above which a loop is called sticky with the least share of errors,
    and that share.

    Both labels count the same. A zone without a decision, at half the cost of an error, is never
    cheaper than one bound.
    """
    known = np.isfinite(score)
    tried = np.unique(np.quantile(score[known], np.linspace(0.0, 1.0, _TRIED)))
    wrong = [
        0.5 * np.mean(score[known & y] < at) + 0.5 * np.mean(score[known & ~y] >= at)
        for at in tried
    ]
    best = int(np.argmin(wrong))
    return float(tried[best]), float(wrong[best])


def centred(prepared: Prepared, evidence: tuple[IndexWeight, ...]) -> list[float]:
    """Return each index, limited to its range, less its neutral value; 0 where the method
    abstains.
    """
    verdicts = {}
    for name in dict.fromkeys(e.method for e in evidence):
        module = methods.load(name)
        verdicts[name] = judge_one(name, module, prepared, True, module.METHOD.defaults())
    return [e.count(verdicts[e.method]) for e in evidence]


def fit(x: np.ndarray, y: np.ndarray) -> tuple[float, np.ndarray]:
    """Return bias and weights (indices,) of the log-odds from centred indices (loops, indices),
    labels equally frequent.
    """
    from sklearn.linear_model import LogisticRegression

    model = LogisticRegression(C=1 / PENALTY, class_weight="balanced").fit(x, y)
    return float(model.intercept_[0]), model.coef_[0]


def main(arguments: list[str] | None = None) -> int:
    """Print the weights that belong into detectors/evidence.py, or the bounds of methods into their
    files.
    """
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.procedure_weights", description=__doc__
    )
    parser.add_argument("--grid", nargs="+", default=["chapter", "plant"])
    parser.add_argument("--seed", type=int, default=111, help="other than the grids' own")
    parser.add_argument("--every", type=int, default=1, help="every so many-th group only")
    parser.add_argument(
        "--bounds",
        nargs="*",
        metavar="METHOD",
        help=f"bounds of scores instead [{', '.join(BOUNDED)}]",
    )
    chosen = parser.parse_args(arguments)
    if chosen.bounds is not None:
        names = chosen.bounds or BOUNDED
        data = [scores(names, grid, chosen.seed, chosen.every) for grid in chosen.grid]
        value, y = (
            np.concatenate([f[0] for f in data], axis=1),
            np.concatenate([f[1] for f in data]),
        )
        for name, score in zip(names, value, strict=True):
            at, wrong = bound(score, y)
            print(
                f"{name}: {y.size} loops, {y.mean():.0%} cycling; score_low and score_high"
                f" {at:.3g}, {wrong:.1%} wrong"
            )
        return 0
    parts = [collect(grid, chosen.seed, chosen.every) for grid in chosen.grid]
    for case in (False, True):
        x, y = (np.concatenate([part[case][i] for part in parts]) for i in (0, 1))
        bias, weights = fit(x, y)
        right = np.mean((x @ weights + bias > 0) == y)
        print(
            f"integrating = {case}: {y.size} loops, {y.mean():.0%} cycling, {right:.1%} right; bias"
            f" {bias:+.2f}"
        )
        for e, w in zip(EVIDENCE[case], weights, strict=True):
            print(f"  {e.method} {e.index}: {w:+.2f}")
        odds = x @ weights + bias
        low, high = np.quantile(odds[y], 0.05), np.quantile(odds[~y], 0.95)
        print(
            f"  1 in 20 healthy loops exceed {high:+.2f}, 1 in 20 cycling ones stay below"
            f" {low:+.2f}"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
