"""Theory against the simulator, on a few random loops; `python -m results.studies.theory_check`
does many.
"""

import sys

import numpy as np
import pytest

from results.studies import theory_check as verify


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


@pytest.mark.parametrize("what", ["existence-p", pytest.param("kicks", marks=pytest.mark.slow)])
def test_command_prints_its_figures(what, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["verify", what, "--loops", "2", "--seed", "8"])
    verify.main()
    assert capsys.readouterr().out.strip()


def test_errors_are_printed_in_percent():
    printed = str(
        verify.Errors(np.array([[1, 2], [3, 44]]), np.array([0.01, 0.02, 0.03]), np.array([]))
    )
    assert printed.splitlines() == [
        "                 no cycle  cycles (simulated)",
        "predicted no            1       2",
        "predicted yes           3      44",
        "period error: median 2.000 %, 95th percentile 2.900 %, largest 3.00 %",
    ]
