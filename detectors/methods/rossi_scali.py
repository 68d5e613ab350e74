"""Rossi & Scali 2005: downstream of a sticky valve PV is what a relay would make of the process,
not a sine.

Needs: PV, three periods of a sustained oscillation; both process types (after an integrator the
relay's answer is a triangle).
Parameters: `bound` (-), half width of the uncertain zone, published; `left_out` (-), set here, 0 in
the source.
Indices: eta_rossi in -1..1, from sine to relay.
Rule: eta_rossi = (E_sine - E_relay) / (E_sine + E_relay), errors averaged over the typical nine
tenths of PV's half cycles (Eq 11.14), E_relay the least over the square-wave answers of all
first-order lags, from square to triangle; above 0.21 stiction, below -0.21 no stiction, between no
decision.
Not for: PV of a slow process, whose lags leave a sine of any relay; oscillations that come in from
another sticky loop; it is known for false alarms on distorted waves of any origin.
Source: M. Rossi, C. Scali (2005), Journal of Process Control 15, 505-514; Jelali (2013), Eq 11.14.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.half_cycles import half_sine, misfit, relays, typical_means
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="relay answer against sine, in PV",
    source="Rossi & Scali 2005, Eq 11.14",
    cannot_cope=("undersampled",),
    thresholds={
        "bound": Threshold(
            0.21,
            "-",
            0.0,
            1.0,
            "Rossi & Scali 2005",
            "above: stiction; below its negative: no stiction",
        ),
        "left_out": Threshold(
            0.1,
            "-",
            0.0,
            0.9,
            "own; 0 in Eq 11.14, a mean",
            "share of odd half cycles that do not count",
        ),
    },
    published={"left_out": 0.0},
)


def relay_index(humps: np.ndarray, left_out: float = 0.1) -> float:
    """Return eta_rossi of half cycles, positive humps (m, points): -1 for sines, 1 for triangles,
    squares and what lies between.

    The published triangle is the limit of the relay's answers for a slow process, so it needs no
    separate error.
    """
    points = humps.shape[1]
    sine, relay = typical_means(
        misfit(humps, half_sine(points)), misfit(humps, relays(points)), left_out=left_out
    )
    if sine + relay > 0:
        return (sine - relay) / (sine + relay)
    return 0.0


def detect(prepared: Prepared, *, bound: float, left_out: float = 0.1) -> Verdict:
    """Judge a record by the shape of PV.

    Parameters
    ----------
    prepared : Prepared
        The record.
    bound : float
        Half width of the uncertain zone (-).
    left_out : float
        Share of the half cycles, the odd ones, that does not count (-).

    Returns
    -------
    Verdict
        `score` is (1 + eta_rossi) / 2.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> detect(Prepared(LoopRecord(np.cos(t), np.sin(t), 0.1)), bound=0.21).verdict
    'no_stiction'
    """
    # Half cycles of PV
    humps = prepared.half_cycles("pv", cleaned=False)
    if len(humps) < 4:
        return Verdict(
            "rossi_scali",
            NO_DECISION,
            reason=f"{len(humps)} half cycles in PV; at least 4 are needed",
        )

    # A relay's answer fits better under stiction, a sine without
    index = relay_index(humps, left_out)
    if index > bound:
        verdict = STICTION
        shape = "like a relay's answer"
    elif index < -bound:
        verdict = NO_STICTION
        shape = "like a sine"
    else:
        verdict = NO_DECISION
        shape = "between sine and relay's answer"

    # The verdict with its index
    reason = f"PV is {shape}: eta_rossi = {index:.2f} over {len(humps)} half cycles"
    return Verdict("rossi_scali", verdict, 0.5 + 0.5 * index, {"eta_rossi": index}, reason=reason)
