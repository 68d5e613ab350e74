"""Stenman 2003: the valve either keeps its place or jumps to where OP is; find the jumps that
explain PV best.

Needs: OP and PV, either process type, four periods of at least 8 samples.
Parameters: `score_low`, `score_high` (-), set here from simulated loops; the paper judges the jumps
by eye.
Indices: gain (error of one-step predictions of PV that the jumps take off, each jump paid for,
0..1), stuck_share (share of samples without a jump, 0..1), jumps_per_period.
Rule: score = gain stuck_share; >= score_high stiction, <= score_low none. The valve is x(k) = (1 -
d(k)) x(k-1) + d(k) u(k) with d = 0 or 1, the plant y(k) = a y(k-1) + b x(k-1-nd) + c; plant and
jumps are estimated in turn, the jumps of each turn exactly, by dynamic programming, with the
penalty s^2 ln(n) / 2 per jump in place of the paper's prior and pruned search.
Not for: valves that slide for long, whose every sample costs a jump; noise on PV beyond a fifth of
it; PV moved from outside.
Source: A. Stenman, F. Gustafsson, K. Forsman (2003), Int. J. Adaptive Control and Signal Processing
17, 625-634.
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.compiled import LANES, compiled, lanes, quick
from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.fits.arx import fit_plant
from simbench.detectors.signal.fits.hammerstein import moving_mean, strongest_segment, swing
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

_SAMPLES = 30  # per period at least, after averaging
_LENGTH = 400  # averaged samples
_ROUNDS = 3
_PRICE = 0.5  # of a jump, in ln(n) times the error variance; set here on simulated loops
_FIRST_GUESSES = (
    0.0,
    0.4,
)  # half widths of the dead band that gives the first guess of the valve, shares of OP's swing

METHOD = Method(
    title="jumps of the valve by segmentation",
    source="Stenman et al. 2003",
    budget="full",
    min_periods=4.0,
    thresholds={
        "score_low": Threshold(
            0.03, "-", 0.0, 1.0, "own, simulated loops", "at or below: a moving valve fits as well"
        ),
        "score_high": Threshold(
            0.03, "-", 0.0, 1.0, "own, simulated loops", "at or above: the valve sticks and jumps"
        ),
    },
)


def best_jumps(u: np.ndarray, r: np.ndarray, penalty: float) -> np.ndarray:
    """Return the x that minimises sum (r - x)^2 + penalty jumps, exactly, where x(k) = x(k-1) or
    u(k): keep the place or jump to OP.
    """
    x = np.empty(u.size)
    compiled(_follow_jumps)(np.ascontiguousarray(u), np.ascontiguousarray(r), float(penalty), x)
    return x


def _follow_jumps(u, r, penalty, x):
    """Fill `x` with the best course; places are compared `LANES` at a time, of equal ones the first
    wins.
    """
    # Room for the lines of all places, of which the lowest is the cheapest course
    n = u.size
    room = (n + LANES - 1) // LANES * LANES
    base = np.full(room, np.inf)
    twice = np.zeros(room)
    square = np.zeros(room)
    origin = np.empty(n, dtype=np.int64)
    least = lanes()
    place = lanes()
    cheapest = 0.0
    last = 0
    R1 = R2 = 0.0
    for j in range(n):
        # cheapest course with a jump at j, without the samples from j on; kept less what j's line
        # adds
        base[j] = cheapest - R2 + 2.0 * u[j] * R1 - j * (u[j] * u[j])
        twice[j] = 2.0 * u[j]
        square[j] = u[j] * u[j]
        origin[j] = last
        R1 += r[j]
        R2 += r[j] * r[j]
        # cheapest course up to sample j + 1, over the place of its last jump
        for c in range(LANES):
            least[c] = np.inf
            place[c] = 0.0
        for first in range(0, j + 1, LANES):
            for c in range(LANES):
                i = np.uintp(first + c)
                end = base[i] - twice[i] * R1 + (j + 1.0) * square[i]
                place[c] = first + c if end < least[c] else place[c]
                least[c] = end if end < least[c] else least[c]

        # The lowest of the lanes, of equal ones the first place
        lowest = least[0]
        at = place[0]
        for c in range(1, LANES):
            if least[c] < lowest or (least[c] == lowest and place[c] < at):
                lowest = least[c]
                at = place[c]
        last = int(at)
        cheapest = lowest + R2 + penalty

    # The course backwards, jump by jump
    stop = n
    while stop > 0:
        for k in range(last, stop):
            x[k] = u[last]
        stop = last
        last = origin[last]


def _first_guess(u, band, x):
    """Fill `x` with Stenman's valve with one parameter."""
    x[0] = u[0]
    for k in range(1, u.size):
        x[k] = u[k] if abs(u[k] - x[k - 1]) > band else x[k - 1]


def detect(prepared: Prepared, *, score_low: float, score_high: float) -> Verdict:
    """Judge a record by the jumps that explain PV.

    Parameters
    ----------
    prepared : Prepared
        The record.
    score_low, score_high : float
        Bounds of the score (-).

    Returns
    -------
    Verdict
        `score` is gain times stuck_share.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> op = 50 + 3 * np.abs((np.arange(900) % 60) / 15 - 2)
    >>> mv = np.repeat(op[::30], 30)
    >>> pv = np.convolve(mv - 53, 0.1 * 0.9 ** np.arange(80))[:900]
    >>> detect(Prepared(LoopRecord(op, pv, 1.0)), **METHOD.defaults()).verdict
    'stiction'
    """
    # Too few samples per cycle hide a jump
    record = prepared.record
    period = prepared.period
    if period < 8:
        return Verdict(
            "stenman", NO_DECISION, reason=f"{period:.1f} samples per cycle; at least 8 are needed"
        )

    # The most regular stretch, averaged to few samples per cycle
    q = max(1, int(period / _SAMPLES))
    start, stop = strongest_segment(
        prepared.searchable("travel"), period, min(record.n, _LENGTH * q)
    )
    n = (stop - start) // q
    op, pv = (
        x[start : start + n * q].reshape(n, q).mean(axis=1)
        for x in map(prepared.searchable, ("travel", "pv"))
    )
    period /= q
    y = pv - moving_mean(pv, max(round(period / 2), 1))

    # OP in units of its swing, PV of its standard deviation
    scale = swing(op, period)
    if not (scale > 0 and y.any()):
        return Verdict("stenman", NO_DECISION, reason="OP or PV stands still in most cycles")
    u = (op - op.mean()) / scale
    y = y / y.std()

    # A linear plant, and the best course of jumps from several first guesses
    delays = range(max(2, round(0.5 * period)))
    linear = fit_plant(u, y, delays)
    best = min((_alternate_fits(u, y, band, delays) for band in _FIRST_GUESSES), key=lambda f: f[0])
    cost, x = best

    # The score: what jumps take off the error, times how long the valve rests
    jumps = int(np.count_nonzero(np.diff(x)))
    gain = max(1.0 - cost / linear[4], 0.0)
    stuck = 1.0 - jumps / (n - 1)
    score = gain * stuck
    indices = {"gain": gain, "stuck_share": stuck, "jumps_per_period": jumps * period / n}
    reason = (
        f"{jumps} jumps in {n / period:.0f} periods take {gain:.0%} off the error; the valve rests"
        f" {stuck:.0%} of the time"
    )
    if score >= score_high:
        return Verdict("stenman", STICTION, score, indices, reason=reason)
    return Verdict(
        "stenman", NO_STICTION if score <= score_low else NO_DECISION, score, indices, reason=reason
    )


def _alternate_fits(
    u: np.ndarray, y: np.ndarray, band: float, delays: range
) -> tuple[float, np.ndarray]:
    """Estimate plant and jumps in turn; returns the error with the jumps' price, and the valve."""
    # The first guess of the valve position
    x = np.empty(u.size)
    quick(_first_guess)(u, band, x)
    best = (np.inf, x)

    # Plant and jumps in turn, as long as the price falls
    for _ in range(_ROUNDS):
        a, b, c, d, error = fit_plant(x, y, delays)
        price = _PRICE * error * np.log(u.size)
        cost = error + price * np.count_nonzero(np.diff(x)) / u.size

        # A plant that does not answer leaves nothing to explain by jumps
        best = min(best, (cost, x), key=lambda f: f[0])
        if abs(b) < 1e-6:
            break
        r = (y[1:] - a * y[:-1] - c) / b
        x = np.concatenate(
            [best_jumps(u[: u.size - 1 - d], r[d:], price / b**2), u[u.size - 1 - d :]]
        )
    return best
