"""Describing functions of the valve maps, their -1/N curves, and where these meet the loop's
Nyquist curve.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator
from scipy.optimize import root

from simbench.detectors.errors import ParameterError
from simbench.loop.response import valve_response
from simbench.theory.sampled import SampledLoop


@dataclass(frozen=True, eq=False)
class _DescribingFunction:
    """Gain of a valve map for the fundamental of a sine of amplitude A (%), from `low` to
    `high`.
    """

    N: Callable[[np.ndarray], np.ndarray]  # A (%) -> complex gain
    # low, high: amplitudes (%) between which N is known and not 0
    low: float
    high: float

    def critical(self, A: ArrayLike) -> np.ndarray:
        """Return -1/N(A), the curve that the Nyquist curve must meet for a limit cycle."""
        return -1 / self.N(np.asarray(A, dtype=float))


@dataclass(frozen=True)
class _Intersection:
    """A limit cycle predicted by the describing function."""

    period: float  # s
    amplitude: float  # of the fundamental of OP (%)
    stable: bool  # whether a small change of the amplitude dies out


def stiction(S: float, J: float) -> _DescribingFunction:
    """Describing function of the two-parameter stiction map; J = 0 is the dead-band.

    Choudhury, Thornhill and Shah (2005), Control Engineering Practice 13, 641, whose form is N =
    -(P_re - j P_im)/(pi A) (the chapter's Eqs. 11.1 and 11.2 lost the signs).
    """
    if not (S > 0 and J >= 0):
        raise ParameterError(f"describing function: S = {S}, J = {J}; S > 0 and J >= 0 are needed")
    fd = 0.5 * (S - J)

    # u = A sin(t). Past its top at t = pi/2 the valve stands at v = A - fd, until u has come down
    # by S: t = pi - phi with sin(phi) = (A - S)/A. Then it moves with v = A sin(t) + fd down to t =
    # 3 pi/2, and the other half mirrors this one:
    #   b = 2/pi int v sin = 2/pi [(A - 2 fd) cos(phi) + A/2 (pi/2 + phi - sin(phi) cos(phi))]
    # a = 2/pi int v cos = 2/pi [A (sin(phi) - 1) - 2 fd sin(phi) + A/2 cos(phi)^2],     N = (b + j
    # a)/A
    def N(A):
        sin = np.clip((A - S) / A, -1.0, 1.0)
        phi = np.arcsin(sin)
        cos = np.sqrt(1 - sin**2)
        b = (A - 2 * fd) * cos + 0.5 * A * (np.pi / 2 + phi - sin * cos)
        a = A * (sin - 1) - 2 * fd * sin + 0.5 * A * cos**2
        return 2 / np.pi * (b + 1j * a) / A

    return _DescribingFunction(N, 0.5 * S, np.inf)


def deadzone(D: float) -> _DescribingFunction:
    """Describing function of a dead-zone around the operating point.

    Gelb and Vander Velde (1968), Multiple-Input Describing Functions, table B. -1/N runs along the
    real axis left of -1, so that a stable loop never meets it.
    """
    if not D > 0:
        raise ParameterError(f"describing function: D = {D}; a width above 0 is needed")

    # v = A sin(t) - D/2 where A sin(t) > D/2 = A sin(t1), so N = 4/(pi A) int_t1^{pi/2} (A sin t -
    # D/2) sin t dt
    def N(A):
        x = np.minimum(0.5 * D / A, 1.0)
        return (1 - 2 / np.pi * (np.arcsin(x) + x * np.sqrt(1 - x**2))).astype(complex)

    return _DescribingFunction(N, 0.5 * D, np.inf)


def first_harmonic(
    model: str,
    parameters: Mapping[str, Any],
    A: ArrayLike,
    *,
    period: float = 100.0,
    samples: int = 1000,
    centre: float = 50.0,
) -> np.ndarray:
    """Measure the describing function of any valve model: the fundamental of MV under a sine of OP.

    A sine between S/2 and S/2 + J/2 has two steady answers, rest and full cycle; a first period
    with a larger amplitude selects the cycle. Error about 0.2 times J over A per 1000 samples at
    the jumps.
    """
    A = np.atleast_1d(np.asarray(A, dtype=float))
    t = 2 * np.pi * np.arange(4 * samples) / samples
    wave = np.exp(-1j * t[-samples:])
    out = np.empty(A.size, dtype=complex)
    for i, a in enumerate(A):
        large = min(2 * a + 10, min(centre, 100 - centre))
        # the amplitude comes down over the second period, without a jump of OP
        size = a + (large - a) * np.clip(2 - t / (2 * np.pi), 0, 1)
        mv = valve_response(model, centre + size * np.sin(t), parameters, period / samples)
        out[i] = 2j / a * np.mean((mv[-samples:] - centre) * wave)
    return out


def measured(model: str, parameters: Mapping[str, Any], **settings: Any) -> _DescribingFunction:
    """Describing function of any valve model, measured at 80 amplitudes and interpolated."""
    # The first harmonic at every amplitude
    A = np.geomspace(0.05, 49.0, 80)
    N = first_harmonic(model, parameters, A, **settings)

    # Below the first amplitude that moves the valve there is none
    moves = np.nonzero(np.abs(N) < 1e-6)[0]
    if moves.size:
        first = moves[-1] + 1
    else:
        first = 0
    if first > A.size - 2:
        raise ParameterError(
            f"describing function: valve {model!r} does not move under a sine of {A[-1]:g} %"
        )

    # Interpolated over the logarithm of the amplitude
    x = np.log(A[first:])
    re = N.real[first:]
    im = N.imag[first:]
    real = PchipInterpolator(x, re)
    imag = PchipInterpolator(x, im)
    return _DescribingFunction(
        lambda a: real(np.log(a)) + 1j * imag(np.log(a)), float(A[first]), float(A[-1])
    )


def intersections(loop: SampledLoop, valve: _DescribingFunction) -> list[_Intersection]:
    """Find all limit cycles that the describing function predicts: L(j w) N(A) = -1.

    Real and imaginary part of L N + 1 change sign in a cell of a grid in log frequency and
    log(A/low - 1); from there Newton's method. Qualitative: OP is a triangle rather than a sine,
    periods are off by -22 to +38 %, and cycles exist (PI with Ti > T
    + Td) where the curves do not meet. For numbers see `simbench.theory.cycle`.
    """
    w = np.geomspace(1e-5 / max(loop.times), 50 / min(loop.times), 500)
    top = min(1e3, valve.high / valve.low - 1)
    a = np.geomspace(1e-6, top, 240)
    F = 1 + loop.response(w)[:, None] * valve.N(valve.low * (1 + a))[None, :]

    def brackets(part):
        corners = np.stack([part[:-1, :-1], part[1:, :-1], part[:-1, 1:], part[1:, 1:]])
        return (corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0)

    def gap(x):
        F = 1 + loop.response(np.exp(x[0])) * valve.N(np.asarray(valve.low * (1 + np.exp(x[1]))))
        return [float(F.real), float(F.imag)]

    found: list[_Intersection] = []
    for i, j in zip(*np.nonzero(brackets(F.real) & brackets(F.imag))):
        start = [0.5 * np.log(w[i] * w[i + 1]), 0.5 * np.log(a[j] * a[j + 1])]
        solved = root(gap, start)
        near = np.abs(solved.x - start) < [1.0, 1.5]
        if not (solved.success and near.all() and max(map(abs, solved.fun)) < 1e-8):
            continue
        period = 2 * np.pi / np.exp(solved.x[0])
        A = valve.low * (1 + np.exp(solved.x[1]))
        if all(abs(np.log(period / f.period)) > 1e-6 for f in found):
            found.append(
                _Intersection(
                    float(period),
                    float(A),
                    _is_attracting(loop, valve, 2 * np.pi / period, float(A)),
                )
            )
    return sorted(found, key=lambda f: f.period)


def _is_attracting(loop: SampledLoop, valve: _DescribingFunction, w: float, A: float) -> bool:
    # Loeb: 1 + N(A) L(s) = 0 stays true when A grows by dA if s moves by ds = -(dN/dA L)/(N dL/ds)
    # dA, with dL/ds = -j dL/dw; the cycle attracts when a larger amplitude decays, Re ds < 0
    h = 1e-5
    dN = (valve.N(np.asarray(A * (1 + h))) - valve.N(np.asarray(A * (1 - h)))) / (2 * A * h)
    dL = (loop.response(w * (1 + h)) - loop.response(w * (1 - h))) / (2 * w * h)
    return bool((-(dN * loop.response(w)) / (valve.N(np.asarray(A)) * -1j * dL)).real < 0)
