"""Kano 2004, method A: a sticky valve rests for a good part of the time although its command
moves.

Needs: OP with the valve position, or with PV of a flow loop; three periods of a sustained
oscillation.
Parameters: `share_min` (-), least share of time in such intervals; `op_min` (-), least movement of
OP in an interval, as a share of its whole swing. The paper has process-specific values for both and
gives no universal ones; these are set here, between a sine followed with a lag (0.2 of the time)
and a sticky valve (0.6 and more).
Indices: stuck_share in 0..1; stuck_op, mean movement of OP in these intervals, in units of OP.
Rule: stiction when stuck_share > share_min. S is estimated by stuck_op.
Not for: noisy valve positions; PV of a slow process in their place; valves whose S is far below the
swing of OP.
Source: method A of M. Kano, H. Maruta, H. Kugemoto, K. Shimizu (2004), IFAC DYCOPS; own bounds.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.conditioning import drift
from simbench.detectors.signal.standstill import stuck_intervals
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="time in which the valve stands still while OP moves",
    source="Kano et al. 2004, method A",
    needs_mv=True,
    cannot_cope=("undersampled",),
    thresholds={
        "share_min": Threshold(0.35, "-", 0.0, 1.0, "own; the paper has none", "above: stiction"),
        "op_min": Threshold(
            0.25,
            "-",
            0.0,
            1.0,
            "own; the paper has none",
            "OP must move by this share of its swing",
        ),
    },
)


def detect(prepared: Prepared, *, share_min: float, op_min: float) -> Verdict:
    """Judge a record by how long the valve rests while OP moves.

    Parameters
    ----------
    prepared : Prepared
        The record.
    share_min : float
        Least share of time (-).
    op_min : float
        Least movement of OP per interval, as a share of its swing (-).

    Returns
    -------
    Verdict
        `score` is stuck_share.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> op = 50 + np.sin(np.arange(2000) / 20)
    >>> record = LoopRecord(op, op, 1.0, kind="flow")
    >>> detect(Prepared(record), **METHOD.defaults()).verdict
    'no_stiction'
    """
    # The signal that stands for the valve position
    signal, _, note = prepared.valve_position()
    if signal is None:
        return Verdict("kano_a", NO_DECISION, applicable=False, reason=note)

    # Where the valve rests, by a threshold above the noise
    record = prepared.record
    period = prepared.period
    op = prepared.smooth_op()
    swing = float(np.subtract(*np.percentile(op - drift(op, period), [95, 5])))
    _, still, clear = prepared.steady_valve(signal)
    if not clear:
        return Verdict(
            "kano_a", NO_DECISION, reason=f"noise hides whether the valve stands still ({note})"
        )

    # Intervals in which the valve rests while OP moves
    length, moved = stuck_intervals(op, still, period, op_min * swing)
    share = float(length.sum() / record.n)
    if moved.size:
        mean = float(moved.mean())
    else:
        mean = 0.0
    verdict = STICTION if share > share_min else NO_STICTION

    # S is what OP moved in such an interval, in % of travel where the span is known
    S = None
    if verdict == STICTION:
        if record.op_span is None:
            S = mean
        else:
            S = mean * 100.0 / (record.op_span[1] - record.op_span[0])

    # The verdict with both indices
    reason = (
        f"the valve stands still in {share:.0%} of the time while OP moves by {mean:.3g} ({note})"
    )
    return Verdict(
        "kano_a", verdict, share, {"stuck_share": share, "stuck_op": mean}, S=S, reason=reason
    )
