"""Groups that cannot be distinguished follow from the configuration, and from nothing else."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.gap.likelihood.kernels import plant
from simbench.loop.effects import BLOCKS, EFFECTS, Choice, block_of
from simbench.loop.effects._alike import Circumstances, circumstances, indistinguishable

BARE = Circumstances(sp_moves=True)
PLANT = {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0}
VESSEL = {"type": "integrating", "K": 0.05, "Td": 6.0}
N = 1000
PV, OP = np.resize([1.0, -1.0], N), 50.0 + np.resize([0.0, 1.0, 1.0], N)


def alike(effect, **here):
    return set(indistinguishable(effect, replace(BARE, **here)))


def test_there_are_26_effects_in_five_blocks():
    assert len(EFFECTS) == 26
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
    assert alike("deadzone", sp_moves=False) == {
        "deadzone",
        "valve_characteristic",
        "gain_mismatch",
    }
    assert alike("deadzone", sp_moves=False, mv=True) == {"deadzone"}
    assert alike("time_constant_mismatch", sp_moves=False) == {
        "gain_mismatch",
        "time_constant_mismatch",
    }
    assert alike("time_constant_mismatch", sp_moves=False, integrating=True) == {
        "time_constant_mismatch"
    }
    assert alike("gain_mismatch", sp_moves=False) >= {"deadzone", "time_constant_mismatch"}
    assert alike("gain_mismatch") == {"gain_mismatch"}


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


def test_circumstances_come_from_baseline_and_record():
    rng = np.random.default_rng(3)
    noise, walk = rng.standard_normal(4000), np.cumsum(rng.standard_normal(4000))
    flat, stepped = np.zeros(4000), np.repeat([0.0, 10.0], 2000)
    here = circumstances(
        PLANT, 1.0, flat, 50 + 0.2 * noise, noise, None, "stiction", {"S": 3.0, "J": 0.1}
    )
    assert here.noise_shows
    assert not here.sp_moves
    assert not here.mv
    assert here.op_jitter == pytest.approx(0.2 * np.sqrt(2), rel=0.05)
    assert here.J == 0.1
    assert circumstances(PLANT, 1.0, stepped, noise, noise, noise).sp_moves
    assert circumstances(PLANT, 1.0, stepped, noise, noise, noise).mv
    assert not circumstances(PLANT, 1.0, flat, noise, 20 * walk, None).noise_shows
    assert not circumstances(PLANT, 1.0, None, noise, noise, None).sp_moves
    assert circumstances(VESSEL, 0.1, None, OP, PV, None).integrating
    assert not any(getattr(Circumstances(), name) for name in Circumstances.__dataclass_fields__)


@pytest.mark.parametrize(
    ("effect", "parameters", "J"),
    [
        ("stiction", {"S": 3.0, "J": 0.4}, 0.4),
        ("stiction", {"S": 3.0}, None),
        ("deadband", {"S": 3.0}, 0.0),
        ("deadband", None, 0.0),
        ("deadzone", {"D": 3.0}, None),
        ("none", None, None),
    ],
)
def test_the_slip_jump_is_the_effects_own(effect, parameters, J):
    assert circumstances(PLANT, 0.1, None, OP, PV, OP, effect, parameters).J == J


@pytest.mark.parametrize(("noise", "shows"), [(0.0, False), (0.70, False), (0.72, True)])
def test_noise_shows_from_a_quarter_of_the_variance_of_pvs_changes(noise, shows):
    # PV jumps by 2 at every sample: a variance of 4, and noise of 0.71 makes 1 of it
    assert circumstances(PLANT, noise, None, OP, PV, None).noise_shows == shows


@pytest.mark.parametrize(("move", "moves"), [(0.0, False), (0.19, False), (0.21, True)])
def test_a_set_point_moves_from_twice_the_noise(move, moves):
    assert circumstances(PLANT, 0.1, np.linspace(0.0, move, N), OP, PV, None).sp_moves == moves


@pytest.mark.parametrize("drift", [0.0, 0.3])
def test_ops_jitter_is_the_robust_size_of_its_changes_about_their_median(drift):
    # changes of 1, 0 and -1 besides the drift: a median distance of 1
    assert circumstances(
        PLANT, 0.1, None, OP + drift * np.arange(N), PV, None
    ).op_jitter == pytest.approx(1.4826)


def test_ramps_of_any_size_at_either_end_of_a_self_regulating_plant_look_alike():
    assert alike("drift", ramp=True) == alike("load_drift", ramp=True) == {"drift", "load_drift"}
    assert alike("load_steps", ramp=True) == {"load_steps"}
    assert alike("drift", ramp=True, integrating=True) == {"drift"}
    ramp = np.linspace(0.0, 100.0, 400)
    left = plant(ramp, 12.0, 3.0, 0.0) - ramp
    np.testing.assert_allclose(left[250:], left[-1], atol=1e-6)


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


@pytest.mark.parametrize(
    ("rate", "walk", "effect", "slow", "ramp"),
    [
        (0.0019, 0.0, "load_drift", True, True),
        (0.0021, 0.0, "load_drift", False, True),
        (0.0, 0.0095, "load_drift", True, False),
        (-0.0021, 0.0, "load_drift", False, True),
        (0.0, 0.0105, "load_drift", False, False),
        (0.001, 0.0045, "load_drift", True, True),
        (0.001, 0.0055, "load_drift", False, True),
        (0.001, 0.0105, "load_drift", False, False),
        (0.0039, 0.0, "drift", True, True),
        (0.0041, 0.0, "drift", False, True),
        (0.0, 0.0195, "drift", True, False),
        (0.0, 0.0205, "drift", False, False),
    ],
)
def test_what_moves_pv_by_less_than_the_noise_within_t_and_td_is_slow(
    rate, walk, effect, slow, ramp
):
    # K = 2 and T + Td = 25 s: a rate of 0.002 %/s, or a walk of 0.01 %/sqrt(s), moves PV by the
    # noise of 0.1
    plant = PLANT | {"K": -2.0, "T": 20.0, "Td": 5.0}
    context = circumstances(plant, 0.1, None, OP, PV, None, effect, {"rate": rate, "walk": walk})
    assert (context.slow, context.ramp) == (slow, ramp)
    assert ("load_steps" in indistinguishable(effect, context)) == slow
    assert ({"drift", "load_drift"} <= indistinguishable(effect, context)) == (slow or ramp)


@pytest.mark.parametrize("effect", list(EFFECTS))
def test_where_everything_shows_nothing_is_alike(effect):
    assert indistinguishable(effect, Circumstances(sp_moves=True, mv=True, noise_shows=True)) == {
        effect
    }


def test_none_unknown_and_what_is_no_effect_are_alone():
    for name in ("none", "unknown", "a fire"):
        assert indistinguishable(name, Circumstances()) == {name}
