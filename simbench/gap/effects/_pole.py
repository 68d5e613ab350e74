"""Shared by valve lag, extra lag and sensor lag: fit one additional series pole."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.likelihood.search import fit_likeliest, plants
from simbench.gap.situation import Situation


def pole(where: str) -> Callable[[Engine, Fit], tuple[Fit, float]]:
    """Return the fit with one more series pole in the valve, the plant or the sensor."""

    def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
        d = engine.data
        spec = base.spec.join(Spec(pole=where))
        lags = np.geomspace(0.3, max(1.5 * engine.longest_load, 3.0 * d.T), 10)
        theta = dict(base.theta)
        if where == "sensor" and d.noise > 0:
            # what the base took for quiet, coloured noise is the filter's work, but for what the
            # noise remembers by itself
            theta |= {"noise_std": d.noise, "colour": 0.2}
        shortest = engine.bounds(spec, "Td")[0]

        # without the pole the base has lengthened Td and T in its stead
        points = []
        for x in lags:
            for plant in plants(engine, base):
                for td in {plant["Td"], shortest}:
                    points.append({**plant, "tau": float(x), "Td": td})
        tries = engine.grid(spec, theta, points)

        # a long lag shows its worth only once the load has given way
        stated = plants(engine, base)[1]
        for x in lags[4::2]:
            tries.append(engine.fit(spec, {**theta, **stated, "tau": float(x)}, steps=2))
        tries.sort(key=lambda f: -f.loglik)
        return fit_likeliest(engine, spec, (t.theta for t in tries[:2])), 1.0

    return fit


def tau(fit: Fit, s: Situation) -> dict[str, float | str]:
    """Return the time constant (s)."""
    return {"tau": fit.theta["tau"] * s.record.Ts}
