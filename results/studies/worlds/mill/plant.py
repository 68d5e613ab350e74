"""The plant as an exact discrete state-space model: sections in series, zero-order hold, fractional
dead time.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

_Plant = dict[str, Any]


class Discrete(NamedTuple):
    """x(k+1) = A x(k) + old w(k-delay-1) + new w(k-delay), y(k) = c x(k); nothing passes straight
    through.
    """

    A: np.ndarray
    old: np.ndarray
    new: np.ndarray
    c: np.ndarray
    delay: int


def discretise(plant: _Plant, Ts: float) -> Discrete:
    """Return the plant sampled at Ts: exact for an input held over each sample, for any dead time.

    With Td = d Ts + phi the delayed input is w(k-d-1) during the first phi of a sample and w(k-d)
    after it, so old = exp(A (Ts
    - phi)) integral_0^phi exp(A s) ds B and new = integral_0^(Ts - phi) exp(A s) ds B (Astrom and
      Wittenmark,
    Computer-Controlled Systems, 3rd ed., section 2.3).
    """
    A, B, C = _continuous(plant)
    delay = math.floor(plant["Td"] / Ts + 1e-9)
    late = max(0.0, plant["Td"] - delay * Ts)
    if late < 1e-9 * Ts:
        late = 0.0
    phi, before = _held(A, B, late)
    rest, new = _held(A, B, Ts - late)
    return Discrete(
        np.ascontiguousarray(rest @ phi),
        np.ascontiguousarray(rest @ before),
        np.ascontiguousarray(new),
        C,
        delay,
    )


def _continuous(plant: _Plant) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (A, B, C) of the plant without its dead time."""
    integrating = plant["type"] == "integrating"
    first = ("integrator", plant["K"]) if integrating else ("lag", plant["T"], plant["K"])
    A, B, C, _ = _section(first)
    for part in [("lag", tau, 1.0) for tau in plant.get("lags", ())] + [
        tuple(s) for s in plant.get("sections", ())
    ]:
        a, b, c, d = _section(part)
        m, n = len(B), len(b)
        A = np.block([[A, np.zeros((m, n))], [np.outer(b, C), a]])
        B = np.concatenate([B, np.zeros(n)])
        C = np.concatenate([d * C, c])
    return A, B, C


def fitted(T: float | None, Td: float, lags: list[float]) -> tuple[float | None, float]:
    """Return T and Td of the first-order model whose step response agrees with that of a plant with
    small extra lags.

    The mean residence time T + Td is kept (the responses enclose the same area), the split is the
    one with the least squared difference. An integrating plant's ramp is late by Td plus all lags.
    """
    if T is None or not lags:
        return T, Td + sum(lags)
    total = T + sum(lags)
    t = np.linspace(0.0, 6.0 * total, 400)
    A, B, C = _continuous({"type": "foptd", "K": 1.0, "T": T, "lags": lags})
    rest, new = _held(A, B, t[1])
    x, truth = np.zeros(len(B)), np.empty(len(t))
    for i in range(len(t)):
        truth[i] = C @ x
        x = rest @ x + new

    def misfit(theta: float) -> float:
        return float(
            np.sum((truth - (1.0 - np.exp(-np.maximum(t - theta, 0.0) / (total - theta)))) ** 2)
        )

    theta = float(minimize_scalar(misfit, bounds=(0.0, sum(lags)), method="bounded").x)
    return total - theta, Td + theta


def margins(
    g: Discrete, Kc: float, per_sample: float, now: float, before: float
) -> tuple[float, float]:
    """Return the largest sensitivity and the loop gain at the phase crossover of plant and PI
    controller, both sampled.
    """
    w = np.geomspace(1e-3, math.pi, 400)
    z = np.exp(1j * w)
    m = len(g.c)
    right = g.new[None, :] * z[:, None] ** -g.delay + g.old[None, :] * z[:, None] ** -(g.delay + 1)
    x = np.linalg.solve(z[:, None, None] * np.eye(m) - g.A, right[:, :, None])[:, :, 0]
    law = Kc * (1.0 + per_sample * (now + before / z) / (1.0 - 1.0 / z))
    L = (x @ g.c) * law
    phase = np.unwrap(np.angle(L))
    # start between -270 and +90 degrees
    phase -= 2 * math.pi * np.round(phase[0] / (2 * math.pi) + 0.25)
    cross = np.floor((phase[1:] + math.pi) / (2 * math.pi)) != np.floor(
        (phase[:-1] + math.pi) / (2 * math.pi)
    )
    worst = float(np.max(np.maximum(np.abs(L[1:]), np.abs(L[:-1]))[cross], initial=0.0))
    if L[-1].real < 0.0:  # L is real at half the sampling frequency
        worst = max(worst, float(abs(L[-1])))
    return float(np.max(1.0 / np.abs(1.0 + L))), worst


def _held(A: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    """exp(A h) and the integral of exp(A s) B over 0..h."""
    m = len(B)
    big = np.zeros((m + 1, m + 1))
    big[:m, :m], big[:m, m] = A * h, B * h
    big = expm(big)
    return big[:m, :m], big[:m, m]


def _section(part: tuple) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """(A, B, C, D) of one section: integrator K | lag tau K | swell lead (1 - a s)/(1 + .3 a s) |
    resonance period damping.
    """
    kind = part[0]
    if kind == "integrator":
        return np.zeros((1, 1)), np.array([part[1]]), np.ones(1), 0.0
    if kind == "lag":
        return np.array([[-1.0 / part[1]]]), np.array([part[2] / part[1]]), np.ones(1), 0.0
    if kind == "swell":
        a, tau = part[1], 0.3 * part[1]
        return np.array([[-1.0 / tau]]), np.array([(1.0 + a / tau) / tau]), np.ones(1), -a / tau
    period, damping = part[1], part[2]
    w = 2.0 * math.pi / period
    return (
        np.array([[0.0, 1.0], [-w * w, -2.0 * damping * w]]),
        np.array([0.0, w * w]),
        np.array([1.0, 0.0]),
        0.0,
    )
