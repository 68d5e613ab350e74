"""An effect's numbers in proportion to the loop, so that they mean the same in every unit."""

from __future__ import annotations

import numpy as np

from simbench.gap.situation import LOAD_MEMORY, Situation, load_memory


class LoopSize:
    """How large things are in a loop with a record."""

    def __init__(self, s: Situation) -> None:
        d = s.data
        self.Ts, self.n = s.record.Ts, d.n
        self.pace = load_memory(s) / LOAD_MEMORY
        self.duration = self.Ts * d.n
        self.gain = abs(d.K) * (self.pace if s.integrating else 1.0)
        self.op_mean, self.op_std = float(np.mean(s.op)), float(np.std(s.op)) + 1e-6
        self.op_span = float(np.quantile(s.op, 0.995) - np.quantile(s.op, 0.005)) + 1e-6
        self.pv = d.size

    def travel(self, value: float | str) -> float:
        """Return a size in % of travel, relative to OP's range, as a logarithm."""
        return float(np.log(float(value) / self.op_span + 1e-4))

    def level(self, value: float | str) -> float:
        """Return a size in PV units, relative to PV's standard deviation, as a logarithm."""
        return float(np.log(float(value) / self.pv + 1e-4))

    def load(self, value: float | str) -> float:
        """Return a size in %, relative to OP's standard deviation, as a logarithm."""
        return float(np.log(float(value) / self.op_std + 1e-4))

    def time(self, value: float | str) -> float:
        """Return a time (s) in time scales of the loop."""
        return float(value) / self.Ts / self.pace

    def slow(self, p, at_pv: float) -> dict[str, float]:
        """Return ramp and walk, as what they do to PV over the record; `at_pv` PV units per unit of the signal."""
        rate, walk = abs(float(p["rate"])) * self.duration, float(p["walk"]) * np.sqrt(self.duration)
        return {"ramp": float(np.log(rate * at_pv / self.pv + 1e-6)), "size": float(np.log(walk * at_pv / self.pv + 1e-6))}


def ratio(value: float | str) -> float:
    """Return a factor's logarithm."""
    return float(np.log(max(float(value), 1e-3)))
