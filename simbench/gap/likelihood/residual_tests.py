"""What the best model leaves behind: tests of its innovations, on which the answer "unknown" rests."""

from __future__ import annotations

import numpy as np

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec, size_penalty, valve_of
from simbench.gap.likelihood.valve_map import lagged

WINDOWS = (10.0, 50.0)  # samples over which a spell of loud innovations is felt


def generic_directions(engine: Engine, fit: Fit) -> dict[str, float]:
    """Return nats that generic directions, which no effect of the vocabulary owns, would still bring to a fit.

    `dynamics`: other time scales between MV and PV; `shape`: a bent static curve; `aging`: a gain that changes along the
    record; `level`: a gain that changes with PV; `speed`: a valve that moves otherwise when it moves fast, or one way.
    """
    d = engine.data
    T, Td = (fit.theta["T"] if d.T > 0 else 0.0), fit.theta["Td"]
    v = valve_of(fit.spec, fit.theta, d.u)
    v = v - v.mean()
    size = float(np.std(v)) or 1.0
    pace = T + Td + 1.0
    t = np.linspace(-1.0, 1.0, d.n)
    lags = [lagged(v, pace * s) for s in (0.25, 0.7, 2.0)]
    fast = v - lagged(v, 0.5 * pace)
    slow = lagged(d.y - d.y.mean(), pace) / (float(np.std(d.y)) or 1.0)
    groups = {
        "dynamics": [kernels.plant(x, T, Td, 0.0) for x in lags] + [kernels.plant(v, T, 0.5 * Td, 0.0)],
        "shape": [kernels.plant(size * (v / size) ** 2, T, Td, 0.0), kernels.plant(size * (v / size) ** 3, T, Td, 0.0)],
        "aging": [kernels.plant(v * t, T, Td, 0.0), kernels.plant(v * t**2, T, Td, 0.0)],
        "level": [kernels.plant(v * slow, T, Td, 0.0)],
        "speed": [kernels.plant(np.abs(fast), T, Td, 0.0), kernels.plant(fast * np.abs(fast) / size, T, Td, 0.0)],
    }
    out = {}
    for name, channels in groups.items():
        spec = fit.spec.join(Spec(channels=tuple(channels)))
        gain = engine.evaluate(spec, fit.theta)[0] - fit.loglik
        out[f"{name} nats"] = float(gain - size_penalty(d.n, len(channels)))
    return out


def residual_tests(fit: Fit, data: Data) -> dict[str, float]:
    """Return what is left in the innovations of a fit; each is near 0 (in standard deviations) when the model is whole.

    `memory`: correlation over 25 lags; `input`: correlation with past OP; `bursts`: variance that changes along the record;
    `tails`: kurtosis; `level`: variance against what the model says; `tone`: the highest peak of the spectrum; `jump`: the
    largest step in the mean, both in nats over what chance gives.
    """
    x = np.asarray(fit.residual)[kernels.SKIP :]
    x = np.clip(x, -6.0, 6.0) - np.mean(x)
    n = x.size
    power = float(np.mean(x**2)) or 1.0
    lags = min(25, n // 4)
    rho = np.array([float(np.mean(x[k:] * x[:-k])) / power for k in range(1, lags + 1)])
    du = np.diff(data.u)[kernels.SKIP - 1 :]
    du = (du - du.mean()) / (float(np.std(du)) or 1.0)
    cross = np.array([float(np.mean(x[k:] * du[: n - k])) / np.sqrt(power) for k in range(1, lags + 1)])
    parts = np.array([float(np.mean(p**2)) for p in np.array_split(x, 10)]) / power
    kurtosis = float(np.mean(x**4)) / power**2
    tones = np.abs(np.fft.rfft(x))[3:] ** 2
    k = np.arange(10, n - 10)
    steps = np.cumsum(x)[k] * np.sqrt(n / (k * (n - k)))
    return {
        "memory": float((n * np.sum(rho**2) - lags) / np.sqrt(2 * lags)),
        "input": float((n * np.sum(cross**2) - lags) / np.sqrt(2 * lags)),
        "bursts": float((np.sum((parts - 1) ** 2) * n / 20 - 9) / np.sqrt(18)),
        "tails": float((kurtosis - 3) / np.sqrt(24 / n)),
        "level": float((power - 1) / np.sqrt(2 / n)),
        "tone": float(tones.max() / tones.mean() - np.log(n / 2)),
        "jump": float(0.5 * np.max(steps**2) / power - np.log(n)),
    }


def predictable(fit: Fit, d: Data, sp: np.ndarray) -> dict[str, float]:
    """Return nats by which plain regressions predict the innovations of a fit, or their size, from the recorded past.

    An innovation of a whole model cannot be predicted by anything. Each group of regressors stands for a kind of physics that
    the vocabulary lacks: `stroke` a valve that moves otherwise in one direction, `curve` a bent static curve, `height` a plant
    that changes with PV, `time` one that ages, `mixed` a gain that depends on the state, `set point` a controller or filter
    that treats SP in its own way; `loud ...` a noise whose size goes with movement, level, time, or comes in spells.

    Parameters
    ----------
    fit : Fit
    d : Data
    sp : ndarray, shape (n,)
        Set point (PV units).

    Returns
    -------
    dict of str to float
        Gain of log-likelihood of each regression less half a nat per regressor, which is what chance gives.
    """
    r = np.clip(np.asarray(fit.residual), -6.0, 6.0)
    n = d.n
    u, y, move = _standard(d.u), _standard(d.y), _standard(np.diff(d.u, prepend=d.u[0]))
    sp = _standard(np.diff(sp, prepend=sp[0]))
    t = np.linspace(-1.0, 1.0, n)
    reach = sorted({1, 2, 1 + round(d.Td), 1 + round(d.Td + 0.5 * (d.T or d.Td))})
    last = {name: np.roll(x, 1) for name, x in (("r", r), ("u", u), ("y", y), ("move", move))}
    far = np.roll(u, reach[-1])
    size = np.log(r**2 + 0.05)
    mean = {
        "stroke": [np.roll(f(move), k) for k in reach for f in (np.sign, np.abs)],
        "curve": [np.roll(u**p, k) for k in reach for p in (2, 3)],
        "height": [last["y"] ** 2, last["y"] ** 3, last["y"] * last["u"], last["y"] * far],
        "time": [t, t**2, t * far, t * np.roll(move, reach[-1])],
        "mixed": [last["r"] * x for x in (last["u"], last["y"], np.abs(last["move"]), np.roll(last["r"], 1))],
        "set point": [np.roll(sp, k) for k in (0, 1, 2, 4, 8)],
    }
    spread = {
        "loud when moving": [lagged(np.abs(move), 5.0), np.abs(last["move"])],
        "loud by level": [last["y"], last["y"] ** 2, last["u"], last["u"] ** 2],
        "loud in time": [t, t**2, *(f(k * np.pi * t) for k in (1, 2, 3) for f in (np.sin, np.cos))],
        "loud in spells": [np.roll(lagged(r**2, w), 1) for w in WINDOWS],
    }
    rows = slice(max(20, reach[-1] + 1), n)
    out = {name: _regressed(r[rows], [x[rows] for x in regressors]) for name, regressors in mean.items()}
    return out | {name: _regressed(size[rows], [x[rows] for x in regressors]) for name, regressors in spread.items()}


def _standard(x: np.ndarray) -> np.ndarray:
    return (x - x.mean()) / (float(np.std(x)) or 1.0)


def _regressed(target: np.ndarray, regressors: list[np.ndarray]) -> float:
    """Return the gain of log-likelihood of a regression with intercept, less what chance gives."""
    X = np.column_stack(regressors)
    X = X - X.mean(axis=0)
    z = target - target.mean()
    A, b = X.T @ X, X.T @ z
    A.flat[:: len(A) + 1] += 1e-9 * float(np.trace(A)) + 1e-12
    whole = float(z @ z) or 1.0
    left = max(whole - float(b @ np.linalg.solve(A, b)), 1e-9 * whole)
    return 0.5 * z.size * float(np.log(whole / left)) - 0.5 * len(regressors)
