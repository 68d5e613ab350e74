"""Identify a baseline from the record: controller settings by regression, plant by maximum
likelihood (`--identify`).
"""

from __future__ import annotations

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.spikes import cleaned
from simbench.gap.candidates import fit_candidates
from simbench.gap.controller.law import Law
from simbench.gap.controller.pi_law import examine_law
from simbench.gap.controller.pid_law import Stated
from simbench.gap.effects import recogniser
from simbench.gap.intake.observed import op_in_percent
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec, size_penalty
from simbench.gap.sensor.samples import inspect_samples
from simbench.gap.situation import name_of_record
from simbench.loop.effects import EFFECTS
from simbench.scenarios.parts import Noise, Sampling
from simbench.scenarios.plant import Controller, Plant
from simbench.scenarios.spec import Loop

_BAND = min(
    (e for e in EFFECTS if recogniser(e).band is not None), key=lambda e: len(EFFECTS[e].parameters)
)
_HALF = 0.5  # of what OP does, that a law may leave unexplained and still show its direction


class NoAnswer(RecordError):
    """No plant can be identified, as PV does not answer to OP."""


def identify(
    record: LoopRecord,
    plant: Plant | None = None,
    controller: Controller | None = None,
    law: Law | None = None,
) -> Loop:
    """Return a loop file that fits the record, without any effect in it; `law` is what `law_of`
    showed of it already.
    """
    # The controller's law, by the sign of the plant where that is known
    noise = 0.0
    if plant is None:
        guess = 1.0
    else:
        guess = float(np.sign(plant.K))
    law = law or law_of(record, guess)
    if plant is None:
        # friction and feedback turn the sign of a plant; what OP does about PV shows the
        # controller's direction
        if law.residual < _HALF:
            shown = float(np.sign(law.Kc))
        else:
            shown = 0.0
        plant, noise = _identify_plant(record, shown if controller is None else controller.sign)

    # The controller, by a law of the plant's sign
    if controller is None:
        sign = float(np.sign(plant.K))
        if not (law.known or sign == guess):
            law = law_of(record, sign)
        if not (np.isfinite(law.Kc) and law.Kc != 0.0):
            raise RecordError(
                f"{name_of_record(record)}: no controller can be identified: OP does not answer"
                f" to PV (Kc = {abs(law.Kc):g})"
            )
        controller = _identified_controller(law, sign, record.Ts)
    return Loop(
        plant=plant,
        controller=controller,
        sampling=Sampling(Ts=record.Ts, n=record.n),
        noise=Noise(std=noise),
    )


def law_of(r: LoopRecord, sign: float = 1.0) -> Law:
    """Return the law from a guess of its tuning: a gain of a sign, by the sizes of the changes."""
    op = op_in_percent(r, False, "")
    rough = float(np.std(np.diff(op))) / (float(np.std(np.diff(r.pv))) or np.inf)
    guess = Stated(sign * (rough or 1.0), 20.0 * r.Ts, r.Ts)
    return examine_law(op, r.pv, r.sp, guess, trusted=False)


def _identified_controller(law: Law, sign: float, Ts: float) -> Controller:
    direction = "reverse" if sign > 0 else "direct"
    Kc = abs(law.Kc)
    if law.known and np.isinf(law.Ti):
        return Controller(type="P", Kc=Kc, direction=direction)
    if np.isfinite(law.Ti):
        Ti = law.Ti
    else:
        Ti = 20.0 * Ts
    return Controller(type="PI", Kc=Kc, Ti=Ti, direction=direction)


def _identify_plant(r: LoopRecord, sign: float) -> tuple[Plant, float]:
    """Return the plant, its gain of a sign where that is not 0, and the standard deviation of the
    noise; of an unknown process the likelier, friction allowed to both.
    """
    # The input, and PV without its spikes
    samples = inspect_samples(r.pv, r.op)
    if r.mv is None:
        u = op_in_percent(r, False, "")
    else:
        u = r.mv
    pv = cleaned(r.pv, samples.spikes)

    # Both kinds of plant, a time constant at its price
    tries = []
    for integrating in (False, True) if r.process is None else (r.process == "integrating",):
        _, fit = fit_plant(u, pv, integrating, samples.digits, sign)
        # a time constant is one number more to fit
        score = fit.loglik - (0.0 if integrating else size_penalty(r.n, 1.0))
        if r.mv is None and r.process is None:
            # after a valve that rests between its slips any plant looks as if it integrated; a band
            # without a jump tells as much of it as one with, at a fifth of the cost
            if integrating:
                T = 0.0
            else:
                T = fit.theta["T"]
            engine = _make_engine(u, pv, fit.K, T, fit.theta["Td"], samples.digits)
            friction = fit_candidates(engine, fit, [_BAND])[_BAND].log_likelihood_gain
            score += max(0.0, friction)
        tries.append((score, integrating, fit))
    _, integrating, fit = max(tries, key=lambda t: t[0])

    # The gain with the sign that was asked for
    if sign:
        K = sign * abs(fit.K)
    else:
        K = fit.K
    if not (np.isfinite(K) and K != 0.0):
        raise NoAnswer(
            f"{name_of_record(r)}: no plant can be identified: PV does not answer to OP (K = {K:g})"
        )

    # The plant in seconds
    dead = fit.theta["Td"] * r.Ts
    noise = fit.theta["noise_std"]
    if integrating:
        return Plant(type="integrating", K=K / r.Ts, Td=dead), noise
    return Plant(type="foptd", K=K, T=fit.theta["T"] * r.Ts, Td=dead), noise


def fit_plant(
    u: np.ndarray, pv: np.ndarray, integrating: bool, resolution: float, sign: float = 0.0
) -> tuple[Engine, Fit]:
    """Return the best first-order (or integrating) plant from OP to PV, and the engine that fitted
    it: a coarse grid, then a joint fit of its best point.
    """
    gain = float(np.std(pv)) / (float(np.std(u)) or 1.0)
    tries = []
    for T in (0.0,) if integrating else (0.5, 1.5, 4.0, 10.0, 30.0):
        for Td in (0.0, 1.0, 3.0, 8.0):
            engine = _make_engine(u, pv, gain, T, Td, resolution)
            tries.append((engine, engine.at(Spec(), engine.start())))
    engine, best = max(tries, key=lambda t: (t[1].K * sign >= 0.0, t[1].loglik))
    fit = engine.fit(Spec(), best.theta, steps=40)
    return engine, fit if fit.K * sign >= 0.0 or best.K * sign < 0.0 else best


def _make_engine(
    u: np.ndarray, pv: np.ndarray, K: float, T: float, Td: float, resolution: float
) -> Engine:
    data = Data(u, pv, K, T, Td, 0.0, resolution, trusted=False)
    return Engine(data, max(0.1 * u.size, 20.0))
