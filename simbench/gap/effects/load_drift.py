"""Recognise a load drift: a random walk with a ramp on the load, in addition to its usual
variation.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import LINEAR, Fit, Spec, input_gain
from simbench.gap.situation import Situation


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Fit a random walk with a ramp to the load."""
    d = engine.data
    line = kernels.plant(np.linspace(0.0, 1.0, d.n), base.theta["T"] if d.T > 0 else 0.0, 0.0, 0.0)
    spec = base.spec.join(Spec(load_walk=True, channels=(line,)))
    size = float(np.std(d.y)) if d.T > 0 else float(np.std(np.diff(d.y)))
    best = engine.grid(
        spec, base.theta, [{"load_walk": size * f / np.sqrt(d.n)} for f in (1e-3, 0.03, 0.3, 1.0)]
    )[0]
    return engine.fit(spec, best.theta), 2.0


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return ramp (%/s) and walk (%/sqrt(s)) at the plant's input."""
    Ts, K = s.record.Ts, input_gain(fit, s.data)
    rate, walk = (
        fit.beta[LINEAR:][-1] / K / (s.data.n * Ts),
        fit.theta["load_walk"] / abs(K) / np.sqrt(Ts),
    )
    return {"rate": float(rate), "walk": float(walk)}


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    bends_plant=True,
    mean_op_shift=lambda p, half, K: float(p["rate"]) * half,
)
