"""Shared by the mismatches of time constant and dead time: fit one parameter of the plant."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.likelihood.search import fit_likeliest


def release_number(
    name: str, trials: Callable[[Engine], list[float]]
) -> Callable[[Engine, Fit], tuple[Fit, float]]:
    """Return the fit in which one number of the plant is released, begun from several values of
    it.
    """

    def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
        spec = base.spec.join(Spec(free=frozenset({name})))
        # the load that hid the mismatch must give way before a trial shows its worth
        few = ("load_time", "load")
        tries = []
        for v in trials(engine):
            tries.append(engine.fit(spec, {**base.theta, name: v}, search=few, steps=2))
        tries.sort(key=lambda f: -f.loglik)
        return fit_likeliest(engine, spec, (t.theta for t in (base, *tries[:2]))), 1.0

    return fit


def times(engine: Engine) -> list[float]:
    """Return time constants to begin from (samples)."""
    return [engine.data.T * s for s in (0.3, 0.5, 0.7, 1.5, 2.0, 3.0)]


def dead_times(engine: Engine) -> list[float]:
    """Return dead times to begin from (samples)."""
    d = engine.data
    return list(np.linspace(0.0, d.Td, 5)[:-1]) + list(
        d.Td + np.geomspace(0.25, 6.0, 12) * max(d.Td, 0.3 * d.T, 2.0)
    )
