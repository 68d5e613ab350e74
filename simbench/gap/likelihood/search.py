"""Search for the parameters of a valve model, for which the likelihood has many local maxima: scan,
refit the other parameters, refine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec
from simbench.valve.maps import SIZES_APART, distinct_valves

SMOOTH = (
    "load_time",
    "load_lag",
    "load",
    "noise_std",
    "colour",
    "load_jump",
)  # searched together with a valve
MV_STARTS = (-1.0, 0.0, 1.0)  # of MV within its band, in halves of it
_JUMPS = (-4.0, -1.5, 0.0, 1.5, 4.0)  # shares by which J is varied with S, whose peak is narrower
_SLIPPING = (kernels.STICK, kernels.CREEP)  # maps with a jump
KEPT = 30  # different peaks followed
_CHILDREN = 6  # points tried around each
_SPREADS = (0.03, 0.012)  # of log S around them, ever closer
_ROUGH = ("S", "J", "D", "c")  # in which the likelihood has corners
TINY = 10  # widths below what OP's jitter hides
_QUIET = 0.3  # of the load that "no effect" needed, with which peaks are looked for
# where no plant is known, friction is looked for with plants of these time constants and dead times
# (samples)
_LAGS = (0.7, 3.0, 10.0, 30.0)
_DELAYS = (0.5, 3.0, 8.0, 15.0)
_FOLLOWED = 2  # of the starts, the likeliest
_HOPELESS = 4.0  # nats below the base from which a grid's best point is not worth refining


def search_map(engine: Engine, base: Fit, kind: int, coarse: np.ndarray) -> Fit:
    """Return the fit of a valve map (`kind`: play, dead zone or stick-slip; a point holds S, J and
    where MV starts). The likelihood is rough in these: scan them, refit plant, load and noise,
    refine.
    """
    # at the load that "no effect" needed, peaks look flat: try a quieter one
    fitted, _, *others = plants(engine, base)
    tries = [(1.0, fitted)] + [(_QUIET, plant) for plant in (fitted, *others)]
    starts = [{**base.theta, **plant, "load": base.theta["load"] * level} for level, plant in tries]
    if not engine.data.trusted and kind in _SLIPPING:
        starts = screen_starts(engine, base, kind, coarse, starts)
    found = [settle(engine, scan_map(engine, base.spec, theta, kind, coarse)) for theta in starts]
    best = max(found, key=lambda f: f.loglik)
    if promising(best, base):
        return narrow(engine, best)
    return best


def screen_starts(
    engine: Engine,
    base: Fit,
    kind: int,
    coarse: np.ndarray,
    starts: list[dict[str, float]],
) -> list[dict[str, float]]:
    """Return those of some starts, and of a grid of plants, at which points of a valve map are
    likeliest.

    Feedback and friction hide the plant: what was identified without friction may be far from it.
    """
    # A grid of quiet plants beside the starts
    if engine.data.T > 0.0:
        lags = _LAGS
    else:
        lags = (0.0,)
    quiet = {**base.theta, "load": _QUIET * base.theta["load"]}
    grid = []
    for T in lags:
        for Td in _DELAYS:
            if Td < engine.data.n / 8:
                grid.append({**quiet, "T": T, "Td": Td})
    every = starts + grid

    # Those in which the map's best point is likeliest
    values = [engine.scan(base.spec, theta, kind, coarse).max() for theta in every]
    return [every[i] for i in np.argsort(-np.array(values), kind="stable")[:_FOLLOWED]]


def fit_likeliest(engine: Engine, spec: Spec, starts: Iterable[Mapping[str, float]]) -> Fit:
    """Return the likeliest of the fits from several starts, the first of equal ones."""
    return max((engine.fit(spec, start) for start in starts), key=lambda f: f.loglik)


def better(one: Fit | None, other: Fit) -> Fit:
    """Return the likelier fit."""
    return other if one is None or other.loglik > one.loglik else one


def scan_map(
    engine: Engine, spec: Spec, theta: dict[str, float], kind: int, points: np.ndarray
) -> Fit:
    """Return the fit at the best point of a valve map, looked for around the best of a coarse
    set.
    """
    # The best points whose sizes lie apart
    values = engine.scan(spec, theta, kind, points)
    tops: list[int] = []
    for i in np.argsort(-values):
        if all(abs(np.log(points[i, 0] / points[j, 0])) > SIZES_APART for j in tops):
            tops.append(int(i))
        if len(tops) == (3 if kind in _SLIPPING else 2):
            break

    # Finer around each of them
    near = np.vstack([around(kind, points[i], 0.5 * SIZES_APART) for i in tops])
    high = engine.scan(spec, theta, kind, near)

    # Maps that slip have many peaks; the others one
    if kind in _SLIPPING:
        points = np.vstack([points, near])
        values = np.concatenate([values, high])
        best = refine_peaks(
            lambda children: engine.scan(spec, theta, kind, children), points, values
        )[0]
        return fit_with_map(engine, spec, theta, kind, best)
    return fit_with_map(engine, spec, theta, kind, near[int(np.argmax(high))])


def refine_peaks(
    scan: Callable[[np.ndarray], np.ndarray], points: np.ndarray, values: np.ndarray
) -> np.ndarray:
    """Return points (p, 3) of a map with a jump, the best first, looked for ever closer around many
    distinct ones.

    The true peak is a percent or two wide in S, and on a coarse set its foot is no higher than
    broad hills elsewhere.
    """
    rng = np.random.default_rng(0)
    for turn, spread in enumerate(_SPREADS):
        kept = distinct_valves(points, -values, KEPT, 0.5**turn)
        parents = np.repeat(points[kept], _CHILDREN, axis=0)
        S = parents[:, 0] * np.exp(spread * rng.standard_normal(len(parents)))
        share = np.clip(
            parents[:, 1] / parents[:, 0] + 1.5 * spread * rng.standard_normal(len(parents)),
            0.02,
            1.0,
        )
        # every other one begins where its parent does
        start = np.where(
            np.arange(len(S)) % 2 == 0,
            parents[:, 2] / parents[:, 0],
            rng.choice(MV_STARTS, len(S)) / 2,
        )
        children = np.column_stack([S, share * S, start * S])
        points = np.vstack([points[kept], children])
        values = np.concatenate([values[kept], scan(children)])
    return points[np.argsort(-values, kind="stable")]


def around(kind: int, point: np.ndarray, share: float) -> np.ndarray:
    """Return points about one of a valve map: sizes within a share of it, the other number, and
    starts within the band.
    """
    # Sizes about the point, in five steps
    a, b, _ = point
    sizes = a * (1 + share * np.linspace(-1.0, 1.0, 5))

    # The other number: a dead-zone's middle, a start, or a slip jump with a start
    if kind == kernels.ZONE:
        return np.array(
            [
                (x, b + shift * share * a, 0.0)
                for x in sizes
                for shift in (-1.0, -0.5, 0.0, 0.5, 1.0)
            ]
        )
    if kind == kernels.PLAY:
        return np.array([(x, begin * x / 2, 0.0) for x in sizes for begin in MV_STARTS])
    return np.array(
        [
            (x, b * (1 + y * share), begin * x / 2)
            for x in sizes
            for y in _JUMPS
            for begin in MV_STARTS
        ]
    )


def fit_with_map(
    engine: Engine, spec: Spec, theta: dict[str, float], kind: int, point: np.ndarray
) -> Fit:
    """Return the fit with a valve map at a point."""
    a, b, c = (float(x) for x in point)
    if kind == kernels.ZONE:
        return engine.at(replace(spec, valve=kind), {**theta, "D": a, "c": b})
    begin = 2 * (b if kind == kernels.PLAY else c) / a
    if kind == kernels.PLAY:
        numbers = {"S": a}
    else:
        numbers = {"S": a, "J": b}
    return engine.at(replace(spec, valve=kind, start=begin), {**theta, **numbers})


def settle(engine: Engine, fit: Fit, steps: int = 3) -> Fit:
    """Return the fit after a few steps in everything but the valve's numbers."""
    return engine.fit(
        fit.spec, fit.theta, search=tuple(m for m in fit.spec.names if m not in _ROUGH), steps=steps
    )


def narrow(engine: Engine, fit: Fit) -> Fit:
    """Alternate ever finer scans around a valve map's numbers with steps in all others."""
    # The map taken out, so that a scan can try others
    best = fit
    kind = fit.spec.valve
    bare = replace(fit.spec, valve=kernels.IDEAL, start=0.0)
    if kind == kernels.ZONE:
        first = "D"
        second = "c"
    else:
        first = "S"
        second = "J"

    # Ever finer: a scan, then steps in all numbers, while it gains
    for share in (0.06, 0.02, 0.007, 0.002):
        for _ in range(3):
            th = best.theta
            before = best.loglik
            points = around(kind, np.array([th[first], th.get(second, 0.0), 0.0]), share)
            point = points[int(np.argmax(engine.scan(bare, th, kind, points)))]
            best = better(best, fit_with_map(engine, bare, th, kind, point))
            best = better(best, settle(engine, best))
            if best.loglik < before + 2.0:
                break
    return best


def promising(fit: Fit, base: Fit) -> bool:
    """Return whether a search's best point may still beat the base."""
    return fit.loglik > base.loglik - _HOPELESS


def band_sizes(data: Data, count: int) -> np.ndarray:
    """Return widths to try, from next to none, lest a sound valve be none of the family, to beyond
    OP's range.
    """
    span = float(np.quantile(data.u, 0.995) - np.quantile(data.u, 0.005)) or 1.0
    return span * np.concatenate([np.geomspace(0.001, 0.017, TINY), np.geomspace(0.02, 1.2, count)])


def plants(engine: Engine, base: Fit) -> list[dict[str, float]]:
    """Return the plants from which an effect is looked for: the base's, which has bent itself
    around it, and the baseline's.
    """
    d = engine.data
    out = [{"T": base.theta.get("T", 0.0), "Td": base.theta["Td"]}, {"T": d.T, "Td": d.Td}]
    # an identified plant has bent itself around the effect as well
    if d.trusted:
        return out
    return out + [{"T": d.T / n, "Td": d.Td / n} for n in (2, 6)]
