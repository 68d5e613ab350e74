"""What a ranking owes to two choices of the reader: what no decision costs, and which share of the
loops is sticky.

At a prevalence p a method costs p (missed + w undecided of the cycling loops) + (1 - p) (false
positives + w undecided of the others), where w is the cost of no decision; never to claim stiction
costs p. Rates are those of the oscillating loops of a run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd

WEIGHTS = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0)  # of no decision
PREVALENCES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5)  # shares of sticky loops
EVEN = 0.5  # prevalence at which weights are compared


def costs(rows: pd.DataFrame, weight: float, prevalence: float) -> np.ndarray:
    """Return the cost of each method of a block of a score's table."""
    of_sticky, of_others = _errors(rows, weight)
    return prevalence * of_sticky + (1.0 - prevalence) * of_others


def worth_from(rows: pd.DataFrame, weight: float) -> np.ndarray:
    """Return the prevalence from which on each method costs less than never to claim stiction; NaN
    where none does.
    """
    of_sticky, of_others = _errors(rows, weight)
    gain = 1.0 - of_sticky
    with np.errstate(invalid="ignore"):
        return np.where(gain > 0.0, of_others / (of_others + gain), np.nan)


def as_rows(rows: pd.DataFrame, weight: float) -> list[dict[str, Any]]:
    """Return for each method its costs over weights and prevalences, and the prevalence from which
    it is worth asking, as JSON types.
    """
    by_weight = [costs(rows, w, EVEN) for w in WEIGHTS]
    by_share = [costs(rows, weight, p) for p in PREVALENCES]
    return [
        {
            "method": method,
            "over_weight": [[w, _plain(x[i])] for w, x in zip(WEIGHTS, by_weight, strict=True)],
            "over_prevalence": [
                [p, _plain(x[i])] for p, x in zip(PREVALENCES, by_share, strict=True)
            ],
            "worth_from": _plain(from_),
        }
        for i, (method, from_) in enumerate(zip(rows.method, worth_from(rows, weight), strict=True))
    ]


def _errors(rows: pd.DataFrame, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what a method costs on the cycling loops, and on the others."""
    missed, open_, alarms, others_open = (
        rows[name].to_numpy(float)
        for name in ("missed", "no_decision_positives", "false_positives", "no_decision_negatives")
    )
    return missed + weight * open_, alarms + weight * others_open


def _plain(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
