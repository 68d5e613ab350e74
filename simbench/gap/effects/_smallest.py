"""Compute the smallest effect that a record could have shown; the answer "no effect" excludes only
larger ones.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.situation import Situation

# nats that an effect of the stated size would bring: the price of a number and a clear lead over
# "none"
_NATS = 9.0
_STEPS = np.geomspace(0.02, 2.0, 14)  # shares of the record's scale, from barely there to gross


class Probe:
    """A record's fit without effect, into which effects of growing size are forced."""

    def __init__(self, engine: Engine, base: Fit, situation: Situation) -> None:
        self.engine = engine
        self.base = base
        self.situation = situation
        self.level = engine.evaluate(base.spec, base.theta)

    def first(
        self,
        spec: Spec,
        numbers: Callable[[float], dict[str, float]],
        size: Callable[[float], float],
    ) -> float:
        """Return the size of the first step that costs `_NATS` in likelihood, all else held;
        infinite where none does.
        """
        joined = self.base.spec.join(spec)
        for step in _STEPS:
            if (
                self.level - self.engine.evaluate(joined, {**self.base.theta, **numbers(step)})
                > _NATS
            ):
                return float(size(step))
        return float("inf")

    def pole(self, where: str) -> tuple[float, str]:
        """Return the smallest time constant of one more series pole."""
        d = self.engine.data
        unit = 5.0 * (d.T or d.Td + 1.0)
        size = self.first(
            Spec(pole=where),
            lambda x: {"tau": x * unit},
            lambda x: x * unit * self.situation.record.Ts,
        )
        return size, "s"

    def factor(self, name: str) -> tuple[float, str]:
        """Return the smallest factor of a number of the model."""
        theta = self.base.theta
        size = self.first(
            Spec(free=frozenset({name})),
            lambda x: {name: theta[name] * (1.0 + x)},
            lambda x: 1.0 + x,
        )
        return size, ""
