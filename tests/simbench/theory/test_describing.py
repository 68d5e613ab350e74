"""Describing functions against published numbers, quadrature and the valves themselves;
intersections against golden ones.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from simbench.theory.describing import deadzone, first_harmonic, intersections, measured, stiction
from simbench.theory.sampled import sampled_loop

sizes = st.floats(0.5, 20)


def printed(A, S, J):
    """Eqs. 11.1 and 11.2 with their signs restored."""
    phi = np.arcsin((A - S) / A)
    re = (
        A / 2 * np.sin(2 * phi)
        - 2 * A * np.cos(phi)
        - A * (np.pi / 2 + phi)
        + 2 * (S - J) * np.cos(phi)
    )
    im = -3 * A / 2 + A / 2 * np.cos(2 * phi) + 2 * A * np.sin(phi) - 2 * (S - J) * np.sin(phi)
    return -(re - 1j * im) / (np.pi * A)


@given(S=sizes, ratio=st.floats(0, 2), above=st.floats(1.001, 50))
def test_stiction_equals_the_published_equation(S, ratio, above):
    A = above * S / 2
    assert abs(stiction(S, ratio * S).N(A) - printed(A, S, ratio * S)) < 1e-9


@given(D=sizes, above=st.floats(1.01, 30))
def test_deadzone_equals_its_fourier_integral(D, above):
    A = above * D / 2
    t1 = np.arcsin(D / 2 / A)
    N = 4 / (np.pi * A) * quad(lambda t: (A * np.sin(t) - D / 2) * np.sin(t), t1, np.pi / 2)[0]
    assert abs(deadzone(D).N(A) - N) < 1e-9


@pytest.mark.parametrize("J", [0.0, 1.0, 5.0, 7.5])
def test_measured_first_harmonic_of_the_valve_equals_the_formula(J):
    A = np.array([2.6, 3.0, 5.0, 12.0, 40.0])
    assert (
        np.abs(
            first_harmonic("choudhury", {"S": 5, "J": J}, A, samples=4000) - stiction(5, J).N(A)
        ).max()
        < 1e-3
    )
    if J == 0:
        assert np.abs(first_harmonic("deadband", {"S": 5}, A) - stiction(5, 0).N(A)).max() < 1e-3
        assert (
            np.abs(first_harmonic("deadzone", {"D": 5}, A[1:]) - deadzone(5).N(A[1:])).max() < 1e-3
        )


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, [(122.89, 2.507)]),
        ({"J": 7}, [(35.58, 2.581)]),
        ({"Td": 0.5, "Kc": 2, "Ti": 8, "J": 1}, [(102.34, 2.51)]),
        ({"T": 3, "Td": 6, "Kc": 0.25, "Ti": 3}, [(144.3, 2.544)]),
        ({"Kc": 2.5, "Ti": 7}, [(39.65, 2.672)]),
        ({"K": 2, "Kc": 0.4, "Ti": 20, "J": 3}, []),
        (
            {"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 1.5, "Ti": 30, "J": 0},
            [(127.01, 3.208)],
        ),
        ({"kind": "integrating", "K": 0.1, "Td": 1, "Kc": 2, "Ti": None}, [(61.44, 2.507)]),
        ({"J": 0}, []),
    ],
)
def test_intersections_give_the_golden_cycles(loop, settings, expected):
    sampled = sampled_loop(loop(**settings, Ts=0.5))
    balances = intersections(sampled, stiction(sampled.S, sampled.J))
    assert [f.stable for f in balances] == [True] * len(expected)
    for f, (period, amplitude) in zip(balances, expected, strict=True):
        assert f.period == pytest.approx(period, rel=2e-4)
        assert f.amplitude == pytest.approx(amplitude, abs=1e-3)


def test_deadzone_makes_an_unstable_loop_jump_but_no_stable_loop_cycle(loop):
    # K Kc = 12 is beyond the ultimate gain 8.5: the zone lowers the gain at small amplitudes, so
    # the cycle repels
    [balances] = intersections(sampled_loop(loop(Ti=None, Kc=12)), deadzone(4.0))
    assert not balances.stable
    assert intersections(sampled_loop(loop(Ti=None, Kc=4)), deadzone(4.0)) == []


def test_describing_function_of_a_valve_that_stops_at_every_sample_follows_its_stop():
    valve = measured("stenman", {"d": 4.0})
    assert 3.5 < valve.low < 5
    assert abs(valve.N(np.array(40.0))) == pytest.approx(1, abs=0.05)
