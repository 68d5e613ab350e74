"""Recognise another noise level: fit it, which other fits keep near the stated one."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Parameters, Recogniser
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.situation import Situation

_QUIETER = 4.0  # numbers that a noise below the stated level is priced at


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Release the noise level."""
    spec = base.spec.join(Spec(free=frozenset({"noise_std"})))
    stated = engine.data.noise
    best = engine.fit(spec, base.theta)
    if stated > 0:
        # where the noise was held down, the load had taken its place: begin anew as well
        fresh = {**base.theta, **engine.start(), "noise_std": 2.0 * stated}
        tries = [
            engine.fit(spec, {**base.theta, "noise_std": 2.0 * stated, "colour": 0.05}),
            engine.fit(spec, fresh),
        ]
        best = max([best] + tries, key=lambda f: f.loglik)

    # less noise than stated is seldom less noise: something smooths it
    return best, 1.0 if best.theta["noise_std"] >= stated else _QUIETER


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return a factor of the stated std, or the std (PV units) where none is stated."""
    std = fit.theta["noise_std"]
    stated = s.data.noise
    if stated > 0:
        return {"factor": std / stated}
    return {"std": std}


def ordinary(fit: Fit, s: Situation) -> bool:
    """Return whether rounding or compression makes noise, or the baseline states a load on PV."""
    return s.archive.rounding is not None or s.archive.band > 0.0 or bool(s.loads_on_pv)


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    ordinary=ordinary,
    needs=frozenset({"plant"}),
)
