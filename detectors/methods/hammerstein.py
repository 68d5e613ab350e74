"""Hammerstein: the sticky valve and the linear plant that best turn OP into PV; without stiction a
straight valve does as well.

Needs: OP and PV, either process type, four periods of at least 8 samples. OP in % (or a span) for S
and J in % of travel.
Parameters: `score_low`, `score_high` (-), set here from simulated loops, 0 in the source: there S
alone decides; `S_low` (% of travel), the chapter's 0.5 %; `output_error` (1 or 0), set here: 0, as
in the source, a linear part fitted by one-step errors.
Indices: gain (error a sticky valve takes off that of a straight one, 0..1), share ((S + J) over the
swing of OP: a cycle of the valve alone swings by no more than about S + J), error (unexplained
share of the variance of PV), S_hat, J_hat, T_s (NaN where the plant integrates), Td_s.
Rule: score = gain min(share, 1); >= 0.03 and S >= 0.5 %: stiction; below it: none. S is an interval
around what both maps say, which holds in nine loops of ten; J a number where the record fixes it,
else all values that fit as well, without a level. The valve is Choudhury's map or one that stops
within every sample (He's), whichever explains PV better.
Not for: loops whose PV is moved from outside more than by the valve (error above one half: no
decision); J, wherever the valve only toggles between two positions: J and the gain of the plant
then trade off.
Source: R. Srinivasan, R. Rengaswamy, S. Narasimhan, R. Miller (2005), Ind. Eng. Chem. Res. 44,
6719-6728; M. Jelali (2008), J. Process Control 18, 632-642. Own: an output-error linear part, and
the two ratios that make a verdict of the fit.
"""

from __future__ import annotations

import math

import numpy as np

from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.fits.arx import fit_plant
from simbench.detectors.signal.fits.hammerstein import fit_hammerstein, swing
from simbench.detectors.signal.stiction_map import valve_position
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Level, Verdict

_SAMPLES = 30  # per period at least, after averaging, of the one-step fit
_SHARES = np.arange(1, 11) / 10.0  # of S in OP's swing, tried by it
_JUMPS = np.arange(7) / 4.0  # of J in S
# times what fits S is looked for, so that it holds in nine of ten loops (`results/families.txt`)
_BEYOND = 1.3

METHOD = Method(
    title="sticky valve and linear plant fitted to OP and PV",
    source="Srinivasan et al. 2005b, Jelali 2008",
    min_periods=4.0,
    thresholds={
        "score_low": Threshold(
            0.13,
            "-",
            0.0,
            1.0,
            "own; 0 in Jelali 2008: S decides",
            "at or below: a straight one will do",
        ),
        "score_high": Threshold(
            0.13,
            "-",
            0.0,
            1.0,
            "own; 0 in Jelali 2008: S decides",
            "at or above: a sticky one is needed",
        ),
        "S_low": Threshold(
            0.5, "% of travel", 0.0, 100.0, "chapter, section 11.1", "below: negligible"
        ),
        "output_error": Threshold(
            1.0, "-", 0.0, 1.0, "own; 0 in Jelali 2008, an ARX part", "1: simulation; 0: one-step"
        ),
    },
    fitted_on=("chapter", "plant", "families"),
    stated=("S",),
    published={"output_error": 0.0, "score_low": 0.0, "score_high": 0.0},
)


def interval(best: float, span: tuple[float, float], width: float) -> Level:
    """Return a number where its span is narrower than `width`, else the span."""
    return best if span[1] - span[0] <= width else span


def _one_step(
    op: np.ndarray, pv: np.ndarray, period: float, usual: float
) -> tuple[dict[str, float], str]:
    """Return the S and J whose valve leaves the smallest one-step errors of y(k) = a y(k-1) + b
    v(k-1-nd) + c, on a grid.
    """
    # Averages, so that a cycle has few samples
    q = max(1, int(period / _SAMPLES))
    n = op.size // q
    u = op[: n * q].reshape(n, q).mean(axis=1)
    y = pv[: n * q].reshape(n, q).mean(axis=1)
    delays = range(max(2, round(0.5 * period / q)))

    # Every valve of a small grid with its best plant, and no valve at all
    tried = [(0.0, 0.0)] + [(s * usual, s * j * usual) for s in _SHARES for j in _JUMPS]
    error, S, J = min(
        (fit_plant(valve_position(u, S, J, limits=(-np.inf, np.inf)), y, delays)[4], S, J)
        for S, J in tried
    )

    # How much of the straight line's error the best valve takes off
    straight = fit_plant(u, y, delays)[4]
    if straight > 0.0:
        gain = max(1.0 - error / straight, 0.0)
    else:
        gain = 0.0
    return {
        "gain": gain,
        "share": (S + J) / usual,
        "S_hat": S,
        "J_hat": J,
    }, f"S = {S:.2g}, J = {J:.2g} leave the least errors"


def detect(
    prepared: Prepared,
    *,
    score_low: float,
    score_high: float,
    S_low: float,
    output_error: float = 1.0,
) -> Verdict:
    """Judge a record by whether a sticky valve explains PV better than a straight one.

    Parameters
    ----------
    prepared : Prepared
        The record.
    score_low, score_high : float
        Bounds of the score (-).
    S_low : float
        Smallest S that counts (% of travel; not applied to OP in unknown units).
    output_error : float
        1: the linear part by simulation errors; 0: by one-step errors, on a grid of S and J.

    Returns
    -------
    Verdict
        `score` is gain times share (at most 1).

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> from simbench.detectors.signal.stiction_map import valve_position
    >>> op = 50 + 3 * np.abs((np.arange(1500) % 60) / 15 - 2)
    >>> pv = np.convolve(valve_position(op, 4.0, 1.5) - 50, 0.1 * 0.9 ** np.arange(80))[:1500]
    >>> detect(Prepared(LoopRecord(op, -pv, 1.0)), **METHOD.defaults()).verdict
    'stiction'
    """
    # Samples enough in a cycle, and an OP that moves
    record = prepared.record
    period = prepared.period
    if period < 8:
        return Verdict(
            "hammerstein",
            NO_DECISION,
            reason=f"{period:.1f} samples per cycle; at least 8 are needed",
        )
    op = prepared.searchable("travel")
    pv = prepared.searchable("pv")
    if record.op_percent is None:
        limits = (-np.inf, np.inf)
    else:
        limits = (0.0, 100.0)
    usual = swing(op, period)
    if usual <= 0.0:
        return Verdict("hammerstein", NO_DECISION, reason="OP stands still in most cycles")

    # By one-step errors, on a grid
    if output_error <= 0.5:
        indices, fit = _one_step(op, pv, period, usual)
        S = indices["S_hat"]
        score = indices["gain"] * min(indices["share"], 1.0)
        sticks = S >= (S_low if record.op_percent is not None else 1e-9) and score >= score_high
        return Verdict(
            "hammerstein",
            STICTION if sticks else NO_STICTION,
            score,
            indices,
            S=S if sticks else None,
            reason=fit,
        )

    # By simulation errors: what the sticky valve gains on a straight one
    model = prepared.share(
        "hammerstein",
        lambda: fit_hammerstein(op, pv, period, prepared.integrating, limits, record.Ts),
    )
    if model.error_linear > 1e-6:
        gain = max(1.0 - model.error / max(model.error_linear, 1e-12), 0.0)
    else:
        gain = 0.0
    share = (model.S + model.J) / usual
    score = gain * min(share, 1.0)
    indices = {
        "gain": gain,
        "share": share,
        "error": model.error,
        "S_hat": model.S,
        "J_hat": model.J,
    }

    # an integrating plant has no time constant
    T_s = model.T_s if math.isfinite(model.T_s) else math.nan
    indices |= {"T_s": T_s, "Td_s": model.Td_s}

    # A loop that is moved from outside, a band that is negligible, or a gain that decides
    if model.error > 0.5:
        reason = (
            f"valve and plant explain only {1 - model.error:.0%} of PV: it is moved from outside"
        )
        return Verdict("hammerstein", NO_DECISION, score, indices, reason=reason)
    fit = (
        f"a sticky valve takes {gain:.0%} off the error of a straight one, S + J = {share:.2g} of"
        " OP's swing"
    )
    if record.op_percent is not None and model.S < S_low:
        return Verdict(
            "hammerstein",
            NO_STICTION,
            score,
            indices,
            reason=f"S = {model.S:.2g} % is negligible; {fit}",
        )

    # The sizes are ranges, as many valves fit about as well
    if score >= score_high:
        lowest, highest = model.S_range
        S = (lowest / _BEYOND, highest * _BEYOND)
        J = interval(model.J, model.J_range, 0.3 * model.S)
        return Verdict("hammerstein", STICTION, score, indices, S=S, J=J, reason=fit)
    verdict = NO_STICTION if score <= score_low else NO_DECISION
    return Verdict("hammerstein", verdict, score, indices, reason=fit)
