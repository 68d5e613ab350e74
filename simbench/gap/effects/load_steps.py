"""Load steps recognised: one jump after the other, each where it explains the innovations best."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from simbench.gap.effects._draw import Size, Yardstick, between
from simbench.gap.effects._recogniser import Parameters, Recogniser, clip
from simbench.gap.effects._slow import LINEAR, slow
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec, lag_of, size_penalty
from simbench.gap.likelihood.search import SMOOTH
from simbench.gap.situation import Situation

MOST = 12
PLAIN = 40.0  # nats below which a load that wanders at will may have made the jumps
BESIDE = 0.25  # share of the load that must be left beside the jumps: a load that only jumps is an ordinary one


def fit(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Add load jumps one by one, where the whitened step response fits the innovations best."""
    n = engine.data.n
    fit, count, settled = base, 0, True
    channels: tuple[np.ndarray, ...] = ()
    while count < MOST:
        response = _step_response(fit, engine.data)
        k = _where(engine, fit, response)
        shape = np.zeros(n)
        shape[k:] = response[: n - k]
        trial = (*channels, shape)
        spec = base.spec.join(Spec(channels=trial))
        better = engine.fit(spec, {**fit.theta, "load": 0.7 * fit.theta["load"]}, search=SMOOTH, steps=8)
        # the place was picked out of many
        if better.loglik - fit.loglik >= size_penalty(n, 1.0) + np.log(n) * 0.5:
            fit, channels, count, settled = better, trial, count + 1, False
        elif settled:
            break
        else:
            # the base had bent its plant around the jumps
            fit, settled = engine.fit(fit.spec, fit.theta, steps=8), True
    if count == 0:
        return base, 2.0
    if not settled:
        fit = engine.fit(fit.spec, fit.theta, steps=8)
    fit.theta["steps"] = float(count)
    return fit, 2.0 * count


def _where(engine: Engine, fit: Fit, response: np.ndarray) -> int:
    """Return the sample at which a jump of the load explains the innovations best."""
    d, th, n = engine.data, fit.theta, engine.data.n
    white = kernels.whiten(
        response[None, :], th["T"] if d.T > 0 else 0.0, 0.0, th["load_time"], lag_of(th), th["load"], 0.0, 0.0,
        th["noise_std"], th["colour"], engine.spread,
    )[0][0]  # fmt: skip
    residual = np.asarray(fit.residual).copy()
    residual[: kernels.SKIP] = 0.0
    size = 2 * n
    cross = np.fft.irfft(np.fft.rfft(residual, size) * np.conj(np.fft.rfft(white, size)), size)[:n]
    energy = np.cumsum(white**2)[::-1]
    score = cross**2 / np.maximum(energy, 1e-3 * energy[0])
    score[: max(3, int(0.005 * n))] = 0.0
    score[-5:] = 0.0
    return int(np.argmax(score))


def _step_response(fit: Fit, d: Data) -> np.ndarray:
    unit = np.ones(d.n)
    unit[0] = 0.0
    g = kernels.plant(unit, fit.theta["T"] if d.T > 0 else 0.0, 0.0, 0.0)
    return np.append(g[1:], g[-1])


def numbers(fit: Fit, s: Situation) -> Parameters:
    """Return jumps per second and the std of the levels between them (%)."""
    count = int(fit.theta["steps"])
    heights = fit.beta[LINEAR:][-count:] / fit.K
    times = [int(np.argmax(c != 0.0)) for c in fit.spec.channels[-count:]]
    levels = np.concatenate([[0.0], np.cumsum(heights[np.argsort(times)])])
    size = float(np.std(levels)) * np.sqrt(levels.size / max(levels.size - 1, 1))
    return {"rate": float(fit.theta["steps"]) / (s.data.n * s.record.Ts), "size": clip(size, 0.0, 100.0)}


def ordinary(fit: Fit, base: Fit, gain: float) -> bool:
    """Return whether the jumps may be all that the loop's ordinary load does: many, small, or with nothing beside them."""
    count = int(fit.theta["steps"])
    alone = fit.theta["load"] < BESIDE * base.theta["load"]
    small = float(np.std(fit.beta[LINEAR:][-count:])) < fit.theta["load"]
    return gain < PLAIN or count >= MOST or alone or small


def traits(p: Mapping, plant: Mapping, noise: float) -> dict[str, bool]:
    """Return whether a jump moves PV by less than the noise."""
    known = plant.get("T") is not None and "size" in p
    return {"slow": abs(float(plant["K"])) * abs(float(p["size"])) < noise} if known else {}


def draw(y: Yardstick, rng: np.random.Generator) -> Size:
    """Draw how many."""
    rate = float(rng.uniform(4, 25)) / y.seconds
    return lambda x: {"rate": rate, "size": min(between(x, 0.2, 10.0) * y.op, 20.0)}


RECOGNISER = Recogniser(
    fit=fit,
    numbers=numbers,
    ordinary=ordinary,
    bends_plant=True,
    leaves_traces=True,
    alike={"slow": slow},
    traits=traits,
    draw=draw,
)
