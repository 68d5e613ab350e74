"""Which effect: all candidates scored on one record, block by block, and the residual tests that lead to "unknown"."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from simbench.gap.effects._candidates import ENGINE, Candidate, Fitted, fit_candidates
from simbench.gap.effects._parameters import effect_parameters
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, size_penalty
from simbench.gap.likelihood.residual_tests import generic_directions, predictable, residual_tests
from simbench.gap.likelihood.valve_map import HEALTHY, healthy_level, valve_against_mv
from simbench.gap.situation import Situation, load_memory
from simbench.loop.effects import EFFECTS, block_of

SURE = 1000.0  # nats that stand for evidence needing no statistics
SECOND = 12.0  # nats a second effect must bring on top of the first


@dataclass(frozen=True, eq=False)
class Assessment(Fitted):
    """Scores of one record.

    `log_likelihood_gains` are nats over "no effect" for every effect that could be tried; `chosen` stands before `none`
    and `unknown` are weighed; `tests` are the residual statistics of `final`; `unexplained` the blocks in which something no
    known effect explains, with the reason; `mv_unexplained` whether MV is what strays.
    """

    log_likelihood_gains: dict[str, float] = field(default_factory=dict)
    tests: dict[str, float] = field(default_factory=dict)
    log_likelihood_gains_on_top: dict[str, float] = field(default_factory=dict)
    unexplained: dict[str, str] = field(default_factory=dict)
    mv_unexplained: bool = False


def assess(situation: Situation) -> Assessment:
    """Fit and score every effect.

    Parameters
    ----------
    situation : Situation

    Returns
    -------
    Assessment
    """
    engine = Engine(situation.data, load_memory(situation))
    base = engine.base()
    candidates = fit_candidates(engine, base, possible_effects(situation))
    gains = {e: capped(float(c.log_likelihood_gain)) for e, c in candidates.items()}
    parameters: dict[str, dict[str, float | str]] = {
        e: effect_parameters(e, c.fit, situation) for e, c in candidates.items() if c.used
    }
    for effect in EFFECTS:
        gains.setdefault(effect, -10.0)
    for effect, p in situation.proven.items():
        gains[effect] = SURE
        parameters[effect] = p
    mv_unexplained = False
    if situation.record.mv is not None:
        mv_unexplained = _valve_by_mv(situation, gains, parameters)
    for effect in ("stiction", "deadband"):
        if effect in candidates and gains[effect] > 0 and situation.trusted:
            gains[effect] *= beyond_healthy(candidates[effect].fit.theta["S"])
    _spikes_by_innovations(situation, base, gains, parameters)
    if "quantisation" in situation.proven or "compression" in situation.proven:
        gains["noise"] = min(gains["noise"], 0.0)
    chosen = sorted(situation.proven, key=lambda e: -gains[e])[:2]
    order = sorted((e for e in gains if e not in situation.proven), key=lambda e: -gains[e])
    final, log_likelihood_gains_on_top = base, {}
    if len(chosen) < 2:
        best = next((e for e in order if block_of(e) not in {block_of(c) for c in chosen}), None)
        if best is not None and gains[best] > (0.0 if not chosen else SECOND):
            chosen.append(best)
            final = candidates[best].fit if best in candidates else base
    if len(chosen) < 2:
        taken = {block_of(c) for c in chosen}
        others = [e for e in order if block_of(e) not in taken and e in candidates and gains[e] > -5.0]
        log_likelihood_gains_on_top = {
            e: float(c.log_likelihood_gain) for e, c in fit_second(situation, engine, final, others, parameters).items()
        }
        # what the engine does not see stands by itself
        log_likelihood_gains_on_top |= {e: gains[e] for e in order if e not in candidates and block_of(e) not in taken}
        runner = max(log_likelihood_gains_on_top, key=lambda e: log_likelihood_gains_on_top[e], default=None)
        if chosen and runner is not None and log_likelihood_gains_on_top[runner] > SECOND:
            chosen.append(runner)
            if runner in candidates:
                second = fit_candidates(engine, final, [runner])[runner]
                final = second.fit
                parameters[runner] = effect_parameters(runner, final, situation)
    tests = residual_tests(final, situation.data) | generic_directions(engine, final)
    tests |= predictable(final, situation.data, situation.sp)
    unexplained = unexplained_blocks(situation, tests, mv_unexplained, chosen)
    fitted = (situation, base, candidates, parameters, chosen, final)
    return Assessment(*fitted, gains, tests, log_likelihood_gains_on_top, unexplained, mv_unexplained)


# what the residual tests of whole models do not exceed (99 % of development records), and the block that fails beyond
LIMITS = {
    "memory": (8.0, "disturbance"),
    "input": (6.0, "process"),
    "bursts": (14.0, "sensor"),
    "tails": (16.0, "disturbance"),
    "dynamics nats": (3.0, "process"),
    "shape nats": (3.0, "valve"),
    "aging nats": (3.0, "process"),
    "level nats": (4.0, "process"),
}
LENIENT = (
    4.0  # factor on the limits where samples were quantised, compressed or hit by spikes: the engine's PV is not the plant's
)


def unexplained_blocks(situation: Situation, tests: dict[str, float], valve: bool, chosen: list[str]) -> dict[str, str]:
    """Return the blocks in which something no known effect explains, each with its reason.

    Parameters
    ----------
    situation : Situation
    tests : dict of str to float
        Of the best model.
    valve : bool
        MV strays from OP as no map makes it.
    chosen : list of str
        Effects in the model.

    Returns
    -------
    dict of str to str
    """
    out: dict[str, str] = {}
    if situation.unexplained_law:
        out["controller"] = situation.unexplained_law
    if situation.frozen:
        out["sensor"] = f"PV stands exactly still for {situation.samples.held} samples"
    if valve:
        out["valve"] = "MV strays from OP as no known valve makes it"
    rough = {"quantisation", "compression", "outliers", "error_deadband"} & set(situation.proven)
    for name, (limit, block) in LIMITS.items():
        # jumps beyond those the search adds, spikes, and friction that is no two-parameter map leave traces of their own
        loose = rough or (name in ("bursts", "tails", "memory") and {"load_steps", "outliers", "stiction"} & set(chosen))
        if tests[name] > limit * (LENIENT if loose else 1.0):
            out.setdefault(
                block,
                f"the best model leaves something behind ({name.removesuffix(' nats')}: {tests[name]:.0f}, limit {limit:.0f})",
            )
    return out


def capped(gain: float) -> float:
    """Return a gain that stays below SURE and keeps its order: no likelihood outranks what single samples prove."""
    most = 0.9 * SURE
    return gain if gain <= most else most + 0.09 * SURE * (1.0 - most / gain)


def uncapped(gain: float) -> float:
    """Return the nats that `capped` made a gain of; what single samples prove stays as it is."""
    most = 0.9 * SURE
    return gain if gain <= most or gain >= SURE - 1.0 else most / (1.0 - (gain - most) / (0.09 * SURE))


def beyond_healthy(S: float) -> float:
    """Return how far a band exceeds what a healthy valve may have, from 0 to 1."""
    return float(np.clip((S - HEALTHY) / (0.5 * HEALTHY), 0.0, 1.0))


def fit_second(
    situation: Situation, engine: Engine, first: Fit, others: list[str], parameters: dict[str, dict[str, float | str]]
) -> dict[str, Candidate]:
    """Fit further effects on top of the first, friction within a healthy valve's allowance discounted."""
    found = fit_candidates(engine, first, others)
    for effect in {"stiction", "deadband"} & set(found):
        c = found[effect]
        if c.log_likelihood_gain > 0 and situation.trusted:
            found[effect] = replace(c, log_likelihood_gain=c.log_likelihood_gain * beyond_healthy(c.fit.theta["S"]))
    return found


def _spikes_by_innovations(
    situation: Situation, base: Fit, gains: dict[str, float], parameters: dict[str, dict[str, float | str]]
) -> None:
    """Score outliers by single innovations that no Gaussian gives, where the samples themselves were not conclusive."""
    if "outliers" in situation.proven:
        return
    x = np.asarray(base.residual)[kernels.SKIP :]
    scale = 1.4826 * float(np.median(np.abs(x))) or 1.0
    z = np.abs(x) / scale
    far = np.flatnonzero(z > 4.0)
    # a spike leaves one large innovation; a step or a slip leaves several of one sign
    alone = [
        k for k in far if z[max(k - 2, 0) : k].max(initial=0) < 0.7 * z[k] and z[k + 1 : k + 3].max(initial=0) < 0.7 * z[k]
    ]
    if len(alone) < 3 or len(alone) < 0.6 * len(far):
        gains["outliers"] = min(gains["outliers"], -3.0)
        return
    heights = z[alone] * scale
    rate = len(alone) / x.size
    wide = float(np.std(heights)) + float(np.mean(heights))
    mixture = np.log((1 - rate) * np.exp(-0.5 * (x / scale) ** 2) / scale + rate * np.exp(-0.5 * (x / wide) ** 2) / wide)
    plain = -0.5 * (x / float(np.std(x))) ** 2 - np.log(float(np.std(x)))
    gains["outliers"] = float(np.sum(mixture - plain) - size_penalty(x.size, 2.0))
    noise = base.theta["noise"]
    parameters["outliers"] = {
        "rate": rate,
        "size": float(np.mean(heights)) * noise,
        "at": "loop" if situation.law.known else "record",
    }


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


def _valve_by_mv(situation: Situation, gains: dict[str, float], parameters: dict[str, dict[str, float | str]]) -> bool:
    """Score the valve's effects by MV given OP alone; return whether MV strays from OP in a way that no map explains."""
    op, mv = situation.op, np.asarray(situation.record.mv)
    scored = valve_against_mv(op, mv, situation.record.Ts)
    for effect, (gain, p) in scored.items():
        gains[effect] = capped(gain)
        if effect in ("stiction", "deadband") and gain > 0:
            gains[effect] *= beyond_healthy(float(p["S"]))
        parameters[effect] = p
    best = max(gain for gain, _ in scored.values())
    healthy = float(np.exp(healthy_level(op, mv) / op.size))
    left = healthy * float(np.exp(-max(best, 0.0) / op.size))
    # friction is only known up to its model; the other maps are exact
    winner = max(scored, key=lambda e: scored[e][0])
    most = 0.85 if winner == "stiction" else 0.3
    return left > most * healthy and left > max(0.15, 0.03 * float(np.std(op)))
