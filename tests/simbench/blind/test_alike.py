"""Groups that cannot be told apart follow from the configuration, and from nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.blind.alike import Facts, facts_of, indistinguishable
from simbench.gap.likelihood.kernels import plant
from simbench.loop.effects import BLOCKS, EFFECTS, Choice, block_of

BARE = Facts(integrating=False, sp_moves=True, mv=False, noise_shows=False, op_jitter=0.0, J=None, slow=False)


def alike(effect, **facts):
    return set(indistinguishable(effect, replace(BARE, **facts)))


def test_there_are_22_effects_in_five_blocks():
    assert len(EFFECTS) == 22
    assert {e.block for e in EFFECTS.values()} == set(BLOCKS)
    assert block_of("unknown") == "unknown"
    with pytest.raises(KeyError):
        block_of("stickshun")


def test_the_identity_of_every_parameter_lies_within_its_bounds():
    for effect in EFFECTS.values():
        for name, q in effect.parameters.items():
            if not isinstance(q, Choice):
                assert q.low <= q.identity <= q.high, name


def test_one_series_pole_has_three_places():
    assert alike("extra_lag") == {"valve_lag", "extra_lag", "sensor_lag"}
    assert alike("extra_lag", mv=True) == {"extra_lag", "sensor_lag"}
    assert alike("extra_lag", noise_shows=True) == {"valve_lag", "extra_lag"}
    assert alike("extra_lag", mv=True, noise_shows=True) == {"extra_lag"}
    assert alike("valve_lag", mv=True) == {"valve_lag"}


def test_slow_loads_and_sensor_drift_look_alike_only_when_slow_and_self_regulating():
    assert alike("drift", slow=True) == {"drift", "load_drift", "load_steps"}
    assert alike("drift") == {"drift"}
    assert alike("drift", slow=True, integrating=True) == {"drift"}


def test_stiction_and_deadband_look_alike_when_op_jitters_by_more_than_j():
    assert alike("stiction", J=0.5, op_jitter=0.6) == {"stiction", "deadband"}
    assert alike("stiction", J=0.5, op_jitter=0.4) == {"stiction"}
    assert alike("stiction", J=None, op_jitter=9.0) == {"stiction"}
    assert alike("stiction", J=0.5, op_jitter=0.6, mv=True) == {"stiction"}


def test_local_gain_needs_a_moving_set_point():
    assert alike("deadzone", sp_moves=False) == {"deadzone", "valve_characteristic", "gain_mismatch"}
    assert alike("deadzone", sp_moves=False, mv=True) == {"deadzone"}
    assert alike("time_constant_mismatch", sp_moves=False) == {"gain_mismatch", "time_constant_mismatch"}
    assert alike("time_constant_mismatch", sp_moves=False, integrating=True) == {"time_constant_mismatch"}
    assert alike("gain_mismatch", sp_moves=False) >= {"deadzone", "time_constant_mismatch"}
    assert alike("gain_mismatch") == {"gain_mismatch"}


@given(
    st.sampled_from(sorted(EFFECTS)), st.sampled_from(sorted(EFFECTS)),
    st.builds(
        Facts, *[st.booleans()] * 4, op_jitter=st.floats(0, 5), J=st.none() | st.floats(0, 5), slow=st.booleans(),
        ramp=st.booleans(),
    ),
)  # fmt: skip
def test_looking_alike_is_mutual_and_includes_oneself(a, b, facts):
    assert a in indistinguishable(a, facts)
    assert (b in indistinguishable(a, facts)) == (a in indistinguishable(b, facts))


def test_facts_come_from_baseline_and_record():
    rng = np.random.default_rng(3)
    noise, walk = rng.standard_normal(4000), np.cumsum(rng.standard_normal(4000))
    table = {"plant": {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0}, "noise": {"std": 1.0}}
    flat, stepped = np.zeros(4000), np.repeat([0.0, 10.0], 2000)
    facts = facts_of(table, flat, 50 + 0.2 * noise, noise, None, "stiction", {"S": 3.0, "J": 0.1})
    assert facts.noise_shows
    assert not facts.sp_moves
    assert not facts.mv
    assert facts.op_jitter == pytest.approx(0.2 * np.sqrt(2), rel=0.05)
    assert facts.J == 0.1
    assert facts_of(table, stepped, noise, noise, noise).sp_moves
    assert facts_of(table, stepped, noise, noise, noise).mv
    assert not facts_of(table, flat, noise, 20 * walk, None).noise_shows
    assert not facts_of(table, None, noise, noise, None).sp_moves


def test_ramps_of_any_size_at_either_end_of_a_self_regulating_plant_look_alike():
    assert alike("drift", ramp=True) == alike("load_drift", ramp=True) == {"drift", "load_drift"}
    assert alike("load_steps", ramp=True) == {"load_steps"}
    assert alike("drift", ramp=True, integrating=True) == {"drift"}
    ramp = np.linspace(0.0, 100.0, 400)
    left = plant(ramp, 12.0, 3.0, 0.0) - ramp
    np.testing.assert_allclose(left[250:], left[-1], atol=1e-6)


@pytest.mark.parametrize(("walk", "ramp"), [(0.0, True), (1e-4, True), (1.0, False)])
def test_a_ramp_is_one_as_long_as_its_walk_hides_in_the_noise(walk, ramp):
    table = {"plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 2.0}, "noise": {"std": 0.1}}
    x = np.random.default_rng(0).standard_normal(300)
    assert facts_of(table, None, x, x, None, "drift", {"rate": 5.0, "walk": walk}).ramp is ramp


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
    table = {"plant": {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0}, "noise": {"std": 1.0}}
    x = np.random.default_rng(0).standard_normal(100)
    assert facts_of(table, None, x, x, None, effect, parameters).slow is slow
