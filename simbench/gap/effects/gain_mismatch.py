"""Recognise a gain mismatch: fit the plant's gain, which other fits keep near the baseline's."""

from __future__ import annotations

from simbench.gap.effects._recogniser import Recogniser, clip
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.likelihood.search import fit_likeliest


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Release K, from loads of several sizes."""
    spec = base.spec.join(Spec(free=frozenset({"K"})))
    quiet = {**base.theta, "load": 0.3 * base.theta["load"]}
    return fit_likeliest(engine, spec, (base.theta, quiet)), 1.0


RECOGNISER = Recogniser(
    fit=fit,
    numbers=lambda fit, s: {"factor": clip(fit.K / s.data.K, 0.05, 20.0)},
    needs=frozenset({"plant"}),
)
