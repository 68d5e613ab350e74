"""Surrogate test: a nonlinear cycle predicts itself better than signals with its spectrum but
random phases do.

Needs: the control error, 12 cycles of at least 7 samples.
Parameters: `npi_low` (-), published.
Indices: npi, (mean surrogate error - error) / (3 std); above 1 nonlinear.
Rule: npi > 1: nonlinear, written as "stiction" although the test does not say which element it is;
else linear.
Not for: strict cycles, whose harmonics every surrogate keeps: squares and triangles reach 0.2 to
0.6 here. A verdict "linear" rules nothing out.
Source: N.F. Thornhill (2005), IEEE Trans. Control Systems Technology 13, 434-443; surrogates by
Schreiber & Schmitz (1996).
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.conditioning import drift, snapped
from simbench.detectors.signal.surrogates import nonlinearity_index
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="predictability of the control error against surrogates",
    source="Thornhill 2005",
    role="nonlinearity",
    budget="full",
    min_periods=12.0,
    thresholds={"npi_low": Threshold(1.0, "-", -5.0, 20.0, "Thornhill 2005", "above: nonlinear")},
)


def detect(prepared: Prepared, *, npi_low: float) -> Verdict:
    """Judge whether the loop contains a nonlinearity.

    Parameters
    ----------
    prepared : Prepared
        The record.
    npi_low : float
        Bound of npi (-).

    Returns
    -------
    Verdict
        `score` is npi.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(3000) / 5
    >>> record = LoopRecord(op=np.sin(t), pv=np.cos(t), Ts=1.0)
    >>> detect(Prepared(record), **METHOD.defaults()).verdict
    'no_stiction'
    """
    # The control error without its drift, of cycles with samples enough
    record = prepared.record
    period = prepared.period
    if period < 7:
        return Verdict(
            "surrogate",
            NO_DECISION,
            reason=f"{period:.1f} samples per cycle; at least 7 are needed",
        )
    e = record.e - drift(record.e, period)

    # surrogates of a clean cycle hang on the last digits, and these on the unit of PV
    test = nonlinearity_index(snapped(e / (float(np.ptp(e)) or 1.0)), period)
    nonlinear = test.npi > npi_low

    # A strict cycle can be predicted, as its surrogates can: what is not seen is no proof
    numbers = (
        "nonlinear"
        if nonlinear
        else "no nonlinearity seen, which a strict cycle would not show either"
    )
    return Verdict(
        "surrogate",
        STICTION if nonlinear else NO_STICTION,
        test.npi,
        {"npi": test.npi},
        reason=f"{numbers}: NPI = {test.npi:.2f} over {test.cycles:.0f} cycles",
    )
