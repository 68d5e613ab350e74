"""Identify a baseline from the record: controller settings by regression, plant by maximum
likelihood (`--identify`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from detectors.errors import RecordError
from detectors.record import LoopRecord
from detectors.signal.spikes import cleaned
from scenarios.spec import Controller, Loop, Noise, Plant, Sampling
from simbench.gap.candidates import fit_candidates
from simbench.gap.controller.pi_law import Law, examine_law
from simbench.gap.effects import recogniser
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit, Spec, size_penalty
from simbench.gap.sensor.samples import inspect_samples
from simbench.loop.effects import EFFECTS, block_of

_BAND = min(
    (e for e in EFFECTS if recogniser(e).band is not None), key=lambda e: len(EFFECTS[e].parameters)
)
_HALF = 0.5  # of what OP does, that a law may leave unexplained and still show its direction


def identify(
    record: LoopRecord, plant: Plant | None = None, controller: Controller | None = None
) -> Loop:
    """Return a loop file that fits the record, without any effect in it."""
    it = _Unidentified(record)
    noise, law = 0.0, it.law(1.0 if plant is None else float(np.sign(plant.K)))
    if plant is None:
        # friction and feedback turn the sign of a plant; what OP does about PV shows the
        # controller's direction
        shown = float(np.sign(law.Kc)) if law.residual < _HALF and np.isfinite(law.Kc) else 0.0
        plant, noise = it.plant(shown if controller is None else controller.sign)
    if controller is None:
        sign = 1.0 if plant.K > 0 else -1.0
        controller = it.controller(law if law.known else it.law(sign), sign)
    return Loop(
        plant=plant,
        controller=controller,
        sampling=Sampling(Ts=record.Ts, n=record.n),
        noise=Noise(std=noise),
    )


def exact_controller(record: LoopRecord) -> Controller | None:
    """Return the controller whose law turns the recorded error into OP; None where no PI law
    does.
    """
    it = _Unidentified(record)
    law = it.law(1.0)
    return (
        it.controller(law, float(np.sign(law.Kc)))
        if law.known and np.isfinite(law.Kc) and law.Kc
        else None
    )


@dataclass(frozen=True, eq=False)
class _Unidentified:
    """A record of whose loop nothing is known yet; OP in % where its span is known."""

    record: LoopRecord

    @property
    def op(self) -> np.ndarray:
        return self.record.op if self.record.op_percent is None else self.record.op_percent

    @property
    def rough_gain(self) -> float:
        change = float(np.std(np.diff(self.record.pv)))
        return float(np.std(np.diff(self.op))) / change if change > 0 else 1.0

    def law(self, sign: float) -> Law:
        r = self.record
        return examine_law(
            self.op,
            r.pv,
            r.sp,
            r.Ts,
            sign * self.rough_gain,
            20.0 * r.Ts,
            trusted=False,
        )

    def controller(self, law: Law, sign: float) -> Controller:
        Kc = abs(law.Kc) if np.isfinite(law.Kc) and law.Kc != 0 else self.rough_gain
        direction = "reverse" if sign > 0 else "direct"
        if law.known and np.isinf(law.Ti):
            return Controller(type="P", Kc=Kc, direction=direction)
        Ti = law.Ti if np.isfinite(law.Ti) and law.Ti > 0 else 20.0 * self.record.Ts
        return Controller(type="PI", Kc=Kc, Ti=Ti, direction=direction)

    def plant(self, sign: float) -> tuple[Plant, float]:
        """Return the plant, its gain of a sign where that is not 0, and the standard deviation of
        the noise.
        """
        r, samples = self.record, inspect_samples(self.record.pv, self.record.op)
        u = np.ascontiguousarray(self.op if r.mv is None else r.mv, dtype=float)
        integrating, fit = self._fit(u, cleaned(r.pv, samples.spikes), samples.digits, sign)
        K = sign * abs(fit.K) if sign else fit.K
        if not (np.isfinite(K) and K != 0.0):
            where = f"record {r.tag!r}" if r.tag else "record"
            raise RecordError(
                f"{where}: no plant can be identified: PV does not answer to OP (K = {K:g})"
            )
        dead, noise = fit.theta["Td"] * r.Ts, fit.theta["noise_std"]
        if integrating:
            return Plant(type="integrating", K=K / r.Ts, Td=dead), noise
        return Plant(type="foptd", K=K, T=fit.theta["T"] * r.Ts, Td=dead), noise

    def _fit(
        self, u: np.ndarray, pv: np.ndarray, resolution: float, sign: float
    ) -> tuple[bool, Fit]:
        """Return whether the plant integrates, and its fit; of an unknown process the likelier,
        friction allowed to both.
        """
        r = self.record
        if r.process is not None:
            integrating = r.process == "integrating"
            return integrating, fit_plant(u, pv, integrating, resolution, sign)
        fits, score = {}, {}
        for integrating in (False, True):
            fit = fits[integrating] = fit_plant(u, pv, integrating, resolution, sign)
            # a time constant is one number more to fit
            score[integrating] = fit.loglik - (0.0 if integrating else size_penalty(r.n, 1.0))
            if r.mv is None:
                # after a valve that rests between its slips any plant looks as if it integrated
                T = 0.0 if integrating else fit.theta["T"]
                engine = Engine(
                    Data(u, pv, fit.K, T, fit.theta["Td"], 0.0, resolution, trusted=False),
                    max(0.1 * r.n, 20.0),
                )
                # a band without a jump tells as much of it as one with, at a fifth of the cost
                score[integrating] += max(
                    0.0, fit_candidates(engine, fit, [_BAND])[_BAND].log_likelihood_gain
                )
        integrating = score[True] > score[False]
        return integrating, fits[integrating]


def fit_plant(
    op: np.ndarray, pv: np.ndarray, integrating: bool, resolution: float, sign: float = 0.0
) -> Fit:
    """Return the best first-order (or integrating) plant from OP to PV; a coarse grid, then a joint
    fit of its best point.
    """
    n = op.size
    gain = float(np.std(pv)) / (float(np.std(op)) or 1.0)
    slow = (0.0,) if integrating else (0.5, 1.5, 4.0, 10.0, 30.0)
    tries = []
    for T in slow:
        for Td in (0.0, 1.0, 3.0, 8.0):
            engine = Engine(
                Data(op, pv, gain, T, Td, 0.0, resolution, trusted=False), max(0.1 * n, 20.0)
            )
            tries.append((engine, engine.at(Spec(), engine.start())))
    engine, best = max(tries, key=lambda t: (t[1].K * sign >= 0.0, t[1].loglik))
    fit = engine.fit(Spec(), best.theta, steps=40)
    return fit if fit.K * sign >= 0.0 or best.K * sign < 0.0 else best


def meaningful(mv: bool, tuned: bool) -> set[str]:
    """Return the effects that can be judged without a trusted plant."""
    known = {"", "tuning"} if tuned else {""}
    return {e for e in EFFECTS if recogniser(e).needs in known or (mv and block_of(e) == "valve")}
