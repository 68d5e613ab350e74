"""Ellipse fit: downstream of a sticky valve PV drawn over OP runs round an ellipse; without it the
points scatter or lie on a line.

Needs: PV and OP, an oscillation; the fit is made to the four most regular cycles, drift and noise
removed.
Parameters: `fitness_low` (-), published; `harmonics` (-), set here: kept of OP and PV; 0, as in the
source: the filter of Procedure 11.3, step 2, about the peak of the bicoherence.
Indices: fitness (share of points within 10 % of the ellipse, 0..1), S_apparent (chord through the
centre along OP).
Rule: fitness >= 0.6: stiction; else none.
Not for: deciding alone. Any oscillation with a phase shift between OP and PV draws an ellipse,
sticky or not; the paper asks for a nonlinearity first (method choudhury). S is the apparent
stiction: a mark of the loop more than the valve's S.
Source: M.A.A.S. Choudhury, S.L. Shah, N.F. Thornhill, D.S. Shook (2006), Control Engineering
Practice 14, 1395-1412; Eq 11.15.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.bicoherence import boundaries, error_bicoherence
from simbench.detectors.signal.conditioning import band_pass
from simbench.detectors.signal.ellipse import fit_ellipse
from simbench.detectors.signal.oscillation import regular_segment
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

_DEAD = 1e-9  # of a signal's range over the record: what moves by less is at rest

METHOD = Method(
    title="ellipse fitted to PV over OP",
    source="Choudhury et al. 2006, Eq 11.15",
    thresholds={
        "fitness_low": Threshold(
            0.6, "-", 0.0, 1.0, "Choudhury 2006", "at or above: the points form an ellipse"
        ),
        "harmonics": Threshold(
            3.0,
            "-",
            0.0,
            1e3,
            "own; 0 in Procedure 11.3, step 2",
            "kept of OP and PV; 0: about the peak",
        ),
    },
    published={"harmonics": 0.0},
)


def detect(prepared: Prepared, *, fitness_low: float, harmonics: float = 3.0) -> Verdict:
    """Judge a record by the ellipse of PV over OP.

    Parameters
    ----------
    prepared : Prepared
        The record.
    fitness_low : float
        Least share of points near the ellipse (-).
    harmonics : float
        Kept of OP and PV, the fundamental and what makes its corners; 0: the filter of Procedure
        11.3 (-).

    Returns
    -------
    Verdict
        `score` is the fitness.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> detect(Prepared(LoopRecord(np.sin(t), np.cos(t), 0.1)), **METHOD.defaults()).verdict
    'stiction'
    """
    # Both signals about the peak of the bicoherence, or with a few harmonics
    record = prepared.record
    period = prepared.period
    if harmonics <= 0.0:
        higher = prepared.share("bicoherence", lambda: error_bicoherence(record.e, period))
        if higher is None:
            return Verdict(
                "ellipse",
                NO_DECISION,
                reason="too short: fewer than twelve cycles of the oscillation",
            )
        op = band_pass(prepared.signal("travel"), *boundaries(higher.peak))
        pv = band_pass(prepared.signal("pv"), *boundaries(higher.peak))
    else:
        op = prepared.band("travel", period / harmonics)
        pv = prepared.band("pv", period / harmonics)
    cut = slice(*regular_segment(op, period, round(4 * period)))

    # of an oscillation that has died out rounding is left, and that depends on the unit
    moves = all(
        np.ptp(x[cut]) > _DEAD * np.ptp(prepared.signal(name))
        for name, x in (("op", op), ("pv", pv))
    )
    if moves:
        ellipse = fit_ellipse(op[cut], pv[cut])
    else:
        ellipse = None

    # How many points lie on the ellipse decides
    if ellipse is None:
        return Verdict(
            "ellipse", NO_STICTION, 0.0, {"fitness": 0.0}, reason="PV over OP is no ellipse"
        )
    fitness = ellipse.fitness(op[cut], pv[cut])
    S = ellipse.apparent_stiction
    indices = {"fitness": fitness, "S_apparent": S}
    if fitness >= fitness_low:
        reason = (
            f"{fitness:.0%} of the points lie on an ellipse; apparent stiction {S:.2g}"
            f" {record.S_unit}"
        )
        return Verdict("ellipse", STICTION, fitness, indices, S=S, reason=reason)
    return Verdict(
        "ellipse",
        NO_STICTION,
        fitness,
        indices,
        reason=f"no clear ellipse: {fitness:.0%} of the points lie on it",
    )
