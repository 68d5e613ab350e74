"""An effect's numbers in the units of the loop file, from its fit."""

from __future__ import annotations

import numpy as np

from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation

LOAD_FIRST = 3  # linear coefficients before the effect's own: gain, bias or ramp, onset


def effect_parameters(effect: str, fit: Fit, situation: Situation) -> dict[str, float | str]:
    """Return an engine effect's numbers in the units of the loop file.

    Parameters
    ----------
    effect : str
        One that the fit has switched on.
    fit : Fit
    situation : Situation

    Returns
    -------
    dict
    """
    d, th, Ts = situation.data, fit.theta, situation.record.Ts
    n = d.n
    if effect == "gain_mismatch":
        return {"factor": _clip(fit.K / d.K, 0.05, 20.0)}
    if effect == "time_constant_mismatch":
        return {"factor": _clip(th["T"] / d.T, 0.05, 20.0)}
    if effect == "dead_time_mismatch":
        return {"extra": (th["Td"] - d.Td) * Ts}
    if effect in ("valve_lag", "extra_lag", "sensor_lag"):
        return {"tau": th["tau"] * Ts}
    if effect == "noise":
        return {"factor": th["noise"] / d.noise} if d.noise > 0 else {"std": th["noise"]}
    if effect == "deadband":
        return {"S": _clip(th["S"], 0.0, 100.0)}
    if effect == "stiction":
        return {"S": _clip(th["S"], 0.0, 100.0), "J": _clip(th["J"], 0.0, 100.0)}
    if effect == "deadzone":
        return {"D": _clip(th["D"], 0.0, 100.0), "c": _clip(th["c"], 0.0, 100.0)}
    if effect == "valve_characteristic":
        return {"R": _clip(th["R"], 0.01, 100.0)}
    linear = fit.beta[LOAD_FIRST:]
    if effect == "drift":
        rate = linear[-1] / (n * Ts) if d.T > 0 else 0.0
        return {"rate": float(rate), "walk": float(th["walk"] / np.sqrt(Ts))}
    gain = abs(fit.K)
    if effect == "load_drift":
        return {"rate": float(linear[-1] / fit.K / (n * Ts)), "walk": float(th["load_walk"] / gain / np.sqrt(Ts))}
    if effect == "load_steps":
        count = int(th["steps"])
        times = [int(np.argmax(c != 0.0)) for c in fit.spec.channels[-count:]]
        levels = np.concatenate([[0.0], np.cumsum((linear[-count:] / fit.K)[np.argsort(times)])])
        size = float(np.std(levels)) * np.sqrt(levels.size / max(levels.size - 1, 1))
        return {"rate": float(th["steps"]) / (n * Ts), "size": _clip(size, 0.0, 100.0)}
    w = 2 * np.pi / th["period"]
    pole = abs(1.0 / (1j * w * th.get("T", 1.0) + 1.0)) if d.T > 0 else 1.0 / w
    return {"amplitude": _clip(float(np.hypot(*linear[-2:])) / (gain * pole), 0.0, 100.0), "period": th["period"] * Ts}


def _clip(x: float, low: float, high: float) -> float:
    return float(min(max(x, low), high))
