"""Families of empirical models between OP and PV, fitted by the likelihood of the one-step
prediction errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from simbench.gap.effects import (
    dead_time_mismatch,
    deadzone,
    gain_mismatch,
    slew_limit,
    stiction,
    time_constant_mismatch,
)
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import NUISANCES, Fit, Free, Moves, Spec, size_penalty
from simbench.gap.likelihood.search import MV_STARTS, likeliest
from simbench.gap.likelihood.valve_map import lagged
from simbench.gap.situation import Situation

# the library's fits that find a law as well: the law's form, and its numbers by the effect's
_PLANT = (
    ("size", gain_mismatch.RECOGNISER, {"gain": "factor"}),
    ("size", time_constant_mismatch.RECOGNISER, {"pace": "factor"}),
    ("size", dead_time_mismatch.RECOGNISER, {"delay": "extra"}),
)
_VALVE = (
    ("memory", stiction.RECOGNISER, {"S": "S", "J": "J"}),
    ("rate", slew_limit.RECOGNISER, {"slowness": "slowness"}),
)
KNOTS = (0.25, 0.5, 0.75)  # of a curve, as quantiles of OP


class Family(NamedTuple):
    """A family: its form, how it is fitted on top of a fit without it, and its numbers in units of
    the loop file.
    """

    form: str
    fit: Callable[[Engine, Fit], tuple[Fit, float]]
    numbers: Callable[[Fit], dict[str, float]]


class Tried(NamedTuple):
    """The likeliest law of a family: its fit, and by how many nats it is above the fit without it,
    its numbers paid for.
    """

    family: Family
    fit: Fit
    gain: float


def fitted(family: Family, engine: Engine, null: Fit) -> Tried:
    """Return the likeliest law of a family on top of the fit without a law."""
    fit, count = family.fit(engine, null)
    return Tried(family, fit, fit.loglik - null.loglik - size_penalty(engine.data.n, count))


def held(law: Tried, engine: Engine, null: Fit) -> Fit:
    """Return the likeliest fit of a law, its numbers held, to samples it was not fitted to."""
    spec, theta = law.fit.spec, law.fit.theta
    load = {name: theta[name] for name in NUISANCES if name in theta}
    # another gain, lag or dead time belongs to the baseline's plant
    plant = {name: law.fit.K if name == "K" else theta[name] for name in spec.free}
    engine = Engine(replace(engine.data, **plant), engine.longest_load)
    valve = Spec(valve=spec.valve, moves=spec.moves)
    numbers = {number.name: theta[number.name] for number in valve.effect_numbers}
    begun = [
        engine.at(null.spec.join(replace(valve, start=start)), {**null.theta, **more, **numbers})
        for more in ({}, load)
        for start in (MV_STARTS if spec.valve else (0.0,))
    ]
    best = max(begun, key=lambda fit: fit.loglik)
    return engine.fit(best.spec, best.theta, search=NUISANCES, steps=8)


def families(s: Situation, first: int) -> Iterator[Family]:
    """Yield the families whose law this record may show; numbers of a valve are not asked for where
    MV was recorded.
    """
    Ts, d, known = s.record.Ts, s.data, _PLANT
    if s.record.mv is None:
        known = (*_VALVE, *_PLANT)
        knots = dict(zip(("q1", "q2", "q3"), np.quantile(d.u[:first], KNOTS).tolist()))
        flat = dict.fromkeys(("k1", "k2", "k3"), 0.0)
        yield Family(
            "curve",
            _moved(
                lambda u, p: (
                    u + sum(p[k] * np.maximum(u - q, 0.0) for k, q in zip(flat, knots.values()))
                ),
                dict.fromkeys(flat, (-0.98, 5.0, False)),
                [{**flat, k: bend} for k in flat for bend in (0.5, -0.4)],
            ),
            lambda fit: knots | {k: fit.theta[k] for k in flat},
        )
        # flat between two knots
        yield Family(
            "curve",
            deadzone.fit,
            lambda fit: {
                "q1": fit.theta["c"] - fit.theta["D"] / 2,
                "q2": fit.theta["c"] + fit.theta["D"] / 2,
                "k1": -1.0,
                "k2": 1.0,
            },
        )
    pace = d.T + d.Td + 1.0
    yield Family(
        "zero",
        _moved(
            lambda u, p: _led(u, p["lead"], p["lag"]),
            {"lead": (-5 * pace, 5 * pace, False), "lag": (0.2, 10 * pace, True)},
            [
                {"lead": a * pace, "lag": g * pace}
                for a in (-1.0, -0.3, 0.0, 0.5, 1.5)
                for g in (0.1, 0.3, 1.0)
            ],
        ),
        lambda fit: {name: fit.theta[name] * Ts for name in ("lead", "lag")},
    )
    for form, how, names in known:
        if how.fit is not None and how.possible(s):
            yield Family(
                form,
                how.fit,
                lambda fit, how=how, names=names: {
                    own: float(how.numbers(fit, s)[name]) for own, name in names.items()
                },
            )


def _moved(
    mv: Callable[[np.ndarray, Any], np.ndarray],
    bounds: Mapping[str, tuple[float, float, bool]],
    starts: list[dict[str, float]],
) -> Callable[[Engine, Fit], tuple[Fit, float]]:
    """Return the fit of a valve as a function, with the lower and the upper bound of each of its
    numbers and whether it is searched by its logarithm, begun from several values of them.
    """
    free = tuple(
        Free(name, lambda d, low=low: low, lambda d, high=high: high, log=log)
        for name, (low, high, log) in bounds.items()
    )

    def fit(engine: Engine, null: Fit) -> tuple[Fit, float]:
        spec = null.spec.join(Spec(moves=Moves(mv, free)))
        tries = [one.theta for one in engine.grid(spec, null.theta, starts, keep=2)]
        return likeliest(engine, spec, tries), len(free)

    return fit


def _led(u: np.ndarray, lead: float, lag: float) -> np.ndarray:
    """Return u (n,) after (lead s + 1)/(lag s + 1), in samples, begun at rest."""
    slow = lagged(u, lag)
    return slow + (lead / lag) * (u - slow)
