"""From a fit to the numbers of the loop file, and what an effect takes for its own: cases with
known answers.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.effects import (
    Recogniser,
    oscillation,
    recogniser,
)

DATA = SimpleNamespace(n=1000, K=2.0, T=10.0, Td=4.0, noise=0.2, late=0, loads={}, measured=False)
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


def beside(data, trusted=True):
    """Return a situation with a record of 1000 samples."""
    record = SimpleNamespace(n=1000, Ts=1.0, duration=1000.0)
    return SimpleNamespace(data=data, record=record, trusted=trusted)


def plain(effect, shown, data, **more):
    """Return whether a fit shows an ordinary load of its kind."""
    return effect.ordinary(shown, beside(data, **more))


def test_what_a_file_does_not_say_of_an_effect_adds_nothing():
    bare = Recogniser()
    assert bare.numbers(None, None) == {}
    assert bare.proven(None) is None
    assert not bare.ordinary(None, None)
    assert bare.needs == frozenset()


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
