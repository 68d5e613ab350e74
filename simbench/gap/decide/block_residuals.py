"""What each block leaves of the recorded signal behind it when it is driven with the recorded one in front of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from simbench.gap.decide.assess import Assessment
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation


def law_residuals(s: Situation) -> tuple[np.ndarray, np.ndarray, float]:
    """Return what the baseline's law and the identified one leave of OP's changes, and the former's share of their power.

    Parameters
    ----------
    s : Situation

    Returns
    -------
    bare, freed : ndarray, shape (n,)
        In %; 0 at the first sample.
    share : float
        Power of `bare` over that of OP's changes.
    """
    control, law = s.baseline.controller, s.law
    pv = np.asarray(s.record.pv if law.recovered_pv is None else law.recovered_pv)
    Ts, Kc, Ti = s.record.Ts, control.sign * control.Kc, control.Ti or np.inf
    du = np.diff(s.op, prepend=s.op[0])

    def left(e: np.ndarray, Kc: float, Ti: float, limits: dict, step: float) -> np.ndarray:
        tries = []
        # an integral of the new error, of both, or of the old one
        for part in (1.0, 0.5, 0.0):
            a, b = Kc * (1.0 + part * Ts / Ti), -Kc * (1.0 - (1.0 - part) * Ts / Ti)
            want = s.op[:-1] + a * e[1:] + b * e[:-1]
            off = s.op[1:] - np.clip(want, float(limits["lo"]), float(limits["hi"]))
            if s.record.sp is None:
                # the set point is only known up to a constant
                off = off - np.median(off)
            tries.append(np.append(0.0, np.where(np.abs(off) <= step, 0.0, off)))
        return min(tries, key=lambda r: float(np.median(np.abs(r))) + 1e-3 * float(np.mean(np.abs(r))))

    width = float(law.found.get("error_deadband", {}).get("width", 0.0))
    step = float(law.found.get("op_quantisation", {}).get("step", 0.0))
    kc, ti = (law.Kc, law.Ti) if "detuning" in law.found else (Kc, Ti)
    ends = {"lo": min(0.0, float(s.op.min())), "hi": max(100.0, float(s.op.max()))}
    results = []
    for late in (0, 1) if law.late else (0,):
        y = np.append(pv[: law.late], pv[: pv.size - law.late])
        r = np.append(s.sp[:late], s.sp[: s.sp.size - late])
        e = r - y
        held = np.where(np.abs(e) <= width / 2, 0.0, e) if width > 0.0 else e
        results.append((left(e, Kc, Ti, ends, 0.0), left(held, kc, ti, law.found.get("saturation", ends), step)))
    bare, freed = min(results, key=lambda t: float(np.median(np.abs(t[0]))) + 1e-3 * float(np.mean(np.abs(t[0]))))
    return bare, freed, float(np.sum(bare**2) / (np.sum(du**2) or 1.0))


def mv_residuals(s: Situation, effect: str, p: Mapping[str, float | str]) -> tuple[np.ndarray, np.ndarray]:
    """Return what an ideal valve, and one with an effect, driven with OP, leave of the recorded MV; a constant is no misfit.

    Parameters
    ----------
    s : Situation
        With a recorded MV.
    effect : str
        Of the valve.
    p : mapping
        Its parameters.

    Returns
    -------
    bare, freed : ndarray, shape (n,)
        In % of travel.
    """
    op, mv = s.op, np.asarray(s.record.mv)
    first = float(mv[0] - op[0])
    if effect == "stiction":
        S, J = float(p["S"]), float(p["J"])
        tries = [kernels.valve(op, kind, S, J, first) for kind in (kernels.STICK, kernels.CREEP)]
    elif effect == "deadband":
        tries = [kernels.valve(op, kernels.PLAY, float(p["S"]), first, 0.0)]
    elif effect == "deadzone":
        tries = [kernels.valve(op, kernels.ZONE, float(p["D"]), float(p["c"]), 0.0)]
    elif effect == "valve_characteristic":
        tries = [kernels.valve(op, kernels.CURVE, float(p["R"]), 0.0, 0.0)]
    else:
        from scipy.signal import lfilter

        a = np.exp(-s.record.Ts / float(p["tau"]))
        tries = [op[0] + lfilter([1.0 - a], [1.0, -a], op - op[0])]
    off = [mv - v - np.mean(mv - v) for v in (np.clip(op, 0.0, 100.0), *tries)]
    return off[0], min(off[1:], key=lambda r: float(r @ r))


def sample_misfit(s: Situation) -> np.ndarray:
    """Return the power, sample by sample, of what the sensor's proven effects add to the changes of PV.

    Parameters
    ----------
    s : Situation

    Returns
    -------
    ndarray, shape (n,)
        In PV units squared.
    """
    pv = np.asarray(s.record.pv)
    off = pv - s.plant_pv
    power = np.diff(off, prepend=off[0]) ** 2
    if "quantisation" in s.proven and not off.any():
        # rounding errors of two samples, each of variance step^2/12
        power = power + float(s.proven["quantisation"]["step"]) ** 2 / 6.0
    if "compression" in s.proven and not off.any():
        power = power + float(s.proven["compression"]["band"]) ** 2 / 3.0
    if s.frozen:
        power = power + (np.diff(pv, prepend=np.inf) == 0.0) * float(np.mean(np.diff(pv) ** 2))
    return power


def loglik(fit: Fit) -> np.ndarray:
    """Return a fit's log-likelihood sample by sample.

    Parameters
    ----------
    fit : Fit

    Returns
    -------
    ndarray, shape (n,)
        In nats; it sums to the fit's, prior included.
    """
    x = -0.5 * np.asarray(fit.residual) ** 2
    x[: kernels.SKIP] = 0.0
    return spread_to(x, fit.loglik)


def spread_to(x: np.ndarray, total: float) -> np.ndarray:
    """Return values shifted alike so that they sum to a total.

    Parameters
    ----------
    x : ndarray, shape (n,)
    total : float

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> spread_to(np.array([1.0, 3.0]), 10.0)
    array([4., 6.])
    """
    return x + (total - x.sum()) / x.size


def spikes(found: Assessment) -> np.ndarray:
    """Return what rare spikes beside Gaussian innovations bring, sample by sample.

    Parameters
    ----------
    found : Assessment
        With parameters of `outliers`.

    Returns
    -------
    ndarray, shape (n,)
        In nats over plain Gaussian innovations, numbers not paid for.
    """
    x = np.asarray(found.base.residual).copy()
    x[: kernels.SKIP] = 0.0
    p = found.parameters["outliers"]
    rate, wide = float(p["rate"]), 1.5 * float(p["size"]) / found.base.theta["noise"]
    scale, std = 1.4826 * float(np.median(np.abs(x))) or 1.0, float(np.std(x)) or 1.0
    mixture = (1 - rate) / scale * np.exp(-0.5 * (x / scale) ** 2) + rate / wide * np.exp(-0.5 * (x / wide) ** 2)
    return np.log(np.maximum(mixture, 1e-300)) + 0.5 * (x / std) ** 2 + np.log(std)
