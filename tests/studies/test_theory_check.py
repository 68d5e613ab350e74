"""Theory against the simulator, on a few random loops; `python -m results.studies.theory_check`
does many.
"""

import sys
from itertools import islice

import numpy as np
import pytest
from scipy import stats

from results.studies import theory_check as verify
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


@pytest.mark.parametrize("what", ["existence-p", pytest.param("kicks", marks=pytest.mark.slow)])
def test_command_prints_its_figures(what, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["verify", what, "--loops", "2", "--seed", "8"])
    verify.main()
    assert capsys.readouterr().out.strip()


@pytest.fixture(scope="module")
def drawn():
    return list(islice(verify.drawn_loops(11), 250))


def test_draws_are_even_in_what_they_promise(drawn):
    def even(x, lo, hi):
        return stats.kstest((np.asarray(x) - lo) / (hi - lo), "uniform").pvalue > 1e-3

    ratio = [loop.plant.Td / 10.0 for loop in drawn]
    assert even(np.log(ratio), np.log(0.05), np.log(2.0))
    assert even(
        np.log([loop.plant.Td / loop.sampling.Ts for loop in drawn]), np.log(3.0), np.log(50.0)
    )
    assert even([loop.valve.parameters["J"] / 5.0 for loop in drawn], 0.1, 1.5)
    Ti = [
        loop.controller.Ti
        for loop in drawn
        if loop.plant.type == "foptd" and loop.controller.type == "PI"
    ]
    assert even(np.log(np.array(Ti) / 10.0), np.log(0.3), np.log(3.0))
    tuned = [loop for loop in drawn if verify.ultimate_gain(sampled_loop(loop)) is not None]
    assert even([1.0 / verify.ultimate_gain(sampled_loop(loop)) for loop in tuned], 0.1, 0.9)
    for chosen in (
        [loop.plant.type == "foptd" for loop in drawn],
        [loop.controller.type == "P" for loop in drawn],
    ):
        assert 0.4 < np.mean(chosen) < 0.6


def test_the_starts_are_multiples_of_the_break_away(drawn):
    for loop in drawn[:4]:
        fs = (loop.valve.parameters["S"] + loop.valve.parameters["J"]) / 2
        ways = list(verify.starts(loop))
        assert [round(more["kick"] / fs, 9) for _, more in ways if more] == [1.05, 1.6, 3.0]
        loads = [moved.disturbance[0] for moved, _ in ways if moved.disturbance]
        assert [round(load.parameters["amplitude"] / fs, 9) for load in loads] == [
            0.5,
            1.0,
            1.5,
            3.0,
        ]
        assert {load.parameters["at"] for load in loads} == {"input"}
        steps = [moved.setpoint.steps[0] for moved, _ in ways if moved.setpoint.steps]
        up = [(to - loop.setpoint.value) * loop.controller.Kc / fs for _, to in steps]
        assert up == pytest.approx([0.6, 2.0])
        assert len(ways) == 9


def test_a_simulated_cycle_is_measured_where_it_repeats(drawn):
    """Against the record's own autocorrelation and range."""
    measured = 0
    for loop in drawn[:12]:
        found = verify.simulated_cycle(loop, kick=8.0)
        record = verify.simulate(loop.with_("sampling.n", 20_000), kick=8.0).record
        op = record.op[10_000:] - record.op[10_000:].mean()
        if found is None:
            continue
        measured += 1
        lag = round(found[0] / record.Ts)
        near = range(max(int(0.8 * lag), 1), int(1.2 * lag) + 2)
        likeness = [op[k:] @ op[:-k] / (op.size - k) for k in near]
        assert near[int(np.argmax(likeness))] == pytest.approx(
            found[0] / record.Ts, rel=0.02, abs=1.0
        )
        assert np.ptp(op) / 2 == pytest.approx(found[1], rel=0.15)
    assert measured >= 4
    assert verify.simulated_cycle(drawn[0]) is None  # from rest, nothing moves


def test_errors_are_told_in_percent():
    told = str(
        verify.Errors(np.array([[1, 2], [3, 44]]), np.array([0.01, 0.02, 0.03]), np.array([]))
    )
    assert told.splitlines() == [
        "                 no cycle  cycles (simulated)",
        "predicted no            1       2",
        "predicted yes           3      44",
        "period error: median 2.000 %, 95th percentile 2.900 %, largest 3.00 %",
    ]


def test_kicks_are_right_a_little_above_and_below_the_smallest():
    right, unreachable = verify.kicks(3, seed=5)
    assert right == 3
    assert unreachable >= 0
