"""What a record shows of the law by which its controller computes OP."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy

from simbench.detectors.signal.holds import runs_of


@dataclass(frozen=True, eq=False)
class Law:
    """Result of the controller regression: the best law, what lies between error and OP, and what
    the archive hides.
    """

    residual: float  # robust size of what the best law leaves of OP's changes, over these
    Kc: float  # %/PV unit
    Ti: float  # s
    # between error and OP may lie: limits of OP (%) tighter than its range
    limits: tuple[float, float] | None = None
    gap: float = 0.0  # full width of the error (PV units) in which OP rests
    step: float = 0.0  # of OP's lattice (%)
    tuning: tuple[float, float] | None = None  # another one, as factors of the baseline's Kc and Ti
    # (n,), the PV that the controller must have seen, where it can be recovered
    recovered_pv: np.ndarray | None = None
    reason: str = ""  # why the block cannot be judged
    foreign: str = ""  # why it is another controller
    late: int = 0  # samples by which OP answers late
    averaged: bool = False  # the archive's PV is a mean
    quick: bool = False  # it runs several times in a sample, plainly
    blur: float = 0.0  # what the digits leave uncertain of the recovered PV (PV units)
    # samples that an otherwise exact law does not explain
    strays: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    hidden: float = 0.0  # what an archive that reports by exception may hide of a change of OP (%)

    @property
    def known(self) -> bool:
        """Whether a PI law turns the recorded error into OP."""
        return not (self.reason or self.foreign)

    @property
    def apart(self) -> bool:
        """Whether the archive's PV is not the one that the controller saw, which OP shows."""
        return self.recovered_pv is not None and bool(self.reason)


# --- Regressions of the controller law: on changes of OP, on sums of the error, and with a
# derivative term.

EXACT = 0.03  # residual of dOP, relative to dOP, below which the law is taken as known
_ADDED = 200  # samples over which the errors of the digits add up to no more than a line
FORMS = (1.0, 0.5, 0.0)  # share of the newest error in the integral: backward, trapezoid, forward


class LawFit(NamedTuple):
    """dOP = a e_k + b e_{k-1}, what it and the baseline leave of dOP, and the samples an exact law
    does not explain.
    """

    a: float
    b: float
    residual: float
    base: float
    strays: np.ndarray


def solve_least_squares(X: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the coefficients of least squares."""
    return np.linalg.lstsq(X, y, rcond=None)[0]


def solve_by_majority(X: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the coefficients of least squares over the rows that they explain."""
    beta = solve_least_squares(X, y)
    keep = np.ones(y.size, dtype=bool)
    for _ in range(8):
        off = np.abs(y - X @ beta)
        # trimming, not weighting: where the law holds it holds exactly
        keep, before = off <= max(float(np.quantile(off, 0.7)) * 2.0, 1e-12), keep
        if np.array_equal(keep, before):
            break
        beta = solve_least_squares(X[keep], y[keep])
    return beta


def spread(x: np.ndarray) -> float:
    """Return the standard deviation by the median distance from the median, 0 of nothing."""
    if x.size:
        return 1.4826 * float(np.median(np.abs(x - np.median(x))))
    return 0.0


def about_zero(x: np.ndarray) -> float:
    """Return the standard deviation about 0 by the median size."""
    return 1.4826 * float(np.median(np.abs(x)))


def by_steps(
    du: np.ndarray,
    e: np.ndarray,
    rows: np.ndarray,
    Kc: float,
    Ki: float,
    size: float,
    with_sp_offset: bool,
) -> LawFit:
    """Fit dOP = a e_k + b e_{k-1} (+ c) robustly; the baseline's residual is that of its best
    form.
    """
    X = np.column_stack([e[1:], e[:-1]] + ([np.ones(e.size - 1)] if with_sp_offset else []))[rows]
    y = du[rows]
    bases = [y - X[:, :2] @ np.array([Kc + s * Ki, (1.0 - s) * Ki - Kc]) for s in FORMS]
    if with_sp_offset:
        bases = [b - np.median(b) for b in bases]
    base = min(bases, key=about_zero)
    beta = solve_by_majority(X, y)
    off = y - X @ beta
    left = about_zero(off) / size
    strays = np.flatnonzero(rows)[np.abs(off) > max(0.1, 20 * left) * size] + 1
    return LawFit(float(beta[0]), float(beta[1]), left, about_zero(base) / size, strays)


def by_sums(
    op: np.ndarray, e: np.ndarray, inside: np.ndarray, Kc: float, Ki: float, step: float
) -> LawFit:
    """Fit OP = c + Kc e + Ki sum(e): the law of a coarse output, whose error does not add up.

    After each stay at a limit the sum begins anew: c is another one. The digits of SP and PV add up
    as well, to a line over `_ADDED` samples, which is taken off.
    """
    parts = []
    for a, b in runs_of(inside):
        for k in range(a, b, _ADDED):
            parts.append(slice(k, min(k + _ADDED, b)))
    now, total, out = (
        np.concatenate([scipy.signal.detrend(x[p]) for p in parts if p.stop - p.start >= 5])
        for x in (e, np.cumsum(e), op)
    )
    X = np.column_stack([now, total])
    beta = solve_least_squares(X, out)
    bases = [out - X @ np.array([Kc - (1.0 - s) * Ki, Ki]) for s in FORMS]

    # rounding leaves +-step/2: what exceeds it is not explained
    rests = (out - X @ beta, min(bases, key=about_zero))
    left = (max(float(np.quantile(np.abs(r), 0.98)) / (0.5 * step) - 1.1, 0.0) for r in rests)
    return LawFit(float(beta[0] + beta[1]), float(-beta[0]), *left, np.empty(0, dtype=int))
