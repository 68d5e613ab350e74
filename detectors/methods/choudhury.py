"""Choudhury 2006, the whole Procedure 11.3: first a nonlinearity in the control error, then an ellipse of PV over OP.

Needs: PV and OP (SP where it moves), either process type, 256 samples.
Parameters: `ngi_low`, `height_low` as in bicoherence; `fitness_low` (-), published; `width_low` (-), own.
Indices: ngi, nli, fitness, S_apparent.
Rule: step 1, bicoherence says linear: no stiction (tuning or an outside oscillation); step 2, zero-phase band-pass around
the bicoherence peak; step 3, the four most regular cycles; step 4, an ellipse with fitness >= 0.6: stiction, and the
chord along OP is the apparent stiction; else another valve problem. OP moving over more than 25 % of its span is said: the
valve's characteristic may then be the nonlinearity.
Not for: symmetric cycles, which step 1 does not see.
Source: M.A.A.S. Choudhury, S.L. Shah, N.F. Thornhill, D.S. Shook (2006), Control Engineering Practice 14, 1395-1412;
Jelali (2013), Procedure 11.3. The published lower filter boundary, max(0.004, f_min - 0.05) per sample, often needs tuning
by hand (Manum 2006); here drift slower than the period goes instead, the upper one is f_max + 0.05 as published.
"""

from __future__ import annotations

import numpy as np

from detectors.method import Method, Threshold
from detectors.prepared import Prepared
from detectors.signal.bicoherence import error_bicoherence
from detectors.signal.ellipse import fit_ellipse
from detectors.signal.oscillation import regular_segment
from detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

WIDE = 25.0  # % of span; beyond it the valve's characteristic may be the nonlinearity (Choudhury 2004)

METHOD = Method(
    title="nonlinearity, then an ellipse of PV over OP",
    source="Choudhury et al. 2006, Procedure 11.3",
    min_samples=256,
    thresholds={
        "ngi_low": Threshold(0.0, "-", -1.0, 1.0, "own, 5 % of linear signals", "above: non-Gaussian"),
        "height_low": Threshold(1.0, "-", 0.0, 20.0, "own, 5 % of linear signals", "above: a pair stands out"),
        "fitness_low": Threshold(0.6, "-", 0.0, 1.0, "Choudhury 2006", "at or above: the points form an ellipse"),
        "width_low": Threshold(0.1, "-", 0.0, 1.0, "own", "chord over OP range; below: a line"),
    },
    exempt={"stiction": "step 1 is blind to a symmetric cycle, which has no even harmonics"},
)


def detect(prepared: Prepared, *, ngi_low: float, height_low: float, fitness_low: float, width_low: float) -> Verdict:
    """Judge a record by Procedure 11.3.

    Parameters
    ----------
    prepared : Prepared
        The record.
    ngi_low, height_low : float
        Bounds of step 1 (-).
    fitness_low, width_low : float
        Bounds of step 4 (-).

    Returns
    -------
    Verdict
        `score` is the fitness times the height of the bicoherence peak (at most 1); S is the apparent stiction.

    Examples
    --------
    >>> from detectors.record import LoopRecord
    >>> t = np.arange(4000)
    >>> noise = 0.05 * np.random.default_rng(0).standard_normal(4000)
    >>> detect(Prepared(LoopRecord(np.sin(t / 8) + noise, np.cos(t / 8) + noise, 1.0)), **METHOD.defaults()).verdict
    'no_stiction'
    """
    record = prepared.record
    period = prepared.oscillation.period_s / record.Ts
    higher = prepared.share("bicoherence", lambda: error_bicoherence(record.e, period))
    if higher is None:
        return Verdict("choudhury", NO_DECISION, reason="too short: fewer than four segments of 64 samples")
    shortest = 1.0 / min(0.5, max(*higher.peak, 1.0 / period) + 0.05)
    op, pv = (prepared.band(name, shortest) for name in ("travel", "pv"))
    cut = slice(*regular_segment(op, period, round(4 * period)))
    found = fit_ellipse(op[cut], pv[cut])
    indices = {"ngi": higher.ngi, "nli": higher.nli}
    fitness = S = 0.0
    if found is not None and found.apparent_stiction >= width_low * float(np.ptp(op[cut])):
        fitness, S = found.fitness(op[cut], pv[cut]), found.apparent_stiction
        indices |= {"fitness": fitness, "S_apparent": S}
    score = fitness * min(higher.height, 1.0)
    if not (higher.ngi > ngi_low and higher.height > height_low):
        reason = f"no nonlinearity seen (NGI = {higher.ngi:.3f}, NLI = {higher.nli:.3f}): tuning or an outside oscillation"
        return Verdict("choudhury", NO_STICTION, score, indices, reason=reason)
    if fitness < fitness_low:
        reason = f"nonlinear (NLI = {higher.nli:.2f}), but no ellipse ({fitness:.0%} of the points): another valve problem"
        return Verdict("choudhury", NO_STICTION, score, indices, reason=reason)
    reason = f"nonlinear (NLI = {higher.nli:.2f}) and {fitness:.0%} of the points on an ellipse"
    if record.op_percent is not None and np.ptp(record.op_percent) > WIDE:
        reason += f"; OP moves over {np.ptp(record.op_percent):.0f} %, so look at the valve's characteristic as well"
    return Verdict("choudhury", STICTION, score, indices, S=S, reason=reason)
