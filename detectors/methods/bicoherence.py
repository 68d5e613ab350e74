"""Bicoherence test: in a loop with a nonlinear element pairs of frequencies drive their sum; in a
linear one they do not.

Needs: the control error (mean PV replaces a set point that was not recorded), either process
type, 256 samples.
Parameters: `ngi_low` (-), `nli_low` (-), published.
Indices: ngi (mean squared bicoherence above that; > 0 non-Gaussian), nli (its peak above mean + 2
std), height (its peak over the bound).
Rule: ngi > ngi_low and nli > nli_low: nonlinear, written as "stiction" although the test does not
say which element it is; else linear.
Not for: symmetric cycles. A cycle with half-wave symmetry has odd harmonics only and looks like
noise; a verdict "linear" rules nothing out.
Source: M.A.A.S. Choudhury, S.L. Shah, N.F. Thornhill (2004), Automatica 40, 1719-1728.
"""

from __future__ import annotations

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.bicoherence import NGI_LOW, NLI_LOW, error_bicoherence
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="quadratic phase coupling in the control error",
    source="Choudhury et al. 2004",
    role="nonlinearity",
    min_samples=256,
    thresholds={
        "ngi_low": Threshold(NGI_LOW, "-", -1.0, 1.0, "Choudhury 2004", "above: non-Gaussian"),
        "nli_low": Threshold(NLI_LOW, "-", -1.0, 1.0, "Choudhury 2004", "above: a pair stands out"),
    },
)


def detect(prepared: Prepared, *, ngi_low: float, nli_low: float) -> Verdict:
    """Judge whether the loop contains a nonlinearity.

    Parameters
    ----------
    prepared : Prepared
        The record.
    ngi_low : float
        Bound of ngi (-).
    nli_low : float
        Bound of nli (-).

    Returns
    -------
    Verdict
        `score` is the height of the peak.

    Examples
    --------
    >>> import numpy as np
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(6000)
    >>> saw = (t % 40) / 40 + 0.1 * np.random.default_rng(0).standard_normal(6000)
    >>> detect(Prepared(LoopRecord(op=saw, pv=saw, Ts=1.0)), **METHOD.defaults()).verdict
    'stiction'
    """
    # The bicoherence of the control error, which the procedure shares
    record = prepared.record
    period = prepared.oscillation.period_s / record.Ts
    test = prepared.share("bicoherence", lambda: error_bicoherence(record.e, period))
    if test is None:
        return Verdict(
            "bicoherence",
            NO_DECISION,
            reason="too short: fewer than twelve cycles of the oscillation",
        )

    # A symmetric cycle has no even harmonics: what is not seen is no proof of a linear loop
    nonlinear = test.nonlinear(ngi_low, nli_low)
    numbers = f"NGI = {test.ngi:.3f}, NLI = {test.nli:.3f}, peak {test.height:.2f} times its bound"
    conclusion = (
        "nonlinear"
        if nonlinear
        else "no nonlinearity seen, which a symmetric cycle would not show either"
    )
    return Verdict(
        "bicoherence",
        STICTION if nonlinear else NO_STICTION,
        test.height,
        {"ngi": test.ngi, "nli": test.nli, "height": test.height},
        reason=f"{conclusion}: {numbers}",
    )
