"""Kano 2004, method B: plotted against its command a sticky valve runs round a parallelogram, whose
long sides lie apart by the friction.

Needs: OP with the valve position, or with PV of a flow loop; three periods of a sustained
oscillation.
Parameters: `width_min` (-), least distance of the sides as a share of OP's swing; `still_min` (-),
least share of time on the flat sides. The paper has process-specific values and gives no universal
ones; these are set here.
Indices: width, distance of the two sides along OP over the swing of OP, 0..1; still, share of time
in which the valve does not move, 0..1.
Rule: lines through the samples in which the valve moves up and those in which it moves down, with
one slope; their distance along OP is S - J. Stiction when width > width_min and still > still_min:
a lag alone draws an ellipse, which is wide but has no flat sides.
Not for: J near S, whose parallelogram has no width (no decision when the valve rests all the
same); noisy valve positions; PV of a slow process in their place.
Source: method B of M. Kano, H. Maruta, H. Kugemoto, K. Shimizu (2004), IFAC DYCOPS; own bounds.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.conditioning import drift
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="width of the parallelogram of valve position over OP",
    source="Kano et al. 2004, method B",
    needs_mv=True,
    cannot_cope=("undersampled",),
    thresholds={
        "width_min": Threshold(
            0.25, "-", 0.0, 1.0, "own; the paper has none", "above, with flat sides: stiction"
        ),
        "still_min": Threshold(
            0.35, "-", 0.0, 1.0, "own; the paper has none", "above: the sides are flat"
        ),
    },
)


def side_distance(op: np.ndarray, mv: np.ndarray, moving: np.ndarray) -> float:
    """Return S - J in units of OP, the distance of the lines of upward and downward movement; NaN
    for one direction only.

    The lines OP = a MV + b_up and a MV + b_down share the slope of the geometric mean regression
    within both groups.
    """
    # Samples in which the valve moves up, and down
    step = np.diff(mv, prepend=mv[0])
    least = 1e-9 * float(np.ptp(mv))  # a valve at rest must not move by rounding
    sides = [moving & (step > least), moving & (step < -least)]
    if min(side.sum() for side in sides) < 3:
        return float("nan")

    # The common slope of both sides, about their means
    means = [(op[side].mean(), mv[side].mean()) for side in sides]
    u = np.concatenate([op[side] - mean[0] for side, mean in zip(sides, means, strict=True)])
    v = np.concatenate([mv[side] - mean[1] for side, mean in zip(sides, means, strict=True)])
    if v.std() > 0:
        slope = float(u.std() / v.std())
    else:
        slope = 0.0

    # Their distance along OP
    (up_u, up_v), (down_u, down_v) = means
    return float((up_u - slope * up_v) - (down_u - slope * down_v))


def detect(prepared: Prepared, *, width_min: float, still_min: float) -> Verdict:
    """Judge a record by the parallelogram of valve position over OP.

    Parameters
    ----------
    prepared : Prepared
        The record.
    width_min : float
        Least width as a share of OP's swing (-).
    still_min : float
        Least share of time on the flat sides (-).

    Returns
    -------
    Verdict
        `score` is the width times the share of time on flat sides, root taken; S is S - J, the jump
        being neglected.

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
        return Verdict("kano_b", NO_DECISION, applicable=False, reason=note)

    # Where the valve rests, by a threshold above the noise
    record = prepared.record
    period = prepared.period
    op = prepared.smooth_op()
    swing = float(np.subtract(*np.percentile(op - drift(op, period), [98, 2])))
    clean, still, clear = prepared.steady_valve(signal)
    if not clear:
        return Verdict(
            "kano_b", NO_DECISION, reason=f"noise hides whether the valve stands still ({note})"
        )

    # Distance of the parallelogram's slanted sides, as a share of OP's swing
    distance = side_distance(op, clean, ~still)
    if not np.isfinite(distance) or swing == 0.0:
        return Verdict("kano_b", NO_DECISION, reason="the valve does not move both ways")
    width = float(np.clip(distance / swing, 0.0, 1.0))
    flat = float(still.mean())
    score = float(np.sqrt(width * flat))
    indices = {"width": width, "still": flat}

    # Wide and flat is stiction; flat alone cannot tell
    S = None
    if width > width_min and flat > still_min:
        verdict = STICTION
        shape = "a parallelogram"
        if record.op_span is None:
            S = distance
        else:
            S = distance * 100.0 / (record.op_span[1] - record.op_span[0])
    elif flat > still_min:
        verdict = NO_DECISION
        shape = "flat sides that lie together (J near S, or no stiction)"
    else:
        verdict = NO_STICTION
        shape = "no flat sides"

    # The verdict with both indices
    reason = (
        f"valve position over OP has {shape}: width {width:.2f} of the swing, still in {flat:.0%}"
        f" ({note})"
    )
    return Verdict("kano_b", verdict, score, indices, S=S, reason=reason)
