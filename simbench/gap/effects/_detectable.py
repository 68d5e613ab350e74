"""The smallest effect this record could have shown: "nothing found" is worth only that."""

from __future__ import annotations

import numpy as np

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, Spec
from simbench.gap.situation import Situation

NATS = 9.0  # what an effect of the stated size would bring: the price of a number and a clear lead over "none"

# spec, parameter, unit of the answer, sizes tried
_SIZES: dict[str, tuple[Spec, str, str]] = {
    "deadband": (Spec(valve=kernels.PLAY), "S", "%"),
    "stiction": (Spec(valve=kernels.STICK), "S", "%"),
    "valve_lag": (Spec(pole="valve"), "tau", "s"),
    "extra_lag": (Spec(pole="extra"), "tau", "s"),
    "sensor_lag": (Spec(pole="sensor"), "tau", "s"),
    "valve_characteristic": (Spec(valve=kernels.CURVE), "R", ""),
    "time_constant_mismatch": (Spec(free=frozenset({"T"})), "T", ""),
    "dead_time_mismatch": (Spec(free=frozenset({"Td"})), "Td", "s"),
    "noise": (Spec(free=frozenset({"noise"})), "noise", ""),
    "drift": (Spec(walk=True), "walk", "PV units over the record"),
}


def smallest_detectable(situation: Situation, base: Fit, longest_load: float) -> dict[str, tuple[float, str]]:
    """Return the size of each effect that would have been found, with its unit.

    Parameters
    ----------
    situation : Situation
    base : Fit
        The fit without effect.
    longest_load : float
        As the base was fitted with (samples).

    Returns
    -------
    dict of str to (float, str)
        By what forcing the effect on costs in likelihood with everything else held; re-fitted nuisances would hide a
        little more, so read it as "about". Infinite where no size up to the largest tried would show.
    """
    engine = Engine(situation.data, longest_load)
    d, Ts = situation.data, situation.record.Ts
    span = float(np.ptp(d.u)) or 1.0
    level = engine.evaluate(base.spec, base.theta)[0]
    out: dict[str, tuple[float, str]] = {}
    for effect, (spec, name, unit) in _SIZES.items():
        if (effect == "time_constant_mismatch" and d.T == 0) or (name == "noise" and d.noise == 0):
            continue
        joined = base.spec.join(spec)
        found = np.inf
        for step in np.geomspace(0.02, 2.0, 14):
            theta = {**base.theta, "J": 0.5 * step * span, "S": step * span, "tau": step * 5.0 * (d.T or d.Td + 1.0)}
            theta |= {"R": float(np.exp(3.0 * step)), "walk": step * float(np.std(d.y)) / np.sqrt(d.n)}
            if name in ("T", "noise"):
                theta[name] = base.theta[name] * (1.0 + step)
            if name == "Td":
                theta[name] = base.theta["Td"] + step * 5.0
            if level - engine.evaluate(joined, theta)[0] > NATS:
                found = {
                    "T": 1.0 + step, "noise": 1.0 + step, "Td": step * 5.0 * Ts, "tau": theta["tau"] * Ts, "R": theta["R"],
                    "S": theta["S"], "walk": step * float(np.std(d.y)),
                }[name]  # fmt: skip
                break
        out[effect] = (float(found), unit)
    spread = max(float(np.sqrt(np.mean(base.residual[kernels.SKIP :] ** 2))), 0.0)
    out["outliers"] = (4.0 * spread * base.theta["noise"], "PV units")
    out["quantisation"] = (max(20.0 * situation.samples.resolution, 1e-6 * float(np.ptp(d.y))), "PV units")
    if situation.law.known:
        out["detuning"] = (1.14, "factor")
        e = np.abs(situation.sp - np.asarray(situation.record.pv))
        out["error_deadband"] = (2.0 * float(np.quantile(e, 0.2)), "PV units")
    return out
