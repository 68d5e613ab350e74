"""Recognise a drift of the sensor: a random walk with a ramp on the measurement."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.situation import Situation


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Let the measurement walk, with a ramp on top; an integrating plant's balance is a ramp
    already.
    """
    n = engine.data.n
    T = engine.data.T
    t = np.linspace(0.0, 1.0, n)
    # as a load's, it may bend
    spec = base.spec.join(Spec(walk=True, channels=(4.0 * t * (1.0 - t), t) if T > 0 else ()))
    size = float(np.std(engine.data.y)) / np.sqrt(n)
    best = engine.grid(spec, base.theta, [{"walk": size * f} for f in (0.01, 0.1, 0.5, 2.0)])[0]
    return engine.fit(spec, best.theta), 3.0 if T > 0 else 1.0


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return ramp (PV units/s) and walk (PV units/sqrt(s))."""
    Ts = s.record.Ts
    if s.data.T > 0:
        rate = fit.beta[-1] / (s.data.n * Ts)
    else:
        rate = 0.0
    return {"rate": float(rate), "walk": float(fit.theta["walk"] / np.sqrt(Ts))}


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    # a slow load on PV that the baseline states does the same
    ordinary=lambda fit, s: bool(s.loads_on_pv),
)
