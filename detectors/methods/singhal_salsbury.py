"""Singhal & Salsbury 2005: a sticky valve lets the error grow slowly and fall fast, so each half
cycle peaks late.

Needs: PV of a self-regulating process under PI, three periods of a sustained oscillation.
Parameters: `R_low` (-), published; `cleaned` (1 or 0), set here, 0 in the source: drift and noise
are taken off first.
Indices: r_area > 0, mean of the areas before over the areas after the peak of the half cycles of
the error.
Rule: R = mean(A1 / A2); R > 1: stiction; else none.
Not for: integrating processes (R = 1 with stiction); processes with a long dead time; errors in
which noise moves the peak: it lifts R above 1 by itself, and a fifth to a quarter of simulated
healthy loops are taken for sticky.
Source: A. Singhal, T.I. Salsbury (2005), Journal of Process Control 15, 371-382.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.half_cycles import peak_areas
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="area before the peak over area after it",
    source="Singhal & Salsbury 2005",
    process=("self-regulating",),
    cannot_cope=("undersampled",),
    thresholds={
        "R_low": Threshold(1.0, "-", 0.0, 10.0, "Singhal & Salsbury 2005", "above: stiction"),
        "cleaned": Threshold(
            1.0, "-", 0.0, 1.0, "own; 0 in the source", "1: drift and noise are taken off first"
        ),
    },
    published={"cleaned": 0.0},
)


def area_ratio(humps: np.ndarray) -> float:
    """Return R, the mean of A1 / A2 over half cycles, positive humps (m, points)."""
    before, after = peak_areas(humps)
    floor = 1e-3 * (before + after)
    return float(np.mean(np.maximum(before, floor) / np.maximum(after, floor)))


def detect(prepared: Prepared, *, R_low: float, cleaned: float = 1.0) -> Verdict:
    """Judge a record by where the half cycles of the error have their peak.

    Parameters
    ----------
    prepared : Prepared
        The record.
    R_low : float
        Bound of R (-).
    cleaned : float
        1: drift and noise are taken off first.

    Returns
    -------
    Verdict
        `score` is x / (1 + x) with x = R / R_low: above 0.5 = stiction.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> detect(Prepared(LoopRecord(np.cos(t), np.sin(t), 0.1)), R_low=1.2).verdict
    'no_stiction'
    """
    humps = prepared.half_cycles("pv", cleaned > 0.5)
    if len(humps) < 4:
        return Verdict(
            "singhal_salsbury",
            NO_DECISION,
            reason=f"{len(humps)} half cycles; at least 4 are needed",
        )
    R = area_ratio(humps)
    verdict = STICTION if R_low < R else NO_STICTION
    reason = f"R = {R:.2f} against {R_low:g} over {len(humps)} half cycles"
    return Verdict("singhal_salsbury", verdict, R / (R_low + R), {"r_area": R}, reason=reason)
