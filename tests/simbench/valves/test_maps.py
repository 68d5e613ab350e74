"""The data-driven valves: published sequences, equalities between models, and what no valve may
break.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.loop.response import valve_response

# Open-loop sequences worked out for S/J models before this package existed (golden numbers of the
# reference sheet).
# fmt: off
U = [50, 52, 54, 56, 58, 60, 59, 58, 57, 56, 55, 54, 53, 52, 51, 50, 50, 51, 52, 53, 54, 55, 56,
     57, 58, 58, 58, 59, 60, 61, 62, 63]
SJ = {
    (5, 0): [50, 50, 51.5, 53.5, 55.5, 57.5, 57.5, 57.5, 57.5, 57.5, 57.5, 56.5, 55.5, 54.5, 53.5,
             52.5, 52.5, 52.5, 52.5, 52.5, 52.5, 52.5, 53.5, 54.5, 55.5, 55.5, 55.5, 56.5, 57.5,
             58.5, 59.5, 60.5],
    (5, 2): [50, 50, 52.5, 54.5, 56.5, 58.5, 58.5, 58.5, 58.5, 58.5, 58.5, 55.5, 54.5, 53.5, 52.5,
             51.5, 51.5, 51.5, 51.5, 51.5, 51.5, 51.5, 54.5, 55.5, 56.5, 56.5, 56.5, 56.5, 56.5,
             59.5, 60.5, 61.5],
    (5, 5): [50, 50, 50, 56, 58, 60, 60, 60, 60, 60, 60, 54, 53, 52, 51, 50, 50, 50, 50, 50, 50,
             50, 56, 57, 58, 58, 58, 58, 58, 58, 58, 58],
    (5, 7): [50, 50, 50, 50, 59, 61, 61, 61, 61, 61, 61, 53, 52, 51, 50, 49, 49, 49, 49, 49, 49,
             49, 57, 58, 59, 59, 59, 59, 59, 59, 59, 59],
}
HE = {
    (2.5, 2.5): SJ[5, 0],
    (3.5, 1.5): [50, 50, 52.5, 52.5, 56.5, 56.5, 56.5, 56.5, 56.5, 56.5, 56.5, 56.5, 56.5, 53.5,
                 53.5, 53.5, 53.5, 53.5, 53.5, 53.5, 53.5, 53.5, 53.5, 53.5, 56.5, 56.5, 56.5,
                 56.5, 56.5, 59.5, 59.5, 59.5],
    (5, 0): [50, 50, 50, 56, 56, 56, 56, 56, 56, 56, 56, 56, 56, 56, 56, 50, 50, 50, 50, 50, 50,
             50, 56, 56, 56, 56, 56, 56, 56, 56, 62, 62],
    (6, -1): [50, 50, 50, 50, 59, 59, 59, 59, 59, 59, 59, 59, 59, 51, 51, 51, 51, 51, 51, 51, 51,
              51, 51, 51, 59, 59, 59, 59, 59, 59, 59, 59],
}
# fmt: on


@pytest.mark.parametrize("model", ["choudhury", "kano"])
@pytest.mark.parametrize(("S", "J"), SJ)
def test_stiction_maps_give_the_published_sequences(model, S, J):
    np.testing.assert_array_equal(valve_response(model, U, {"S": S, "J": J}), SJ[S, J])


@pytest.mark.parametrize(("fs", "fd"), HE)
def test_he_gives_the_published_sequences_by_either_pair(fs, fd):
    np.testing.assert_array_equal(valve_response("he", U, {"fs": fs, "fd": fd}), HE[fs, fd])
    np.testing.assert_array_equal(valve_response("he", U, {"S": fs + fd, "J": fs - fd}), HE[fs, fd])


@pytest.mark.parametrize(("S", "J"), [(5, 0), (5, 2), (5, 5), (0.7, 0.3), (12, 3), (0, 0)])
def test_kano_equals_choudhury_with_holds_and_saturation(wandering_op, S, J):
    assert np.mean(wandering_op > 100) > 0.02
    assert np.mean(np.diff(wandering_op) == 0) > 0.1
    p = {"S": S, "J": J}
    np.testing.assert_array_equal(
        valve_response("kano", wandering_op, p), valve_response("choudhury", wandering_op, p)
    )


@pytest.mark.parametrize("S", [0.0, 1.0, 5.0, 17.3])
def test_without_a_jump_all_maps_are_one_play(wandering_op, S):
    play = valve_response("deadband", wandering_op, {"S": S})
    sides = {"S_up": S, "J_up": 0, "S_down": S, "J_down": 0}
    for model, p in (
        ("choudhury", {"S": S, "J": 0}),
        ("kano", {"S": S, "J": 0}),
        ("he", {"S": S, "J": 0}),
        ("asymmetric", sides),
        ("hysteresis", {"S": S, "H": 0}),
    ):
        np.testing.assert_array_equal(valve_response(model, wandering_op, p), play, err_msg=model)


def test_models_that_generalise_choudhury_contain_it(wandering_op):
    mv = valve_response("choudhury", wandering_op, {"S": 5, "J": 2})
    for model, p in (
        ("asymmetric", {"S_up": 5, "J_up": 2, "S_down": 5, "J_down": 2}),
        ("time_varying", {"S": 5, "J": 2, "t_end": 100}),
        ("intermittent", {"S": 5, "J": 2, "period": 10, "on": 10}),
        ("intermittent", {"S": 1, "J": 1, "period": 10, "on": 0, "S_off": 5, "J_off": 2}),
    ):
        np.testing.assert_array_equal(valve_response(model, wandering_op, p), mv, err_msg=model)


def test_he_gain_multiplies_the_slip_and_moves_the_band():
    # rest at 50, break-away above 53.5, slip K (c - fd) = 1.5 (4 - 1.5), then c = 54 - 53.75
    mv = valve_response("he", [50, 54, 57, 57.5, 51, 50], {"S": 5, "J": 2, "K": 1.5})
    np.testing.assert_allclose(mv, [50, 53.75, 53.75, 57.125, 50.1875, 50.1875])


def test_literal_flow_chart_hardly_moves_under_noisy_op_where_the_other_reading_does():
    rng = np.random.default_rng(0)
    op = 50 + 30 * np.sin(np.arange(3000) / 300) + rng.normal(0, 0.3, 3000)
    literal = valve_response("choudhury_literal", op, {"S": 5, "J": 2})
    mended = valve_response("choudhury", op, {"S": 5, "J": 2})
    assert np.sqrt(np.mean((literal - mended) ** 2)) > 10.0
    assert np.ptp(mended) > 50


@pytest.mark.parametrize(("S", "H"), [(0, 6), (4, 3), (3, 0)])
def test_hysteresis_is_what_isa_measures_on_a_full_traverse(S, H):
    ramp = np.linspace(0, 100, 2001)
    op = np.concatenate([ramp, ramp[::-1], ramp, ramp[::-1]])
    mv = valve_response("hysteresis", op, {"S": S, "H": H})
    rising, falling = mv[4002:6003], mv[6003:][::-1]
    assert np.max(falling - rising) - S == pytest.approx(H, abs=1e-9)
    # dead-band: OP range after a reversal over which the position does not move
    assert ramp[np.argmax(rising > rising[0])] == pytest.approx(S, abs=0.06)


ops = st.lists(st.floats(-20, 120, allow_nan=False), min_size=1, max_size=60)
band = st.floats(0, 40)


def run(model, op, table):
    return valve_response(model, op, table, plain=True)


@settings(max_examples=60, deadline=None)
@given(op=ops)
def test_without_friction_every_map_is_the_identity(op):
    for model, table in (
        ("ideal", {}),
        ("choudhury", {"S": 0, "J": 0}),
        ("choudhury_literal", {"S": 0, "J": 0}),
        ("kano", {"S": 0, "J": 0}),
        ("he", {"S": 0, "J": 0}),
        ("stenman", {"d": 0}),
        ("deadband", {"S": 0}),
        ("deadzone", {"D": 0}),
        ("hysteresis", {"S": 0, "H": 0}),
        ("asymmetric", {"S_up": 0, "J_up": 0, "S_down": 0, "J_down": 0}),
        ("time_varying", {"S": 0, "J": 0, "t_end": 9}),
        ("intermittent", {"S": 0, "J": 0, "period": 3, "on": 1}),
    ):
        np.testing.assert_array_equal(run(model, op, table), np.clip(op, 0, 100), err_msg=model)


@settings(max_examples=60, deadline=None)
@given(op=ops, S=band, J=band)
def test_position_never_strays_from_op_by_more_than_break_away(op, S, J):
    x = np.clip(op, 0, 100)
    for model, table in (
        ("choudhury", {"S": S, "J": J}),
        ("kano", {"S": S, "J": J}),
        ("he", {"S": S, "J": J}),
        ("asymmetric", {"S_up": S, "J_up": J, "S_down": S / 2, "J_down": J / 3}),
        ("time_varying", {"S": S, "J": J, "S_end": S / 2, "J_end": J / 2, "t_end": 20}),
        ("intermittent", {"S": S, "J": J, "period": 5, "on": 2}),
        ("deadband", {"S": S}),
        ("stenman", {"d": (S + J) / 2}),
    ):
        mv = run(model, op, table)
        assert np.abs(x - mv).max() <= (S + J) / 2 + 1e-9, model
        assert mv.min() >= 0, model
        assert mv.max() <= 100, model
