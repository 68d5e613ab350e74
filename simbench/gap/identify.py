"""A baseline from the record itself: tuning by regression, plant by the innovations' likelihood; what then can be said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from detectors.record import LoopRecord
from scenarios.spec import Controller, Loop, Noise, Plant, Sampling
from simbench.gap.assess import Assessment
from simbench.gap.candidates import fit_candidates, size_penalty
from simbench.gap.check import Situation
from simbench.gap.fit import Engine
from simbench.gap.law import examine_law
from simbench.gap.model import NUISANCES, Data, Fit, Spec
from simbench.gap.samples import cleaned, inspect_samples
from simbench.gap.spacing import spacing
from simbench.loop.effects import EFFECTS, block_of


def identify(record: LoopRecord, plant: Plant | None = None, controller: Controller | None = None) -> Loop:
    """Return a loop file that fits the record, without any effect in it.

    Parameters
    ----------
    record : LoopRecord
        OP, PV, and SP and MV where recorded; MV, if there, drives the plant. `process` decides between foptd and
        integrating; where it is unknown the likelier of the two.
    plant, controller : optional
        What is known already; only the rest is identified.

    Returns
    -------
    Loop

    Notes
    -----
    Not a model to design a controller with: in closed loop and without excitation K and T are known only as K/T.
    """
    op = record.op if record.op_percent is None else record.op_percent
    noise = 0.0
    if plant is None:
        plant, noise = _identified_plant(record, op, controller)
    if controller is None:
        controller = _identified_controller(record, op, 1.0 if plant.K > 0 else -1.0)
    return Loop(plant=plant, controller=controller, sampling=Sampling(Ts=record.Ts, n=record.n), noise=Noise(std=noise))


def _identified_plant(record: LoopRecord, op: np.ndarray, controller: Controller | None) -> tuple[Plant, float]:
    """Return the plant and the standard deviation of the noise."""
    samples = inspect_samples(record.pv, record.op)
    pv = cleaned(np.asarray(record.pv), samples.spikes)
    u = np.ascontiguousarray(op if record.mv is None else record.mv, dtype=float)
    integrating, fit = _plant(record, u, pv, max(samples.resolution, samples.step))
    # feedback alone may turn the sign; the controller's direction tells it
    K = fit.K if controller is None else controller.sign * abs(fit.K)
    dead, noise = fit.theta["Td"] * record.Ts, fit.theta["noise"]
    if integrating:
        return Plant(type="integrating", K=K / record.Ts, Td=dead), noise
    return Plant(type="foptd", K=K, T=fit.theta["T"] * record.Ts, Td=dead), noise


def _identified_controller(record: LoopRecord, op: np.ndarray, sign: float) -> Controller:
    rough, slow = _rough_gain(op, np.asarray(record.pv)), 20.0 * record.Ts
    law = examine_law(op, np.asarray(record.pv), record.sp, record.Ts, sign * rough, slow, trusted=False)
    Kc = abs(law.Kc) if np.isfinite(law.Kc) and law.Kc != 0 else rough
    direction = "reverse" if sign > 0 else "direct"
    if law.known and np.isinf(law.Ti):
        return Controller(type="P", Kc=Kc, direction=direction)
    Ti = law.Ti if np.isfinite(law.Ti) and law.Ti > 0 else slow
    return Controller(type="PI", Kc=Kc, Ti=Ti, direction=direction)


def _plant(record: LoopRecord, u: np.ndarray, pv: np.ndarray, resolution: float) -> tuple[bool, Fit]:
    """Return whether the plant integrates, and its fit; an unknown process is the likelier one, friction allowed to both."""
    if record.process is not None:
        integrating = record.process == "integrating"
        return integrating, fit_plant(u, pv, integrating, resolution)
    fits, score = {}, {}
    for integrating in (False, True):
        fit = fits[integrating] = fit_plant(u, pv, integrating, resolution)
        # a time constant is one number more to fit
        score[integrating] = fit.loglik - (0.0 if integrating else size_penalty(record.n, 1.0))
        if record.mv is None:
            # behind a valve that rests between its slips any plant looks as if it integrated
            T = 0.0 if integrating else fit.theta["T"]
            engine = Engine(Data(u, pv, fit.K, T, fit.theta["Td"], 0.0, resolution, trusted=False), max(0.1 * record.n, 20.0))
            sticky = fit_candidates(engine, fit, ["stiction", "deadband"])
            score[integrating] += max(0.0, *(c.gain for c in sticky.values()))
    integrating = score[True] > score[False]
    return integrating, fits[integrating]


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


def meaningful(mv: bool, tuned: bool) -> set[str]:
    """Return the effects that can be judged without a trusted plant.

    Parameters
    ----------
    mv : bool
        MV is recorded; MV given OP is the valve, whatever the plant.
    tuned : bool
        The controller's tuning was given.

    Returns
    -------
    set of str
    """
    return MEANINGFUL | {e for e in EFFECTS if mv and block_of(e) == "valve"} | ({"detuning"} if tuned else set())


SHARE = 0.15  # of the OP range that a band must span to count as friction
IMMATERIAL = 0.01  # of the variance of the moves; rounding that adds less is not what a simulation lacks


def plausible(found: Assessment) -> Assessment:
    """Keep of an assessment without trusted baseline what the record alone can carry.

    Parameters
    ----------
    found : Assessment

    Returns
    -------
    Assessment
        Effects that compare with a plant are dropped, and with a tuning, unless that was given; friction must span a share of
        the OP range and be found in both halves of the record. What MV shows of the valve needs no baseline and stays. Notes
        say what the samples show.
    """
    s = found.situation
    seen = s.record.mv is not None
    kept = meaningful(seen, s.tuned)
    gains = {e: (g if e in kept else min(g, -10.0)) for e, g in found.gains.items()}
    span = float(np.quantile(s.op, 0.99) - np.quantile(s.op, 0.01))
    for effect in ("stiction", "deadband"):
        if gains[effect] > 0 and not seen:
            S = float(found.parameters.get(effect, {}).get("S", 0.0))
            if S < SHARE * span or not in_both_halves(found, effect):
                gains[effect] = -5.0
    for effect, x in (("op_quantisation", s.op), ("quantisation", np.asarray(s.record.pv))):
        # a transmitter's lattice is a fact; a file's decimals, and an output card's, must hide something
        if effect in s.hard and not (effect == "quantisation" and s.samples.step > 0.0):
            step = float(s.hard[effect]["step"])
            if step**2 / 12.0 < IMMATERIAL * float(np.var(np.diff(x))):
                gains[effect] = -5.0
    order = sorted((e for e in gains if gains[e] > 0 and e not in s.hard), key=lambda e: -gains[e])
    chosen = [e for e in found.chosen if e in s.hard and gains[e] > 0][:2]
    for e in order:
        if len(chosen) < 2 and block_of(e) not in {block_of(c) for c in chosen}:
            chosen.append(e)
    fits = [e for e in chosen if e in found.candidates]
    final = found.candidates[fits[0]].fit if fits else found.base
    # a residual test asks whether a trusted model is whole; an identified one never is, a valve with MV is
    sound = {"valve": found.stranger, "controller": bool(s.strange_law)}
    strange = {block: why for block, why in found.strange.items() if sound.get(block)}
    said = replace(s, notes=[*s.notes, *remarks(s)])
    return replace(found, situation=said, gains=gains, chosen=chosen, final=final, strange=strange)


def remarks(situation: Situation) -> list[str]:
    """Return, as "name: evidence", what record and samples show beside the effects.

    Parameters
    ----------
    situation : Situation

    Returns
    -------
    list of str
        `process`: which plant type was assumed; `quantisation`, `op_quantisation`, `outliers`: how many, how large.
    """
    record, pv = situation.record, np.asarray(situation.record.pv)
    out = []
    if record.process is None:
        kind = "integrating" if situation.integrating else "self-regulating"
        out.append(f"process: not given; judged as {kind}, the likelier of the two")
    for name, x in (("quantisation", pv), ("op_quantisation", np.asarray(record.op))):
        step, levels = spacing(x)
        if step > 0.0:
            share = step / float(x.std())
            out.append(f"{name}: {x.size} samples on {levels} levels, {step:.3g} apart ({share:.1%} of the standard deviation)")
    spikes = situation.samples.spikes
    if spikes.size:
        out.append(f"outliers: {spikes.size} isolated, the first {spikes[0] * record.Ts:g} s after the start")
    return out


def in_both_halves(found: Assessment, effect: str) -> bool:
    """Return whether friction explains each half of the record better than none, its numbers held.

    Parameters
    ----------
    found : Assessment
    effect : str
        Stiction or dead-band.

    Returns
    -------
    bool
    """
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
        tries = [engine.fit(replace(spec, start=begin), theta, search=NUISANCES, steps=8) for begin in (-1.0, 0.0, 1.0)]
        # the same plant and load are free on both sides
        without = engine.fit(replace(found.base.spec, channels=()), {**found.base.theta, **theta}, steps=8)
        if max(t.loglik for t in tries) < without.loglik:
            return False
    return True


def _rough_gain(op: np.ndarray, pv: np.ndarray) -> float:
    change = float(np.std(np.diff(pv)))
    return float(np.std(np.diff(op))) / change if change > 0 else 1.0
