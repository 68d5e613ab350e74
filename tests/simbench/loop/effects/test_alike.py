"""Groups that cannot be distinguished follow from the configuration, and from nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.loop.effects import EFFECTS
from simbench.loop.effects._alike import Circumstances, circumstances, indistinguishable

BARE = Circumstances(sp_moves=True)
PLANT = {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0}
VESSEL = {"type": "integrating", "K": 0.05, "Td": 6.0}
N = 1000
PV, OP = np.resize([1.0, -1.0], N), 50.0 + np.resize([0.0, 1.0, 1.0], N)


def alike(effect, **here):
    return set(indistinguishable(effect, replace(BARE, **here)))


def test_one_series_pole_has_three_places():
    assert alike("extra_lag") == {"valve_lag", "extra_lag", "sensor_lag"}
    assert alike("extra_lag", mv=True) == {"extra_lag", "sensor_lag"}
    assert alike("extra_lag", noise_shows=True) == {"valve_lag", "extra_lag"}
    assert alike("extra_lag", mv=True, noise_shows=True) == {"extra_lag"}
    assert alike("valve_lag", mv=True) == {"valve_lag"}


def test_stiction_and_deadband_look_alike_when_op_jitters_by_more_than_j():
    assert alike("stiction", J=0.5, op_jitter=0.6) == {"stiction", "deadband"}
    assert alike("stiction", J=0.5, op_jitter=0.4) == {"stiction"}
    assert alike("stiction", J=None, op_jitter=9.0) == {"stiction"}
    assert alike("stiction", J=0.5, op_jitter=0.6, mv=True) == {"stiction"}


@given(
    st.sampled_from(sorted(EFFECTS)),
    st.sampled_from(sorted(EFFECTS)),
    st.builds(
        Circumstances,
        *[st.booleans()] * 4,
        op_jitter=st.floats(0, 5),
        J=st.none() | st.floats(0, 5),
        slow=st.booleans(),
        ramp=st.booleans(),
    ),
)
def test_looking_alike_is_mutual_and_includes_oneself(a, b, facts):
    assert a in indistinguishable(a, facts)
    assert (b in indistinguishable(a, facts)) == (a in indistinguishable(b, facts))


@pytest.mark.parametrize(("walk", "ramp"), [(0.0, True), (1e-4, True), (1.0, False)])
def test_a_ramp_is_one_as_long_as_its_walk_hides_in_the_noise(walk, ramp):
    assert (
        circumstances(PLANT, 0.1, None, OP, PV, None, "drift", {"rate": 5.0, "walk": walk}).ramp
        is ramp
    )
    assert not circumstances(
        PLANT, 0.1, None, OP, PV, None, "drift", {"rate": 0.0, "walk": walk}
    ).ramp


@pytest.mark.parametrize(
    ("effect", "parameters", "slow"),
    [
        ("drift", {"rate": 0.01, "walk": 0.0}, True),  # 12 s x 0.01 PV/s is hidden in noise of 1
        ("drift", {"rate": 0.0, "walk": 0.5}, False),  # 0.5 sqrt(12) is not
        ("load_drift", {"rate": 0.01}, True),
        ("load_drift", {"rate": 0.05}, False),  # a load acts with the plant's gain 2
        ("load_steps", {"rate": 0.01, "size": 0.4}, True),
        ("load_steps", {"rate": 0.01, "size": 2.0}, False),
        ("load_steps", {}, False),
        ("stiction", {"S": 1.0}, False),
    ],
)
def test_slow_means_hidden_in_the_noise_within_the_plants_time_scale(effect, parameters, slow):
    assert circumstances(PLANT, 1.0, None, OP, PV, None, effect, parameters).slow is slow
    assert not circumstances(VESSEL, 1.0, None, OP, PV, None, effect, parameters).slow
