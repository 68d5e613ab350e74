"""The pieces of theory on cases that need no computer: gains, thresholds, starts, small arrays,
printed words.
"""

from dataclasses import replace
from itertools import cycle as cycle_through
from itertools import repeat
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import ParameterError
from simbench.loop.parameters import VALVES, valve_parameters
from simbench.theory import table_check
from simbench.theory.cycle import exact_cycle
from simbench.theory.describing import deadzone, first_harmonic, intersections, measured, stiction
from simbench.theory.half_cycle import (
    _move_states,
    _multiply_into,
    _residual_by_kernel,
    _solve_half_cycle,
    half_cycles,
    standing,
)
from simbench.theory.predict import as_text
from simbench.theory.sampled import mapped_valve, sampled_loop, ultimate_gain
from simbench.theory.tables import CONDITIONS, cell, refined, table_11_3


def test_sizes_of_a_sampled_loop(loop):
    made = sampled_loop(loop(K=2.0, Kc=1.5, T=10.0, Td=2.0, Ti=8.0, S=5.0, J=2.0, Ts=0.5))
    assert (made.fs, made.fd, made.least_swing, made.order, made.delay) == (3.5, 1.5, 1.0, 1, 4)
    assert made.static_gain == pytest.approx(3.0)
    assert (made.beta, made.lo, made.hi) == (0.0625, -50.0, 50.0)
    assert sorted(made.times) == pytest.approx([0.5, 2.0, 8.0, 10.0])
    assert sampled_loop(loop(J=0.0)).least_swing == pytest.approx(0.025)
    assert not made.integrating
    assert sampled_loop(loop(kind="integrating", K=0.1)).integrating


def test_responses_of_a_loop_by_their_formulas(loop):
    made = sampled_loop(loop(K=2.0, Kc=1.5, T=10.0, Td=2.0, Ti=8.0, Ts=0.5))
    w = np.array([0.01, 0.1, 1.0])
    G = 3.0 * np.exp(-2j * w) / (1 + 10j * w) * (1 + 1 / (8j * w))
    np.testing.assert_allclose(made.response(w), G, rtol=1e-12)
    a, z = np.exp(-0.05), np.exp(0.5j * w)
    sampled = 3.0 * (1 - a) / (z - a) * z**-4.0 * (1 + 0.0625 / (1 - 1 / z))
    # a new OP acts in its own sample: one step ahead of the textbook's hold
    assert (
        min(abs(made.sampled_response(w) / (sampled * z**ahead) - 1).max() for ahead in (0, 1))
        < 1e-9
    )
    p = sampled_loop(loop(K=2.0, Kc=1.5, T=10.0, Td=2.0, Ti=None, Ts=0.5))
    np.testing.assert_allclose(p.response(w), 3.0 * np.exp(-2j * w) / (1 + 10j * w), rtol=1e-12)


def stage(name, **table):
    module = VALVES.load(name)
    return (module, valve_parameters(module, table, 1.0))


def test_one_stage_with_friction_is_described_and_two_are_not(loop):
    more = {"name": "stiction", "S": 2.0, "J": 1.0}
    stages = [
        stage("choudhury", S=3.0, J=1.0),
        stage("kano", S=2.0, J=1.0),
        stage("kano", S=0.0, J=0.0),
    ]
    assert mapped_valve(SimpleNamespace(valves=stages[1:])) == (2.0, 1.0)
    assert mapped_valve(SimpleNamespace(valves=stages[2:])) == (0.0, 0.0)
    with pytest.raises(ParameterError, match="2 valve stages have friction"):
        mapped_valve(SimpleNamespace(valves=stages))
    with pytest.raises(ParameterError, match="'lag' has no"):
        sampled_loop(loop(effect=[{"name": "valve_lag", "tau": 0.1}]))
    one = sampled_loop(loop(S=0.0, J=0.0, effect=[more]))
    assert (one.S, one.J) == (2.0, 1.0)


def test_a_loop_without_friction_has_no_cycle_and_no_cell(loop):
    free = sampled_loop(loop(S=0.0, J=0.0, Ts=0.5))
    assert exact_cycle(free) is None
    assert half_cycles(free) == []
    assert cell(free) is None
    assert not table_11_3(free)


@pytest.mark.parametrize(("J", "cycles"), [(2.499, False), (2.501, True)])
def test_a_p_loop_cycles_where_gain_times_jump_exceeds_the_band(loop, J, cycles):
    made = sampled_loop(loop(K=1.0, Kc=2.0, Ti=None, S=5.0, J=2.5, Ts=0.5))
    assert refined(replace(made, J=J), None) is cycles
    assert list(CONDITIONS) == [
        ("self-regulating", "P", "stick-slip"),
        ("self-regulating", "PI", "dead-band"),
    ]


def test_a_product_of_small_arrays():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(3, 3)), rng.normal(size=(3, 4))
    out = np.full((3, 4), np.nan)
    _multiply_into.py_func(a, b, out)
    np.testing.assert_allclose(out, a @ b, rtol=1e-12)


@pytest.mark.parametrize("Ti", [None, 10.0])
def test_the_head_of_a_half_cycle_is_the_march_with_the_valve_set_free(loop, Ti):
    """Sample by sample: MV follows OP at `fd` for m samples, then rests; the delay empties for two
    more.
    """
    made = sampled_loop(loop(Ti=Ti, Ts=0.5, Td=1.0))
    m, c = made.delay + 3, made.order + 2
    head = np.full((c, c + 1), np.nan)
    plant = made.A, made.B_old, made.B_new, made.C
    _move_states.py_func(plant, (made.integral, made.beta), made.fd, made.delay, m, head)
    start = np.array([0.7, 2.0, 5.0])
    x, u, v, w = start[:1], start[1], [start[2]] * (made.delay + 3), float(made.C @ start[:1])
    for k in range(1, m + made.delay + 3):
        x = made.A @ x + made.B_old * v[-made.delay - 2] + made.B_new * v[-made.delay - 1]
        y = float(made.C @ x)
        u, w = (u - (y - w) - made.beta * y if made.integral else -y), y
        v.append(u + made.fd if k <= m else v[-1])
    assert (head[:, :-1] @ start + head[:, -1]).tolist() == pytest.approx([*x, u, v[-1]])


@pytest.mark.parametrize("q", [0, 1, 6, 11])
def test_the_residual_of_a_half_cycle_is_that_of_the_whole_arrays(loop, q):
    made = sampled_loop(loop(Ts=0.5, Td=1.0))
    T, powers, c = standing(made), [standing(made)], made.order + 2
    for _ in range(3):
        powers.append(powers[-1] @ powers[-1])
    head = np.random.default_rng(3).normal(size=(c, c + 1))
    room = np.empty((3, c, c + 1))
    residual = _residual_by_kernel.py_func(head, T, np.array(powers), made.fs, q, *room)
    assert residual == pytest.approx(
        _solve_half_cycle(head, T, powers, made.fs, np.array([q]))[0][0]
    )


def test_the_first_harmonic_of_valves_whose_answer_is_known():
    A = np.array([2.0, 10.0, 40.0])
    np.testing.assert_allclose(first_harmonic("ideal", {}, A), 1.0, atol=1e-12)
    np.testing.assert_allclose(
        first_harmonic("deadzone", {"D": 6.0}, A), deadzone(6.0).N(A), atol=2e-3
    )
    assert first_harmonic("deadzone", {"D": 6.0}, 2.0) == pytest.approx(0.0, abs=1e-12)
    # a corner at the frequency of the sine
    lagging = first_harmonic("lag", {"T": 100 / (2 * np.pi)}, 10.0, period=100.0)
    assert lagging[0] == pytest.approx(1 / (1 + 1j), abs=5e-3)


def test_the_range_of_a_describing_function():
    assert (stiction(6.0, 2.0).low, stiction(6.0, 2.0).high) == (3.0, np.inf)
    assert (deadzone(6.0).low, deadzone(6.0).high) == (3.0, np.inf)
    function = measured("deadzone", {"D": 6.0}, samples=200)
    assert 3.0 < function.low < 3.4
    assert function.high == pytest.approx(49.0)
    A = np.array([4.0, 20.0, 40.0])
    np.testing.assert_allclose(function.N(A), deadzone(6.0).N(A), atol=5e-3)
    np.testing.assert_allclose(function.critical(A), -1 / function.N(A))
    with pytest.raises(ParameterError, match="does not move under a sine of 49 %"):
        measured("deadzone", {"D": 99.0}, samples=50)


def test_a_dead_band_in_an_integrating_loop_has_one_attracting_balance(loop):
    balances = intersections(
        sampled_loop(loop(kind="integrating", K=0.1, Td=1.0, Ti=20.0, J=0.0, Ts=0.1)),
        stiction(5.0, 0.0),
    )
    assert [f.stable for f in balances].count(True) == 1
    assert [f.period for f in balances] == sorted(f.period for f in balances)


def test_a_prediction_is_printed_line_by_line():
    prediction = {
        "table_11_3": True,
        "refined": False,
        "describing_function": [
            {"period": 20.0, "amplitude": 3.0, "stable": True},
            {"period": 5.0, "amplitude": 9.5, "stable": False},
        ],
        "exact": {"period": 19.0, "amplitude": 2.5, "kick_min": 3.51},
        "reason": "why",
    }
    assert as_text(prediction).splitlines() == [
        "Table 11.3             limit cycle",
        "same, with conditions  no limit cycle",
        "describing function    20 s, OP +-3 %, stable; 5 s, OP +-9.5 %, unstable",
        "exact cycle            19 s, OP +-2.5 %, the least offset of OP that starts it is 3.51 %",
        "note                   why",
    ]
    bare = {
        "table_11_3": None,
        "refined": None,
        "describing_function": [],
        "exact": None,
        "reason": "",
    }
    assert [line[23:] for line in as_text(bare).splitlines()] == [
        "no cell",
        "no cell",
        "no limit cycle",
        "none",
    ]
    unkicked = {**prediction, "exact": {**prediction["exact"], "kick_min": None}}
    assert "no offset of OP starts it" in as_text(unkicked)


def test_the_ultimate_gain_of_pure_first_order_lag_and_delay(loop):
    """K e^(-2 s)/(10 s + 1): its phase is -pi where tan(2 w) = -10 w (w = 0.8501); sampled finely,
    P control.
    """
    made = sampled_loop(loop(K=1.0, T=10.0, Td=2.0, Kc=1.0, Ti=None, Ts=0.002))
    w = 0.844
    for _ in range(50):
        w = (np.pi - np.arctan(10 * w)) / 2
    assert ultimate_gain(made) == pytest.approx(np.hypot(1, 10 * w), rel=3e-3)


def test_a_cell_s_loops_are_counted_by_what_they_do(monkeypatch):
    """Four loops: no cycle; a cycle that none, one and both of two load steps reach; the condition
    is wrong of the last.
    """
    reached = {"b": repeat(False), "c": cycle_through([True, False]), "d": repeat(True)}
    monkeypatch.setattr(table_check, "_loops_of_cell", lambda *key: iter("abcd"))
    monkeypatch.setattr(
        table_check, "exact_cycle", lambda loop: None if loop == "a" else loop.upper()
    )
    monkeypatch.setattr(
        table_check, "refined", lambda loop, cycle: loop in "bcd" if loop != "d" else False
    )
    monkeypatch.setattr(table_check, "after_load_step", lambda loop, step: step)
    monkeypatch.setattr(table_check, "reaches_cycle", lambda loop, cycle, step: next(reached[loop]))
    for check in table_check.check_table_11_3(load_steps=2):
        assert (check.loops, check.exist, check.conditions_right, check.reached) == (4, 3, 3, 2)
        assert sum(check.disagreements.values()) == (1 if check.table else 3)
    every_other = table_check.check_table_11_3(load_steps=2, every=2)[0]
    assert (every_other.loops, every_other.exist) == (2, 1)


def test_the_checked_loops_have_the_integral_times_they_promise():
    for process, times in (
        ("integrating", {10.0, 20.0, 40.0}),
        ("self-regulating", {5.0, 10.0, 20.0}),
    ):
        made = list(table_check._loops_of_cell(process, "PI", "dead-band"))
        assert {round(loop.Ts / loop.beta, 9) for loop in made} == times
        assert {round(loop.Td, 9) for loop in made} == (
            {0.0, 1.0, 4.0} if process == "integrating" else {0.0, 2.0, 10.0}
        )
