"""Compare two sets of loops by kernel distance, a classifier and single features, each with a
permutation p-value.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_PERMUTATIONS = 499
_ROUNDS = 99  # permutations of the classifier
_BOOTSTRAPS = 200
_FOLDS = 5


@dataclass(frozen=True, eq=False)
class FeatureScaler:
    """How features are made comparable: median and spread of the simulated loops, and the median
    distance of two loops.
    """

    centre: np.ndarray
    spread: np.ndarray
    width: float

    @classmethod
    def of(cls, simulated: np.ndarray, real: np.ndarray) -> FeatureScaler:
        """Return the ruler of two sets, shapes (loops, features)."""
        centre = np.median(simulated, axis=0)
        spread = 1.4826 * np.median(np.abs(simulated - centre), axis=0)
        # a feature that hardly varies in simulation must not drown the others
        spread = np.maximum(spread, np.maximum(0.5 * simulated.std(axis=0), 1e-3))
        z = np.clip((np.vstack([simulated, real]) - centre) / spread, -6, 6)
        apart = np.sqrt(_squares(z, z))
        return cls(centre, spread, float(np.median(apart[np.triu_indices(len(z), 1)])) or 1.0)

    def measured(self, features: np.ndarray) -> np.ndarray:
        """Return features in spreads of the simulation, within +-6."""
        return np.clip((features - self.centre) / self.spread, -6, 6)

    def kernel(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return how alike loops are, 0..1, shape (loops of one, loops of other)."""
        return np.exp(-_squares(self.measured(one), self.measured(other)) / (2 * self.width**2))


def mmd(ruler: FeatureScaler, one: np.ndarray, other: np.ndarray) -> float:
    """Return the maximum mean discrepancy of two sets of loops (Gretton et al. 2012, J. Mach.
    Learn. Res. 13, eq. 3).
    """
    return float(np.sqrt(max(mmd_squared(ruler, one, other), 0.0)))


def mmd_squared(ruler: FeatureScaler, one: np.ndarray, other: np.ndarray) -> float:
    """Return the unbiased estimate that `mmd` is the root of; of two sets alike, one may lie
    further below 0 than the other.
    """
    both = np.vstack([one, other])
    return _squared(ruler.kernel(both, both), np.arange(len(both)) < len(one))


def mmd_test(
    ruler: FeatureScaler, one: np.ndarray, other: np.ndarray, rng: np.random.Generator
) -> dict[str, float]:
    """Return the distance, its 95 % bootstrap interval by loop, and the permutation p-value that
    there is none.
    """
    both = np.vstack([one, other])
    kernel, first = ruler.kernel(both, both), np.arange(len(both)) < len(one)
    value = _mmd(kernel, first)
    shuffled = [_mmd(kernel, rng.permutation(first)) for _ in range(_PERMUTATIONS)]
    again = []
    for _ in range(_BOOTSTRAPS):
        a, b = (
            rng.integers(len(one), size=len(one)),
            len(one) + rng.integers(len(other), size=len(other)),
        )
        pick = np.r_[a, b]
        again.append(_mmd(kernel[np.ix_(pick, pick)], first, twins=pick[:, None] == pick[None, :]))
    lo, hi = np.quantile(again, [0.025, 0.975])
    p = (1 + sum(s >= value for s in shuffled)) / (1 + _PERMUTATIONS)
    return {"value": value, "lo": float(min(lo, value)), "hi": float(max(hi, value)), "p": float(p)}


def classifier_test(
    one: np.ndarray, other: np.ndarray, rng: np.random.Generator
) -> tuple[float, float]:
    """Return how well a shrunken linear discriminant tells two sets apart on loops left out, and
    the permutation p-value.

    Lopez-Paz and Oquab (2017), Revisiting classifier two-sample tests, ICLR.
    """
    x, first = np.vstack([one, other]), np.arange(len(one) + len(other)) < len(one)
    fold = _folds(first, rng)
    value = _auc(x, first, fold)
    shuffled = []
    for _ in range(_ROUNDS):
        label = rng.permutation(first)
        shuffled.append(_auc(x, label, _folds(label, rng)))
    return value, float((1 + sum(s >= value for s in shuffled)) / (1 + _ROUNDS))


def feature_tests(
    ruler: FeatureScaler, names: list[str], simulated: np.ndarray, real: np.ndarray
) -> list[dict[str, float | str]]:
    """Return per feature how far the real loops' median lies from the simulated, and a p-value held
    against all features.
    """
    from scipy.stats import mannwhitneyu

    from simbench.bench.statistics import holm

    shift = np.median(ruler.measured(real), axis=0) - np.median(ruler.measured(simulated), axis=0)
    p = np.array([mannwhitneyu(simulated[:, i], real[:, i]).pvalue for i in range(len(names))])
    rows = [
        {"name": n, "shift": float(s), "p": float(q)}
        for n, s, q in zip(names, shift, holm(np.nan_to_num(p, nan=1.0)))
    ]
    return sorted(rows, key=lambda r: (r["p"], -abs(r["shift"])))


def _squares(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.maximum((a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None, :] - 2 * a @ b.T, 0.0)


def _mmd(kernel: np.ndarray, first: np.ndarray, twins: np.ndarray | None = None) -> float:
    return float(np.sqrt(max(_squared(kernel, first, twins), 0.0)))


def _squared(kernel: np.ndarray, first: np.ndarray, twins: np.ndarray | None = None) -> float:
    # a loop is not compared with itself, nor in a bootstrap with its copy
    k = np.where(np.eye(len(kernel), dtype=bool) if twins is None else twins, 0.0, kernel)
    apart = 1.0 - (np.eye(len(kernel)) if twins is None else twins)
    a, b = first.astype(float), (~first).astype(float)
    within = (a @ k @ a) / max(a @ apart @ a, 1.0) + (b @ k @ b) / max(b @ apart @ b, 1.0)
    return float(within - 2 * (a @ kernel @ b) / (a.sum() * b.sum()))


def _folds(first: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    fold = np.empty(first.size, dtype=int)
    for kind in (True, False):
        here = np.flatnonzero(first == kind)
        fold[here] = rng.permutation(np.arange(here.size) % _FOLDS)
    return fold


def _auc(x: np.ndarray, first: np.ndarray, fold: np.ndarray) -> float:
    out = np.zeros(first.size)
    for i in range(_FOLDS):
        a, b = x[(fold != i) & first], x[(fold != i) & ~first]
        within = np.cov(np.vstack([a - a.mean(axis=0), b - b.mean(axis=0)]).T)
        # half of the covariance is shrunk to its diagonal: there are more features than loops
        within = 0.5 * within + 0.5 * np.diag(np.diag(within)) + 1e-3 * np.eye(x.shape[1])
        w = np.linalg.solve(within, a.mean(axis=0) - b.mean(axis=0))
        out[fold == i] = (x[fold == i] - 0.5 * (a.mean(axis=0) + b.mean(axis=0))) @ w
    difference = np.subtract.outer(out[first], out[~first])
    return float(np.mean((difference > 0) + 0.5 * (difference == 0)))
