"""The maps of a valve beside other statements of the same: what each must do under any OP."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.valve import maps

OPS = st.lists(st.floats(-10.0, 110.0), min_size=1, max_size=60)
SIZES = st.floats(0.0, 20.0)


@given(ops=OPS, S=SIZES)
def test_a_play_moves_only_when_its_band_pushes_it(ops, S):
    v = 50.0
    for u in ops:
        before, x = v, np.clip(u, 0.0, 100.0)
        v = maps.play(u, v, S)
        assert abs(x - v) <= 0.5 * S + 1e-12
        assert v == before or abs(x - v) == pytest.approx(0.5 * S, abs=1e-12)


@given(u=st.floats(-10.0, 110.0), D=SIZES, c=st.floats(20.0, 80.0))
def test_a_zone_is_its_formula(u, D, c):
    x = np.clip(u, 0.0, 100.0)
    expected = c + np.sign(x - c) * max(abs(x - c) - 0.5 * D, 0.0)
    assert maps.zone(u, D, c) == pytest.approx(expected, abs=1e-9)


@given(ops=OPS, S=SIZES)
def test_without_a_jump_a_sticking_valve_is_a_play(ops, S):
    state, v = maps.at_rest(50.0), 50.0
    for u in ops:
        state, v = maps.stick(u, state, S, 0.0), maps.play(u, v, S)
        assert state[0] == pytest.approx(v, abs=1e-9)
