"""Choudhury 2006, the whole Procedure 11.3: first a nonlinearity in the control error, then an
ellipse of PV over OP.

Needs: PV and OP (SP where it moves), either process type, 12 cycles; with `surrogate` each of at
least 7 samples. All steps see a record resampled to 21 samples a cycle, where it has more: a
segment of 64 samples, the authors', then holds three cycles. Their records have some thousand
samples, of hundreds of cycles: in a shorter one fewer segments are averaged, the bound of NGI
rises, and less is seen.
Parameters: `surrogate` (1 or 0): step 1 asks NPI > 1 in place of the bicoherence; `ngi_low`,
`nli_low` as in bicoherence; `fitness_low` (-); `low`, `high` (cycles per sample): boundaries of the
filter chosen by hand, 0 for those of step 2.
Indices: ngi, nli (or npi), fitness, S_apparent.
Rule: step 1, the error is linear: no stiction (tuning or an outside oscillation); step 2,
zero-phase band-pass around the bicoherence peak; step 3, the most regular of the stretches of 1000
samples gives the period, the most regular one of four periods is taken; step 4, an ellipse with
fitness >= 0.6: stiction, and the chord along OP is the apparent stiction; else another valve
problem. OP moving over more than 25 % of its span is noted: the valve's characteristic may then be
the nonlinearity.
Not for: symmetric cycles, which step 1 does not see, neither by bicoherence nor by surrogates.
Source: M.A.A.S. Choudhury, S.L. Shah, N.F. Thornhill, D.S. Shook (2006), Control Engineering
Practice 14, 1395-1412; Jelali (2013), Procedure 11.3, with its surrogate branch. The boundaries,
max(0.004, f_min - 0.05) and min(0.5, f_max + 0.05) per sample about the peak of the bicoherence,
often need tuning by hand (Manum 2006), which its authors did as well. Samples are those of the
resampled record.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.bicoherence import (
    NGI_LOW,
    NLI_LOW,
    boundaries,
    error_bicoherence,
    resampling_step,
)
from simbench.detectors.signal.conditioning import band_pass, drift, means
from simbench.detectors.signal.ellipse import fit_ellipse
from simbench.detectors.signal.oscillation import oscillations_of
from simbench.detectors.signal.surrogates import nonlinearity_index
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

# % of span; beyond it the valve's characteristic may be the nonlinearity (Choudhury 2004)
_WIDE = 25.0

METHOD = Method(
    title="nonlinearity, then an ellipse of PV over OP",
    source="Choudhury et al. 2006, Procedure 11.3",
    min_samples=256,
    thresholds={
        "surrogate": Threshold(
            0.0, "-", 0.0, 1.0, "Jelali 2013, step 1", "1: surrogates; 0: bicoherence"
        ),
        "ngi_low": Threshold(NGI_LOW, "-", -1.0, 1.0, "Choudhury 2004", "above: non-Gaussian"),
        "nli_low": Threshold(NLI_LOW, "-", -1.0, 1.0, "Choudhury 2004", "above: a pair stands out"),
        "fitness_low": Threshold(
            0.6, "-", 0.0, 1.0, "Choudhury 2006", "at or above: the points form an ellipse"
        ),
        "low": Threshold(
            0.0,
            "1/sample",
            0.0,
            0.5,
            "Procedure 11.3, step 2",
            "lower boundary by hand; 0: from the peak",
        ),
        "high": Threshold(
            0.0,
            "1/sample",
            0.0,
            0.5,
            "Procedure 11.3, step 2",
            "upper boundary by hand; 0: from the peak",
        ),
    },
)


def _most_regular(op: np.ndarray) -> tuple[int, int]:
    """Return the stretch of step 3: the period of the most regular 1000 samples, then the most
    regular four periods.
    """
    length = min(1000, op.size)
    for again in (True, False):
        stretches = op[: op.size // length * length].reshape(-1, length)
        best, oscillation = max(
            enumerate(oscillations_of(stretches)), key=lambda f: f[1].regularity
        )
        start = best * length
        if not (again and length > 4.0 * oscillation.period_s):
            break
        length = round(4.0 * oscillation.period_s)
    return start, start + length


def detect(
    prepared: Prepared,
    *,
    ngi_low: float,
    nli_low: float,
    fitness_low: float,
    surrogate: float = 0.0,
    low: float = 0.0,
    high: float = 0.0,
) -> Verdict:
    """Judge a record by Procedure 11.3.

    Parameters
    ----------
    prepared : Prepared
        The record.
    ngi_low, nli_low : float
        Bounds of step 1, as in bicoherence (-).
    fitness_low : float
        Bound of step 4 (-).
    surrogate : float
        1: step 1 by surrogates.
    low, high : float
        Boundaries of the filter (cycles per sample); 0: about the peak of the bicoherence.

    Returns
    -------
    Verdict
        `score` is the fitness times how clear the nonlinearity is (at most 1); S is the apparent
        stiction.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(4000)
    >>> noise = 0.05 * np.random.default_rng(0).standard_normal(4000)
    >>> record = LoopRecord(np.sin(t / 8) + noise, np.cos(t / 8) + noise, 1.0)
    >>> detect(Prepared(record), **METHOD.defaults()).verdict
    'no_stiction'
    """
    # A bicoherence and a period are needed
    record = prepared.record
    period = prepared.oscillation.period_s / record.Ts
    higher = prepared.share("bicoherence", lambda: error_bicoherence(record.e, period))
    if higher is None:
        return Verdict(
            "choudhury",
            NO_DECISION,
            reason="too short: fewer than twelve cycles of the oscillation",
        )
    if not np.isfinite(period):
        return Verdict(
            "choudhury",
            NO_DECISION,
            reason="no period found in OP or PV: no cycle whose ellipse could be fitted",
        )

    # Nonlinear by surrogates, or by the bicoherence
    if surrogate > 0.5:
        if period < 7 or record.n < 12 * period:
            return Verdict(
                "choudhury", NO_DECISION, reason="surrogates need 12 cycles of at least 7 samples"
            )
        npi = nonlinearity_index(record.e - drift(record.e, period), period).npi
        bent = npi > 1.0
        clear = npi
        indices = {"npi": npi}
        numbers = f"NPI = {npi:.2f}"
    else:
        bent = higher.nonlinear(ngi_low, nli_low)
        clear = higher.height
        indices = {"ngi": higher.ngi, "nli": higher.nli}
        numbers = f"NGI = {higher.ngi:.3f}, NLI = {higher.nli:.3f}"

    # the surrogates name no frequencies: the oscillation's is used
    if surrogate > 0.5:
        around = (1.0 / period, 1.0 / period)
    else:
        around = higher.peak

    # Both signals band-passed about the frequencies that interact
    op = record.op if record.op_percent is None else record.op_percent
    step = resampling_step(period)
    op = means(op, step)
    pv = means(record.pv, step)
    around = (step * around[0], step * around[1])
    low, high = (
        given or ellipse for given, ellipse in zip((low, high), boundaries(around), strict=True)
    )
    op = band_pass(op, low, high)
    pv = band_pass(pv, low, high)

    # The ellipse of the most regular cycles
    cut = slice(*_most_regular(op))
    ellipse = fit_ellipse(op[cut], pv[cut])
    fitness = S = 0.0
    if ellipse is not None:
        fitness = ellipse.fitness(op[cut], pv[cut])
        S = ellipse.apparent_stiction
        indices |= {"fitness": fitness, "S_apparent": S}

    # Linear, nonlinear without an ellipse, or both
    score = fitness * min(max(clear, 0.0), 1.0)
    if not bent:
        reason = f"no nonlinearity seen ({numbers}): tuning or an outside oscillation"
        return Verdict("choudhury", NO_STICTION, score, indices, reason=reason)
    if fitness < fitness_low:
        reason = (
            f"nonlinear ({numbers}), but no ellipse ({fitness:.0%} of the points): another valve"
            " problem"
        )
        return Verdict("choudhury", NO_STICTION, score, indices, reason=reason)

    # A valve that moves over most of its travel may be bent as well
    reason = f"nonlinear ({numbers}) and {fitness:.0%} of the points on an ellipse"
    if record.op_percent is not None and np.ptp(record.op_percent) > _WIDE:
        reason += (
            f"; OP moves over {np.ptp(record.op_percent):.0f} %, so look at the valve's"
            " characteristic as well"
        )
    return Verdict("choudhury", STICTION, score, indices, S=S, reason=reason)
