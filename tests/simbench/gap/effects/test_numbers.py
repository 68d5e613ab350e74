"""From a fit to the numbers of the loop file, and what an effect takes for its own: cases with
known answers.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.closed_loop.level import kick_of
from simbench.gap.closed_loop.loop_from_fit import shift_by_ramps
from simbench.gap.effects import (
    Recogniser,
    load_drift,
    load_steps,
    oscillation,
    recogniser,
)

DATA = SimpleNamespace(n=1000, K=2.0, T=10.0, Td=4.0, noise=0.2, late=0, loads={}, measured=False)
TRUSTED = SimpleNamespace(**vars(DATA), trusted=True)
SITUATION = SimpleNamespace(data=DATA, record=SimpleNamespace(Ts=2.0))


def fit(K=1.0, linear=(), jumps=(), **theta):
    """Return a fit with gain K, its bias and onset, and an effect's own linear numbers."""
    spec = SimpleNamespace(jumps=jumps, pole="", fade=False)
    return SimpleNamespace(K=K, beta=np.array([K, 0.3, 0.7, *linear]), theta=theta, spec=spec)


@pytest.mark.parametrize(
    ("effect", "fitted", "numbers"),
    [
        ("valve_lag", fit(tau=3.0), {"tau": 6.0}),
        ("dead_time_mismatch", fit(Td=7.0), {"extra": 6.0}),
        ("dead_time_mismatch", fit(Td=1.0), {"extra": -6.0}),
        ("time_constant_mismatch", fit(T=30.0), {"factor": 3.0}),
        ("time_constant_mismatch", fit(T=300.0), {"factor": 20.0}),
        ("gain_mismatch", fit(K=0.5), {"factor": 0.25}),
        ("gain_mismatch", fit(K=0.01), {"factor": 0.05}),
        ("noise", fit(noise_std=0.5), {"factor": 2.5}),
        ("stiction", fit(S=5.0, J=2.0), {"S": 5.0, "J": 2.0}),
        ("deadzone", fit(D=3.0, c=50.0), {"D": 3.0, "c": 50.0}),
        ("valve_characteristic", fit(R=0.001), {"R": 0.01}),
        ("drift", fit(linear=(40.0,), walk=0.3), {"rate": 0.02, "walk": 0.3 / np.sqrt(2.0)}),
        (
            "load_drift",
            fit(K=-0.5, linear=(40.0,), load_walk=0.3),
            {"rate": -0.04, "walk": 0.6 / np.sqrt(2.0)},
        ),
    ],
)
def test_a_fits_numbers_are_those_of_the_loop_file(effect, fitted, numbers):
    assert recogniser(effect).numbers(fitted, SITUATION) == pytest.approx(numbers)


def test_an_op_that_is_archived_late_hides_a_sample_of_the_dead_time():
    late = SimpleNamespace(data=SimpleNamespace(Td=4.0, late=1), record=SITUATION.record)
    numbers = recogniser("dead_time_mismatch").numbers(fit(Td=7.0), late)
    assert numbers == {"extra": pytest.approx(8.0)}


def test_a_sine_on_pv_is_as_large_at_the_input_as_the_plant_makes_it_small():
    # 3-4-5: amplitude 5; at a period of 2 pi T the pole takes a factor of the root of 2
    sine = recogniser("oscillation").numbers(
        fit(K=2.0, linear=(3.0, 4.0), period=20 * np.pi, T=10.0), SITUATION
    )
    assert sine == pytest.approx({"amplitude": 2.5 * np.sqrt(2.0), "period": 40 * np.pi})
    vessel = SimpleNamespace(data=SimpleNamespace(T=0.0, K=2.0), record=SITUATION.record)
    sine = recogniser("oscillation").numbers(
        fit(K=2.0, linear=(3.0, 4.0), period=20 * np.pi), vessel
    )
    assert sine["amplitude"] == pytest.approx(0.25)


@pytest.mark.parametrize("effect", ["oscillation", "load_drift", "load_steps"])
def test_a_load_after_a_valve_that_never_moved_has_a_size(effect):
    still = fit(
        K=0.0, linear=(3.0, 4.0), jumps=(200,), period=60.0, T=10.0, load_walk=0.3, load_jump=8.0
    )
    assert all(np.isfinite(x) for x in recogniser(effect).numbers(still, SITUATION).values())


def test_load_steps_are_counted_and_sized_in_percent_of_op():
    steps = load_steps.numbers(fit(K=-2.0, jumps=(200, 500, 700), load_jump=8.0), SITUATION)
    # two parts of 8 are a jump of 8 sqrt(2), between levels that spread by 8: 4 % at the input
    assert steps == pytest.approx({"rate": 3 / 2000.0, "size": 4.0})


def test_jumps_are_ordinary_up_to_half_as_large_again_as_healthy_records_show():
    jumping = fit(K=-1.0, jumps=(100, 200), load=0.2, load_jump=0.5)
    assert not plain(load_steps, jumping, TRUSTED)
    known = SimpleNamespace(**(vars(TRUSTED) | {"loads": {"steps": 2.0}, "measured": True}))
    for size, is_ordinary in ((2.9, True), (3.1, False)):
        jumping = fit(K=-1.0, jumps=(100, 200), load=0.5, load_jump=size)
        assert plain(load_steps, jumping, known) is is_ordinary
    # and so are those that fade as the load does, its kicks, and a single one
    jumping.spec.fade = True
    assert plain(load_steps, jumping, known)
    assert plain(load_steps, fit(K=-1.0, jumps=(100,), load=0.5, load_jump=3.1), known)
    # the load of an identified loop is its own
    assert plain(load_steps, jumping, known, trusted=False)


def beside(data, trusted=True):
    """Return a situation with a record of 1000 samples."""
    record = SimpleNamespace(n=1000, Ts=1.0, duration=1000.0)
    return SimpleNamespace(data=data, record=record, trusted=trusted)


def plain(effect, shown, data, **more):
    """Return whether a fit shows an ordinary load of its kind."""
    return effect.ordinary(shown, beside(data, **more))


@pytest.mark.parametrize(
    ("ramp", "walk", "drifts"), [(5.0, 0.0, True), (7.0, 0.0, False), (4.0, 5.0 / 1000**0.5, False)]
)
def test_a_load_drifts_half_as_far_again_as_healthy_records_show(ramp, walk, drifts):
    # K = 2: two percent are four of PV
    drifting = SimpleNamespace(beta=np.array([2.0, 0.0, 0.0, ramp]), K=2.0)
    drifting.theta = {"load_walk": walk}
    data = SimpleNamespace(n=1000, K=2.0, loads={}, measured=False)
    assert not plain(load_drift, drifting, data)
    assert plain(load_drift, drifting, data, trusted=False)
    data.measured, data.loads = True, {"slow": 2.0}
    assert plain(load_drift, drifting, data) is drifts


def test_what_a_file_does_not_say_of_an_effect_adds_nothing():
    bare = Recogniser()
    assert bare.numbers(None, None) == {}
    assert bare.proven(None) is None
    assert not bare.ordinary(None, None)
    assert bare.needs == frozenset()


def test_only_a_ramp_moves_the_mean_of_op_and_only_a_jump_needs_a_kick():
    ramps = {"load_drift": {"rate": 0.02, "walk": 3.0}, "drift": {"rate": 0.04, "walk": 3.0}}
    assert shift_by_ramps({"load_drift": ramps["load_drift"]}, 100.0, 2.0) == pytest.approx(2.0)
    # the controller moves OP against a ramp that it takes for PV
    assert shift_by_ramps({"drift": ramps["drift"]}, 100.0, 2.0) == pytest.approx(2.0)
    assert shift_by_ramps({"drift": ramps["drift"]}, 100.0, np.inf) == 0.0
    assert (
        shift_by_ramps({"load_steps": {"rate": 1.0, "size": 2.0}, "noise": {}}, 100.0, 2.0) == 0.0
    )
    assert kick_of({"S": 3.0, "J": 1.0}) == 3.0
    assert kick_of({"S": 3.0}) == kick_of({"rate": 1.0}) == 0.0


@pytest.mark.parametrize(("noise", "rounding", "band", "drowned"), [
    (0.1, None, 0.0, False), (0.1, (0.5, "loop"), 0.0, True), (0.1, None, 0.2, True),
])  # fmt: skip
def test_noise_is_not_judged_where_rounding_or_compression_makes_some(
    noise, rounding, band, drowned
):
    archive = SimpleNamespace(rounding=rounding, band=band)
    s = SimpleNamespace(archive=archive, loads_on_pv=[])
    assert recogniser("noise").ordinary(None, s) is drowned
    # nor where the baseline states a load that does the same
    s.loads_on_pv = [{"type": "coloured"}]
    assert recogniser("noise").ordinary(None, s)
    assert recogniser("drift").ordinary(None, s)


@pytest.mark.parametrize(("period", "load"), [(110.0, False), (150.0, True)])
def test_an_oscillation_of_fewer_than_eight_periods_wanders_as_an_identified_load(period, load):
    sine = fit(K=1.0, linear=(0.6, 0.8), period=period, T=1e-3)
    of_plant = {"T": 1.0, "K": 1.0, "sines": (), "loads": {}}
    s = beside(SimpleNamespace(measured=False, **of_plant), trusted=False)
    assert oscillation.ordinary(sine, s) == load
    # beside a loop file only up to half as far again as healthy records wander
    s.trusted = True
    assert not oscillation.ordinary(sine, s)
    s.data.loads = {"slow": 0.7}
    assert oscillation.ordinary(sine, s) == load
    s.data.loads = {"slow": 0.6}
    assert not oscillation.ordinary(sine, s)


@pytest.mark.parametrize(
    ("period", "amplitude", "ordinary"),
    [(50.0, 3.0, True), (52.0, 3.0, True), (53.0, 3.0, False), (50.0, 4.6, False)],
)
def test_a_sine_that_the_baseline_states_is_an_ordinary_load(period, amplitude, ordinary):
    stated = SimpleNamespace(T=1.0, K=1.0, sines=((50.0, 3.0),), measured=False, loads={})
    sine = fit(K=1.0, T=1e-3, linear=(0.6 * amplitude, 0.8 * amplitude), period=period)
    assert plain(oscillation, sine, stated) is ordinary
    stated.sines = ()
    assert not plain(oscillation, sine, stated)
