"""The candidates of the engine: each effect between OP and PV as a fit on top of what is fitted so far."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from simbench.gap import innovations as kernels
from simbench.gap.fit import Data, Engine, Fit, Spec, lag_of, with_start

SMOOTH = ("load_time", "load_lag", "load", "noise", "colour")  # searched beside a valve
ROUGH = ("S", "J", "D", "c")  # in which the likelihood has corners
QUIETER = 4.0  # numbers that a noise below the stated level is priced at
HOPELESS = 4.0  # nats below the base from which a grid's best point is not worth refining


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fitted effect: `gain` in nats over the base, its own numbers paid for; `used` False when nothing was switched on."""

    effect: str
    fit: Fit
    gain: float
    used: bool = True


def size_penalty(n: int, count: float) -> float:
    """Return the price of `count` fitted numbers (Schwarz 1978)."""
    return 0.5 * count * np.log(n)


def free_plant(effect: str, name: str) -> Callable[[Engine, Fit], tuple[Fit, float]]:
    """Return the fit in which one plant parameter is released."""

    def run(engine: Engine, base: Fit) -> tuple[Fit, float]:
        spec = base.spec.join(Spec(free=frozenset({name})))
        best = engine.fit(spec, base.theta)
        d = engine.data
        if name == "T":
            trials = [d.T * s for s in (0.3, 0.5, 0.7, 1.5, 2.0, 3.0)]
        elif name == "Td":
            trials = [*np.linspace(0.0, d.Td, 5)[:-1], *(d.Td + np.linspace(0.25, 3.0, 12) * max(d.Td, 0.3 * d.T, 2.0))]
        else:
            return best, 1.0
        start = max(trials, key=lambda v: engine.evaluate(spec, {**base.theta, name: v})[0])
        return max(best, engine.fit(spec, {**base.theta, name: start}), key=lambda f: f.loglik), 1.0

    return run


def gain_mismatch(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Release K."""
    return engine.fit(base.spec.join(Spec(free=frozenset({"K"}))), base.theta), 1.0


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
        spec = base.spec.join(Spec(pole=kind))
        scale = engine.data.T or 3.0 * engine.data.Td + 3.0
        lags = np.geomspace(0.3, 2.0 * scale, 8)
        theta = dict(base.theta)
        if kind == "sensor" and engine.data.noise > 0:
            # what the base took for quiet, coloured noise is the filter's work
            theta |= {"noise": engine.data.noise, "colour": 0.0}
        best = engine.grid(spec, theta, [{"lag": float(x)} for x in lags])
        # the filter trades places with the noise's colour, which a grid over it alone does not see
        go = kind == "sensor" or promising(best, base)
        return (engine.fit(spec, best.theta) if go else best), 1.0

    return run


def deadband(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan the band finely, then refine it alone and with the nuisances."""
    spec = base.spec.join(Spec(valve=kernels.PLAY))
    sizes = np.geomspace(band_sizes(engine.data)[0], band_sizes(engine.data)[-1], 40)
    points = np.array([(s, start * s / 2, 0.0) for s in sizes for start in (-1.0, 0.0, 1.0)])
    fits = []
    for level in (1.0, 0.35):
        theta = {**base.theta, "load": base.theta["load"] * level}
        S, offset, _ = points[int(np.argmax(engine.scan(base.spec, theta, kernels.PLAY, points)))]
        fits.append(engine.at(replace(spec, start=float(np.sign(offset))), {**theta, "S": float(S)}))
    best = max(fits, key=lambda f: f.loglik)
    return (refine(engine, best, ("S",)) if promising(best, base) else best), 1.0


def deadzone(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Search width and centre on a grid, then refine."""
    spec = base.spec.join(Spec(valve=kernels.ZONE))
    u = engine.data.u
    # OP jumps across the zone: its middle is where OP seldom is
    centres = np.linspace(*np.quantile(u, [0.03, 0.97]), 7)
    points = [{"D": s, "c": float(c)} for s in band_sizes(engine.data)[3:] for c in centres]
    best = engine.grid(spec, base.theta, points)
    return (refine(engine, best, ("D", "c", "D")) if promising(best, base) else best), 2.0


def valve_characteristic(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Search the ratio of gains on both sides of 1, then refine."""
    spec = base.spec.join(Spec(valve=kernels.CURVE))
    best = engine.grid(spec, base.theta, [{"R": r} for r in (0.03, 0.1, 0.25, 0.5, 2.0, 4.0, 10.0, 30.0)])
    return engine.fit(spec, best.theta), 1.0


def stiction(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Scan S and J/S finely under two valve models and refine the best peaks: they are narrow, a local search misses them."""
    fits = []
    for model in (kernels.STICK, kernels.CREEP):
        spec = base.spec.join(Spec(valve=model))
        for theta, start in peaks(engine, base, model):
            fits.append(engine.at(replace(spec, start=start), theta))
    fits.sort(key=lambda f: -f.loglik)
    if engine.data.trusted and not promising(fits[0], base):
        return fits[0], 2.5
    best = [refine(engine, f, ("S", "J")) for f in fits[: 2 if engine.data.trusted else 4]]
    return max(best, key=lambda f: f.loglik), 2.5


def peaks(engine: Engine, base: Fit, model: int) -> list[tuple[dict[str, float], float]]:
    """Return the best points (parameters, start in the band) of a fine scan, at the base's load and at a fraction of it."""
    span = float(np.quantile(engine.data.u, 0.995) - np.quantile(engine.data.u, 0.005)) or 1.0
    sizes = np.geomspace(max(0.03 * span, 0.05), max(1.3 * span, 0.1), 36)
    shares = np.array([0.05, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0])
    coarse = np.array([(s, s * j, 0.0) for s in sizes for j in shares])
    found = []
    plants: list[dict[str, float]] = [{}]
    if not engine.data.trusted:
        # a free plant without friction has bent itself around it
        plants += [{"T": engine.data.T, "Td": engine.data.Td}, {"T": engine.data.T / 2, "Td": engine.data.Td / 2}]
    for level, plant in product((1.0, 0.35), plants):
        theta = {**base.theta, **plant, "load": base.theta["load"] * level}
        S, J, _ = coarse[int(np.argmax(engine.scan(base.spec, theta, model, coarse)))]
        for share in (0.06, 0.02):
            near = np.array([
                (S * (1 + a * share), J * (1 + 2 * b * share), S * start / 2)
                for a in (-1.0, -0.5, 0.0, 0.5, 1.0) for b in (-1.0, 0.0, 1.0) for start in (-1.0, 0.0, 1.0)
            ])  # fmt: skip
            S, J, offset = near[int(np.argmax(engine.scan(base.spec, theta, model, near)))]
        found.append(({**theta, "S": float(S), "J": float(J)}, float(np.sign(offset))))
    return found


def promising(fit: Fit, base: Fit) -> bool:
    """Return whether a grid's best point may still beat the base."""
    return fit.loglik > base.loglik - HOPELESS


def band_sizes(data: Data) -> list[float]:
    """Return widths to try, from below OP's jitter to its range."""
    span = float(np.quantile(data.u, 0.995) - np.quantile(data.u, 0.005)) or 1.0
    low = max(0.02 * span, 0.05)
    return [float(x) for x in np.geomspace(low, max(1.2 * span, 2 * low), 12)]


def refine(engine: Engine, fit: Fit, rough: tuple[str, ...]) -> Fit:
    """Alternate smooth fits with line searches where the likelihood is rough; try other starts in the band."""
    best = engine.fit(fit.spec, fit.theta, search=SMOOTH)
    for name in rough:
        x = best.theta[name]
        wide = max(0.06 * best.theta.get("S", best.theta.get("D", 1.0)), 0.02)
        best = engine.line(best, name, x - wide if name == "c" else max(x - wide, 0.0), x + wide)
    if best.spec.valve in (kernels.PLAY, kernels.STICK, kernels.CREEP):
        for begin in (-1.0, 0.0, 1.0):
            best = max(best, engine.at(with_start(best, begin), best.theta), key=lambda f: f.loglik)
    smooth = tuple(m for m in best.spec.names if m not in ROUGH)
    better = engine.fit(best.spec, best.theta, search=smooth)
    best = better if better.loglik > best.loglik else best
    for name in rough[:2]:
        x = best.theta[name]
        wide = max(0.03 * best.theta.get("S", best.theta.get("D", 1.0)), 0.01)
        best = engine.line(best, name, x - wide if name == "c" else max(x - wide, 0.0), x + wide)
    return best


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
    best = engine.grid(spec, base.theta, [{"load_walk": size * f / np.sqrt(d.n)} for f in (1e-3, 0.03, 0.3, 1.0)])
    return engine.fit(spec, best.theta), 2.0


def drift(engine: Engine, base: Fit) -> tuple[Fit, float]:
    """Let the measurement walk, with a ramp on top."""
    n = engine.data.n
    ramp = np.linspace(0.0, 1.0, n)
    spec = base.spec.join(Spec(walk=True, channels=(ramp,) if engine.data.T > 0 else ()))
    size = float(np.std(engine.data.y)) / np.sqrt(n)
    best = engine.grid(spec, base.theta, [{"walk": size * f} for f in (0.01, 0.1, 0.5, 2.0)])
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
LOAD_FIRST = 3  # linear coefficients before the effect's own: gain, bias or ramp, onset


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
    if other.loglik > fit.loglik - HOPELESS:
        other = engine.fit(spec, other.theta, search=tuple(m for m in spec.names if m not in ROUGH), steps=6)
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
