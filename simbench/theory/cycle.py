"""Compute the exact limit cycle of the sampled loop: the switching times give a first estimate, and
simulating sample by sample from it gives the mean period and amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop.elementary import without_last_bits
from simbench.loop.resolve import undisturbed
from simbench.loop.run import Start
from simbench.scenarios.spec import Loop
from simbench.theory.half_cycle import HalfCycle, half_cycles
from simbench.theory.march import reversals
from simbench.theory.sampled import SampledLoop, sampled_loop

BLOCK = 100  # half cycles averaged at a time; two blocks must agree
_STEADY = 0.005  # relative difference of two blocks that counts as agreement
_MARCH_BLOCKS = 16
_LONGEST_MARCH = 10**9  # samples of a march, some 10 s of work
_LOAD_STEPS = (0.4, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0)  # tried in turn, in multiples of the break-away

# Why marching at all: inside one pattern (m, n) of whole samples the return map expands by about
# S/p (p the half swing of the valve), because a later break-away makes a larger jump. The cycle of
# the sampled loop is therefore irregular when S > J, wandering around the mean cycle of
# `half_cycle` by about one sample; its period is an average.


@dataclass(frozen=True, eq=False)
class ExactCycle:
    """The sustained oscillation of a sampled loop without noise and disturbance."""

    period: float  # mean time (s) between every second reversal of the valve
    amplitude: float  # mean half peak-to-peak of OP over a cycle (%)
    swing: float  # mean distance (%) between the valve's turning points
    irregularity: float  # standard deviation of the half period over its mean
    # growth of a deviation per half cycle, of the mean cycle; None when it was found by marching
    # alone
    multiplier: float | None
    # (x, s, past) as `simbench.theory.march` takes it, on the cycle
    state: tuple[np.ndarray, np.ndarray, np.ndarray]


def exact_cycle(loop: SampledLoop) -> ExactCycle | None:
    """Return the limit cycle of a sampled loop, or None when nothing keeps cycling.

    The march starts on the symmetric cycles that reproduce themselves (`half_cycles`), the
    attracting ones first; when none persists, from a ladder of load steps. A cycle between the
    limits of OP is found in the same way. Valves that stick again after every sample (He's;
    physical friction under a sampled OP) are marched as such. Not for valves that are no (S, J) map
    at all (`SampledLoop.misfit`): asymmetric ones, hysteresis, pre-sliding; there it is an
    approximation.
    """
    # The half cycles of theory, the most stable first
    if loop.fs == 0:
        return None
    halves = sorted(
        half_cycles(loop), key=lambda h: float(without_last_bits(np.array(h.multiplier)))
    )
    for half in halves:
        cycle = settled(loop, _round_state(on_half_cycle(loop, half)), half.multiplier)
        if cycle is not None:
            return cycle

    # Else what load steps start
    for size in _LOAD_STEPS:
        cycle = settled(loop, _round_state(after_load_step(loop, size * loop.fs)), None)
        if cycle is not None:
            return cycle
    return None


def _round_state(state: tuple[np.ndarray, np.ndarray, np.ndarray]) -> tuple:
    """Return a state to march from: its last bits would grow to another cycle."""
    return tuple(without_last_bits(part) for part in state)


def on_half_cycle(loop: SampledLoop, half: HalfCycle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the state one sample before the valve of a symmetric cycle breaks away downwards."""
    s = np.array([half.op, loop.C @ half.x, half.mv, 1.0, 0.0])
    return half.x.copy(), s, np.full(loop.delay + 2, half.mv)


def at_rest(loop: SampledLoop, kick: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the state at sample 0 of a loop at rest in mid-band whose OP is offset by `kick`
    (%).
    """
    op = min(max(kick, loop.lo), loop.hi)
    if abs(op) > loop.fs:
        side = np.sign(op)
    else:
        side = 0.0
    if side:
        mv = op - side * loop.fd
    else:
        mv = 0.0
    past = np.zeros(loop.delay + 2)
    past[-1] = mv
    return np.zeros(loop.order), np.array([op, 0.0, mv, side, abs(side)]), past


def settled(loop: SampledLoop, state: tuple, multiplier: float | None) -> ExactCycle | None:
    """March from a state until two blocks of half cycles agree; None when the valve comes to rest
    or its swing dies.
    """
    # The march in blocks, until two blocks agree
    x, s, past = (a.copy() for a in state)
    means: list[np.ndarray] = []
    left = _LONGEST_MARCH
    for _ in range(_MARCH_BLOCKS):
        run = reversals(loop, x, s, past, BLOCK, left)
        left -= run.samples
        if run.count < BLOCK and not run.stalled:
            asked = (
                f"sampling.Ts = {loop.Ts:g} s: no cycle settles within {_LONGEST_MARCH:g} samples"
            )
            raise ParameterError(f"{asked}; a longer Ts, or a larger gain K Kc, is needed")
        if run.count < BLOCK:
            return None
        halves = np.diff(run.sample)
        swing = float(np.abs(np.diff(run.stop)).mean())
        if swing < loop.least_swing:
            return None
        means.append(np.array([halves.mean(), np.abs(np.diff(run.extreme)).mean() / 2, swing]))
        # the first block is the transient
        if len(means) > 2 and np.all(np.abs(means[-1] / means[-2] - 1) < _STEADY):
            break
    else:
        if loop.J == 0 and means[-1][2] < means[-2][2]:
            return None  # without a slip jump nothing stops the swing from fading away

    # The means of the last two blocks
    half, amplitude, swing = (float(value) for value in (means[-1] + means[-2]) / 2)
    irregularity = float(halves.std() / halves.mean())
    return ExactCycle(2 * half * loop.Ts, amplitude, swing, irregularity, multiplier, (x, s, past))


def after_load_step(loop: SampledLoop, load: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the state of a loop at rest in mid-band when the load at the plant's input changes by
    -`load` (%).

    Seen from the new balance, valve and OP are off by `load` (P on a self-regulating plant: by g/(1
    + g) of it), and PV is where it was.
    """
    g = loop.static_gain
    if loop.integral or np.isinf(g):
        v = load
    else:
        v = load * g / (1 + g)
    w = 0.0 if loop.integral else -v
    values, vectors = np.linalg.eig(loop.A)
    slow = np.real(vectors[:, np.argmax(np.abs(values))])
    return slow * (w / (loop.C @ slow)), np.array([v, w, v, 0.0, 0.0]), np.full(loop.delay + 2, v)


def cycle_start(loop: Loop) -> Start:
    """Return where a simulation must begin to be on the loop's limit cycle: the valve has just
    stopped.
    """
    # The exact cycle of a loop that has one valve
    sampled = sampled_loop(loop)
    [*stages, (module, p)] = undisturbed(loop).valves
    cycle = exact_cycle(sampled)
    if cycle is None:
        raise ParameterError("cycle_start: this loop has no limit cycle to start on")
    if loop.effect or stages:
        raise ParameterError("cycle_start: only a loop with one valve and no effect starts there")

    # From the break-away to the stop that follows
    x, s, past = (a.copy() for a in cycle.state)
    while s[4] == 1.0:  # the march ends where the valve breaks away: let it come to its stop
        reversals(sampled, x, s, past, 1, most=1)

    # The state there, as the simulation begins with it
    op0, op, w, mv = loop.operating_point.op0, *(float(value) for value in s[:3])
    ahead = sampled.A @ x + sampled.B_old * past[0] + sampled.B_new * past[1]
    if sampled.order != 1 and loop.plant.parameters is not None:
        raise ParameterError(
            "cycle_start: a plant plug-in starts there only where it is of first order"
        )

    # What each kind of plant and controller keeps
    pid = loop.controller.type == "PID"
    order = sampled.order - 2 * (sampled.kd > 0.0)
    return Start(
        op=op0 + op,
        error=loop.setpoint.value - loop.pv0 - w / sampled.gain,
        pv=(
            loop.pv0 + float(sampled.C @ ahead) / sampled.gain
            if order == 1 and not pid
            else loop.pv0
        ),
        state=tuple(ahead[:order].tolist()) if order > 1 or pid else (),
        control=_pid_state(loop, sampled, x, op, op0) if pid else (),
        valve=module.step(op0 + op, module.start(op0 + mv, p), p),
        mv=tuple(op0 + past[1:]),
    )


def _pid_state(
    loop: Loop, sampled: SampledLoop, x: np.ndarray, op: float, op0: float
) -> tuple[float, ...]:
    """Return the state of a PID as its `step` takes it, from the state of the sampled loop."""
    y = float(sampled.C @ x)
    d = 0.0
    if sampled.kd > 0.0:
        g = 1.0 / (1.0 + sampled.beta)
        y = float(sampled.C[:-2] @ x[:-2]) / (1.0 + sampled.kd * g)
        d = sampled.kd * ((sampled.fade - 1.0) * x[-2] + g * (1.0 - sampled.fade) * x[-1] + y)
    if loop.controller.form == "velocity":
        kept = op0 + op
    else:
        kept = op0 + op + y + d
    return op0 + op, kept, -y, -d, -y / sampled.gain
