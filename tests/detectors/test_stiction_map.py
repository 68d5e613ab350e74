"""The (S, J) automaton: golden sequences, and the published x_ss reading as slow twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simbench.detectors.signal.stiction_map import valve_position
from simbench.valve.maps import at_rest as start
from simbench.valve.maps import stick as step

U = np.concatenate(
    [np.arange(50, 61, 2), np.arange(59, 49, -1), np.arange(50, 59), [58, 58], np.arange(59, 64)]
).astype(float)
# Position (% of travel) under U for S = 5 and each J, from an independent implementation of the
# flow chart.
GOLDEN = {
    0: (
        "50 50 51.5 53.5 55.5 57.5 57.5 57.5 57.5 57.5 57.5 56.5 55.5 54.5 53.5 52.5 52.5 52.5 52.5"
        " 52.5 52.5 52.5 53.5 54.5 55.5 55.5 55.5 56.5 57.5 58.5 59.5 60.5"
    ),
    2: (
        "50 50 52.5 54.5 56.5 58.5 58.5 58.5 58.5 58.5 58.5 55.5 54.5 53.5 52.5 51.5 51.5 51.5 51.5"
        " 51.5 51.5 51.5 54.5 55.5 56.5 56.5 56.5 56.5 56.5 59.5 60.5 61.5"
    ),
    5: (
        "50 50 50 56 58 60 60 60 60 60 60 54 53 52 51 50 50 50 50 50 50 50 56 57 58 58 58 58 58 58"
        " 58 58"
    ),
    7: (
        "50 50 50 50 59 61 61 61 61 61 61 53 52 51 50 49 49 49 49 49 49 49 57 58 59 59 59 59 59 59"
        " 59 59"
    ),
}


def naive(op, S, J):
    """The flow chart in its x_ss form (OP at which motion ended): other variables, same valve."""
    v = [float(np.clip(op[0], 0, 100))]
    moving, d = False, 0
    x_prev = v[0]
    rest = None  # OP that would hold the present position in mid-band
    for u in op:
        x = float(np.clip(u, 0, 100))
        if moving and (x - x_prev) * d <= 0:
            moving = False
        if rest is None:
            rest = x
        if not moving:
            up, down = ((S + J) / 2, (S + J) / 2) if d == 0 else ((J, S) if d > 0 else (S, J))
            if x - rest > up + 1e-12:
                moving, d = True, 1
            elif rest - x > down + 1e-12:
                moving, d = True, -1
        if moving:
            rest = x
            v.append(float(np.clip(x - d * (S - J) / 2, 0, 100)))
        else:
            v.append(v[-1])
        x_prev = x
    return np.array(v[1:])


@pytest.mark.parametrize("J", sorted(GOLDEN))
def test_golden_sequence_holds_exactly(J):
    expected = np.array([float(x) for x in GOLDEN[J].split()])
    assert np.array_equal(valve_position(U, 5.0, float(J)), expected)


@pytest.mark.parametrize(("S", "J"), [(5, 0), (5, 2), (5, 5), (5, 7), (0.5, 0.2)])
def test_flow_chart_in_its_published_variables_gives_the_same_valve(S, J):
    rng = np.random.default_rng(3)
    op = 50 + 5 * np.sin(np.arange(2000) / 20) + np.repeat(rng.normal(0, 3, 200), 10)
    assert np.max(np.abs(valve_position(op, S, J) - naive(op, S, J))) < 1e-9


def test_compiled_trace_is_bit_equal_to_the_plain_steps():
    rng = np.random.default_rng(1)
    op = np.clip(50 + np.cumsum(rng.normal(0, 4, 3000)), -20, 120)
    state, plain = start(op[0]), []
    for u in op:
        state = step(u, state, 4.0, 1.5)
        plain.append(state[0])
    assert np.array_equal(valve_position(op, 4.0, 1.5), plain)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0, 100), min_size=1, max_size=60))
def test_without_friction_the_valve_follows_op(op):
    assert np.array_equal(valve_position(op, 0.0, 0.0), op)
