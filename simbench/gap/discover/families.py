"""Families of laws between OP and PV, tried by the innovations' likelihood: each by its numbers and first guesses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from simbench.gap.discover.moves import led, rung
from simbench.gap.effects import deadzone, load_steps, stiction
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import NUISANCES, Data, Fit, Free, Moves, Spec, input_gain, size_penalty
from simbench.gap.situation import Situation

_LOAD = (*NUISANCES, "load_jump")  # searched anew in every part of the record; a law's own numbers are not
_Numbers = dict[str, float]


def _own(own: _Numbers, fit: Fit) -> _Numbers:
    searched = {number.name for number in (fit.spec.moves.free if fit.spec.moves else ())} | own.keys()
    return {name: fit.theta.get(name, own.get(name, 0.0)) for name in searched}


@dataclass(frozen=True)
class Family:
    """A family: its form, the engine's spec for a part of the record that begins at a sample, and where the search begins.

    `numbers` are the law's in units of the loop file, of the engine's own, which `kept` takes from a fit; `seen` is the data as
    the law takes them; `price` counts what each part fits anew.
    """

    form: str
    spec: Callable[[Data, int, _Numbers], Spec]
    starts: Callable[[Engine, Fit], list[_Numbers]]
    numbers: Callable[[Fit, _Numbers], _Numbers]
    seen: Callable[[Data, _Numbers], Data] = lambda d, own: d
    kept: Callable[[_Numbers, Fit], _Numbers] = _own
    price: float = 0.0


def fitted(family: Family, engine: Engine, null: Fit) -> tuple[Fit, _Numbers] | None:
    """Return fit and the law's own numbers of the likeliest law of a family, beside its null."""
    tries = []
    for own in family.starts(engine, null):
        spec = null.spec.join(family.spec(engine.data, 0, own))
        for share in (1.0, 0.3):
            theta = {**null.theta, **own, "load": share * null.theta["load"]}
            tries.append((engine.evaluate(spec, theta)[0], spec, theta, own))
    tries.sort(key=lambda t: -t[0])
    near = [t for t in tries[:2] if t[0] > null.loglik - _HOPELESS]
    found = [(engine.fit(spec, theta, steps=8), own) for _, spec, theta, own in near]
    if not found:
        return None
    best, own = max(found, key=lambda f: f[0].loglik)
    return best, family.kept(own, best)


def numbers_of(family: Family, own: _Numbers) -> float:
    """Return how many numbers a law of a family pays for."""
    return len(own.keys() - {"valve", "start"}) + family.price


_HOPELESS = 30.0  # nats below the null, from which a point of a family's grid is not refined


def judged(family: Family, own: _Numbers, fit: Fit, engine: Engine, null: Fit, begin: int) -> tuple[float, Fit]:
    """Return the log-likelihood of a law with given numbers in a part of a record that begins at `begin`, and its fit."""
    data = family.seen(engine.data, own)
    there = engine if data is engine.data else Engine(data, engine.longest_load)
    spec = null.spec.join(family.spec(data, begin, own))
    loads = {k: v for k, v in fit.theta.items() if k in _LOAD}
    starts = (-1.0, 0.0, 1.0) if spec.valve else (spec.start,)
    tries = [there.at(replace(spec, start=x), {**null.theta, **more, **own}) for more in ({}, loads) for x in starts]
    best = max(tries, key=lambda f: f.loglik)
    best = there.fit(best.spec, best.theta, search=tuple(m for m in _LOAD if m in spec.names), steps=8)
    return best.loglik - size_penalty(data.n, family.price), best


def nulls_of(engine: Engine) -> list[tuple[Fit, float]]:
    """Return the fits without a law, each with its price (nats): an ordinary load, and where it is worth it one that jumps."""
    plain = engine.of_higher_order(engine.base())
    jumping, count = load_steps.fit(engine, plain)
    price = size_penalty(engine.data.n, count)
    return [(plain, 0.0), *([(jumping, price)] if jumping.loglik - price > plain.loglik else [])]


def _moves(mv: Callable[[np.ndarray, Any], np.ndarray], *free: Free) -> Callable[..., Spec]:
    return lambda d, begin, own: Spec(moves=Moves(mv, free))


def _free(name: str, low: float, high: float, log: bool = False) -> Free:
    return Free(name, lambda d: low, lambda d: high, log=log)


def families(s: Situation, integrating: bool, first: int) -> Iterator[Family]:
    """Yield the families whose law this record may show; numbers of a valve are not asked for where MV was recorded."""
    Ts, d, op = s.record.Ts, s.data, s.data.u
    by_mv = s.record.mv is not None
    pace = d.T + d.Td + 1.0
    knots = [float(q) for q in np.quantile(op[:first], (0.25, 0.5, 0.75))]
    low, high = float(op.min()), float(op.max())

    def bent(u: np.ndarray, p: Any) -> np.ndarray:
        return u + sum(p[f"k{i + 1}"] * np.maximum(u - q, 0.0) for i, q in enumerate(knots))

    if not by_mv:
        yield Family(
            "curve", _moves(bent, *(_free(f"k{i}", -0.98, 5.0) for i in (1, 2, 3))),
            lambda e, f: [{f"k{i}": k * (i == j) for i in (1, 2, 3)} for j in (1, 2, 3) for k in (0.5, -0.4)],
            lambda f, own: {f"q{i + 1}": q for i, q in enumerate(knots)} | {f"k{i}": f.theta[f"k{i}"] for i in (1, 2, 3)},
        )  # fmt: skip
        yield _mapped("curve", deadzone.fit, ("D", "c"), _zone_curve)
        if s.baseline.valve.name == "ideal":
            yield _mapped("memory", stiction.fit, ("S", "J"), lambda f: {"S": f.theta["S"], "J": f.theta["J"]})
        steps = float(np.std(np.diff(op))) or 1.0
        yield Family(
            "rate", _moves(lambda u, p: kernels.slewed(u, p["r"]), _free("r", 1e-3 * steps, 10 * steps, log=True)),
            lambda e, f: [{"r": float(r)} for r in steps * np.geomspace(0.02, 3.0, 12)],
            lambda f, own: {"slowness": Ts / f.theta["r"]},
        )  # fmt: skip
        ends = [float(q) for q in np.quantile(op, (0.02, 0.1, 0.25, 0.75, 0.9, 0.98))]
        yield Family(
            "stops", _moves(lambda u, p: np.clip(u, p["lo"], max(p["hi"], p["lo"] + 1e-3)), _free("lo", low - 1.0, high),
                            _free("hi", low, high + 1.0)),
            lambda e, f: [{"lo": a, "hi": high} for a in ends[:3]] + [{"lo": low, "hi": b} for b in ends[3:]]
            + [{"lo": a, "hi": b} for a, b in zip(ends[:3], ends[:2:-1])],
            lambda f, own: {k: v for k, v, off in (("low", f.theta["lo"], low), ("high", f.theta["hi"], high))
                            if (v > off) == (k == "low") and v != off} or {"low": f.theta["lo"], "high": f.theta["hi"]},
        )  # fmt: skip
    yield from _process(s, d, pace, Ts, integrating)
    yield Family(
        "filter", lambda d, b, own: Spec(pole="sensor"), lambda e, f: [{"tau": pace * x} for x in np.geomspace(0.05, 3.0, 8)],
        lambda f, own: {"tau": f.theta["tau"] * Ts},
    )  # fmt: skip
    yield Family("periodic", _periodic, _peaks, lambda f, own: _load_size(f, own, s), price=4.0)


def _process(s: Situation, d: Data, pace: float, Ts: float, integrating: bool) -> Iterator[Family]:
    for name in ("K", "T", "Td") if not integrating else ("K", "Td"):
        yield Family("size", lambda d, b, own, name=name: Spec() if own else Spec(free=frozenset({name})), lambda e, f: [{}],
                     lambda f, own: _resized(own, d, Ts), lambda data, own: replace(data, **own),
                     lambda own, f, name=name: {name: f.K if name == "K" else f.theta[name]})  # fmt: skip
    yield Family("zero", _moves(lambda u, p: led(u, p["a"], p["g"]), _free("a", -5 * pace, 5 * pace),
                                _free("g", 0.2, 10 * pace, log=True)),
                 lambda e, f: [{"a": a * pace, "g": g * pace} for a in (-1.0, -0.3, 0.0, 0.5, 1.5) for g in (0.1, 0.3, 1.0)],
                 lambda f, own: {"lead": f.theta["a"] * Ts, "lag": f.theta["g"] * Ts})  # fmt: skip
    yield Family("resonance", _moves(lambda u, p: rung(u, p["P"], p["z"]), _free("P", 2.5, 40 * pace, log=True),
                                     _free("z", 0.02, 1.5, log=True)),
                 lambda e, f: [{"P": P * pace, "z": z} for P in np.geomspace(0.3, 8.0, 8) for z in (0.1, 0.4)],
                 lambda f, own: {"period": f.theta["P"] * Ts, "damping": f.theta["z"]})  # fmt: skip


def _mapped(form: str, fit: Callable[[Engine, Fit], tuple[Fit, float]], names: tuple[str, ...], numbers: Callable) -> Family:
    """Return a family that a valve map's own search fits."""

    def starts(engine: Engine, null: Fit) -> list[_Numbers]:
        best = fit(engine, null)[0]
        if best.spec.valve == kernels.IDEAL:
            return []
        return [{m: best.theta[m] for m in names} | {"valve": best.spec.valve, "start": best.spec.start}]

    return Family(form, lambda d, b, own: Spec(valve=int(own["valve"]), start=own["start"]), starts, lambda f, own: numbers(f))


def _zone_curve(f: Fit) -> _Numbers:
    D, c = f.theta["D"], f.theta["c"]
    return {"q1": c - D / 2, "q2": c + D / 2, "k1": -1.0, "k2": 1.0}


def _resized(own: _Numbers, d: Data, Ts: float) -> _Numbers:
    ((name, value),) = own.items()
    if name == "K":
        return {"gain": max(value / d.K, 0.01)}
    return {"pace": value / d.T} if name == "T" else {"delay": (value - d.Td) * Ts}


def _periodic(data: Data, begin: int, own: _Numbers) -> Spec:
    w, t = 2 * np.pi / own["period"], begin + np.arange(data.n)
    return Spec(channels=tuple(f(h * w * t) for h in (1, 2) for f in (np.sin, np.cos)))


def _peaks(engine: Engine, null: Fit) -> list[_Numbers]:
    """Return the periods of the sharpest peaks of the innovations' spectrum, at least three of them in the part."""
    n, white = engine.data.n, np.asarray(null.residual) - np.mean(null.residual)
    power = np.abs(np.fft.rfft(white, 8 * n)) ** 2
    power[:24] = 0.0
    out = []
    for _ in range(3):
        k = int(np.argmax(power))
        out.append({"period": 8 * n / k})
        power[max(k - 12, 0) : k + 12] = 0.0
    return out


def _load_size(f: Fit, own: _Numbers, s: Situation) -> _Numbers:
    beta = f.beta[-4:]
    gains = [abs(1.0 / (1j * h * 2 * np.pi / own["period"] * f.theta.get("T", 1.0) + 1.0)) if s.data.T > 0
             else own["period"] / (2 * np.pi * h) for h in (1, 2)]  # fmt: skip
    one, two = (float(np.hypot(*b)) / (abs(input_gain(f, s.data)) * g) for b, g in zip((beta[:2], beta[2:]), gains))
    return {"period": own["period"] * s.record.Ts, "amplitude": min(one, 100.0), "second": min(two, 100.0)}
