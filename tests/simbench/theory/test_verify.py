"""Theory against the simulator, on a few random loops; `python -m simbench.theory.verify` does many."""

import sys
from itertools import islice

import numpy as np
import pytest

from simbench.theory import verify
from simbench.theory.sampled import sampled_loop


def test_exact_cycles_of_random_loops_are_those_of_the_simulator():
    exact, switching = verify.predictions(12, seed=21)
    assert exact.table.sum() == switching.table.sum() == 12
    assert exact.table[0, 1] == 0
    for errors in (exact.period, exact.amplitude):
        assert np.median(errors) < 0.01
        assert np.percentile(errors, 95) < 0.03
    assert np.median(switching.period) < 0.01


def test_p_loops_cycle_exactly_where_the_bounds_leave_room():
    assert verify.existence_p(12, seed=21) == (12, 0)


def test_dead_band_loops_cycle_where_theory_says():
    found = verify.existence_pi(15, seed=21)
    assert np.trace(found.table) >= 14


def test_drawn_loops_span_what_they_promise():
    loops = list(islice(verify.drawn_loops(4), 60))
    kinds = {(loop.plant.type, loop.controller.type) for loop in loops}
    assert len(kinds) == 4
    for loop in loops:
        assert 0.05 <= loop.plant.Td / 10 <= 2
        assert 3 <= loop.plant.Td / loop.sampling.Ts <= 50
        assert 0.5 <= loop.valve.parameters["J"] <= 7.5


def test_ultimate_gain_is_where_the_linear_loop_starts_to_oscillate():
    loop = verify.tuned(False, 2.0, None, 1.0, 0.5, 0.01)
    assert loop.controller.Kc == pytest.approx(8.5, rel=0.02)  # T 10, Td 2: w T = 8.44
    sampled = sampled_loop(loop)
    assert verify.ultimate_gain(sampled) == pytest.approx(1, rel=1e-2)
    assert verify.ultimate_gain(sampled_loop(loop.with_("controller.type", "P"))) is not None


@pytest.mark.parametrize("what", ["predictions", "kicks", "existence-p", "existence-pi"])
def test_command_prints_its_figures(what, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["verify", what, "--loops", "2", "--seed", "8"])
    verify.main()
    assert capsys.readouterr().out.strip()
