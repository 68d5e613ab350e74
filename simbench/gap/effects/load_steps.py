"""Recognise load steps: place each step where it explains the one-step prediction errors best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.fft import next_fast_len
from scipy.special import gammaln

from simbench.gap.effects._recogniser import Parameters, Recogniser, clip
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec, input_gain, size_penalty
from simbench.gap.likelihood.search import SMOOTH
from simbench.gap.situation import Situation
from simbench.gap.thresholds import LARGER

_AT_ONCE = 16  # number of jumps looked for before the load's other numbers are fitted again
_APART = 5  # samples between jumps: two that are closer, there and back, are one wild reading
_NATS_OF_A_JUMP = 1.0  # nats beyond their price, for which jumps are added
_LEFT = 0.7  # share of the load that the search with jumps begins from


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Let the load jump wherever that explains the innovations well; the heights have one std.

    Where jumps explain more that fade as the load does, they are kicks of the load, and no steps.
    """
    n = engine.data.n
    best = _add_jumps(engine, base)
    if best is not base:
        kicks = engine.fit(replace(best.spec, fade=True), best.theta, steps=8)
        best = max(best, kicks, key=lambda f: f.loglik)
    # their std is one more number
    return best, _price_of_jumps(best, n) / size_penalty(n, 1.0) + 1.0


def _price_of_jumps(fit: Fit, n: int) -> float:
    """Return the nats that its jumps must bring: in so many ways they could have been placed; no
    height is fitted.
    """
    m = len(fit.spec.jumps)
    return float(gammaln(n + 1) - gammaln(m + 1) - gammaln(n - m + 1))


def _add_jumps(engine: Engine, base: Fit) -> Fit:
    """Return the fit with jumps added as long as they are worth their price."""
    # Rounds of several places, as long as one is worth its price
    n = engine.data.n
    best = base
    while True:
        places, height = _find_jumps(engine, best)
        better = best
        while places and better is best:
            trial = base.spec.join(Spec(jumps=best.spec.jumps + tuple(places)))
            start = {"load_jump": height, **best.theta, "load": _LEFT * best.theta["load"]}
            # the base had bent its plant around the jumps
            one = _prune_jumps(
                engine,
                engine.fit(trial, engine.fit(trial, start, search=SMOOTH, steps=8).theta, steps=4),
            )
            if (
                one.loglik - best.loglik
                >= _price_of_jumps(one, n) - _price_of_jumps(best, n) + _NATS_OF_A_JUMP
            ):
                better = one
            # of those detected together some may have been the same
            places = places[: len(places) // 2]
        if better is best:
            return best
        best = better


def _prune_jumps(engine: Engine, fit: Fit) -> Fit:
    """Return the fit without jumps that are not worth their own price, once the others are
    there.
    """
    jumps = fit.spec.jumps
    n = engine.data.n
    without = [replace(fit.spec, jumps=tuple(j for j in jumps if j != k)) for k in jumps]
    worth = [fit.loglik - engine.evaluate(spec, fit.theta) for spec in without]
    price = float(np.log((n - len(jumps) + 1) / len(jumps)))
    kept = tuple(k for k, nats in zip(jumps, worth) if nats >= price)
    if not kept or kept == jumps:
        return fit
    return engine.fit(replace(fit.spec, jumps=kept), fit.theta, steps=4)


def _find_jumps(engine: Engine, fit: Fit) -> tuple[list[int], float]:
    """Return samples at which a jump of the load explains the innovations, the clearest first, and
    the std of their heights.
    """
    # What PV does after a unit step of the load, whitened as the residual is
    d = engine.data
    th = fit.theta
    n = engine.data.n
    unit = np.ones(d.n)
    unit[0] = 0.0
    g = kernels.plant(unit, th["T"] if d.T > 0 else 0.0, 0.0, 0.0)
    response = np.append(g[1:], g[-1])
    model = engine.noise_model(Spec(), th)
    white = kernels.whiten(response[None, :], model, kernels.NO_JUMPS)[0][0]

    # The residual, and the energy that is left of a step at each place
    residual = np.asarray(fit.residual).copy()
    residual[: kernels.SKIP] = 0.0
    energy = np.cumsum(white**2)[::-1]
    energy = np.maximum(energy, 1e-3 * energy[0])

    # The correlation of both, by the Fourier transform
    size = next_fast_len(2 * n, real=True)
    edge = max(3, int(0.005 * n))
    conjugate = np.conj(np.fft.rfft(white, size))

    # One place after the other: the best, away from the ends and from those taken
    places: list[int] = []
    heights: list[float] = []
    taken = np.zeros(n, dtype=bool)
    taken[list(fit.spec.jumps)] = True
    for _ in range(_AT_ONCE):
        cross = np.fft.irfft(np.fft.rfft(residual, size) * conjugate, size)[:n]
        score = 0.5 * cross**2 / energy
        score[:edge] = 0.0
        score[-5:] = 0.0
        score[np.convolve(taken, np.ones(2 * _APART + 1), "same") > 0.5] = 0.0

        # Its height is taken off the residual before the next is looked for
        k = int(np.argmax(score))
        taken[k] = True
        height = float(cross[k] / energy[k])
        residual[k:] -= height * white[: n - k]
        places.append(k)
        heights.append(height)
    return places, float(np.sqrt(np.mean(np.square(heights)))) if heights else 0.0


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return jumps per second and the std of the levels between them (%)."""
    # a jump is two parts, and between independent levels it spreads by the square root of two more
    # than they
    size = fit.theta["load_jump"] / abs(input_gain(fit, s.data))
    return {"rate": len(fit.spec.jumps) / (s.data.n * s.record.Ts), "size": clip(size, 0.0, 100.0)}


def ordinary(fit: Fit, s: Situation) -> bool:
    """Return whether jumps go no further than healthy records show, or are a single one or fade
    beside such records; the load of an identified loop is its own.
    """
    data = s.data
    most = LARGER * data.loads.get("steps", 0.0)
    petty = fit.theta["load_jump"] < most * abs(input_gain(fit, data))
    known = data.measured and (petty or len(fit.spec.jumps) == 1 or fit.spec.fade)
    return known or not s.trusted


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    ordinary=ordinary,
)
