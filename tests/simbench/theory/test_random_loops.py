"""Theory against the simulator, on a few random loops."""

import numpy as np
import theory_check as verify


def test_exact_cycles_of_random_loops_are_those_of_the_simulator():
    exact, switching = verify.predictions(8, seed=21)
    assert exact.table.sum() == switching.table.sum() == 8
    assert exact.table[0, 1] == 0
    for errors in (exact.period, exact.amplitude):
        assert np.median(errors) < 0.01
        assert np.percentile(errors, 95) < 0.03
    assert np.median(switching.period) < 0.01


def test_dead_band_loops_cycle_where_theory_predicts():
    errors = verify.existence_pi(8, seed=21)
    assert np.trace(errors.table) >= 7
