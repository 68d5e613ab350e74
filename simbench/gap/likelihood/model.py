"""What the likelihood engine works on: the data, the effects that are switched on, and the
resulting fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from simbench.detectors.signal.filters import lfilter
from simbench.gap.likelihood import kernels

NUISANCES = ("T", "Td", "load_time", "load_lag", "load", "noise_std", "colour")
HOLDING = (kernels.PLAY, kernels.STICK, kernels.CREEP)
REDDEST = 0.8  # correlation from sample to sample: noise of more memory has passed a filter
SHORTEST_LAG = 0.1  # samples; a load with a shorter second time constant has none


@dataclass(frozen=True, eq=False)
class Data:
    """What the engine needs of a record and its baseline; the unit of time is one sample."""

    u: np.ndarray  # (n,), input of the plant: OP or MV (%)
    y: np.ndarray  # (n,), PV
    K: float  # gain of the baseline's plant (PV units/%), per sample of an integrating one
    T: float  # its time constant; 0 of an integrating one
    Td: float  # its dead time
    noise: float  # stated standard deviation (PV units), 0 where none is
    resolution: float = 0.0  # smallest step PV is written in (PV units)
    trusted: bool = True  # else K, T and Td are mere starting values
    late: int = 0  # samples by which OP answers PV late in the archive
    early: float = 0.0  # samples by which OP moves on within a sample, in the mean over it
    # (b, a): of a baseline of higher order, the filter of unit gain before the first-order plant
    shape: tuple[np.ndarray, np.ndarray] | None = None
    sines: tuple[tuple[float, float], ...] = ()  # stated ones: period, and amplitude on PV
    # size (% of travel) of the stated `steps`, and of ramps and walks (`slow`)
    loads: Mapping[str, float] = field(default_factory=dict)
    measured: bool = False  # noise, loads and sines are those of healthy records
    most_load: float = math.inf  # largest steady standard deviation on PV that these leave possible

    def __post_init__(self) -> None:
        # a copy: kernels would be compiled anew for a record's arrays, which nobody may write
        object.__setattr__(self, "u", np.array(self.u, dtype=float))

    def shaped(self, v: np.ndarray) -> np.ndarray:
        """Return MV as it drives the first-order plant, from rest at its first value."""
        if self.shape is None:
            return v
        return v[0] + lfilter(*self.shape, v - v[0])

    @cached_property
    def lateness(self) -> float:
        """Mean delay (samples) of the shape."""
        if self.shape is None:
            return 0.0
        b, a = self.shape
        at = np.arange(self.shape[0].size)
        return float(b @ at / b.sum() - a @ at / a.sum())

    @property
    def n(self) -> int:
        """Samples."""
        return self.y.size

    @cached_property
    def floor(self) -> float:
        """Smallest noise std that is believed."""
        least = 1e-6 * float(np.ptp(self.y)) or 1e-9
        return max(self.resolution / np.sqrt(12.0), least)

    @cached_property
    def size(self) -> float:
        """Standard deviation of PV, kept off 0."""
        return float(np.std(self.y)) + self.floor

    @cached_property
    def span(self) -> float:
        """Range of the plant's input, kept off 0."""
        return max(float(np.ptp(self.u)), 1e-3)


@dataclass(frozen=True)
class Free:
    """A number of an effect that is searched, by its logarithm or not; `shapes`: it changes more
    than the noise model.
    """

    name: str
    low: Callable[[Data], float]
    high: Callable[[Data], float]
    log: bool = False
    shapes: bool = True


def before_filter(y: np.ndarray, tau: float) -> np.ndarray:
    """Return what a first-order filter of time constant `tau` (samples, above 0) made y (n,) of."""
    follow = -np.expm1(-1.0 / tau)
    return np.concatenate([y[:1], (y[1:] - (1.0 - follow) * y[:-1]) / follow])


def _no_size(d: Data) -> float:
    return 0.0


BAND = Free("S", _no_size, lambda d: 1.5 * d.span)
JUMP = Free("J", _no_size, lambda d: d.span)
WIDTH = Free("D", _no_size, lambda d: 2.0 * d.span)
CENTRE = Free("c", lambda d: float(d.u.min()), lambda d: float(d.u.max()))
RATIO = Free("R", lambda d: 0.01, lambda d: 100.0, log=True)
TAU = Free("tau", lambda d: 0.05, lambda d: d.n / 5, log=True)
WALK, LOAD_WALK = (
    Free(name, lambda d: 1e-8 * d.size, lambda d: d.size, log=True, shapes=False)
    for name in ("walk", "load_walk")
)
_LOAD_JUMP = Free(
    "load_jump", lambda d: 1e-3 * d.floor, lambda d: 100.0 * d.size, log=True, shapes=False
)
_MAPS = {
    kernels.PLAY: (BAND,),
    kernels.ZONE: (WIDTH, CENTRE),
    kernels.CURVE: (RATIO,),
    kernels.STICK: (BAND, JUMP),
    kernels.CREEP: (BAND, JUMP),
}


@dataclass(frozen=True)
class Moves:
    """A valve as a function: MV from OP `u` (n,) and the numbers searched. Slower than a
    compiled map, and as general.
    """

    mv: Callable[[np.ndarray, Mapping[str, float]], np.ndarray]
    free: tuple[Free, ...]


@dataclass(frozen=True)
class Spec:
    """Which effects are switched on in the engine; `jumps` are the samples at which the load jumps,
    to stay, or (`fade`) to die away as the load does.
    """

    free: frozenset[str] = frozenset()
    valve: int = kernels.IDEAL
    pole: str = ""
    walk: bool = False
    load_walk: bool = False
    pink: bool = False
    channels: tuple[np.ndarray, ...] = ()
    start: float = 0.0
    moves: Moves | None = None
    jumps: tuple[int, ...] = ()
    fade: bool = False

    def join(self, other: Spec) -> Spec:
        """Return both specs together; of two valve maps or poles the second wins."""
        return Spec(
            free=self.free | other.free,
            valve=other.valve or self.valve,
            pole=other.pole or self.pole,
            walk=self.walk or other.walk,
            load_walk=self.load_walk or other.load_walk,
            pink=self.pink or other.pink,
            channels=self.channels + other.channels,
            start=other.start or self.start,
            moves=other.moves or self.moves,
            jumps=tuple(sorted(set(self.jumps + other.jumps))),
            fade=self.fade or other.fade,
        )

    @property
    def effect_numbers(self) -> tuple[Free, ...]:
        """Numbers of the effects switched on that are searched."""
        more = (
            (TAU, self.pole),
            (WALK, self.walk),
            (LOAD_WALK, self.load_walk),
            (_LOAD_JUMP, self.jumps),
        )
        maps = _MAPS.get(self.valve, ()) + (self.moves.free if self.moves else ())
        return (*maps, *(number for number, on in more if on))

    @property
    def names(self) -> tuple[str, ...]:
        """Nonlinear parameters searched, nuisances first."""
        load = tuple(m for m in NUISANCES if m != "load_lag" or not self.pink)
        return (*load, *(number.name for number in self.effect_numbers))


@dataclass(frozen=True, eq=False)
class Fit:
    """One candidate, fitted.

    `loglik` holds the prior's penalties; `theta` the nonlinear parameters, `beta` the linear ones
    (plant gain first); `residual` the standardised innovations.
    """

    spec: Spec
    loglik: float
    theta: dict[str, float]
    beta: np.ndarray = field(repr=False)
    residual: np.ndarray = field(repr=False)

    @property
    def K(self) -> float:
        """Plant gain."""
        return float(self.beta[0])


def input_gain(fit: Fit, data: Data) -> float:
    """Return the gain by which a load at the plant's input reaches PV.

    A valve that never moved shows none: a fiftieth of the baseline's is taken.
    """
    least = 0.02 * abs(data.K)
    if abs(fit.K) >= least:
        return fit.K
    return math.copysign(least, fit.K or data.K)


def lag_of(theta: Mapping[str, float]) -> float:
    """Return the load's second time constant, or the mark of a 1/f load, which has none."""
    return theta.get("load_lag", kernels.PINK_LOAD)


def load_std(theta: Mapping[str, float]) -> float:
    """Return the standard deviation of the fitted load's steady effect on PV."""
    std = theta["load"]
    period = theta["load_time"]
    lag = lag_of(theta)
    if lag <= SHORTEST_LAG:  # as the mark of a 1/f load is
        return std
    a = np.exp(-1.0 / period)
    b = np.exp(-1.0 / lag)
    return std * float(np.sqrt((1 - b) / (1 + b) * (1 + a * b) / (1 - a * b)))


def jumps_of(spec: Spec, theta: Mapping[str, float]) -> kernels.Jumps:
    """Return the jumps of the load."""
    if not spec.jumps:
        return kernels.NO_JUMPS
    return kernels.Jumps(np.array(spec.jumps), theta["load_jump"], spec.fade)


def valve_of(spec: Spec, theta: Mapping[str, float], u: np.ndarray) -> np.ndarray:
    """Return MV of OP `u` under the spec's valve map."""
    kind = spec.valve
    if spec.moves is not None:
        return spec.moves.mv(u, theta)
    if kind == kernels.IDEAL:
        return u
    if kind == kernels.PLAY:
        return kernels.valve(u, kind, theta["S"], spec.start * theta["S"] / 2, 0.0)
    if kind == kernels.ZONE:
        return kernels.valve(u, kind, theta["D"], theta["c"], 0.0)
    if kind == kernels.CURVE:
        return kernels.valve(u, kind, theta["R"], 0.0, 0.0)
    return kernels.valve(u, kind, theta["S"], theta["J"], spec.start * theta["S"] / 2)


def size_penalty(n: int, count: float) -> float:
    """Return the price of `count` fitted numbers (Schwarz 1978)."""
    return 0.5 * count * np.log(n)
