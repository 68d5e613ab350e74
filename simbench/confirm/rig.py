"""Simulate loops during a test: controller gain changed while the loop runs, OP moved by hand,
coupled loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.loop import sensor
from simbench.loop.linear import control_start, parts_of, plant_start
from simbench.loop.setup import Setup
from simbench.scenarios.parts import MAX_SAMPLES
from simbench.scenarios.spec import Loop

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def lengthen_loop(loop: Loop, samples: int) -> Loop:
    """Return a loop with another number of samples, or say that a test would need more than are
    run.
    """
    if samples > MAX_SAMPLES:
        slow = (
            f"Td = {loop.plant.Td:g} s, T = {loop.plant.T or loop.controller.Ti or 0.0:g} s and Ts"
            f" = {loop.sampling.Ts:g} s"
        )
        raise ParameterError(
            f"the test would take {samples} samples with {slow}; at most {MAX_SAMPLES} are run"
        )
    return loop.with_("sampling.n", samples)


@dataclass(frozen=True, eq=False)
class Trace:
    """What one loop did."""

    # op, pv, mv: (n,) controller output (%), measured PV (PV units), valve position (%)
    op: np.ndarray
    pv: np.ndarray
    mv: np.ndarray


def draw_trace(trace: Trace, Ts: float, marks: Sequence[int], title: str) -> Figure:
    """Draw OP with MV above PV over time, with dashed lines at some samples."""
    from matplotlib.figure import Figure

    # the signals
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    t = np.arange(trace.op.size) * Ts
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(t, trace.op, linewidth=1.0, label="OP")
    known = bool(np.isfinite(trace.mv).any())
    if known:
        above.plot(t, trace.mv, linewidth=1.0, label="MV")
    above.legend(fontsize=7)
    below.plot(t, trace.pv, linewidth=1.0)

    # what happens when
    for axes, name in ((above, "OP and MV (%)" if known else "OP (%)"), (below, "PV")):
        axes.set_ylabel(name)
        for mark in marks:
            axes.axvline(t[mark], color="0.4", linestyle="--", linewidth=0.8)
    above.set_title(title, fontsize=8, loc="left", wrap=True)
    below.set_xlabel("time (s)")
    return figure


def run_rig(
    setups: Sequence[Setup],
    *,
    gain: Sequence[np.ndarray | None] | None = None,
    influence: np.ndarray | None = None,
) -> list[Trace]:
    """Run one or more loops side by side, sample by sample, in plain Python: bit-equal to the
    compiled loop.
    """
    # Loops side by side share their clock
    n = setups[0].sp.size
    Ts = setups[0].Ts
    if any(s.sp.size != n or s.Ts != Ts for s in setups):
        raise ParameterError("loops that run side by side need the same sampling period and length")

    # Sample by sample: all controllers first, then all plants
    loops = [LiveLoop(s) for s in setups]
    for k in range(n):
        for i, loop in enumerate(loops):
            if gain is None:
                factor = None
            else:
                factor = gain[i]
            loop.control(k, 1.0 if factor is None else factor[k])
        for i, loop in enumerate(loops):
            load = 0.0
            if influence is not None:
                load = sum(
                    influence[i, j] * other.deviation for j, other in enumerate(loops) if j != i
                )
            loop.advance(k, load)
    return [Trace(loop.op, loop.pv, loop.mv) for loop in loops]


class LiveLoop:
    """The state of one loop between two samples."""

    def __init__(self, setup: Setup) -> None:
        # The loop's parts, as the simulation has them
        n = setup.sp.size
        parts = parts_of(setup)
        self.setup = setup
        self.steps = parts.steps
        self.stages = parts.stages
        self.plant_p, self.control_p, self.gap_p, self.sensor_p, self.valve_p = parts.numbers

        # The plant's input over the dead time, and the state of every part at rest
        self.lag = parts.sampled.delay + 1
        self.w = np.zeros(n + self.lag)
        self.x: Any = plant_start(setup, parts, setup.pv0)
        self.c = control_start(setup, self.control_p)
        full = self.steps["sensor_step"] is sensor.full_step
        self.s: Any = (sensor.full_start if full else sensor.plain_start)(setup.pv0)
        self.v = []

        # The stages of the valve rest on OP, one after the other
        u = setup.op0
        for module, p in setup.valves:
            self.v.append(tuple(float(x) for x in module.start(u, p)))
            u = self.v[-1][0]

        # Room for the signals
        self.op = np.empty(n)
        self.pv = np.empty(n)
        self.mv = np.empty(n)
        self.deviation = 0.0

    def control(self, k: int, gain: float = 1.0, by_hand: float | None = None) -> None:
        """Measure PV of sample `k`, and move the valve by the controller (Kc times `gain`) or to
        the OP (%) set by hand.
        """
        # PV as plant, load and sensor make it
        setup = self.setup
        steps = self.steps
        y = steps["plant_output"](self.x, self.plant_p) + setup.load_out[k]
        self.deviation = y - setup.pv0
        self.s = steps["sensor_step"](y, setup.pv_add[k], self.s, self.sensor_p)

        # OP by the controller, or by hand
        if by_hand is None:
            p = self.control_p._replace(Kc=gain * self.control_p.Kc)
            if setup.Ti is not None:
                p = p._replace(Ki=gain * self.control_p.Ki)
            e = steps["error_step"](setup.sp[k] - self.s[0], self.gap_p)
            self.c = steps["controller_step"](e, setup.sp[k], self.c, p)
            u = steps["output_step"](self.c[0], self.gap_p)
        else:
            u = by_hand
        self.op[k] = u

        # Through every stage of the valve
        for i, step in enumerate(self.stages):
            self.v[i] = step(u, self.v[i], self.valve_p[i])
            u = self.v[i][0]

        # What is recorded
        self.pv[k] = self.s[0]
        self.mv[k] = u

    def advance(self, k: int, load: float = 0.0) -> None:
        """Let the plant answer to valve and load until the next sample."""
        self.w[k + self.lag] = self.mv[k] - self.setup.op0 + self.setup.load_in[k] + load
        self.x = self.steps["plant_step"](self.w[k], self.w[k + 1], self.x, self.plant_p)
