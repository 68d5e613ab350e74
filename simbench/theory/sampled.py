"""The sampled loop as the theory sees it: plant and controller in deviations from rest, valve as
(S, J).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from simbench.detectors.compiled import compiled
from simbench.detectors.errors import ParameterError
from simbench.detectors.signal import stiction_map
from simbench.loop import controller as controllers
from simbench.loop import plant as plants
from simbench.loop.resolve import undisturbed
from simbench.loop.response import stages_response
from simbench.loop.setup import Setup
from simbench.scenarios.spec import Loop
from simbench.valve.maps import creep


@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A loop without noise and disturbance, in deviations from rest; OP, MV and w in % of travel.

    Per sample: x(k+1) = A x(k) + B_old v(k-delay-1) + B_new v(k-delay), w = C x = s Kc (PV - pv0),
    and OP(k) = OP(k-1) - (w(k)
    - w(k-1)) - beta w(k) (PI) or -w(k) (P), within lo..hi.
    """

    # A, B_old, B_new, C: the sampled plant, scaled by the controller's signed gain
    A: np.ndarray
    B_old: np.ndarray
    B_new: np.ndarray
    C: np.ndarray
    delay: int  # whole samples of dead time
    Ts: float  # sampling period (s)
    integral: bool  # PI (True) or P
    beta: float  # Ts/Ti; 0 for P
    # S, J: dead-band plus stick band, and slip jump (%)
    S: float
    J: float
    # whether the valve sticks again after every sample (He's, and physical friction under a sampled
    # OP) or follows OP until it turns
    resticks: bool
    # how far the valve model is from that (S, J) map: rms difference over a test wave, in units of
    # its jump
    misfit: float
    # lo, hi: limits of OP and MV (%)
    lo: float
    hi: float
    gain: float  # s Kc, % per PV unit
    # num, den: w/v without dead time as a continuous transfer function, highest power of s first
    num: np.ndarray
    den: np.ndarray
    Td: float  # dead time (s)
    times: tuple[float, ...]  # the loop's time constants and dead time above 0 (s)
    # kd, fade: of a PID: gain of its derivative over Kc, and what is left of it after a sample; 0
    # of P and PI
    kd: float = 0.0
    fade: float = 0.0

    @property
    def fs(self) -> float:
        """Distance |OP - MV| (%) beyond which a valve at rest breaks away."""
        return 0.5 * (self.S + self.J)

    @property
    def fd(self) -> float:
        """Distance (%) by which a moving valve lags OP."""
        return 0.5 * (self.S - self.J)

    @property
    def least_swing(self) -> float:
        """Smallest swing of the valve (%) that is a cycle rather than the end of a fading one."""
        if self.J > 0:
            return 0.5 * self.J
        return self.S / 200

    @property
    def order(self) -> int:
        """Number of plant states."""
        return len(self.A)

    @property
    def integrating(self) -> bool:
        """Whether the plant has a pole at z = 1."""
        return bool(np.isinf(self.static_gain))

    @cached_property
    def static_gain(self) -> float:
        """Gain (-) of plant times Kc at rest; inf for an integrating plant."""
        gap = np.eye(self.order) - self.A
        if abs(np.linalg.det(gap)) < 1e-12:
            return np.inf
        return float(self.C @ np.linalg.solve(gap, self.B_old + self.B_new))

    def response(self, w) -> np.ndarray:
        """Return L(j w), continuous plant with dead time times continuous controller, at the
        frequencies `w` (rad/s).
        """
        s = 1j * np.asarray(w, dtype=float)
        G = np.polyval(self.num, s) / np.polyval(self.den, s) * np.exp(-s * self.Td)
        return G * (1 + self.beta / self.Ts / s)

    def sampled_response(self, w) -> np.ndarray:
        """Return L(e^(j w Ts)), which has the hold and the sampled controller in it, at the
        frequencies `w` (rad/s).
        """
        z = np.exp(1j * np.asarray(w, dtype=float) * self.Ts)[..., None]
        poles, V = np.linalg.eig(self.A)
        left = self.C @ V
        new = np.linalg.solve(V, self.B_new)
        old = np.linalg.solve(V, self.B_old)
        G = (left * (new + old / z) / (z - poles)).sum(axis=-1) * z[..., 0] ** -self.delay
        if self.integral:
            return G * (1 + self.beta / (1 - 1 / z[..., 0]))
        return G

    @cached_property
    def patience(self) -> int:
        """Samples without a reversal after which the loop is taken to rest: ten times the slowest
        half period there is.
        """
        # the smallest half swing of the valve that counts as cycling
        swing = 0.5 * max(self.J, self.S / 10, 1e-12)
        if self.integrating:
            # of OP, % per s
            slope = float(abs(self.C @ (self.B_old + self.B_new))) / self.Ts * swing
        elif self.integral:
            slope = abs(self.static_gain) * swing * self.beta / self.Ts
        else:
            slope = np.inf
        return 100 + int(
            min(10 * (self.S / max(slope, 1e-300) + 5 * max(self.times)) / self.Ts, 1e8)
        )


def sampled_loop(loop: Loop) -> SampledLoop:
    """Reduce a loop file to what decides about its limit cycle."""
    setup = undisturbed(loop)
    return reduced(setup, *mapped_valve(setup))


def reduced(setup: Setup, S: float, J: float) -> SampledLoop:
    """Reduce a resolved loop with the valve (S, J) in %; as `sampled_loop`."""
    # What theory does not know is refused
    resticks, misfit = nearest_map(tuple(setup.valves), S, J)
    for name, says in (("error_gap", "an error dead-band"), ("op_step", "a rounded OP")):
        if getattr(setup, name) > 0:
            raise ParameterError(
                f"theory: the controller has {says}; the cycle is known for plain P and PI only"
            )
    if setup.sensor_tau > 0 or setup.pv_step > 0:
        raise ParameterError(
            "theory: the sensor has a lag or rounds PV; the cycle is known for a plain sensor only"
        )
    if setup.not_linear:
        raise ParameterError(f"theory: cannot tell, {setup.not_linear}; simulate the loop instead")

    # The sampled plant, with the gain in it
    flat = np.ascontiguousarray  # one memory layout, one compiled march
    sampled = plants.sample(setup.num, setup.den, setup.Td, setup.Ts)
    gain = setup.sign * setup.Kc
    if setup.loop.controller.type == "PID" and setup.loop.controller.Td:
        return _with_derivative(setup, sampled, gain, (S, J, resticks, misfit))

    # Time constants that set the scale of what follows
    poles = np.roots(setup.den)
    times = [setup.Td, setup.Ti or 0.0, setup.Ts] + [1 / abs(p) for p in poles if abs(p) > 1e-12]
    return SampledLoop(
        A=flat(sampled.A),
        B_old=flat(sampled.B_old),
        B_new=flat(sampled.B_new),
        C=flat(gain * sampled.C),
        delay=sampled.delay,
        Ts=setup.Ts,
        integral=setup.Ti is not None,
        beta=setup.Ts / setup.Ti if setup.Ti else 0.0,
        S=S,
        J=J,
        resticks=resticks,
        misfit=misfit,
        gain=gain,
        lo=setup.op_lo - setup.op0,
        hi=setup.op_hi - setup.op0,
        num=gain * setup.num,
        den=setup.den,
        Td=setup.Td,
        times=tuple(t for t in times if t > 0),
    )


def _with_derivative(setup: Setup, sampled: Any, gain: float, valve: tuple) -> SampledLoop:
    """Reduce a loop with PID: what the derivative adds to PI is a filter of w, two more states of
    the plant.

    With y = s Kc (PV - pv0), OP moves by -(w - w(k-1)) - beta w for w = (1 + D/PI) y, where D = kd
    (z - 1)/(z - fade) and PI = ((1 + beta) z - 1)/(z - 1). Holds within the limits of OP, and there
    for the velocity form with clamping.
    """
    # The PID's numbers as the simulation has them
    c = setup.loop.controller
    Ti = float(setup.Ti or 0.0)
    flat = np.ascontiguousarray
    n = sampled.order
    p = controllers.pid_numbers(c, gain, Ti, setup.Ts, 0.0, 0.0, 100.0)
    beta = setup.Ts / Ti
    Tf = float(c.Td or 0.0) / controllers.derivative_filter(c)

    # Two more states: the filtered derivative, and w one sample ago
    a = p.fade
    g = 1.0 / (1.0 + beta)
    through = p.kd / (1.0 + beta)
    A = np.zeros((n + 2, n + 2))
    A[:n, :n] = sampled.A
    A[n, :n] = gain * sampled.C
    A[n, n:] = (a + g, -a * g)
    A[n + 1, n] = 1.0
    C = np.concatenate(
        [gain * (1.0 + through) * sampled.C, through * np.array([a + g - 2.0, 1.0 - a * g])]
    )

    # The law in s, for frequency responses
    law = np.polymul([Ti, 1.0], [Tf, 1.0])
    S, J, resticks, misfit = valve
    poles = np.roots(setup.den)
    times = [setup.Td, Ti, setup.Ts, Tf, float(c.Td or 0.0)] + [
        1 / abs(p) for p in poles if abs(p) > 1e-12
    ]
    return SampledLoop(
        A=flat(A),
        B_old=np.append(sampled.B_old, [0.0, 0.0]),
        B_new=np.append(sampled.B_new, [0.0, 0.0]),
        C=flat(C),
        delay=sampled.delay,
        Ts=setup.Ts,
        integral=True,
        beta=beta,
        S=S,
        J=J,
        resticks=resticks,
        misfit=misfit,
        gain=gain,
        lo=setup.op_lo - setup.op0,
        hi=setup.op_hi - setup.op0,
        num=gain * np.polymul(setup.num, np.polyadd(law, [Ti * float(c.Td or 0.0), 0.0, 0.0])),
        den=np.polymul(setup.den, law),
        Td=setup.Td,
        times=tuple(t for t in times if t > 0),
        kd=p.kd,
        fade=p.fade,
    )


def mapped_valve(setup: Setup) -> tuple[float, float]:
    """Return (S, J) in % of the one valve stage that has friction; (0, 0) for a healthy valve."""
    # The (S, J) of each stage
    found: list[tuple[float, float]] = []
    for module, p in setup.valves:
        if not hasattr(module, "mapped_SJ"):
            name = module.__name__.rpartition(".")[2]
            raise ParameterError(
                f"theory: valve {name!r} has no (S, J); tables and exact cycle do not describe it"
            )
        S, J = _pair_of_floats(module.mapped_SJ(p))
        if S > 0 or J > 0:
            found.append((S, J))

    # One stage at most has friction
    if len(found) > 1:
        raise ParameterError(
            f"theory: {len(found)} valve stages have friction; tables and exact cycle describe one"
        )
    if found:
        return found[0]
    return (0.0, 0.0)


def _pair_of_floats(pair: Any) -> tuple[float, float]:
    S, J = pair
    return float(S), float(J)


@lru_cache(maxsize=1024)
def nearest_map(stages: tuple, S: float, J: float) -> tuple[bool, float]:
    """Say whether a valve follows OP or sticks again after every sample, and how far it is from the
    better (S, J) map.
    """
    # A wave that goes both ways by less than the valve's range
    reach = min(0.75 * (S + J), 50.0)
    if reach == 0:
        return False, 0.0
    slope = np.arange(-40, 40) / 40
    wave = 50.0 + reach * np.concatenate([slope[40:], -slope, slope, -slope, slope])

    # What the valve does, and what either map does
    driven = stages_response(stages, wave, 50.0)
    follows = stiction_map.valve_position(wave, S, J)
    sticks = np.empty(wave.size)
    compiled(_follow_sticking)(wave, S, J, sticks)

    # The nearer map, with its distance
    errors = []
    for ours in (follows, sticks):
        errors.append(float(np.sqrt(np.mean((driven - ours) ** 2))) / max(J, S / 10))
    return errors[1] < errors[0], min(errors)


def _follow_sticking(wave, S, J, out):
    """Fill `out` with the position of a valve that sticks again after every sample."""
    v = 50.0
    for k in range(wave.size):
        v = out[k] = creep(wave[k], v, S, J)


def ultimate_gain(loop: SampledLoop) -> float | None:
    """Return the factor on Kc at which the linear loop begins to oscillate; None when it is
    unstable at any gain.
    """
    w = np.geomspace(1e-4 / max(loop.times), np.pi / loop.Ts, 20_000)
    L = loop.sampled_response(w)
    crossings = phase_crossings(L)
    if crossings.size:
        return float(1 / abs(L[crossings[0]]))
    return None


def phase_crossings(L: np.ndarray) -> np.ndarray:
    """Return the places before which the phase of a frequency response (n,) goes down through -180
    degrees.
    """
    phase = np.unwrap(np.angle(L))
    return np.flatnonzero((phase[:-1] > -np.pi) & (phase[1:] <= -np.pi))
