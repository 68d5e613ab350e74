"""A valve seen directly: a dead band between OP and flow is found without an oscillation, and not
where there is none.
"""

import numpy as np
import pytest

from simbench.detectors.procedure import FOLLOW_MIN
from simbench.detectors.signal.valve_follow import valve_follow

T = np.arange(900)
ROAM = 50 + np.cumsum(np.repeat([0.02, -0.02, 0.025, -0.02, 0.02, -0.025], 150))


def lagged(v, noise, seed=0):
    y = np.empty(v.size)
    y[0] = v[0]
    for k in range(1, v.size):
        y[k] = 0.6 * y[k - 1] + 0.4 * v[k - 1]
    return 3 * y + noise * np.random.default_rng(seed).standard_normal(v.size)


def play(u, S):
    v, out = u[0], []
    for x in u:
        v = max(x - S / 2, min(x + S / 2, v))
        out.append(v)
    return np.array(out)


@pytest.mark.parametrize("S", [2.2, 3.0])
def test_dead_band_is_identified_with_its_size(S):
    follow = valve_follow(ROAM, lagged(play(ROAM, S), 0.3))
    assert follow.score > FOLLOW_MIN
    assert follow.S == pytest.approx(S, abs=0.3)
    assert follow.reversals >= 1


def test_valve_that_follows_scores_nothing():
    for seed in range(5):
        assert valve_follow(ROAM, lagged(ROAM, 0.3, seed)).score < 0.02


def test_noise_alone_scores_nothing():
    for seed in range(5):
        assert valve_follow(ROAM, np.random.default_rng(seed).standard_normal(900)).score < 0.1


def test_a_dead_band_without_a_reversal_is_no_proof():
    ramp = 50 + 0.01 * T
    assert valve_follow(ramp, lagged(play(ramp, 4.0), 0.1)).score == 0.0


def test_long_records_are_thinned_out_and_units_do_not_matter():
    long = np.interp(np.arange(9000) / 10, T, ROAM)
    follow = valve_follow(long, lagged(play(long, 2.4), 0.3))
    assert follow.score > FOLLOW_MIN
    free = valve_follow(20 * long - 500, 0.1 * lagged(play(long, 2.4), 0.3), (-np.inf, np.inf))
    assert free.S == pytest.approx(20 * follow.S, rel=1e-6)
