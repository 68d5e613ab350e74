"""Learn from records of healthy operation how much noise and load a loop has by itself
(`--healthy`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord
from simbench.gap.candidates import fit_candidates
from simbench.gap.effects import Parameters, load_drift, noise, oscillation, recogniser
from simbench.gap.intake.check import check
from simbench.gap.intake.observed import stated_noise
from simbench.gap.intake.partial import Partial, complete_baseline
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, load_std, size_penalty
from simbench.gap.situation import Situation, load_memory
from simbench.gap.thresholds import LARGER
from simbench.scenarios.spec import Loop

_NATS_AT_END = 1.92  # by which the likelihood is lower at the end of a 95 % interval (Wilks 1938)
_FINER = 1.05  # factor on a load by which that end is looked for
_LOADS = ("load_drift", "load_steps", "oscillation")


@dataclass(frozen=True)
class Healthy:
    """What healthy records show of a loop: the standard deviation of its noise (PV units), how far
    its load wanders (% of travel in the square root of a second), the levels between which the load
    steps (standard deviation, %), its sines by period (s) and amplitude on PV, and the largest
    steady standard deviation on PV that they leave possible of the load.
    """

    noise: float
    wander: float
    steps: float
    sines: tuple[tuple[float, float], ...]
    load: float
    records: int = 1

    def note(self, loop: Loop, duration: float) -> str:
        """Return in a sentence what the records show, for one of `duration` s."""
        # What the records show, in the order of the loop file
        drift = self.wander * float(np.sqrt(duration))
        parts = (
            [
                f"noise {self.noise:.3g} (the loop file states {loop.noise.std:.3g})",
                f"a load that wanders by {drift:.2g} % of travel",
            ]
            + ([f"steps of {self.steps:.2g} %"] if self.steps else [])
            + [f"a sine of {period:.3g} s" for period, _ in self.sines]
        )

        # In one sentence
        records = "record shows" if self.records == 1 else "records show"
        return (
            f"healthy: {self.records} {records} {', '.join(parts)}; loads up to {LARGER:g} times as"
            " large and this noise are ordinary"
        )

    def stated_in(self, loop: Loop, Ts: float) -> Loop:
        """Return a loop file with this noise in place of its own."""
        coloured = stated_noise(loop, Ts) ** 2 - loop.noise.std**2
        std = float(np.sqrt(max(self.noise**2 - coloured, 0.0)))
        return loop.model_copy(update={"noise": loop.noise.model_copy(update={"std": std})})

    def ordinary_in(self, s: Situation) -> Situation:
        """Return a situation in which these loads, and none plainly larger, are ordinary."""
        loads = {"slow": self.wander * float(np.sqrt(s.record.duration)), "steps": self.steps}
        sines = tuple((period / s.record.Ts, amplitude) for period, amplitude in self.sines)
        known = {"sines": sines, "measured": True, "most_load": self.load}
        return replace(s, data=replace(s.data, loads=loads, **known))


def learn(records: Sequence[Situation]) -> Healthy:
    """Return what healthy records of a loop show: the largest loads, and the mean noise."""
    each = [_of_one(s) for s in records]
    return Healthy(
        noise=float(np.exp(np.mean([np.log(one.noise) for one in each]))),
        wander=max(one.wander for one in each),
        steps=max(one.steps for one in each),
        sines=tuple(sine for one in each for sine in one.sines),
        load=max(one.load for one in each),
        records=len(each),
    )


def check_healthy(record: LoopRecord, baseline: Loop | Partial | None) -> Situation:
    """Return a healthy record with its loop, checked; the plant must be known, or load could not be
    told from it.
    """
    if baseline is None or (isinstance(baseline, Partial) and "plant" in baseline.missing):
        raise ParameterError(
            "a loop file that states [plant] is needed for healthy records: beside a plant that is"
            " estimated from the same record nothing tells how large its load is"
        )
    return check(record, complete_baseline(record, baseline)[0])


def _of_one(s: Situation) -> Healthy:
    # The engine without loads that are known already, noise free
    s = replace(s, data=replace(s.data, loads={}, sines=()))
    engine = Engine(s.data, load_memory(s))
    base = engine.base()
    free, count = noise.fit(engine, base)
    if free.loglik - base.loglik > size_penalty(s.data.n, count):
        base = free

    # Every ordinary load on top of it
    known = []
    for e in _LOADS:
        if recogniser(e).fit is not None:
            known.append(e)
    found = {}
    for e, c in fit_candidates(engine, base, known).items():
        if c.used:
            found[e] = c

    # Their numbers, and which of them are worth anything
    p: dict[str, Parameters] = {}
    for e, c in found.items():
        p[e] = recogniser(e).numbers(c.fit, s)
    worth = {e for e, c in found.items() if c.log_likelihood_gain > 0.0}

    # A slow wander, or a sine that keeps its period
    duration = s.record.duration
    sines = ()
    slow = 0.0
    if "load_drift" in found:
        slow = load_drift.travel(p["load_drift"], duration)
    if "oscillation" in worth:
        if oscillation.wanders(p["oscillation"], duration):
            slow = max(slow, float(p["oscillation"]["amplitude"]))
        else:
            fit = found["oscillation"].fit
            sines = ((fit.theta["period"] * s.record.Ts, float(np.hypot(*fit.beta[-2:]))),)

    # Steps of the load
    if "load_steps" in worth:
        steps = float(p["load_steps"]["size"])
    else:
        steps = 0.0

    # The noise without what rounding adds
    rounding = s.data.resolution**2 / 12.0
    std = float(np.sqrt(max(base.theta["noise_std"] ** 2 - rounding, s.data.floor**2)))
    return Healthy(std, slow / float(np.sqrt(duration)), steps, sines, _most_load(engine, base))


def _most_load(engine: Engine, fit: Fit) -> float:
    """Return the upper end of the load's 95 % interval by the likelihood, all else as fitted."""
    theta = dict(fit.theta)
    while engine.evaluate(fit.spec, theta) > fit.loglik - _NATS_AT_END:
        theta["load"] *= _FINER
    return load_std(theta)
