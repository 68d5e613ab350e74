"""Evaluate a travel test that was recorded in a plant; read the controller gain off a record."""

from __future__ import annotations

import numpy as np

from simbench.confirm.rig import Trace
from simbench.confirm.travel import MOVE_SHARE, SIGMAS, TravelTest
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord

# of the variance of OP's increments by a PI controller, from which its gain is read off a record
_EXPLAINED = 0.8
_HELD = 5  # samples for which OP must rest between two steps
_LATE = 0.5  # of a hold counts as settled
# times what noise hides of a valve that follows, up to which a band may be none: PV that has not
# settled shows less of a small step than of the large ones before it. Without this 106 of 300 sound
# valves, recorded in noise or with short holds, were said to stick
_HIDES = 2.0


def controller_gain(record: LoopRecord) -> float | None:
    """Return the controller gain that a record shows, in OP units per PV unit; None when OP is not
    that of a PI controller.

    Least squares of OP's increments on the error's increments and the error.
    """
    steps, error = np.diff(record.op), record.e
    columns = np.column_stack([np.diff(error), error[1:]])
    gains = np.linalg.lstsq(columns, steps, rcond=None)[0]
    left = steps - columns @ gains
    explained = 1.0 - float(left @ left) / max(float(steps @ steps), 1e-300)
    return abs(float(gains[0])) if explained >= _EXPLAINED else None


def travel_recorded(record: LoopRecord) -> TravelTest:
    """Read S and J off the record of a valve travel test.

    Procedure 11.4 (Gerry and Ruel 2001). Steps add up until PV moves; the sum is J when it goes on
    in the direction of the last movement, S when it goes against it. A sum that one step alone
    makes up shows no more than that step: only sums of small steps, up to a third of the largest,
    count.
    """
    op = record.op if record.op_percent is None else record.op_percent
    starts = np.concatenate([[0], np.flatnonzero(np.diff(op)) + 1])
    lengths = np.diff(np.append(starts, op.size))
    starts, lengths = starts[lengths >= _HELD], lengths[lengths >= _HELD]
    if starts.size < 4:
        raise ParameterError(
            f"travel test: OP rests {starts.size} times for {_HELD} samples or more; at least 4 are"
            " needed"
        )
    seen, error = _readings(record, starts, lengths)
    steps = np.diff(op[starts])
    small = float(np.abs(steps).max()) / 3.0
    answer = 0.0  # of PV per % of OP, once the first step has shown it
    sums: dict[bool, float | None] = {True: None, False: None}
    phase, side, total = np.zeros(op.size, dtype=int), 0.0, 0.0
    since, hidden = 0, 0.0
    for k, step in enumerate(steps):
        # with its sign: the valve is where it last moved, however OP wanders before it moves
        # again
        total += step
        change = abs(seen[k + 1] - seen[since])
        noise = SIGMAS * np.sqrt(2.0) * max(error[k + 1], error[since])
        if side != 0.0 and abs(step) <= small and answer > 0.0:
            # of OP, that a valve which follows must go before PV stands out of its noise
            hidden = max(hidden, float(noise / answer))
        if change <= max(noise, MOVE_SHARE * answer * abs(step), 1e-12):
            continue
        if side != 0.0 and abs(step) <= small:
            same = bool(np.sign(total) == side)
            phase[starts[since + 1] : starts[k + 1] + lengths[k + 1]] = 1 if same else 2
            sums[same] = sums[same] if sums[same] is not None else round(abs(float(total)), 9)
        elif side == 0.0 or abs(step) > small:
            answer = change / max(abs(total), abs(step))
        side, total, since = float(np.sign(total)), 0.0, k + 1
    fine = np.abs(steps)[np.abs(steps) <= small]
    increment = float(np.median(fine)) if fine.size else float(np.abs(steps).min())
    return _outcome(
        sums[True],
        sums[False],
        increment,
        float(lengths.min()) * record.Ts,
        phase,
        record,
        hidden,
    )


def _readings(
    record: LoopRecord, starts: np.ndarray, lengths: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """PV's settled mean in every hold, on an integrating process its slope per second, with
    standard errors.
    """
    seen, error = np.empty(starts.size), np.empty(starts.size)
    for k, (start, length) in enumerate(zip(starts, lengths, strict=True)):
        late = record.pv[start + int((1.0 - _LATE) * length) : start + length]
        t = np.arange(late.size) * record.Ts
        line = np.polyfit(t, late, 1)
        sigma = float(np.std(late - np.polyval(line, t)))
        if record.process == "integrating":
            seen[k], error[k] = line[0], sigma * np.sqrt(12.0 / late.size) / (late.size * record.Ts)
        else:
            seen[k], error[k] = late.mean(), sigma / np.sqrt(late.size)
    return seen, error


def _outcome(same, back, increment, wait, phase, record, hidden) -> TravelTest:
    op = record.op if record.op_percent is None else record.op_percent
    sticky = None if back is None else bool(back > 2 * increment + 1e-9)
    if sticky and back <= 2 * increment + _HIDES * hidden:
        sticky = None
    if same is None and back is None:
        reason = (
            "PV did not move on small steps: the record holds no travel test, or noise hides it"
        )
    elif same is None or back is None:
        reason = (
            "the record holds no small steps"
            f" {'in the direction of' if same is None else 'against'} the last movement"
        )
    elif sticky is None:
        reason = (
            f"in this noise, and with holds this short, PV shows no valve that moves by less than"
            f" {hidden:.2g} %: larger steps, or longer holds, are needed"
        )
    else:
        reason = (
            f"the valve sticks: stick band S = {back:.3g} %, slip-jump J = {same:.3g} %"
            if sticky
            else "PV follows small steps both ways"
        )
    mv = np.full(op.size, np.nan) if record.mv is None else record.mv
    return TravelTest(
        same, back, increment, wait, sticky, reason, record.Ts, phase, Trace(op, record.pv, mv)
    )
