"""A baseline from the record itself: tuning by regression, plant by the innovations' likelihood."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.assess import Assessment
from simbench.gap.candidates import SMOOTH
from simbench.gap.fit import Data, Engine, Fit, Spec
from simbench.gap.law import examine_law
from simbench.gap.names import block_of
from simbench.gap.samples import cleaned, inspect_samples


def identify(record: LoopRecord) -> Loop:
    """Return a loop file that fits the record, without any effect in it.

    Parameters
    ----------
    record : LoopRecord
        OP, PV, and SP where recorded; `process` decides between foptd and integrating, foptd when unknown.

    Returns
    -------
    Loop

    Notes
    -----
    Not a model to design a controller with: in closed loop and without excitation K and T are known only as K/T.
    """
    op = record.op if record.op_percent is None else record.op_percent
    pv = np.asarray(record.pv)
    samples = inspect_samples(pv, record.op)
    pv = cleaned(pv, samples.spikes)
    integrating = record.process == "integrating"
    fit = fit_plant(np.ascontiguousarray(op), pv, integrating, max(samples.resolution, samples.step))
    Ts = record.Ts
    sign = 1.0 if fit.K >= 0 else -1.0
    law = examine_law(op, np.asarray(record.pv), record.sp, Ts, sign * _rough_gain(op, pv), 20.0 * Ts, trusted=False)
    Kc = abs(law.Kc) if np.isfinite(law.Kc) and law.Kc != 0 else _rough_gain(op, pv)
    Ti = law.Ti if np.isfinite(law.Ti) and law.Ti > 0 else 20.0 * Ts
    plant = {
        "type": "integrating" if integrating else "foptd",
        "K": fit.K / (Ts if integrating else 1.0),
        "Td": fit.theta["Td"] * Ts,
    }
    if not integrating:
        plant["T"] = fit.theta["T"] * Ts
    return Loop.from_table({
        "plant": plant,
        "controller": {"type": "PI", "Kc": Kc, "Ti": Ti, "direction": "reverse" if sign > 0 else "direct"},
        "sampling": {"Ts": Ts, "n": record.n},
        "noise": {"std": fit.theta["noise"]},
    }, "identified loop")  # fmt: skip


def fit_plant(op: np.ndarray, pv: np.ndarray, integrating: bool, resolution: float) -> Fit:
    """Return the best first-order (or integrating) plant from OP to PV; a coarse grid, then a joint fit of its best point.

    Parameters
    ----------
    op, pv : ndarray, shape (n,)
    integrating : bool
    resolution : float
        Smallest step of PV.

    Returns
    -------
    Fit
    """
    n = op.size
    gain = float(np.std(pv)) / (float(np.std(op)) or 1.0)
    slow = (0.0,) if integrating else (0.5, 1.5, 4.0, 10.0, 30.0)
    best: Fit | None = None
    for T in slow:
        for Td in (0.0, 1.0, 3.0, 8.0):
            data = Data(op, pv, gain, T, Td, 0.0, resolution, trusted=False)
            engine = Engine(data, max(0.1 * n, 20.0))
            fit = engine.at(Spec(), engine.start())
            if best is None or fit.loglik > best.loglik:
                best, winner = fit, engine
    assert best is not None
    return winner.fit(Spec(), best.theta, steps=40)


# without a trusted baseline nothing that only its numbers define can be missing
MEANINGFUL = {
    "stiction", "deadband", "quantisation", "compression", "outliers", "drift", "oscillation", "load_steps", "load_drift",
    "saturation",
    "error_deadband", "op_quantisation",
}  # fmt: skip
SHARE = 0.15  # of the OP range that a band must span to count as friction


def plausible(found: Assessment) -> Assessment:
    """Keep of an assessment without trusted baseline what the record alone can carry.

    Parameters
    ----------
    found : Assessment

    Returns
    -------
    Assessment
        Effects that compare with a baseline are dropped; friction must span a share of the OP range and be found in both
        halves of the record.
    """
    s = found.situation
    gains = {e: (g if e in MEANINGFUL else min(g, -10.0)) for e, g in found.gains.items()}
    span = float(np.quantile(s.op, 0.99) - np.quantile(s.op, 0.01))
    for effect in ("stiction", "deadband"):
        if gains[effect] > 0:
            S = float(found.parameters.get(effect, {}).get("S", 0.0))
            if S < SHARE * span or not _in_both_halves(found, effect):
                gains[effect] = -5.0
    order = sorted((e for e in gains if gains[e] > 0 and e not in s.hard), key=lambda e: -gains[e])
    chosen = [e for e in found.chosen if e in s.hard and e in MEANINGFUL][:2]
    for e in order:
        if len(chosen) < 2 and block_of(e) not in {block_of(c) for c in chosen}:
            chosen.append(e)
    fits = [e for e in chosen if e in found.candidates]
    final = found.candidates[fits[0]].fit if fits else found.base
    # a residual test asks whether a trusted model is whole; an identified one never is
    return replace(found, gains=gains, chosen=chosen, final=final, strange={})


def _in_both_halves(found: Assessment, effect: str) -> bool:
    d = found.situation.data
    fit = found.candidates[effect].fit if effect in found.candidates else None
    if fit is None:
        return False
    half = d.n // 2
    for cut in (slice(0, half), slice(half, d.n)):
        part = replace(d, u=np.ascontiguousarray(d.u[cut]), y=np.ascontiguousarray(d.y[cut]))
        engine = Engine(part, max(0.1 * half, 5.0))
        theta = dict(fit.theta)
        spec = replace(fit.spec, channels=())
        # where in its band the valve stands at the cut is anybody's guess
        tries = [engine.fit(replace(spec, start=begin), theta, search=SMOOTH, steps=8) for begin in (-1.0, 0.0, 1.0)]
        without = engine.fit(Spec(), {k: theta[k] for k in found.base.theta}, steps=8)
        if max(t.loglik for t in tries) < without.loglik:
            return False
    return True


def _rough_gain(op: np.ndarray, pv: np.ndarray) -> float:
    change = float(np.std(np.diff(pv)))
    return float(np.std(np.diff(op))) / change if change > 0 else 1.0
