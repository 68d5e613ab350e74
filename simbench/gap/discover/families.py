"""Families of empirical models between OP and PV, fitted by the likelihood of the one-step
prediction errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from simbench.gap.effects import deadzone, load_steps, stiction
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import NUISANCES, Fit, Free, Moves, Spec, size_penalty
from simbench.gap.likelihood.search import MV_STARTS
from simbench.gap.likelihood.valve_map import lagged
from simbench.gap.situation import Situation

# searched anew in every part of the record; the numbers of a law are not
_LOAD = (*NUISANCES, "load_jump")
_LOADS = ("load", "load_time", "load_lag")  # searched with each guess of a family ...
_QUICK = 5  # ... in so many steps
_HOPELESS = 30.0  # nats below the null, from which a point of a family's grid is not refined
_Numbers = dict[str, float]
Nulls = list[tuple[Fit, float]]  # fits without a law, each with its price (nats)


@dataclass(frozen=True)
class Family:
    """A family: its form, `numbers` (the law's in units of the loop file, of the engine), and
    where the search begins.

    Either the engine's `spec` with guesses of its numbers, or the `search` of a valve map,
    which fits both.
    """

    form: str
    numbers: Callable[[_Numbers], _Numbers]
    spec: Spec = field(default_factory=Spec)
    starts: Sequence[_Numbers] = ({},)
    search: Callable[[Engine, Fit], tuple[Fit, float]] | None = None


class Tried(NamedTuple):
    """The likeliest law of a family on top of a null: its fit, its part of the spec and its
    numbers in units of the engine.
    """

    family: Family
    fit: Fit
    spec: Spec
    engine_numbers: _Numbers

    @property
    def numbers(self) -> _Numbers:
        """The law's numbers in units of the loop file."""
        return self.family.numbers(self.engine_numbers)


def fitted(family: Family, engine: Engine, null: Fit) -> Tried | None:
    """Return the likeliest law of a family on top of its null; None where none is near."""
    spec = family.spec
    if family.search is not None:
        best = family.search(engine, null)[0]
        if best.spec.valve == kernels.IDEAL:
            return None
        spec = Spec(valve=best.spec.valve, start=best.spec.start)
        guesses: Sequence[_Numbers] = [
            {number.name: best.theta[number.name] for number in spec.effect_numbers}
        ]
    else:
        guesses = family.starts
    joined = null.spec.join(spec)
    # the load that the null needed may hide a law: each guess is tried with another load, too
    loads = ({}, {k: v for k, v in engine.start().items() if k in _LOAD})
    quick = [
        engine.fit(joined, {**null.theta, **guess, **load}, search=_LOADS, steps=_QUICK)
        for guess, load in product(guesses, loads)
    ]
    tries = sorted(
        (f for f in quick if f.loglik > null.loglik - _HOPELESS), key=lambda f: -f.loglik
    )
    fits = [engine.fit(joined, f.theta, steps=8) for f in tries[:2]]
    if not fits:
        return None
    best = max(fits, key=lambda f: f.loglik)
    names = [*spec.free, *(number.name for number in spec.effect_numbers)]
    return Tried(
        family, best, spec, {name: best.K if name == "K" else best.theta[name] for name in names}
    )


def gain_of(law: Tried, engine: Engine, level: float) -> float:
    """Return by how many nats a law is above a level, its numbers paid for."""
    return law.fit.loglik - level - size_penalty(engine.data.n, len(law.engine_numbers))


def judged(law: Tried, engine: Engine, nulls: Nulls) -> tuple[Fit, float]:
    """Return the likeliest fit of a law, its numbers held, to samples it was not fitted to, and its
    nats above the nulls.
    """
    numbers, loads = law.engine_numbers, {k: v for k, v in law.fit.theta.items() if k in _LOAD}
    if law.spec.free:
        # another gain, lag or dead time belongs to the baseline's plant
        engine, numbers = Engine(replace(engine.data, **numbers), engine.longest_load), {}
    tries = []
    for null, price in nulls:
        spec = null.spec.join(replace(law.spec, free=frozenset()))
        starts = MV_STARTS if spec.valve else (spec.start,)
        begun = [
            engine.at(replace(spec, start=x), {**null.theta, **more, **numbers})
            for more in ({}, loads)
            for x in starts
        ]
        best = max(begun, key=lambda f: f.loglik)
        fit = engine.fit(
            best.spec, best.theta, search=tuple(m for m in _LOAD if m in spec.names), steps=8
        )
        tries.append((fit, fit.loglik - price))
    best, value = max(tries, key=lambda t: t[1])
    return best, value - max(map(worth, nulls))


def worth(null: tuple[Fit, float]) -> float:
    """Return a fit's log-likelihood less its price."""
    return null[0].loglik - null[1]


def nulls_of(engine: Engine) -> Nulls:
    """Return the fits without a law, each with its price (nats): an ordinary load, and where it is
    worth it one that jumps.
    """
    plain = engine.of_higher_order(engine.base())
    jumping, count = load_steps.fit(engine, plain)
    price = size_penalty(engine.data.n, count)
    return [(plain, 0.0), *([(jumping, price)] if jumping.loglik - price > plain.loglik else [])]


def _moves(mv: Callable[[np.ndarray, Any], np.ndarray], *free: Free) -> Spec:
    return Spec(moves=Moves(mv, free))


def _free(name: str, low: float, high: float, log: bool = False) -> Free:
    return Free(name, lambda d: low, lambda d: high, log=log)


def families(s: Situation, first: int) -> Iterator[Family]:
    """Yield the families whose law this record may show; numbers of a valve are not asked for where
    MV was recorded.
    """
    Ts, d = s.record.Ts, s.data
    pace = d.T + d.Td + 1.0
    if s.record.mv is None:
        yield from _valve(s, first)
    for name, size in (("K", "gain"), ("T", "pace"), ("Td", "delay")):
        if name != "T" or d.T > 0.0:
            yield Family(
                "size",
                lambda x, name=name, size=size: _resized(size, x[name], s),
                Spec(free=frozenset({name})),
            )
    yield Family(
        "zero",
        lambda x: {"lead": x["lead"] * Ts, "lag": x["lag"] * Ts},
        _moves(
            lambda u, p: _led(u, p["lead"], p["lag"]),
            _free("lead", -5 * pace, 5 * pace),
            _free("lag", 0.2, 10 * pace, True),
        ),
        [
            {"lead": a * pace, "lag": g * pace}
            for a in (-1.0, -0.3, 0.0, 0.5, 1.5)
            for g in (0.1, 0.3, 1.0)
        ],
    )


def _valve(s: Situation, first: int) -> Iterator[Family]:
    Ts, op = s.record.Ts, s.data.u
    steps = float(np.std(np.diff(op))) or 1.0
    q1, q2, q3 = (float(q) for q in np.quantile(op[:first], (0.25, 0.5, 0.75)))

    def bent(u: np.ndarray, p: Any) -> np.ndarray:
        return u + sum(
            p[k] * np.maximum(u - q, 0.0) for k, q in (("k1", q1), ("k2", q2), ("k3", q3))
        )

    slopes = ("k1", "k2", "k3")
    yield Family(
        "curve",
        lambda x: {"q1": q1, "q2": q2, "q3": q3, **x},
        _moves(bent, *(_free(k, -0.98, 5.0) for k in slopes)),
        [{one: k * (one == bend) for one in slopes} for bend in slopes for k in (0.5, -0.4)],
    )
    yield Family(
        "curve",
        lambda x: {
            "q1": x["c"] - x["D"] / 2,
            "q2": x["c"] + x["D"] / 2,
            "k1": -1.0,
            "k2": 1.0,
        },
        search=deadzone.fit,
    )
    if s.baseline.valve.name == "ideal":
        yield Family("memory", lambda x: {"S": x["S"], "J": x.get("J", 0.0)}, search=stiction.fit)
    yield Family(
        "rate",
        lambda x: {"slowness": Ts / x["rate"]},
        _moves(
            lambda u, p: kernels.slewed(u, p["rate"]), _free("rate", 1e-3 * steps, 10 * steps, True)
        ),
        [{"rate": float(r)} for r in steps * np.geomspace(0.02, 3.0, 12)],
    )


def _resized(size: str, value: float, s: Situation) -> _Numbers:
    """Return a gain, a time constant or a dead time of the engine as the law states it, relative to
    the baseline's.
    """
    d = s.data
    return {
        size: {
            "gain": max(value / d.K, 0.01),
            "pace": value / (d.T or 1.0),
            "delay": (value - d.Td) * s.record.Ts,
        }[size]
    }


def _led(u: np.ndarray, lead: float, lag: float) -> np.ndarray:
    """Return u (n,) after (lead s + 1)/(lag s + 1), in samples, begun at rest."""
    slow = lagged(u, max(lag, 0.05))
    return slow + (lead / max(lag, 0.05)) * (u - slow)
