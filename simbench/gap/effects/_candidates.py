"""The candidates of the engine: each effect between OP and PV as a fit on top of what is fitted so far."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec, lag_of, size_penalty
from simbench.gap.likelihood.search import SMOOTH, STARTS, band_sizes, idle, plants, promising, search_map, settle
from simbench.gap.situation import Situation

QUIETER = 4.0  # numbers that a noise below the stated level is priced at


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted effect: its gain (nats) over the base, its own numbers paid for; `used` False when nothing was switched on."""

    effect: str
    fit: Fit
    log_likelihood_gain: float
    used: bool = True


@dataclass(frozen=True, eq=False)
class Fitted:
    """Effects fitted to one record.

    `base` is the fit without effect, `candidates` those with one each, `parameters` the effects' numbers in the units of the
    loop file, `chosen` the effects named (none, one or two, strongest first), `final` the fit with all of them.
    """

    situation: Situation
    base: Fit
    candidates: dict[str, Candidate]
    parameters: dict[str, dict[str, float | str]]
    chosen: list[str]
    final: Fit


def free_plant(effect: str, name: str) -> Callable[[Engine, Fit], tuple[Fit, float]]:
    """Return the fit in which one plant parameter is released."""

    def run(engine: Engine, base: Fit) -> tuple[Fit, float]:
        spec = base.spec.join(Spec(free=frozenset({name})))
        d = engine.data
        if name == "T":
            trials = [d.T * s for s in (0.3, 0.5, 0.7, 1.5, 2.0, 3.0)]
        else:
            trials = [*np.linspace(0.0, d.Td, 5)[:-1], *(d.Td + np.geomspace(0.25, 6.0, 12) * max(d.Td, 0.3 * d.T, 2.0))]
        # the load that hid the mismatch must give way before a trial shows its worth
        few = ("load_time", "load")
        tries = [engine.fit(spec, {**base.theta, name: v}, search=few, steps=2) for v in trials]
        tries.sort(key=lambda f: -f.loglik)
        tries += [engine.fit(spec, {**idle(engine, base), name: t.theta[name]}, search=few, steps=2) for t in tries[:3]]
        tries.sort(key=lambda f: -f.loglik)
        return max((engine.fit(spec, t.theta) for t in (base, *tries[:2])), key=lambda f: f.loglik), 1.0

    return run


def gain_mismatch(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Release K."""
    spec = base.spec.join(Spec(free=frozenset({"K"})))
    quiet = {**base.theta, "load": 0.3 * base.theta["load"]}
    return max((engine.fit(spec, theta) for theta in (base.theta, quiet, idle(engine, base))), key=lambda f: f.loglik), 1.0


def noise(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Release the noise level."""
    spec = base.spec.join(Spec(free=frozenset({"noise"})))
    stated = engine.data.noise
    best = engine.fit(spec, base.theta)
    if stated > 0:
        # where the noise was held down, the load had taken its place: begin anew as well
        fresh = {**base.theta, **engine.start(), "noise": 2.0 * stated}
        tries = [engine.fit(spec, {**base.theta, "noise": 2.0 * stated, "colour": 0.05}), engine.fit(spec, fresh)]
        best = max([best, *tries], key=lambda f: f.loglik)
    # less noise than stated is seldom less noise: something smooths it
    return best, 1.0 if best.theta["noise"] >= stated else QUIETER


def pole(kind: str) -> Callable[[Engine, Fit], tuple[Fit, float]]:
    """Return the fit with one more series pole in the valve, the plant or the sensor."""

    def run(engine: Engine, base: Fit) -> tuple[Fit, float]:
        d = engine.data
        spec = base.spec.join(Spec(pole=kind))
        lags = np.geomspace(0.3, max(1.5 * engine.longest_load, 3.0 * d.T), 10)
        theta = dict(base.theta)
        if kind == "sensor" and d.noise > 0:
            # what the base took for quiet, coloured noise is the filter's work
            theta |= {"noise": d.noise, "colour": 0.0}
        shortest = engine.bounds(spec, "Td")[0]
        # without the pole the base has lengthened Td and T in its stead
        points = [
            {**plant, "tau": float(x), "Td": td}
            for x in lags for plant in plants(engine, base) for td in {plant["Td"], shortest}
        ]  # fmt: skip
        tries = engine.grid(spec, theta, points)
        # a long lag shows its worth only once the load has given way
        own = plants(engine, base)[1]
        tries += [engine.fit(spec, {**theta, **own, "tau": float(x)}, steps=2) for x in lags[4::2]]
        tries.sort(key=lambda f: -f.loglik)
        return max((engine.fit(spec, t.theta) for t in tries[:2]), key=lambda f: f.loglik), 1.0

    return run


def deadband(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan the band finely, then refine it with the nuisances."""
    coarse = np.array([(s, start * s / 2, 0.0) for s in band_sizes(engine.data, 32) for start in STARTS])
    return search_map(engine, base, kernels.PLAY, coarse), 1.0


def deadzone(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan width and centre, then refine."""
    # OP jumps across the zone: its middle is where OP seldom is
    centres = np.linspace(*np.quantile(engine.data.u, [0.01, 0.99]), 13)
    return search_map(
        engine, base, kernels.ZONE, np.array([(s, c, 0.0) for s in band_sizes(engine.data, 12) for c in centres])
    ), 2.0


def valve_characteristic(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Search the ratio of gains on both sides of 1, then refine."""
    spec = base.spec.join(Spec(valve=kernels.CURVE))
    ratios = [{"R": r} for r in (0.02, 0.05, 0.1, 0.25, 0.5, 2.0, 4.0, 10.0, 20.0, 50.0)]
    tries = [engine.grid(spec, theta, ratios)[0] for theta in (base.theta, idle(engine, base))]
    return max((engine.fit(spec, t.theta) for t in tries), key=lambda f: f.loglik), 1.0


def stiction(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan S and J/S finely under two valve models: peaks are a percent or two wide, a local search misses them."""
    sizes = band_sizes(engine.data, 90)
    coarse = np.array([(s, s * j, 0.0) for s in sizes for j in (0.06, 0.15, 0.27, 0.42, 0.6, 0.78, 0.95)])
    tries = [search_map(engine, base, kind, coarse, few=True) for kind in (kernels.STICK, kernels.CREEP)]
    return max(tries, key=lambda f: f.loglik), 2.5


def oscillation(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Find the sharpest peak of the innovations' periodogram, refine its frequency, add the sine."""
    d = engine.data
    n = d.n
    white = np.asarray(base.residual) - np.mean(base.residual)
    power = np.abs(np.fft.rfft(white, 4 * n)) ** 2
    lowest = 12  # three whole periods in the record
    peak = lowest + int(np.argmax(power[lowest:-4]))
    t = np.arange(n)

    def at(bin_: float) -> Spec:
        w = 2 * np.pi * bin_ / (4 * n)
        return base.spec.join(Spec(channels=(np.sin(w * t), np.cos(w * t))))

    best_bin, best_value = float(peak), -np.inf
    for step in (1.0, 0.3):
        for shift in (-2, -1, 0, 1, 2):
            trial = best_bin + shift * step
            value = engine.evaluate(at(trial), base.theta)[0]
            if value > best_value:
                best_value, keep = value, trial
        best_bin = keep
    fit = engine.fit(at(best_bin), {**base.theta, "load": 0.5 * base.theta["load"]}, search=SMOOTH)
    fit.theta["period"] = 4 * n / best_bin
    # the peak was picked out of n/2 others
    return fit, 2.0 + 2.0


def load_drift(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Let the load walk without end beside its ordinary self, with a ramp on top."""
    d = engine.data
    ramp = kernels.plant(np.linspace(0.0, 1.0, d.n), base.theta["T"] if d.T > 0 else 0.0, 0.0, 0.0)
    spec = base.spec.join(Spec(load_walk=True, channels=(ramp,)))
    size = float(np.std(d.y)) if d.T > 0 else float(np.std(np.diff(d.y)))
    best = engine.grid(spec, base.theta, [{"load_walk": size * f / np.sqrt(d.n)} for f in (1e-3, 0.03, 0.3, 1.0)])[0]
    return engine.fit(spec, best.theta), 2.0


def drift(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Let the measurement walk, with a ramp on top."""
    n = engine.data.n
    ramp = np.linspace(0.0, 1.0, n)
    spec = base.spec.join(Spec(walk=True, channels=(ramp,) if engine.data.T > 0 else ()))
    size = float(np.std(engine.data.y)) / np.sqrt(n)
    best = engine.grid(spec, base.theta, [{"walk": size * f} for f in (0.01, 0.1, 0.5, 2.0)])[0]
    return engine.fit(spec, best.theta), 2.0 if engine.data.T > 0 else 1.0


def load_steps(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Add load jumps one by one, where the whitened step response fits the innovations best."""
    d = engine.data
    n = d.n
    fit, count = base, 0
    channels: tuple[np.ndarray, ...] = ()
    times: list[int] = []
    for _ in range(MOST_STEPS):
        response = _step_response(fit, d)
        white = kernels.whiten(
            response[None, :], fit.theta["T"] if d.T > 0 else 0.0, 0.0, fit.theta["load_time"], lag_of(fit.theta),
            fit.theta["load"], 0.0, 0.0, fit.theta["noise"], fit.theta["colour"], engine.spread,
        )[0][0]  # fmt: skip
        residual = np.asarray(fit.residual).copy()
        residual[: kernels.SKIP] = 0.0
        size = 2 * n
        cross = np.fft.irfft(np.fft.rfft(residual, size) * np.conj(np.fft.rfft(white, size)), size)[:n]
        energy = np.cumsum(white**2)[::-1]
        score = cross**2 / np.maximum(energy, 1e-3 * energy[0])
        score[: max(3, int(0.005 * n))] = 0.0
        score[-5:] = 0.0
        k = int(np.argmax(score))
        shape = np.zeros(n)
        shape[k:] = response[: n - k]
        trial = (*channels, shape)
        spec = base.spec.join(Spec(channels=trial))
        better = engine.fit(spec, {**fit.theta, "load": 0.7 * fit.theta["load"]}, search=SMOOTH, steps=8)
        if better.loglik - fit.loglik < size_penalty(n, 1.0) + np.log(n) * 0.5:
            break
        fit, channels, count = better, trial, count + 1
        times.append(k)
    if count == 0:
        return base, 2.0
    fit.theta["steps"] = float(count)
    return fit, 2.0 * count


MOST_STEPS = 12


def _step_response(fit: Fit, d: Data) -> np.ndarray:
    unit = np.ones(d.n)
    unit[0] = 0.0
    g = kernels.plant(unit, fit.theta["T"] if d.T > 0 else 0.0, 0.0, 0.0)
    return np.append(g[1:], g[-1])


ENGINE: dict[str, Callable[[Engine, Fit], tuple[Fit, float]]] = {
    "stiction": stiction,
    "deadband": deadband,
    "deadzone": deadzone,
    "valve_lag": pole("valve"),
    "valve_characteristic": valve_characteristic,
    "gain_mismatch": gain_mismatch,
    "time_constant_mismatch": free_plant("time_constant_mismatch", "T"),
    "dead_time_mismatch": free_plant("dead_time_mismatch", "Td"),
    "extra_lag": pole("extra"),
    "noise": noise,
    "sensor_lag": pole("sensor"),
    "drift": drift,
    "oscillation": oscillation,
    "load_steps": load_steps,
    "load_drift": load_drift,
}


def reshaped(engine: Engine, fit: Fit) -> Fit:
    """Return the fit under the other shape of load (1/f, or first and second order) where that is more likely.

    The base's shape was chosen without the effect, and may have been bent around it.
    """
    kept = {k: v for k, v in fit.theta.items() if k not in fit.spec.names}
    spec = replace(fit.spec, pink=not fit.spec.pink)
    if spec.pink:
        theta = {**fit.theta, "load_time": 0.7 * engine.longest_load}
        theta.pop("load_lag")
    else:
        theta = {**fit.theta, "load_time": 0.3 * fit.theta["load_time"], "load_lag": 0.1 * fit.theta["load_time"]}
    other = engine.fit(spec, theta, search=SMOOTH, steps=6)
    if promising(other, fit):
        other = settle(engine, other, steps=6)
    if other.loglik <= fit.loglik:
        return fit
    other.theta.update(kept)
    return other


def fit_candidates(engine: Engine, base: Fit, effects: list[str]) -> dict[str, Candidate]:
    """Fit each effect on top of a base and return it with its penalised gain in nats."""
    out = {}
    for effect in effects:
        fit, count = ENGINE[effect](engine, base)
        if fit is not base and promising(fit, base):
            fit = reshaped(engine, fit)
        gain = fit.loglik - base.loglik - size_penalty(engine.data.n, count)
        out[effect] = Candidate(effect, fit, gain, fit is not base)
    return out
