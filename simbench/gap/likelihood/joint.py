"""Fit one model to several records of a loop: plant, effect and noise are shared, loads and
operating points are separate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec

_TIMES = ("T", "tau", "load_time", "load_lag")
_WALKS = ("walk", "load_walk")


@dataclass(frozen=True, eq=False)
class JointPart:
    """One record of a joint fit; `pace`: its samples to one of the first record's."""

    data: Data
    pace: float = 1.0


class JointEngine(Engine):
    """The likelihood of several records as one: what the first record's engine is for one, in units
    of its samples.
    """

    def __init__(self, parts: Sequence[JointPart], longest_load: float) -> None:
        first = parts[0].data
        u, y = (np.concatenate([getattr(p.data, name) for p in parts]) for name in ("u", "y"))
        super().__init__(replace(first, u=u, y=y), longest_load)
        self.parts = tuple(parts)
        self.engines = [Engine(p.data, longest_load * p.pace) for p in parts]
        ends = np.cumsum([p.data.n for p in parts])
        self.places = [slice(int(end - p.data.n), int(end)) for p, end in zip(parts, ends)]
        self.spread = max(e.spread for e in self.engines)

    def one_of(
        self, i: int, spec: Spec, theta: Mapping[str, float]
    ) -> tuple[Spec, dict[str, float]]:
        """Return spec and nonlinear parameters as one record has them, in its samples."""
        part = self.parts[i]
        rows = self.places[i]
        jumps = tuple(
            k - rows.start for k in spec.jumps if rows.start + kernels.SKIP <= k < rows.stop
        )
        spec = replace(spec, channels=tuple(c[rows] for c in spec.channels), jumps=jumps)
        scaled = dict(theta)
        # an archive that lags by a sample hides one sample of dead time, but not in every record
        scaled["Td"] = max((scaled["Td"] + self.data.late) * part.pace - part.data.late, 0.0)
        if part.pace != 1.0:
            scaled |= {name: scaled[name] * part.pace for name in _TIMES if name in scaled}
            scaled |= {name: scaled[name] / np.sqrt(part.pace) for name in _WALKS if name in scaled}
            scaled["colour"] = (
                scaled["colour"] ** part.pace**-1.0 if scaled["colour"] > 0.0 else 0.0
            )
            if self.data.T == 0.0:
                scaled["load"] /= part.pace
        return spec, scaled

    def more_numbers(self, spec: Spec, base: Spec) -> float:
        """Return how many numbers the signals of an effect are fitted by beyond those of one
        record.
        """
        return float((len(self.parts) - 1) * (len(spec.channels) - len(base.channels)))

    def main(self, fit: Fit) -> Fit:
        """Return a fit as the first record alone has it: plant and effect are those of all."""
        alone = self.engines[0].at(*self.one_of(0, fit.spec, fit.theta))
        alone.beta[0] = fit.beta[0]
        alone.theta.update(
            {name: value for name, value in fit.theta.items() if name not in alone.theta}
        )
        return alone

    def _channels(self, spec: Spec, theta: Mapping[str, float]) -> np.ndarray:
        # PV, the plant's answer, every record's bias and onset; last the signals of an effect, the
        # first record's at the end
        whole = np.zeros((2, self.data.n))
        blocks = []
        effects = []
        count = len(spec.channels)
        for i, engine in enumerate(self.engines):
            rows = self.places[i]
            alone = engine._channels(*self.one_of(i, spec, theta))
            whole[:, rows] = alone[:2]
            if self.data.T == 0.0:
                whole[1, rows] /= self.parts[i].pace
            for j, channel in enumerate(alone[2:]):
                placed = np.zeros(self.data.n)
                placed[rows] = channel
                (blocks if j < len(alone) - 2 - count else effects).append(placed)
        effects = [
            effects[i * count + j] for i in reversed(range(len(self.parts))) for j in range(count)
        ]
        return np.vstack([whole, *blocks, *effects])

    def _whiten(
        self, spec: Spec, theta: Mapping[str, float], channels: np.ndarray
    ) -> tuple[np.ndarray, float]:
        white = np.zeros(channels.shape)
        level = 0.0
        for i, engine in enumerate(self.engines):
            rows = self.places[i]
            here = channels[:, rows]
            seen = np.flatnonzero(here.any(axis=1))
            seen = seen if seen.size else np.array([0])
            whitened, more = engine._whiten(
                *self.one_of(i, spec, theta), np.ascontiguousarray(here[seen])
            )
            if i:
                whitened[:, : kernels.SKIP] = 0.0
            white[seen, rows] = whitened
            level += more
        return white, level

    def _scanned(
        self, spec: Spec, theta: Mapping[str, float], kind: int, points: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, float]:
        gy = np.zeros(len(points))
        gg = np.zeros(len(points))
        level = 0.0
        for i, engine in enumerate(self.engines):
            scale = 1.0 / self.parts[i].pace if self.data.T == 0.0 else 1.0
            one = engine._scan_maps(*self.one_of(i, spec, theta), kind, points)
            gy = gy + scale * one[0]
            gg = gg + scale**2 * one[1]
            level = level + one[2]
        return gy, gg, level
