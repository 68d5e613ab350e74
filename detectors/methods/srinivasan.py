"""Srinivasan 2005: every cycle of OP and PV is matched with a square, a triangle, a saw-tooth and a
sine; the pair decides.

Needs: OP and PV, six cycles of at least 8 samples.
Parameters: `by_kind` (0 or 1), set here to 0: where the kind of loop is known only its column of
Table 11.2 counts. The label that most cycles carry wins.
Indices: triangle_op, square_pv ... share of the cycles of either signal with each label (0..1),
under the keys op_square, op_triangle, op_sawtooth, op_sine, pv_...
Rule: (OP, PV) listed in Table 11.2: stiction; sine and sine: none; any other pair: no decision.
Shapes of the chapter's table: triangle-square and square-square (flow), triangle-sine (pressure,
temperature), triangle-triangle and parabola-triangle (level; a parabola is labelled sine).
Saw-teeth count as triangles: J > 0 tilts them.
Not for: fewer than 8 samples per cycle; noise of the size of the cycle, which makes every label a
sine.
Source: R. Srinivasan, R. Rengaswamy, R. Miller (2005), Ind. Eng. Chem. Res. 44, 6708-6718; Table
11.2 after Forsman (2000). Dynamic time warping in a band of a tenth of the cycle.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from simbench.detectors.compiled import LANES, compiled, lanes, rows, wide
from simbench.detectors.method import Method, Threshold
from simbench.detectors.prepared import Prepared
from simbench.detectors.signal.oscillation import zero_crossings
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION, Verdict

CYCLE_POINTS = 40  # samples per resampled cycle
_BAND = CYCLE_POINTS // 10  # of the warping, samples
_CYCLES = 40  # at most, spread over the record
_HARMONICS = 9.0
_GUARD = 0.25  # a crossing counts when the signal then passes this many standard deviations
SHAPES = ("square", "triangle", "sawtooth", "sine")
# Table 11.2 (OP, PV); a level loop's parabolic OP is nearest to the sine
FAST = {("triangle", "square"), ("square", "square")}
SLOW = {("triangle", "sine")}
_LEVEL = {("triangle", "triangle"), ("sine", "triangle")}
COLUMNS = {"flow": FAST, "pressure": SLOW, "temperature": SLOW}

METHOD = Method(
    title="shape of every cycle by dynamic time warping",
    source="Srinivasan et al. 2005, Table 11.2",
    min_periods=6.0,
    thresholds={
        "by_kind": Threshold(
            0.0, "-", 0.0, 1.0, "own; 1 in Table 11.2", "1: only the column of a known kind of loop"
        ),
    },
    published={"by_kind": 1.0},
)


def cycles(x: np.ndarray, period: float) -> np.ndarray:
    """Cut an oscillation into cycles of one length, mean 0 and std 1: one from every zero crossing
    on, turned to begin upward.

    The same for `x` and `-x`, so that the sign of the plant's gain tells nothing; at most
    `_CYCLES`, those shorter than half or longer than one and a half periods left out.
    """
    at = zero_crossings(x, _GUARD * float(x.std()))
    way = np.where(x[np.minimum(at.astype(int) + 1, x.size - 1)] > 0, 1.0, -1.0)[:-2]
    at, length = at[:-2], at[2:] - at[:-2]
    fit = np.flatnonzero((length > 0.5 * period) & (length < 1.5 * period))
    if fit.size:
        fit = fit[np.linspace(0, fit.size - 1, min(fit.size, _CYCLES)).astype(int)]
    place = at[fit, None] + length[fit, None] * ((np.arange(CYCLE_POINTS) + 0.5) / CYCLE_POINTS)
    k = np.minimum(place.astype(int), x.size - 2)
    y = way[fit, None] * (x[k] + (place - k) * (x[k + 1] - x[k]))
    y -= y.mean(axis=1, keepdims=True)
    return y / np.maximum(y.std(axis=1, keepdims=True), 1e-300)


@lru_cache(maxsize=1)
def templates() -> tuple[np.ndarray, np.ndarray]:
    """Return the templates, shape (5, POINTS), mean 0 and std 1, and the index of each one's label
    in LABELS.
    """
    t = (np.arange(CYCLE_POINTS) + 0.5) / CYCLE_POINTS
    triangle = np.interp(t, [0, 0.25, 0.75, 1], [0, 1, -1, 0])
    rising = np.interp(t, [0, 0.5, 0.5001, 1], [0, 1, -1, 0])
    falling = np.interp(t, [0, 0.0001, 0.9999, 1], [0, 1, -1, 0])
    shapes = np.array([np.sign(0.5 - t), triangle, rising, falling, np.sin(2 * np.pi * t)])
    return shapes / shapes.std(axis=1, keepdims=True), np.array([0, 1, 2, 2, 3])


def label_shares(pieces: np.ndarray) -> np.ndarray:
    """Return the share of cycles nearest to each label, shape (4,), in the order of LABELS."""
    shapes, label = templates()
    squares = np.empty((len(pieces), len(shapes)))
    compiled(warped_squares)(np.ascontiguousarray(pieces), shapes, _BAND, squares)
    nearest = label[squares.argmin(axis=1)]
    return np.bincount(nearest, minlength=len(SHAPES)) / len(pieces)


def warped_squares(pieces, shapes, band, out):
    """Fill out[i, s] with the least sum of squares between piece i and shape s, both of n samples,
    along a path of which samples fewer than `band` apart are matched; `LANES` pieces together.

    Sakoe and Chiba (1978), IEEE Trans. ASSP 26, 43: symmetric, without a slope constraint.
    """
    wide()
    m, n = pieces.shape
    x = rows(n)
    cost = rows(n + 1)  # of the best path to each sample of the shape
    before = lanes()
    corner = lanes()

    # Cycles of a block side by side, each against every shape
    for block in range(0, m, LANES):
        for c in range(LANES):
            for k in range(n):
                x[k * LANES + c] = pieces[min(block + c, m - 1), k]
        for s in range(len(shapes)):
            for k in range((n + 1) * LANES):
                cost[k] = 0.0 if k < LANES else np.inf
            for i in range(n):
                first = max(0, i - band + 1)
                row = np.uintp(i * LANES)
                start = np.uintp(first * LANES)
                for c in range(LANES):
                    corner[c] = cost[start + np.uintp(c)]
                    # to the left of the band there is no path
                    before[c] = cost[start + np.uintp(c)] = np.inf
                for j in range(first, min(n, i + band)):
                    place = np.uintp((j + 1) * LANES)
                    for c in range(LANES):
                        above = cost[place + np.uintp(c)]
                        off = x[row + np.uintp(c)] - shapes[s, j]
                        before[c] = off * off + min(min(corner[c], above), before[c])
                        corner[c] = above
                        cost[place + np.uintp(c)] = before[c]

            # The cost of the whole path
            for c in range(min(LANES, m - block)):
                out[block + c, s] = cost[n * LANES + c]


def detect(prepared: Prepared, *, by_kind: float = 0.0) -> Verdict:
    """Judge a record by the pair of shapes of OP and PV.

    Parameters
    ----------
    prepared : Prepared
        The record.
    by_kind : float
        1: only the column of Table 11.2 for the record's kind counts.

    Returns
    -------
    Verdict
        `score` is the share of sharp cycles in OP (integrating: in PV), 1 less the share of sines.

    Examples
    --------
    >>> from simbench.detectors.record import LoopRecord
    >>> t = np.arange(3000) / 10
    >>> record = LoopRecord(np.arcsin(np.sin(t)), np.sign(np.cos(t)), 0.1)
    >>> detect(Prepared(record), **METHOD.defaults()).verdict
    'stiction'
    """
    # Too few samples per cycle have no shape
    period = prepared.period
    if period < 8:
        return Verdict(
            "srinivasan",
            NO_DECISION,
            reason=f"{period:.1f} samples per cycle; at least 8 are needed",
        )

    # The shape of every cycle of OP and PV
    shares = {}
    indices = {}
    for name in ("OP", "PV"):
        pieces = cycles(prepared.band(name.lower(), period / _HARMONICS), period)
        if len(pieces) < 3:
            return Verdict(
                "srinivasan",
                NO_DECISION,
                reason=f"{len(pieces)} whole cycles in {name}; at least 3 are needed",
            )
        shares[name] = label_shares(pieces)
        indices |= {
            f"{name.lower()}_{label}": float(s)
            for label, s in zip(SHAPES, shares[name], strict=True)
        }

    # The shape that most cycles have, a sawtooth counted as a triangle
    decisive = "PV" if prepared.integrating else "OP"
    score = 1.0 - float(shares[decisive][SHAPES.index("sine")])
    seen = {}
    for name, s in shares.items():
        seen[name] = SHAPES[int(np.argmax(s))]
    pair = tuple("triangle" if seen[n] == "sawtooth" else seen[n] for n in ("OP", "PV"))
    looks = ", ".join(
        f"{n} looks like a {seen[n]} ({shares[n].max():.0%} of the cycles)" for n in ("OP", "PV")
    )

    # Pairs that Table 11.2 lists for this kind of plant
    if prepared.integrating:
        pairs = _LEVEL
    else:
        pairs = FAST | SLOW
    if by_kind > 0.5 and not prepared.integrating:
        pairs = COLUMNS.get(str(prepared.record.kind), pairs)

    # A pair of the table is stiction, two sines are none
    if pair in pairs:
        return Verdict(
            "srinivasan", STICTION, score, indices, reason=f"{looks}: a pair of Table 11.2"
        )
    if pair == ("sine", "sine"):
        return Verdict("srinivasan", NO_STICTION, score, indices, reason=looks)
    return Verdict(
        "srinivasan", NO_DECISION, score, indices, reason=f"{looks}: no pair of Table 11.2"
    )
