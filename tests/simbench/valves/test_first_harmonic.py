"""The simulated Choudhury valve under a sine has the first harmonic that Eq. 11.1 says."""

from math import asin, cos, pi, sin

import numpy as np

from simbench.loop.response import valve_response


def describing_function(A, S, J):
    """Eq. 11.1-11.2 with the signs and fractions restored (Choudhury, Thornhill and Shah 2005)."""
    phi = asin((A - S) / A)
    re = A / 2 * sin(2 * phi) - 2 * A * cos(phi) - A * (pi / 2 + phi) + 2 * (S - J) * cos(phi)
    im = -3 * A / 2 + A / 2 * cos(2 * phi) + 2 * A * sin(phi) - 2 * (S - J) * sin(phi)
    return -(re - 1j * im) / (pi * A)


def first_harmonic(A, S, J, n=20000):
    wave = np.sin(2 * np.pi * np.arange(n) / n)
    # below (S + J)/2 a valve at rest would never start: one push, then the cycle
    op = 50 + np.concatenate(
        [[0.0, (S + J) + A], np.roll(A * wave, -3 * n // 4), np.tile(A * wave, 2)]
    )
    mv = valve_response("choudhury", op, {"S": S, "J": J})[-n:]
    return 2j / (n * A) * np.sum((mv - 50) * np.exp(-2j * np.pi * np.arange(n) / n))


def test_first_harmonic_is_eq_11_1_for_108_amplitudes_and_bands():
    cases = [
        (ratio * S / 2, S, share * S)
        for S in (0.5, 1.0, 4.0)
        for share in (0.0, 0.2, 0.5, 0.8, 1.0, 1.5)
        for ratio in (1.01, 1.2, 1.6, 2.5, 6.0, 20.0)
    ]
    assert len(cases) >= 100
    error = [abs(first_harmonic(*case) - describing_function(*case)) for case in cases]
    assert max(error) < 1e-3
