"""Yamashita 2006: a sticky valve rests while OP moves, and then catches up.

Needs: OP with the valve position, or with PV of a flow loop; three periods.
Parameters: `step` (samples) over which a movement is counted, 1 as published, more for records
sampled much faster than the process; `rho3_min` (-), published.
Indices: rho1 in 0..1 (share of movements with OP moving and the valve not), rho2 and rho3 in 0..1
(the same, only where the valve follows afterwards, and without what has nothing to do with
stiction).
Rule: stiction when rho3 > 0.25 (Eq 11.5). rho1 decides nothing: two independent noises have rho1 =
0.41, rho3 = 0.13.
Not for: PV in place of the valve position after a slow process; noise or sampling so fast that
differences are noise; a valve that never rests.
Source: Y. Yamashita (2006), Control Engineering Practice 14, 503-510; Jelali (2013), Eqs 11.3 to
11.5 with the denominator tau_total - tau_SS, which alone reproduces the printed values of loop
PAP2.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.autocorrelation import centred
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="valve stands still while OP moves",
    source="Yamashita 2006, Eqs 11.3-11.5",
    needs_mv=True,
    thresholds={
        "rho3_min": Threshold(0.25, "-", 0.0, 1.0, "Yamashita 2006", "above: stiction"),
        "step": Threshold(
            1, "samples", 1, 1000, "Yamashita 2006", "differences are taken over this many samples"
        ),
    },
)

# a pair of symbols (OP, valve) as 3 OP + valve with D = 0, S = 1, I = 2
IS = 7
DS = 1
SS = 4
# which runs count for Eqs 11.3 to 11.5, by their pair and the pair after them; the last column
# stands for none
_COUNTS = np.zeros((3, 9, 10), dtype=bool)
_COUNTS[0, [IS, DS]] = True
_COUNTS[1, IS, [8, 5]] = _COUNTS[1, DS, [0, 3]] = True  # II, SI and DD, SD: the valve catches up
# W: DD DI SD ID DS and DI SI ID II IS
_COUNTS[2, IS, [0, 2, 3, 6, 1]] = _COUNTS[2, DS, [2, 5, 6, 8, 7]] = True


def movement_indices(op: np.ndarray, mv: np.ndarray, step: int = 1) -> tuple[float, float, float]:
    """Return rho1, rho2 and rho3 of Eqs 11.3 to 11.5, differences taken over `step` samples; NaN
    when nothing moves.
    """
    return pattern_indices(3 * _code_symbols(op, step) + _code_symbols(mv, step))


def pattern_indices(pair: np.ndarray) -> tuple[float, float, float]:
    """Return rho1, rho2 and rho3 of pairs of symbols, 3 OP + valve (0 decreasing, 1 steady, 2
    increasing); NaN when all are SS.
    """
    # Pairs in which anything moves
    pair = pair[pair != SS]
    if pair.size == 0:
        return float("nan"), float("nan"), float("nan")

    # Runs of equal pairs, and what follows each
    start = np.flatnonzero(np.concatenate([[True], pair[1:] != pair[:-1]]))
    length = np.diff(np.append(start, pair.size))
    run = pair[start]
    follower = np.append(pair[start][1:], -1)
    stuck, followed, unrelated = (length[counts[run, follower]].sum() for counts in _COUNTS)

    # Shares of the time
    return (
        float(stuck / pair.size),
        float(followed / pair.size),
        float((stuck - unrelated) / pair.size),
    )


def detect(prepared: Prepared, *, rho3_min: float, step: float) -> Verdict:
    """Judge a record by how OP and the valve move together.

    Parameters
    ----------
    prepared : Prepared
        The record.
    rho3_min : float
        Bound of rho3 (-).
    step : float
        Samples over which a movement is counted.

    Returns
    -------
    Verdict
        `score` is rho3.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> op = 50 + np.arcsin(np.sin(np.arange(1000) / 20))
    >>> mv = np.round(op)
    >>> detect(Prepared(LoopRecord(op, mv, 1.0, kind="flow")), rho3_min=0.25, step=8).verdict
    'stiction'
    """
    signal, _, note = prepared.valve_position()
    if signal is None:
        return Verdict("yamashita", NO_DECISION, applicable=False, reason=note)
    rho1, rho2, rho3 = movement_indices(prepared.record.op, signal, round(step))
    if not np.isfinite(rho3):
        return Verdict("yamashita", NO_DECISION, reason="OP or valve position does not move")
    verdict = STICTION if rho3 > rho3_min else NO_STICTION
    behaviour = "stands still while OP moves, then follows" if rho3 > rho3_min else "follows OP"
    reason = f"the valve {behaviour}: rho3 = {rho3:.2f} ({note})"
    return Verdict(
        "yamashita", verdict, rho3, {"rho1": rho1, "rho2": rho2, "rho3": rho3}, reason=reason
    )


def _code_symbols(x: np.ndarray, step: int) -> np.ndarray:
    """0, 1, 2 for decreasing, steady, increasing."""
    off, std = centred(x[step:] - x[:-step])
    if std > 0:
        z = off / std
    else:
        z = np.zeros(off.size)
    return 1 + (z > 1).astype(int) - (z < -1)
