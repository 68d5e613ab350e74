"""Singhal & Salsbury 2005: a sticky valve lets the error grow slowly and fall fast, so each half cycle peaks late.

Needs: PV of a self-regulating process under PI, three periods of a sustained oscillation.
Parameters: `margin` (-), how far R must exceed 1 in a clean record, five times the bias of a sine of 50 samples per
period, and `noise` (-), how much of what noise does to R counts; both own, 0 in the source.
Indices: r_area > 0, mean of the areas before over the areas after the peak of the half cycles of the error.
Rule: R = mean(A1 / A2); stiction when R > 1 + delta. delta is the margin or, in noise, what noise does to R: noise lifts
mean(A2 / A1) as much as R, so delta = max(margin, lift), lift = mean(A2 / A1) - 1 + 2 standard errors of both. No
stiction where R is no further above 1 than the lift; between the two the peak is late, but by little: no decision.
Not for: integrating processes (R = 1 with stiction); processes with a long dead time; errors in which noise moves the
peak.
Source: A. Singhal, T.I. Salsbury (2005), Journal of Process Control 15, 371-382 (R > 1 against R <= 1); delta is own.

>>> from detectors.judge import judge
>>> from detectors.record import LoopRecord
>>> import numpy as np
>>> t = np.arange(2000) / 10
>>> judge(LoopRecord(np.cos(t), (t % 6) * np.sign(6 - t % 12), 0.1), ["singhal_salsbury"])[0].verdict
'stiction'
"""

from __future__ import annotations

import numpy as np

from detectors.method import Method, Threshold
from detectors.prepared import Prepared
from detectors.signal.half_cycles import peak_areas
from detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="area before the peak over area after it",
    source="Singhal & Salsbury 2005",
    process=("self-regulating",),
    cannot_cope=("undersampled",),
    thresholds={
        "margin": Threshold(0.25, "-", 0.0, 10.0, "own; the source has 0", "R beyond 1 plus this: stiction"),
        "noise": Threshold(1.0, "-", 0.0, 3.0, "own; the source has 0", "share of what noise does to R that counts"),
    },
    published={"margin": 0.0, "noise": 0.0},
)


def area_ratio(humps: np.ndarray) -> tuple[float, float]:
    """Return R and how far noise alone could have lifted it above 1.

    Parameters
    ----------
    humps : ndarray, shape (m, points)
        Half cycles as positive humps.

    Returns
    -------
    R, noise : float
        mean(A1 / A2); mean(A2 / A1) - 1 and 2 standard errors of both means.

    Notes
    -----
    Not for one or two half cycles.

    Examples
    --------
    >>> t = (np.arange(40) + 0.5) / 40
    >>> round(area_ratio(np.sin(np.pi * t)[None].repeat(4, axis=0))[0], 2)
    1.0
    """
    before, after = peak_areas(humps)
    floor = 1e-3 * (before + after)
    before, after = np.maximum(before, floor), np.maximum(after, floor)
    R, reverse = before / after, after / before
    error = float(R.std() + reverse.std()) / max(len(R) - 1, 1) ** 0.5
    return float(R.mean()), max(float(reverse.mean()) - 1.0, 0.0) + 2.0 * error


def detect(prepared: Prepared, *, margin: float, noise: float = 1.0) -> Verdict:
    """Judge a record by where the half cycles of the error have their peak.

    Parameters
    ----------
    prepared : Prepared
        The record.
    margin : float
        How far R must exceed 1 (-).
    noise : float
        Share of what noise does to R that counts (-).

    Returns
    -------
    Verdict
        `score` is x / (1 + x) with x = R / (1 + delta): above 0.5 = stiction.

    Examples
    --------
    >>> from detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> detect(Prepared(LoopRecord(np.cos(t), np.sin(t), 0.1)), margin=0.25).verdict
    'no_stiction'
    """
    humps = prepared.half_cycles("pv")
    if len(humps) < 4:
        return Verdict("singhal_salsbury", NO_DECISION, reason=f"{len(humps)} half cycles; at least 4 are needed")
    R, lift = area_ratio(humps)
    lift *= noise
    delta = max(margin, lift)
    verdict = STICTION if 1.0 + delta < R else NO_STICTION if R <= 1.0 + lift else NO_DECISION
    relative = R / (1.0 + delta)
    reason = f"R = {R:.2f} against 1 + {delta:.2f} over {len(humps)} half cycles"
    if verdict == NO_DECISION:
        reason += f", above the 1 + {lift:.2f} that noise explains"
    return Verdict("singhal_salsbury", verdict, relative / (1.0 + relative), {"r_area": R}, reason=reason)
