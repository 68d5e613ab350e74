"""Recognise a load drift: a random walk with a ramp on the load, in addition to its usual
variation.
"""

from __future__ import annotations

import numpy as np

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec, input_gain
from simbench.gap.likelihood.search import fit_likeliest
from simbench.gap.situation import Situation
from simbench.gap.thresholds import LARGER


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Fit a random walk with a bent ramp to the load."""
    d = engine.data
    t = np.linspace(0.0, 1.0, d.n)
    if d.T > 0:
        T = base.theta["T"]
    else:
        T = 0.0

    # a sine slower than the record bends
    bend = kernels.plant((4.0 * t * (1.0 - t)), T, 0.0, 0.0)
    line = kernels.plant(t, T, 0.0, 0.0)
    spec = base.spec.join(Spec(load_walk=True, channels=(bend, line)))
    if d.T > 0:
        size = float(np.std(d.y))
    else:
        size = float(np.std(np.diff(d.y)))
    best = engine.grid(
        spec, base.theta, [{"load_walk": size * f / np.sqrt(d.n)} for f in (1e-3, 0.03, 0.3, 1.0)]
    )[0]

    # the base's load had taken the drift's place
    quiet = {"load": 0.05 * best.theta["load"], "load_walk": 0.05 * size / np.sqrt(d.n)}
    quiet = {**best.theta, **quiet}
    return fit_likeliest(engine, spec, (best.theta, quiet)), 3.0


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return ramp (%/s) and walk (%/sqrt(s)) at the plant's input."""
    Ts = s.record.Ts
    K = input_gain(fit, s.data)
    rate = fit.beta[-1] / K / (s.data.n * Ts)
    walk = fit.theta["load_walk"] / abs(K) / np.sqrt(Ts)
    return {"rate": float(rate), "walk": float(walk)}


def ordinary(fit: Fit, s: Situation) -> bool:
    """Return whether a load drifts no further than healthy records show; that of an identified loop
    is its own.
    """
    data = s.data
    walk = fit.theta["load_walk"] * np.sqrt(s.record.n)
    most = LARGER * data.loads.get("slow", 0.0)
    near = np.hypot(fit.beta[-1], walk) < most * abs(input_gain(fit, data))
    return bool(near) or not s.trusted


def travel(p: Parameters, duration: float) -> float:
    """Return how far the load drifts."""
    return float(np.hypot(float(p["rate"]) * duration, float(p["walk"]) * np.sqrt(duration)))


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    ordinary=ordinary,
)
