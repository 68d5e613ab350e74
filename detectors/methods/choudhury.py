"""Choudhury 2006, the whole Procedure 11.3: first a nonlinearity in the control error, then an ellipse of PV over OP.

Needs: PV and OP (SP where it moves), either process type, 256 samples; with `surrogate` 12 cycles of at least 7 samples.
Parameters: `surrogate` (1 or 0): step 1 asks NPI > 1 in place of the bicoherence; `ngi_low`, `height_low`, `calibrated` as in
bicoherence; `boundaries` (1 or 0): step 2 filters as published; `fitness_low` (-), published; `width_low` (-), own.
Indices: ngi, nli (or npi), fitness, S_apparent.
Rule: step 1, the error is linear: no stiction (tuning or an outside oscillation); step 2, zero-phase band-pass around
the bicoherence peak; step 3, the four most regular cycles; step 4, an ellipse with fitness >= 0.6: stiction, and the
chord along OP is the apparent stiction; else another valve problem. OP moving over more than 25 % of its span is said: the
valve's characteristic may then be the nonlinearity.
Not for: symmetric cycles, which step 1 does not see, neither by bicoherence nor by surrogates.
Source: M.A.A.S. Choudhury, S.L. Shah, N.F. Thornhill, D.S. Shook (2006), Control Engineering Practice 14, 1395-1412;
Jelali (2013), Procedure 11.3, with its surrogate branch. The published boundaries, max(0.004, f_min - 0.05) and
min(0.5, f_max + 0.05) per sample about the peak of the bicoherence, often need tuning by hand (Manum 2006); by default drift
slower than the period goes instead, and the upper one is f_max + 0.05 as published.
"""

from __future__ import annotations

import numpy as np

from detectors.method import Method, Threshold
from detectors.prepared import Prepared
from detectors.signal.bicoherence import error_bicoherence
from detectors.signal.conditioning import band_pass, drift
from detectors.signal.ellipse import fit_ellipse
from detectors.signal.oscillation import regular_segment
from detectors.signal.surrogates import nonlinearity_index
from detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

LOWEST, BESIDE = 0.004, 0.05  # cycles per sample: lowest filter boundary, distance of either from the peak
WIDE = 25.0  # % of span; beyond it the valve's characteristic may be the nonlinearity (Choudhury 2004)

METHOD = Method(
    title="nonlinearity, then an ellipse of PV over OP",
    source="Choudhury et al. 2006, Procedure 11.3",
    min_samples=256,
    thresholds={
        "surrogate": Threshold(0.0, "-", 0.0, 1.0, "Jelali 2013, step 1", "1: surrogates; 0: bicoherence"),
        "boundaries": Threshold(0.0, "-", 0.0, 1.0, "own; the source has 1", "1: published filter; 0: drift removed"),
        "ngi_low": Threshold(0.0, "-", -1.0, 1.0, "own, 5 % of linear signals", "above: non-Gaussian"),
        "height_low": Threshold(1.0, "-", 0.0, 20.0, "own, 5 % of linear signals", "above: a pair stands out"),
        "calibrated": Threshold(1.0, "-", 0.0, 1.0, "own; the source has 0", "1: bounds above; 0: NGI > 0.001 and NLI > 0.01"),
        "fitness_low": Threshold(0.6, "-", 0.0, 1.0, "Choudhury 2006", "at or above: the points form an ellipse"),
        "width_low": Threshold(0.1, "-", 0.0, 1.0, "own", "chord over OP range; below: a line"),
    },
    published={"calibrated": 0.0, "boundaries": 1.0, "width_low": 0.0},
    exempt={"stiction": "step 1 is blind to a symmetric cycle, which has no even harmonics"},
)


def detect(
    prepared: Prepared,
    *,
    ngi_low: float,
    height_low: float,
    fitness_low: float,
    width_low: float,
    calibrated: float = 1.0,
    surrogate: float = 0.0,
    boundaries: float = 0.0,
) -> Verdict:
    """Judge a record by Procedure 11.3.

    Parameters
    ----------
    prepared : Prepared
        The record.
    ngi_low, height_low, calibrated : float
        Bounds of step 1, as in bicoherence (-).
    fitness_low, width_low : float
        Bounds of step 4 (-).
    surrogate : float
        1: step 1 by surrogates.
    boundaries : float
        1: step 2 by the published band-pass.

    Returns
    -------
    Verdict
        `score` is the fitness times how clear the nonlinearity is (at most 1); S is the apparent stiction.

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
    if surrogate > 0.5:
        if period < 7 or record.n < 12 * period:
            return Verdict("choudhury", NO_DECISION, reason="surrogates need 12 cycles of at least 7 samples")
        npi = nonlinearity_index(record.e - drift(record.e, period), period).npi
        bent, clear, indices, told = npi > 1.0, npi, {"npi": npi}, f"NPI = {npi:.2f}"
    else:
        bent, clear = higher.nonlinear(ngi_low, height_low, calibrated > 0.5), higher.height
        indices, told = {"ngi": higher.ngi, "nli": higher.nli}, f"NGI = {higher.ngi:.3f}, NLI = {higher.nli:.3f}"
    # the surrogates name no frequencies: the oscillation's stands in
    around = (1.0 / period, 1.0 / period) if surrogate > 0.5 else higher.peak
    op, pv = _filtered(prepared, period, around, boundaries > 0.5)
    cut = slice(*regular_segment(op, period, round(4 * period)))
    found = fit_ellipse(op[cut], pv[cut])
    fitness = S = 0.0
    if found is not None and found.apparent_stiction >= width_low * float(np.ptp(op[cut])):
        fitness, S = found.fitness(op[cut], pv[cut]), found.apparent_stiction
        indices |= {"fitness": fitness, "S_apparent": S}
    score = fitness * min(max(clear, 0.0), 1.0)
    if not bent:
        reason = f"no nonlinearity seen ({told}): tuning or an outside oscillation"
        return Verdict("choudhury", NO_STICTION, score, indices, reason=reason)
    if fitness < fitness_low:
        reason = f"nonlinear ({told}), but no ellipse ({fitness:.0%} of the points): another valve problem"
        return Verdict("choudhury", NO_STICTION, score, indices, reason=reason)
    reason = f"nonlinear ({told}) and {fitness:.0%} of the points on an ellipse"
    if record.op_percent is not None and np.ptp(record.op_percent) > WIDE:
        reason += f"; OP moves over {np.ptp(record.op_percent):.0f} %, so look at the valve's characteristic as well"
    return Verdict("choudhury", STICTION, score, indices, S=S, reason=reason)


def _filtered(prepared: Prepared, period: float, peak: tuple[float, float], published: bool) -> tuple[np.ndarray, np.ndarray]:
    if not published:
        shortest = 1.0 / min(0.5, max(*peak, 1.0 / period) + BESIDE)
        return prepared.band("travel", shortest), prepared.band("pv", shortest)
    record = prepared.record
    op = record.op if record.op_percent is None else record.op_percent
    low, high = max(LOWEST, min(peak) - BESIDE), min(0.5, max(peak) + BESIDE)
    return band_pass(op, low, high), band_pass(record.pv, low, high)
