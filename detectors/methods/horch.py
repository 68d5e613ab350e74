"""Horch 1999: the cross-correlation of OP and PV is odd when the valve sticks, even when the loop
is driven from outside.

Needs: OP and PV of a self-regulating process under PI, three periods of a sustained oscillation.
Parameters: `drho_low`, `drho_high`, `dtau_low`, `dtau_high` (-), from the phase margins pi/6 and
pi/3 of Horch (1999).
Indices: dtau in 0..1 (shift of the function's axis), drho in 0..1 (its height at lag 0 against its
peak).
Rule: stiction when dtau >= 2/3 and drho >= 1/3; no stiction when dtau <= 1/3 and drho <= 0.072;
otherwise, and when the two disagree, no decision (Eqs 11.8 and 11.9).
Not for: integrating processes; loops whose controller is slow or fast against the oscillation,
because for every linear PI loop dtau = (2/pi) atan(1/(w Ti)) whatever the valve does: it measures w
Ti.
Source: A. Horch (1999), Control Engineering Practice 7, 1221-1231; Jelali (2013), Eqs 11.6 to 11.9
(absolute bars restored).
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="odd cross-correlation of OP and PV",
    source="Horch 1999, Eqs 11.6-11.9",
    process=("self-regulating",),
    cannot_cope=("undersampled",),
    thresholds={
        "dtau_low": Threshold(
            1 / 3, "-", 0.0, 1.0, "margin pi/6, Eq 11.9", "at or below: even, no stiction"
        ),
        "dtau_high": Threshold(
            2 / 3, "-", 0.0, 1.0, "margin pi/3, Eq 11.8", "at or above: odd, stiction"
        ),
        "drho_low": Threshold(
            0.0718, "-", 0.0, 1.0, "margin pi/6, Eq 11.9", "at or below: even, no stiction"
        ),
        "drho_high": Threshold(
            1 / 3, "-", 0.0, 1.0, "margin pi/3, Eq 11.8", "at or above: odd, stiction"
        ),
    },
)


def correlation_indices(op: np.ndarray, pv: np.ndarray) -> tuple[float, float]:
    """Return dtau and drho of Eqs 11.6 and 11.7; NaN where the cross-correlation never crosses
    zero, as with drift.
    """
    n = pv.size
    size = 1 << (2 * n).bit_length()
    phi = np.fft.irfft(
        np.fft.rfft(pv - pv.mean(), size) * np.conj(np.fft.rfft(op - op.mean(), size)), size
    )
    right = phi[: n // 2]
    left = np.concatenate([phi[:1], phi[: -(n // 2) : -1]])
    tau_r = _first_crossing(right)
    tau_l = _first_crossing(left)
    if not np.isfinite(tau_l + tau_r):
        return float("nan"), float("nan")
    near = np.concatenate([left[: int(tau_l) + 1], right[: int(tau_r) + 1]])

    # Phi_max carries the sign of Phi_0
    top = np.abs(near).max()
    now = abs(phi[0])
    return float(abs(tau_l - tau_r) / (tau_l + tau_r)), float((top - now) / (top + now))


def detect(
    prepared: Prepared, *, dtau_low: float, dtau_high: float, drho_low: float, drho_high: float
) -> Verdict:
    """Judge a record by the symmetry of its cross-correlation.

    Parameters
    ----------
    prepared : Prepared
        The record.
    dtau_low, dtau_high, drho_low, drho_high : float
        Bounds of the two indices (-).

    Returns
    -------
    Verdict
        `score` is the mean of the two indices, both on the scale of dtau.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(2000) / 10
    >>> detect(Prepared(LoopRecord(np.sin(t), np.cos(t), 0.1)), **METHOD.defaults()).verdict
    'stiction'
    """
    dtau, drho = correlation_indices(prepared.record.op, prepared.record.pv)
    if not np.isfinite(dtau):
        return Verdict(
            "horch", NO_DECISION, reason="the cross-correlation of OP and PV does not cross zero"
        )

    # for a sinusoid both measure one phase: drho = (1 - cos d)/(1 + cos d), dtau = d/(pi/2)
    score = 0.5 * (dtau + 2.0 / np.pi * float(np.arccos((1.0 - drho) / (1.0 + drho))))
    if dtau >= dtau_high and drho >= drho_high:
        verdict = STICTION
        parity = "odd cross-correlation"
    elif dtau <= dtau_low and drho <= drho_low:
        verdict = NO_STICTION
        parity = "even cross-correlation"
    else:
        verdict = NO_DECISION
        parity = "cross-correlation neither odd nor even"
    reason = f"{parity}: dtau = {dtau:.2f}, drho = {drho:.2f}"
    return Verdict("horch", verdict, score, {"dtau": dtau, "drho": drho}, reason=reason)


def _first_crossing(phi: np.ndarray) -> float:
    change = np.flatnonzero((phi[1:] > 0) != (phi[:-1] > 0))
    if change.size == 0:
        return float("nan")
    k = change[0]
    return float(k + phi[k] / (phi[k] - phi[k + 1]))
