"""Oracle: a likelihood-ratio test that knows plant, load and noise, and so shows where nobody could
know.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simbench.detectors.compiled import LANES, compiled, lanes, rows, wide
from simbench.detectors.signal.fits.hammerstein_kernels import Stretch, Valves, moves
from simbench.detectors.verdict import NO_STICTION, STICTION, Verdict
from simbench.loop import plant
from simbench.loop.run import Run
from simbench.loop.setup import Setup
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Scenario

ORACLE = "oracle"
SOURCE = (
    "generalised likelihood ratio, Kay (1998), Detection Theory, section 6.4.2; penalty of Schwarz"
    " (1978)"
)
_BANDS = np.geomspace(0.1, 40.0, 31)  # S, % of travel
_JUMPS = np.linspace(0.0, 1.0, 9)  # J/S
_ZOOMS = 3  # rounds of refinement
_AROUND = 5  # candidates a side in each
_FLOOR = 1e-9  # of PV's range: what rounding leaves of a residual without noise
_UNSURE = 3.0  # nats: below this one answer is at most twenty times likelier than the other


def judge_oracle(scenario: Scenario, run: Run) -> Verdict:
    """Ask whether PV fits OP better through a sticky valve than through an ideal one, knowing
    everything else.

    OP, sent through a valve and the known plant, predicts PV; what is left is the white noise of
    the sensor, so the ratio of likelihoods is (RSS ideal - RSS sticky)/(2 noise variance). S and J
    are not known to the oracle: the maximum over all of them is taken (Kay 1998, section 6.4.2).
    """
    # the plant's state is known where the run starts, not where the record does, and OP and PV as
    # they were, not as they were archived
    whole = run.whole or simulate(scenario.loop, scenario.seed).whole
    assert whole is not None
    setup, op, pv = whole
    n = setup.end

    # PV as the known noise and load leave it to the valve, and the inflow that load adds to MV's
    left = pv - setup.pv0 - setup.load_out[:n]
    load = np.array(setup.load_in[:n])
    variance = (
        setup.noise_std**2
        + (_FLOOR * max(float(np.ptp(pv)), 1e-3 * float(np.abs(pv).max()), 1e-9)) ** 2
    )

    # the valve rests under the OP before the first
    record = Stretch(np.append(setup.op0, op), left, 1, 0, 0, n, 1.0, 0.0, 100.0)
    b, a, delay = _transfer_function(setup)

    def misfits(S: np.ndarray, J: np.ndarray) -> np.ndarray:
        none = np.zeros(S.size)
        out = np.empty(S.size)
        valves = Valves(none, S, J, none, none, none, none)
        compiled(squares_left)(record, valves, load, b, a, delay, out)
        return out / (2.0 * variance)

    (ideal,) = misfits(np.zeros(1), np.zeros(1)).tolist()
    S, J, best = _best_valve(misfits)
    ratio = ideal - best
    score = ratio - float(np.log(n))
    likelier = "sticky" if score > 0 else "ideal"
    return Verdict(
        ORACLE,
        STICTION if score > 0 else NO_STICTION,
        score=score,
        indices={"log_likelihood_ratio": ratio},
        S=S,
        J=J,
        applicable=None if abs(score) < _UNSURE else True,
        reason=(
            f"knowing plant, load and noise, the {likelier} valve is likelier by {abs(score):.3g}"
            " nats"
        ),
    )


def _best_valve(
    misfits: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> tuple[float, float, float]:
    """Return S and J of the best valve, and its misfit: of a coarse lattice over all valves, then
    of finer ones around the best so far.
    """
    # The first lattice covers all valves
    sizes = _BANDS
    ratios = _JUMPS
    factor = np.log(_BANDS[1] / _BANDS[0])
    width = _JUMPS[1]
    offsets = np.linspace(-1.0, 1.0, _AROUND)
    best = np.inf
    S = np.nan
    J = np.nan

    # The best of it is the centre of the next one, half as wide
    for _ in range(1 + _ZOOMS):
        s = np.repeat(sizes, ratios.size)
        j = s * np.tile(ratios, sizes.size)
        found = misfits(s, j)
        k = int(found.argmin())
        if found[k] < best:
            best = float(found[k])
            S = float(s[k])
            J = float(j[k])
        sizes = S * np.exp(factor * offsets)
        ratios = np.clip(J / S + width * offsets, 0.0, None)
        factor = factor / 2
        width = width / 2
    return S, J, best


def _transfer_function(setup: Setup) -> tuple[np.ndarray, np.ndarray, int]:
    """Return numerator and denominator of the sampled plant in powers of 1/z, of one length, and
    the samples by which it is late.
    """
    if setup.loop.plant.dt is not None:
        # stated in z: its numbers as they stand, behind whole samples
        b = np.append(0.0, setup.loop.plant.num or ())
        a = np.array(setup.loop.plant.den)
        delay = round(setup.Td / setup.Ts)
    else:
        sampled = plant.sample(setup.num, setup.den, setup.Td, setup.Ts)
        # C (zI - A)^-1 B = (det(zI - A + B C) - det(zI - A))/det(zI - A), the matrix determinant
        # lemma
        A = np.atleast_2d(sampled.A)
        C = np.reshape(sampled.C, (1, -1))
        a = np.poly(A)
        new = np.poly(A - np.outer(sampled.B_new, C)) - a
        old = np.poly(A - np.outer(sampled.B_old, C)) - a
        b = np.append(new, 0.0) + np.append(0.0, old)
        delay = sampled.delay
    size = max(b.size, a.size, 2)
    return np.pad(b, (0, size - b.size)), np.pad(a, (0, size - a.size)), delay


def squares_left(record, valves, load, b, a, delay, out):
    """Fill out[i] with the sum of squares that valve i and the plant b/a, `delay` samples late,
    leave of the record's PV; `load` adds to the valve's position.

    The filter is a transposed direct form II (Oppenheim and Schafer 2010, section 6.3).
    """
    # Room for the positions, the state and the squares
    wide()
    n = load.size
    last = b.size - 1
    v = rows(n + 1)
    total = rows(n + 2)
    state = rows(last)
    w = lanes()
    y = lanes()
    squares = lanes()

    # Block by block: the positions of its valves, and PV before the dead time is over
    for block in range(0, out.size, LANES):
        moves(record, valves, block, v, total)
        for c in range(LANES):
            squares[c] = 0.0
        for k in range(last * LANES):
            state[k] = 0.0
        for k in range(min(delay, n)):
            for c in range(LANES):
                squares[c] += record.y[k] * record.y[k]

        # The plant's difference equation in its transposed form, and the squared error
        for k in range(n - delay):
            # the first position is that before the record
            row = np.uintp((k + 1) * LANES)
            pv = record.y[k + delay]
            add = load[k]
            for c in range(LANES):
                w[c] = v[row + np.uintp(c)] + add
                y[c] = state[np.uintp(c)] + b[0] * w[c]
                squares[c] += (pv - y[c]) * (pv - y[c])
            for j in range(1, last):
                to = np.uintp((j - 1) * LANES)
                of = np.uintp(j * LANES)
                bj = b[j]
                aj = a[j]
                for c in range(LANES):
                    state[to + np.uintp(c)] = state[of + np.uintp(c)] + w[c] * bj - y[c] * aj
            to = np.uintp((last - 1) * LANES)
            bj = b[last]
            aj = a[last]
            for c in range(LANES):
                state[to + np.uintp(c)] = w[c] * bj - y[c] * aj
        for c in range(min(LANES, out.size - block)):
            out[block + c] = squares[c]
