"""Loads from outside the loop: sine, steps, ramp, random walk, coloured noise, and the oscillation
of another sticky loop; `echo` has a file of its own, as it needs the loop that it acts on.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from simbench.detectors.errors import ParameterError, UnknownName
from simbench.detectors.signal.filters import lfilter
from simbench.loop import echo, resampled
from simbench.loop.elementary import elementwise
from simbench.loop.parameters import Choice, Number, resolve
from simbench.loop.run import Start, run_setup
from simbench.loop.setup import plain_setup
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

_AT = ("input", "output", "op")
_PLACE = Choice(
    _AT,
    default="input",
    says="input: in % of travel, between MV and plant; output: in PV units, on PV; op: in %, what"
    " others than the controller add to OP, which goes on from there",
)
_AMPLITUDE = Number("% or PV units", low=0.0, says="size of the load")
_KEPT = 100_000  # samples of a signal that is kept for the next run of the same loop
_START = Number("s", low=0.0, default=0.0, says="when it begins")


def sine(t, Ts, p, rng):
    """Return amplitude sin(2 pi (t - start)/period + phase); its phase walks where `jitter` is
    given.
    """
    phase = 2 * np.pi * (t / p.period + _phase_walk(t.size, Ts, p, rng)) + p.phase
    return p.amplitude * elementwise(math.sin, phase)


def steps(t, Ts, p, rng):
    """Return a load that jumps every `period` to a new level, drawn evenly from
    -amplitude..amplitude.
    """
    index = np.floor_divide(t, p.period).astype(int)
    levels = rng.uniform(-p.amplitude, p.amplitude, size=max(int(index[-1]), 0) + 1)
    return levels[np.maximum(index, 0)]


def ramp(t, Ts, p, rng):
    """Return a load that grows evenly to `amplitude` within `period` and stays there."""
    return p.amplitude * np.clip(t / p.period, 0.0, 1.0)


def random_walk(t, Ts, p, rng):
    """Return a random walk whose standard deviation is `amplitude` after `period`."""
    return np.cumsum(p.amplitude * np.sqrt(Ts / p.period) * rng.standard_normal(t.size))


def coloured(t, Ts, p, rng):
    """Return coloured noise of standard deviation `amplitude` and correlation time `period`,
    smoothed by `lag` where given.
    """
    a = math.exp(-Ts / p.period)
    white = rng.standard_normal(t.size)
    white[1:] *= np.sqrt(1 - a * a)
    signal = lfilter([1.0], [1.0, -a], white)
    if p.lag == 0.0:
        return p.amplitude * signal
    b = math.exp(-Ts / p.lag)
    # what the second filter takes from the variance of the first one's output
    left = (1 - b) / (1 + b) * (1 + a * b) / (1 - a * b)
    return p.amplitude / np.sqrt(left) * lfilter([1 - b], [1.0, -b], signal)


def _phase_walk(n: int, Ts: float, p: Any, rng: np.random.Generator) -> np.ndarray | float:
    """Return a random walk of the phase in periods; its std is `jitter` (rad) after one period."""
    if p.jitter == 0.0:
        return 0.0
    # smoothed over half a period, so that the wave bends and does not tear
    keep = math.exp(-2.0 * Ts / p.period)
    steps = lfilter([1.0 - keep], [1.0, -keep], rng.standard_normal(n))
    return np.cumsum(steps) * p.jitter * np.sqrt(Ts / p.period) / (2.0 * np.pi)


# per period of the other loop: with J near S/2 and few samples it does not cycle
_LEAST_SAMPLES = 20


def propagated(t, Ts, p, rng):
    """Return the PV of another sticky loop behind a first-order lag, scaled to half peak-to-peak
    `amplitude`.

    The other loop is a FOPTD plant under PI with Ti = T and Td/T = 0.2; its time constant is chosen
    so that the exact cycle of equations.md 2.3 has the wanted period. The shape of its waves, not
    their cause, reaches our loop.
    """
    # The wave of another loop, long and fine enough for what is drawn from it
    warm_up = int(np.ceil(12 * p.period / Ts))
    seed = int(rng.integers(2**31))
    moved = _phase_walk(t.size, Ts, p, rng) * p.period / Ts  # samples
    if np.ndim(moved):
        more = int(np.ceil(np.max(moved))) + 2
    else:
        more = 0
    fine = max(int(np.ceil(_LEAST_SAMPLES * Ts / p.period)), 1)
    wave = _other_loop(
        p.S, p.J, p.noise, p.period, Ts / fine, fine * (t.size + max(more, 0) + warm_up), seed
    )[::fine]

    # A lag between both loops
    if p.lag > 0:
        keep = math.exp(-Ts / p.lag)
        wave = np.asarray(lfilter([1 - keep], [1, -keep], wave))

    # scaled on the warm-up alone: a longer run must begin with the same bits
    warm = wave[warm_up // 2 : warm_up]
    half_swing = np.ptp(warm) / 2
    if not half_swing > 0.05 * p.J:
        raise ParameterError(
            f"disturbance 'propagated': the other loop (S = {p.S}, J = {p.J}) does not cycle;"
            " choose J nearer to S"
        )

    # Moved in time by a walk, or as it is
    if np.ndim(moved):
        wave = np.interp(warm_up + np.arange(t.size) + moved, np.arange(wave.size), wave)
    else:
        wave = wave[warm_up:]
    return p.amplitude * (wave - warm.mean()) / half_swing


@lru_cache(maxsize=4)  # a loop and its twin see the same
def _other_loop(
    S: float, J: float, noise: float, period: float, Ts: float, n: int, seed: int
) -> np.ndarray:
    """Return the PV of a sticky loop about its rest, shape (n,)."""
    # P = 2S/(k j) + 2 Td + k Td^2 with j = J/(2 - k Td) and k Td = 0.2, solved for k
    j = J / 1.8
    k = (2 * S / j + 0.44) / period
    other = Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1.0, "T": 1.0 / k, "Td": 0.2 / k},
            "controller": {"type": "PI", "Kc": 1.0, "Ti": 1.0 / k},
            "valve": {"model": "choudhury", "S": S, "J": J},
            "sampling": {"Ts": Ts, "n": n},
            "noise": {"std": noise * J},
        }
    )

    # it starts on its cycle, which from rest it might never reach: the valve has just stopped at
    # +j, OP at its maximum
    top = 50.0 + S / 2 + 0.1 * j
    pv = 50.0 - j * math.tanh(k * period / 4)
    begin = Start(op=top, error=50.0 - pv, pv=pv, valve=(50.0 + j, 1.0, 1.0, top), mv=(50.0 + j,))
    setup = plain_setup(other, seed)
    setup.draw_noise()
    return run_setup(setup, start=begin).record.pv - 50.0


_PERIOD = {
    "sine": "of the sine",
    "steps": "between jumps",
    "ramp": "of the rise",
    "random_walk": "after which the standard deviation is `amplitude`",
    "coloured": "over which it forgets (correlation time)",
    "propagated": "of the other loop's cycle",
}
_JITTER = Number(
    "rad", low=0.0, default=0.0, says="std of the random walk of the phase after one period"
)
_MORE: dict[str, dict[str, Any]] = {
    "sine": {"phase": Number("rad", default=0.0, says="phase at the start"), "jitter": _JITTER},
    "coloured": {
        "lag": Number("s", low=0.0, default=0.0, says="second time constant, 0 = first order")
    },
    "propagated": {
        "S": Number(
            "% of travel",
            low=0.0,
            high=100.0,
            default=5.0,
            says="the other valve's band",
            positive=True,
        ),
        "J": Number(
            "% of travel",
            low=0.0,
            high=100.0,
            default=2.0,
            says="the other valve's jump",
            positive=True,
        ),
        "lag": Number("s", low=0.0, default=0.0, says="first-order lag on the way"),
        "noise": Number("-", low=0.0, default=0.0, says="noise of the other loop over its J"),
        "jitter": _JITTER,
    },
}
DISTURBANCES: dict[str, Callable[..., np.ndarray]] = {
    f.__name__: f for f in (sine, steps, ramp, random_walk, coloured, propagated)
}
PARAMETERS = {
    kind: {
        "amplitude": _AMPLITUDE,
        "period": Number("s", low=0.0, positive=True, says=f"time {_PERIOD[kind]}"),
        "at": _PLACE,
        "start": _START,
        **_MORE.get(kind, {}),
    }
    for kind in DISTURBANCES
} | {echo.NAME: echo.SHAPES, resampled.RESAMPLED: resampled.NUMBERS}


def disturbance_signal(
    part: Part, total: int, Ts: float, stream: tuple[int, ...]
) -> tuple[str, np.ndarray]:
    """Return where a disturbance acts and its signal, drawn from a random stream (its seed)."""
    if part.name not in DISTURBANCES:
        raise UnknownName("disturbance", part.name, PARAMETERS)
    p = resolve(PARAMETERS[part.name], part.parameters, f"disturbance {part.name!r}")
    draw = _draw_signal if total <= _KEPT else _draw_signal.__wrapped__
    return _AT[int(p.at)], draw(part.name, p, total, Ts, stream)


@lru_cache(maxsize=16)  # a loop, its tails and its twin see the same
def _draw_signal(name: str, p: Any, total: int, Ts: float, stream: tuple[int, ...]) -> np.ndarray:
    t = np.arange(total) * Ts - p.start
    signal = np.where(t >= 0, DISTURBANCES[name](t, Ts, p, np.random.default_rng(stream)), 0.0)
    signal.flags.writeable = False
    return signal
