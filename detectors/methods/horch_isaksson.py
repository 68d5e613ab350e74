"""Horch & Isaksson 1998: one model of a resting valve and one of a valve that follows
OP; which explains PV?

Needs: OP and PV, either process type, four periods of at least 8 samples.
Parameters: `score_low`, `score_high` (-), set here from simulated loops; in the source the likelier
model decides, 0.5.
Indices: stuck_share (mean probability that the valve rests, 0..1), evidence (log-likelihood
the two models together gain on the following valve alone, per sample).
Rule: score = stuck_share; >= score_high stiction, <= score_low none. A bank of two Kalman filters
(standing: v(k) = v(k-1); following: v(k) = u(k)) in front of one first-order plant, mixed at every
sample as an interacting multiple model. The paper has a known plant; here it comes from the
Hammerstein fit.
Not for: records from which no plant can be identified; PV moved from outside, which the filter
takes for the valve.
Source: A. Horch, A.J. Isaksson (1998), IFAC Workshop on On-line Fault Detection and Supervision,
Lyon; mixing by Blom & Bar-Shalom (1988), IEEE Trans. Automatic Control 33, 780-783.
"""

from __future__ import annotations

import math

import numpy as np

from simbench.detectors.compiled import compiled, quick
from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.fits.hammerstein import (
    fit_hammerstein,
    moving_mean,
    strongest_segment,
    swing,
)
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

_SAMPLES = 30  # per period at least, after averaging
_LENGTH = 500  # averaged samples
_STAY = 0.95  # probability that the valve goes on doing what it did
LOOSE = 0.02  # std of the valve's position about its model, shares of OP's swing per sample

METHOD = Method(
    title="probability that the valve stands still, by two Kalman filters",
    source="Horch & Isaksson 1998",
    budget="full",
    min_periods=4.0,
    thresholds={
        "score_low": Threshold(
            0.41,
            "-",
            0.0,
            1.0,
            "own; 0.5 in the source",
            "at or below: a following valve fits as well",
        ),
        "score_high": Threshold(
            0.41, "-", 0.0, 1.0, "own; 0.5 in the source", "at or above: it stands still for long"
        ),
    },
    fitted_on=("chapter", "plant"),
    published={"score_low": 0.5, "score_high": 0.5},
)


def two_models(
    u: np.ndarray, y: np.ndarray, a: float, b: float, noise: float, stay: float = _STAY
) -> tuple[np.ndarray, float]:
    """Return the probability (n,) that the valve rests, and the record's log-likelihood, of z(k+1)
    = a z(k) + b v(k) measured as `y`.

    `u` is where the following valve would be; `noise` the measurement's std; `stay` the probability
    of keeping the mode: 1 with a start in "following" is a plain Kalman filter.
    """
    standing = np.empty(u.size)
    total = compiled(_filter_samples)(
        *(np.ascontiguousarray(x, dtype=float) for x in (u, y)), a, b, noise, stay, standing
    )
    return standing, float(total)


def _filter_samples(u, y, a, b, noise, stay, standing):
    """Fill `standing` with the probability that the valve rests; return the log-likelihood of the
    record.
    """
    q = LOOSE**2
    r = noise**2

    # each filter: z, v and the covariances zz, zv, vv; the standing one, then the following one
    one = (y[0], u[0], r, 0.0, 1.0)
    two = (y[0], u[0], r, 0.0, q)
    p_one = 1.0 - stay
    p_two = stay
    total = 0.0

    # Each filter takes the sample, and each mode its probability
    for k in range(u.size):
        one, like_one = _update_filter(one, y[k], r)
        two, like_two = _update_filter(two, y[k], r)
        joint_one = p_one * like_one
        joint_two = p_two * like_two
        total += math.log(joint_one + joint_two)
        p_one = joint_one / (joint_one + joint_two)
        p_two = joint_two / (joint_one + joint_two)
        standing[k] = p_one

        # The modes of the next sample, and what each filter predicts
        ahead_one = p_one * stay + p_two * (1.0 - stay)
        ahead_two = p_two * stay + p_one * (1.0 - stay)
        # what each mode inherits from both
        mixed_one = _mix_filters(one, two, p_one * stay / max(ahead_one, 1e-300))
        mixed_two = _mix_filters(two, one, p_two * stay / max(ahead_two, 1e-300))
        one = _predict_filter(mixed_one, a, b, q)
        two = _predict_filter((mixed_two[0], u[k], mixed_two[2], 0.0, 0.0), a, b, q)
        p_one = ahead_one
        p_two = ahead_two
    return total


def _update_filter(f, y, r):
    """Update one Kalman filter by a measurement; return it with its likelihood."""
    z, v, zz, zv, vv = f
    s = zz + r
    e = y - z
    likelihood = math.exp(max(-0.5 * e * e / s, -300.0)) / math.sqrt(2.0 * math.pi * s)
    return (z + zz / s * e, v + zv / s * e, zz * r / s, zv * r / s, vv - zv * zv / s), likelihood


def _predict_filter(f, a, b, q):
    """Predict one Kalman filter over one sample, with the valve's random movement."""
    z, v, zz, zv, vv = f
    vv = vv + q
    return (a * z + b * v, v, a * a * zz + 2 * a * b * zv + b * b * vv, a * zv + b * vv, vv)


def _mix_filters(one, other, w):
    """Merge two filters into one, the first with weight w."""
    z = w * one[0] + (1 - w) * other[0]
    v = w * one[1] + (1 - w) * other[1]
    dz = one[0] - z
    dv = one[1] - v
    ez = other[0] - z
    ev = other[1] - v
    zz = w * (one[2] + dz * dz) + (1 - w) * (other[2] + ez * ez)
    zv = w * (one[3] + dz * dv) + (1 - w) * (other[3] + ez * ev)
    return (z, v, zz, zv, w * (one[4] + dv * dv) + (1 - w) * (other[4] + ev * ev))


def detect(prepared: Prepared, *, score_low: float, score_high: float) -> Verdict:
    """Judge a record by how probable it is that the valve rests.

    Parameters
    ----------
    prepared : Prepared
        The record.
    score_low, score_high : float
        Bounds of the score (-).

    Returns
    -------
    Verdict
        `score` is stuck_share.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(900) / 8
    >>> noise = 0.02 * np.random.default_rng(0).standard_normal(900)
    >>> op, pv = 50 + np.sin(t), np.sin(t - 2.0) + noise
    >>> detect(Prepared(LoopRecord(op, pv, 1.0)), **METHOD.defaults()).verdict
    'no_stiction'
    """
    # Samples enough in a cycle, and an OP that moves
    record = prepared.record
    period = prepared.period
    if period < 8:
        return Verdict(
            "horch_isaksson",
            NO_DECISION,
            reason=f"{period:.1f} samples per cycle; at least 8 are needed",
        )
    op = prepared.searchable("travel")
    pv = prepared.searchable("pv")
    if record.op_percent is None:
        limits = (-np.inf, np.inf)
    else:
        limits = (0.0, 100.0)
    scale = swing(op, period)
    if scale <= 0:
        return Verdict("horch_isaksson", NO_DECISION, reason="OP stands still in most cycles")

    # The plant, and the stretch with the strongest oscillation
    plant = prepared.share(
        "hammerstein",
        lambda: fit_hammerstein(op, pv, period, prepared.integrating, limits, record.Ts),
    )
    q = max(1, int(period / _SAMPLES))
    start, stop = strongest_segment(op, period, min(record.n, _LENGTH * q))
    n = (stop - start) // q
    u = op[start : start + n * q].reshape(n, q).mean(axis=1)
    y = pv[start : start + n * q].reshape(n, q).mean(axis=1)

    # Both signals about their moving mean, and the pole at this pace
    half = max(round(period / q / 2), 1)
    u = (u - moving_mean(u, half)) / scale
    y = y - moving_mean(y, half)
    y = y / max(float(y.std()), 1e-300)
    if np.isinf(plant.T_s):
        a = 1.0
    else:
        a = math.exp(-q * record.Ts / max(plant.T_s, 1e-3 * record.Ts))

    # the fit gives the dead time to within a sample, and whose half it is shall not hang on the
    # unit of time
    late = round(round(plant.Td_s / record.Ts / q, 6))
    _, b, u = min(
        (_error_of_plant(np.roll(u, d), y, a, half, plant.sign) for d in (late, late + 1)),
        key=lambda f: f[0],
    )

    # Two models against one that always follows
    noise = max(math.sqrt(max(plant.error, 1e-4)), 0.02)
    standing, both = two_models(u, y, a, b, noise)
    following = two_models(u, y, a, b, noise, 1.0)[1]
    evidence = (both - following) / n
    share = float(standing.mean())
    reason = (
        f"the valve stands still {share:.0%} of the time; two models gain {evidence:.2g} per sample"
        " on a following valve"
    )

    # How long the valve stands still decides
    if share >= score_high:
        verdict = STICTION
    elif share <= score_low:
        verdict = NO_STICTION
    else:
        verdict = NO_DECISION
    return Verdict(
        "horch_isaksson",
        verdict,
        share,
        {"stuck_share": share, "evidence": evidence},
        reason=reason,
    )


def _error_of_plant(
    u: np.ndarray, y: np.ndarray, a: float, half: int, sign: float
) -> tuple[float, float, np.ndarray]:
    """Return the squared error of a plant with pole `a` whose response to u is scaled to y, the
    scale, and u.
    """
    x = np.empty(u.size)
    quick(_fill_lag)(u, a, x)
    x -= moving_mean(x, half)
    b = sign * float(y.std() / max(x.std(), 1e-300))
    return float(np.mean((y - b * x) ** 2)), b, u


def _fill_lag(u, a, x):
    """Fill `x` with the response of a first-order lag to `u`."""
    x[0] = 0.0
    for k in range(1, u.size):
        x[k] = a * x[k - 1] + u[k - 1]
