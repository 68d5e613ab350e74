"""Which effect: all candidates scored on one record, block by block, and the residual tests that lead to "unknown"."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from simbench.gap import innovations as kernels
from simbench.gap.candidates import ENGINE, Candidate, fit_candidates, size_penalty
from simbench.gap.check import Situation
from simbench.gap.fit import Engine, Fit, Spec
from simbench.gap.fixed import effect_parameters
from simbench.gap.names import EFFECTS, block_of

SURE = 200.0  # nats that stand for evidence needing no statistics
SECOND = 12.0  # nats a second effect must bring on top of the first
LOAD_MEMORY = 0.1  # longest correlation time of an ordinary load, as a share of the record


@dataclass(frozen=True, eq=False)
class Assessment:
    """Scores of one record.

    `gains` are nats over "no effect" for every effect that could be tried; `candidates` the engine's fits; `base` the fit without effect;
    `chosen` the effects named (none, one or two, strongest first) before `none` and `unknown` are weighed; `final` the fit with all
    engine effects among them; `tests` the residual statistics of `final` and `base`.
    """

    situation: Situation
    base: Fit
    candidates: dict[str, Candidate]
    gains: dict[str, float]
    parameters: dict[str, dict[str, float | str]]
    chosen: list[str]
    final: Fit
    tests: dict[str, float] = field(default_factory=dict)
    second_gains: dict[str, float] = field(default_factory=dict)


def assess(situation: Situation) -> Assessment:
    """Fit and score every effect.

    Parameters
    ----------
    situation : Situation

    Returns
    -------
    Assessment
    """
    engine = Engine(situation.data, max(LOAD_MEMORY * situation.data.n, 20.0))
    base = engine.fit(Spec(), engine.start(), steps=60)
    candidates = fit_candidates(engine, base, possible_effects(situation))
    gains = {e: float(c.gain) for e, c in candidates.items()}
    parameters: dict[str, dict[str, float | str]] = {e: effect_parameters(e, c.fit, situation) for e, c in candidates.items() if c.used}
    for effect in EFFECTS:
        gains.setdefault(effect, -10.0)
    for effect, p in situation.hard.items():
        gains[effect] = SURE
        parameters[effect] = p
    if situation.record.mv is not None:
        _valve_by_mv(situation, gains, parameters)
    if "quantisation" in situation.hard or "compression" in situation.hard:
        gains["noise"] = min(gains["noise"], 0.0)
    chosen = [e for e in sorted(situation.hard, key=lambda e: -gains[e])][:2]
    free = [e for e in gains if e in candidates and block_of(e) not in {block_of(c) for c in chosen}]
    best = max(free, key=lambda e: gains[e], default=None)
    final, second_gains = base, {}
    if best is not None and gains[best] > (0.0 if not chosen else SECOND):
        final = candidates[best].fit
        if len(chosen) < 2:
            chosen.append(best)
        if len(chosen) < 2:
            others = [e for e in free if block_of(e) != block_of(best) and gains[e] > -5.0]
            second = fit_candidates(engine, final, others)
            second_gains = {e: float(c.gain) for e, c in second.items()}
            runner = max(second_gains, key=lambda e: second_gains[e], default=None)
            if runner is not None and second_gains[runner] > SECOND:
                chosen.append(runner)
                final = second[runner].fit
                parameters[runner] = effect_parameters(runner, final, situation)
    tests = residual_tests(final, situation)
    return Assessment(situation, base, candidates, gains, parameters, chosen, final, tests, second_gains)


def possible_effects(situation: Situation) -> list[str]:
    """Return the engine effects that make sense for this baseline and these signals."""
    skip = set()
    if situation.integrating:
        skip.add("time_constant_mismatch")
    if situation.record.mv is not None:
        skip |= {e for e in ENGINE if block_of(e) == "valve"}
    if situation.baseline.valve.name != "ideal":
        skip.add("stiction")
    return [e for e in ENGINE if e not in skip]


def _valve_by_mv(situation: Situation, gains: dict[str, float], parameters: dict[str, dict[str, float | str]]) -> None:
    """Score the valve's effects by MV given OP alone."""
    for effect, (gain, p) in valve_against_mv(situation.op, np.asarray(situation.record.mv), situation.record.Ts).items():
        gains[effect] = gain
        if p:
            parameters[effect] = p


def valve_against_mv(op: np.ndarray, mv: np.ndarray, Ts: float) -> dict[str, tuple[float, dict[str, float | str]]]:
    """Return nats over an ideal valve, and parameters, of each valve effect as a map from OP to MV.

    Parameters
    ----------
    op, mv : ndarray, shape (n,)
        In %.
    Ts : float
        Sampling period (s).

    Returns
    -------
    dict of str to (float, dict)
    """
    n = op.size
    span = float(np.ptp(op)) or 1.0
    fine = (1e-3 * span) ** 2  # below a thousandth of the range nobody's valve is known

    def level(v: np.ndarray) -> float:
        return 0.5 * n * np.log(float(np.mean((mv - v) ** 2)) + fine)

    ideal = level(np.clip(op, 0.0, 100.0))
    sizes = np.geomspace(0.02 * span, 1.5 * span, 40)
    out: dict[str, tuple[float, dict[str, float | str]]] = {}

    def best(trials: list[tuple[float, dict[str, float | str]]], count: float) -> tuple[float, dict[str, float | str]]:
        value, p = min(trials, key=lambda t: t[0])
        return float(np.clip(ideal - value - size_penalty(n, count), -20.0, SURE)), p

    def maps(kind: int, p0: float, p1: float) -> np.ndarray:
        first = mv[0] - op[0] if kind in (kernels.PLAY, kernels.STICK, kernels.CREEP) else 0.0
        if kind == kernels.PLAY:
            return kernels.valve(op, kind, p0, first, 0.0)
        return kernels.valve(op, kind, p0, p1, first)

    def zoom(kind: int, names: tuple[str, str], grid: list[tuple[float, float]], count: float) -> tuple[float, dict[str, float | str]]:
        trials = [(level(maps(kind, a, b)), a, b) for a, b in grid]
        for share in (0.3, 0.1, 0.03, 0.01):
            _, a, b = min(trials)
            near = [(a * (1 + i * share / 2), b * (1 + j * share / 2)) for i in (-2, -1, 0, 1, 2) for j in ((-2, -1, 0, 1, 2) if b else (0,))]
            trials = [(level(maps(kind, x, y)), x, y) for x, y in near]
        value, a, b = min(trials)
        p: dict[str, float | str] = {names[0]: float(a)}
        if names[1]:
            p[names[1]] = float(b)
        return best([(value, p)], count)

    grid = [(s, s * j) for s in sizes for j in (0.05, 0.15, 0.3, 0.5, 0.7, 1.0)]
    stick = max(
        (zoom(k, ("S", "J"), grid, 2.0) for k in (kernels.STICK, kernels.CREEP)), key=lambda t: t[0]
    )
    out["stiction"] = stick
    out["deadband"] = zoom(kernels.PLAY, ("S", ""), [(s, 0.0) for s in sizes], 1.0)
    out["deadzone"] = zoom(kernels.ZONE, ("D", "c"), [(s, c) for s in sizes for c in np.quantile(op, np.linspace(0.05, 0.95, 13))], 2.0)
    out["valve_characteristic"] = zoom(kernels.CURVE, ("R", ""), [(r, 0.0) for r in (*np.geomspace(0.01, 0.8, 12), *np.geomspace(1.25, 100, 12))], 1.0)
    lags = [(level(_lagged(op, tau)), {"tau": float(tau * Ts)}) for tau in np.geomspace(0.2, n / 10, 120)]
    out["valve_lag"] = best(lags, 1.0)
    return out


def _lagged(op: np.ndarray, tau: float) -> np.ndarray:
    from scipy.signal import lfilter

    a = np.exp(-1.0 / tau)
    return op[0] + lfilter([1.0 - a], [1.0, -a], op - op[0])


def residual_tests(fit: Fit, situation: Situation) -> dict[str, float]:
    """Return what is left in the innovations of a fit; each is near 0 (in standard deviations) when the model is whole.

    `memory`: correlation over 25 lags; `input`: correlation with past OP; `bursts`: variance that changes along the record; `tails`:
    kurtosis; `level`: variance against what the model says.
    """
    x = np.asarray(fit.residual)[kernels.SKIP :]
    x = np.clip(x, -6.0, 6.0) - np.mean(x)
    n = x.size
    power = float(np.mean(x**2)) or 1.0
    lags = min(25, n // 4)
    rho = np.array([float(np.mean(x[k:] * x[:-k])) / power for k in range(1, lags + 1)])
    du = np.diff(situation.data.u)[kernels.SKIP - 1 :]
    du = (du - du.mean()) / (float(np.std(du)) or 1.0)
    cross = np.array([float(np.mean(x[k:] * du[: n - k])) / np.sqrt(power) for k in range(1, lags + 1)])
    parts = np.array([float(np.mean(p**2)) for p in np.array_split(x, 10)]) / power
    kurtosis = float(np.mean(x**4)) / power**2
    return {
        "memory": float((n * np.sum(rho**2) - lags) / np.sqrt(2 * lags)),
        "input": float((n * np.sum(cross**2) - lags) / np.sqrt(2 * lags)),
        "bursts": float((np.sum((parts - 1) ** 2) * n / 20 - 9) / np.sqrt(18)),
        "tails": float((kurtosis - 3) / np.sqrt(24 / n)),
        "level": float((power - 1) / np.sqrt(2 / n)),
    }
