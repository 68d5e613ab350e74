"""Compute what a test is expected to tell: simulate it under each explanation that is still
probable, and see which ones it separates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.special import softmax

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import LEAST_NATS, Assessment
from simbench.gap.decide.beside_tests import through_effect
from simbench.gap.decide.classify import TEMPERATURE
from simbench.gap.effects import recogniser
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.joint import JointEngine, JointPart
from simbench.gap.likelihood.model import Data, Fit
from simbench.gap.plan.menu import Limits, Trial, sized
from simbench.gap.situation import Situation, load_memory, through_valve
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN, block_of

_TESTS = ("mv", "sp_steps", "kc_half", "bump", "stairs", "still", "fast", "lab")
_LIKELY = 0.02  # probability from which an explanation is simulated
# probability from which nothing is asked: such answers are right, and another record can only
# unsettle them
_SETTLED = 0.9
_LOOK_ALIKE = 0.05  # of the likeliest's probability, that what gives the same signals has at least
# times a limit, from which "unknown" rests on single samples, the law or MV, and not on statistics
_CERTAIN = 10.0
# of another "unknown" that one test takes away, whichever it is (median of 69 development tests)
# ...
_KNOWN = 0.34
# ... and that is some known effect's where it follows from a simulation that failed (4 records of
# 4)
_REFUTED = 0.75
# gain in the probability of a right answer, and information in nats, up to which a test tells
# nothing
_NOTHING = 0.02
_MV_NOISE = 0.1  # % that a stem's position is known to
_NUISANCES = ("T", "Td", "load_time", "load_lag", "load", "noise_std", "colour")
_APART = 3.0  # nats, tempered, from which two explanations count as separated


@dataclass(frozen=True, eq=False)
class Expected:
    """A test and what it may be expected to tell.

    `nats` (runs, explanations, explanations): log-likelihood of what each explanation (second axis)
    makes of the test under each (third).
    """

    trial: Trial
    pv_excursion: float
    pv_variance: float
    nats: np.ndarray
    information: float
    p_right: float


@dataclass(frozen=True, eq=False)
class PlannedTests:
    """Tests by what they may be expected to tell, best first; the best pair; or why none would tell
    anything.
    """

    effects: tuple[str, ...]
    probability: np.ndarray
    tests: tuple[Expected, ...]
    pair: tuple[str, ...]
    p_right: float
    why: str = ""
    left_out: tuple[str, ...] = field(default_factory=tuple)

    @property
    def best(self) -> Expected | None:
        """The test to run next; None where none would tell anything."""
        return self.tests[0] if self.tests and not self.why else None

    @property
    def next_test(self) -> dict[str, Any] | None:
        """The test to run next, as the diagnosis reports it."""
        one = self.best
        if one is None:
            return None
        return {
            "test": one.trial.id,
            "size": one.trial.size,
            "hold_s": one.trial.hold_s,
            "separates": self.separated(one),
            "p_right_after": one.p_right,
            "says": one.trial.says,
        }

    def as_json(self) -> dict[str, Any]:
        """Return the plan as the contract has it."""
        tests = [
            {
                "id": x.trial.id,
                "settings": x.trial.settings,
                "information": x.information,
                "p_right": x.p_right,
                "minutes": x.trial.minutes,
                "pv_excursion": x.pv_excursion,
            }
            for x in self.tests
        ]
        return {"tests": tests, "pair": list(self.pair), "why": self.sentence()}

    def sentence(self) -> str:
        """Return the plan in a sentence."""
        one = self.best
        if one is None:
            return self.why
        text = f"{one.trial.id}: {one.trial.says}"
        if len(self.pair) == 2 and self.p_right > one.p_right:
            text += f"; the best pair is {' and '.join(self.pair)}, {self.p_right:.2f} after both"
        right = (
            f"right with probability {self.probability.max():.2f} now, {one.p_right:.2f} after it"
        )
        return f"{text} ({right}; separates {', '.join(self.separated(one))})"

    def as_text(self) -> str:
        """Return the plan for a terminal."""
        lines = [self.sentence()]
        if self.tests:
            lines += ["", "p_right  information  minutes  PV excursion  test"]
        lines += [
            f"{x.p_right:7.2f}  {x.information:11.2f}  {x.trial.minutes:7.0f} "
            f" {x.pv_excursion:12.3g}  {x.trial.says}"
            for x in self.tests
        ]
        return "\n".join(lines + [f"left out: {why}" for why in self.left_out])

    def separated(self, one: Expected) -> list[str]:
        """Return the explanations that a test distinguishes from the likeliest."""
        mean = one.nats.mean(axis=0)
        apart = TEMPERATURE * (mean[0, 0] - mean[0] + np.diag(mean) - mean[:, 0])
        return [self.effects[0], *(e for e, x in zip(self.effects[1:], apart[1:]) if x > _APART)]


def plan(
    assessment: Assessment,
    probability: Mapping[str, float],
    loops: ClosedLoops,
    limits: Limits | None = None,
    most: int = 6,
    runs: int = 2,
    tests: Sequence[str] = _TESTS,
) -> PlannedTests:
    """Simulate every test of the menu under the likeliest explanations and estimate what each would
    reveal.
    """
    s, limits = assessment.situation, limits or Limits()
    first = _proven_by_op(assessment, probability)
    probability = _second(assessment) if first else probability
    believed, unknown = _believed(assessment, probability)
    ranking = sorted(
        ((e, p) for e, p in believed.items() if e in assessment.parameters or e == NONE),
        key=lambda kv: -kv[1],
    )
    shown = [
        x
        for i, x in enumerate(x for x in ranking if x[0] not in s.proven)
        if i < 2 or x[1] > _LIKELY
    ][:most]
    effects, p = tuple(e for e, _ in shown), np.array([p for _, p in shown])
    why = _no_need(assessment, probability, effects)
    if why:
        return PlannedTests(effects, p, (), (), max(probability.values()), why)
    files = {e: loops.loop([*first, *([] if e == NONE else [e])]) for e in effects}
    bands = [
        band(assessment.parameters[e])
        for e in effects
        if e in assessment.parameters and (band := recogniser(e).band) is not None
    ]
    others = {e: x for e, x in believed.items() if e not in effects}

    def gained(nats: np.ndarray, *ids: str) -> tuple[float, float]:
        information, right = _gained(p, nats, unknown)
        return information, right + sum(
            x for e, x in others.items() if any(_seen_by(i, e) for i in ids)
        )

    out, left_out = [], []
    for id_ in tests:
        if id_ in assessment.asked or (id_ == "mv" and assessment.valve_seen):
            continue
        trial, why, excursion = sized(id_, s, files, min(bands, default=0.0), limits)
        nats = None if trial is None else _nats(trial, assessment, effects, files, runs)
        if trial is None or nats is None:
            left_out.append(why or f"{id_}: it cannot be simulated")
            continue
        record = trial.run(files[effects[0]], 0)
        information, right = gained(nats, id_)
        out.append(
            Expected(
                trial,
                excursion,
                0.0 if record is None else float(np.var(record.pv)),
                nats,
                information,
                right,
            )
        )
    out.sort(key=lambda x: (-round(x.p_right, 2), -x.information, x.trial.minutes))
    pair: tuple[str, ...] = ()
    now = max(unknown, float(p.max()))
    best = max((x.p_right for x in out), default=now)
    if len(out) > 1:
        # of pairs that tell the same, the one whose first test tells more comes first
        pairs = [
            (gained(a.nats + b.nats, *(ids := (a.trial.id, b.trial.id)))[1], ids)
            for a, b in combinations(out, 2)
        ]
        right, pair = max(pairs, key=lambda x: x[0])
        best = max(best, right)
    tells = best > now + _NOTHING or max((x.information for x in out), default=0.0) > _NOTHING
    why = "" if tells else "no test on the menu would tell the remaining explanations apart"
    return PlannedTests(effects, p, tuple(out), () if why else pair, best, why, tuple(left_out))


def _believed(
    assessment: Assessment, probability: Mapping[str, float]
) -> tuple[dict[str, float], float]:
    """Return probabilities of the known explanations as a test meets them, and that of "unknown"
    which it leaves.
    """
    p = {e: float(x) for e, x in probability.items() if e != UNKNOWN}
    unknown = float(probability.get(UNKNOWN, 0.0))
    first = max(probability, key=lambda e: probability[e])
    if assessment.worst_test[0] < _CERTAIN:
        refuted = (
            [e for e in (*assessment.chosen[:1], NONE) if p.get(e) == 0.0]
            if first == UNKNOWN
            else []
        )
        if refuted:
            p[refuted[0]] = _REFUTED * unknown
        unknown *= 1.0 - (_REFUTED if refuted else _KNOWN)
    for e in _look_alikes(assessment, first):
        p[e] = max(p.get(e, 0.0), _LOOK_ALIKE * p[first])
    whole = sum(p.values())
    return {e: (1.0 - unknown) * x / whole for e, x in p.items()}, unknown


def _proven_by_op(assessment: Assessment, probability: Mapping[str, float]) -> list[str]:
    """Return the effect that OP alone proves, if a second is named by likelihood only;
    none otherwise.
    """
    first, second = assessment.chosen[:1], assessment.chosen[1:]
    by_op = [
        e
        for e in first
        if e in assessment.situation.proven and block_of(e) == "controller" and probability[e] > 0.5
    ]
    return by_op if second and not assessment.shown(second[0]) else []


def _second(assessment: Assessment) -> dict[str, float]:
    """Return the probabilities of second effects, and of none, given the first."""
    gains = assessment.log_likelihood_gains_on_top or assessment.log_likelihood_gains
    others = {
        e: gain for e, gain in gains.items() if block_of(e) != block_of(assessment.chosen[0])
    } | {NONE: LEAST_NATS}
    return dict(zip(others, softmax(TEMPERATURE * np.array(list(others.values()))).tolist()))


def _look_alikes(assessment: Assessment, effect: str) -> list[str]:
    """Return the fitted effects that give the same signals as one in some records."""
    groups = set(EFFECTS[effect].alike) if effect in EFFECTS else set()
    return [e for e in assessment.parameters if e != effect and groups & set(EFFECTS[e].alike)]


def _no_need(
    assessment: Assessment, probability: Mapping[str, float], effects: Sequence[str]
) -> str:
    """Return why no test is needed, or would help; "" where one might."""
    first = max(probability, key=lambda e: probability[e])
    if (
        set(assessment.chosen) & set(assessment.situation.proven)
        and probability.get(assessment.chosen[0], 0.0) > 0.5
    ):
        return f"{assessment.chosen[0]} is shown by the record itself; no test would tell more"
    # of a slow load and a drift no other test shows which it is
    unsettled = "lab" not in assessment.asked and any(
        _seen_by("lab", e) for e in _look_alikes(assessment, first)
    )
    if probability[first] >= _SETTLED and not unsettled:
        return (
            f"no further test is recommended: {first} has probability {probability[first]:.2f},"
            " and another test is unlikely to add information"
        )
    if first == UNKNOWN and assessment.worst_test[0] >= _CERTAIN:
        why = assessment.unexplained[assessment.worst_test[1]]
        return f"no known effect explains it ({why}), which no test on the menu would change"
    return (
        "" if len(effects) > 1 else "one explanation is left; no test on the menu would tell more"
    )


def _seen_by(id_: str, effect: str) -> bool:
    """Return whether a test observes an effect by itself: MV a valve's, lab samples a sensor's, a
    long one the load again.
    """
    if effect == NONE:
        return False
    if id_ == "sp_steps":
        return block_of(effect) == "disturbance"
    return {"mv": recogniser(effect).by_mv, "lab": recogniser(effect).by_lab}.get(id_) is not None


def _gained(p: np.ndarray, nats: np.ndarray, unknown: float = 0.0) -> tuple[float, float]:
    """Return expected information (nats) and probability of a right answer after a test; what is
    not simulated stays open.
    """
    share = p / p.sum()
    log = np.log(np.maximum(share, 1e-12))
    after = softmax(log + TEMPERATURE * nats, axis=2)
    entropy = -np.sum(after * np.log(np.maximum(after, 1e-12)), axis=2).mean(axis=0)
    right = np.maximum(p.sum() * after.max(axis=2), unknown).mean(axis=0)
    return -float(share @ log) - float(share @ entropy), float(share @ right)


def _nats(
    trial: Trial,
    assessment: Assessment,
    effects: Sequence[str],
    files: Mapping[str, Loop],
    runs: int,
) -> np.ndarray | None:
    """Return log-likelihoods (runs, explanations, explanations) of simulated tests."""
    out = np.zeros((runs, len(effects), len(effects)))
    for i in range(runs):
        for a, made_by in enumerate(effects):
            record = trial.run(files[made_by], 1000 + i)
            if record is None:
                return None
            for b, effect in enumerate(effects):
                apart = _seen_by(trial.id, effect) != _seen_by(trial.id, made_by)
                out[i, a, b] = (
                    _level(trial, record, assessment, effect) - apart * _APART / TEMPERATURE
                )
    # on average nothing explains a test better than what made it (Gibbs); a fit that does was
    # merely reached sooner
    mean = out.mean(axis=0)
    return out - np.maximum(mean - np.diag(mean)[:, None], 0.0)


def _level(trial: Trial, record: LoopRecord, assessment: Assessment, effect: str) -> float:
    s = assessment.situation
    p = assessment.parameters.get(effect, {})
    if trial.id == "lab":
        # except for what falsifies the measurement it shows nothing that the record does not
        return 0.0
    op, level, by_mv = np.asarray(record.op), 0.0, trial.id == "mv" or s.record.mv is not None
    if by_mv:
        valve = block_of(effect) == "valve"
        expected = (
            through_effect(s, effect, p, op, trial.Ts)
            if valve
            else through_valve(op, s.baseline.valve, trial.Ts)
        )
        off = float(np.mean((np.asarray(record.mv) - expected) ** 2))
        level = -0.5 * op.size * float(np.log(off + _MV_NOISE**2))
    u = np.asarray(record.mv) if by_mv else through_valve(op, s.baseline.valve, trial.Ts)
    data = replace(s.data, u=np.ascontiguousarray(u), y=np.ascontiguousarray(record.pv), late=0)
    fit = assessment.candidates[effect].fit if effect in assessment.candidates else assessment.base
    return level + _likelihood(data, trial, s, fit, by_mv)


def _likelihood(data: Data, trial: Trial, s: Situation, fit: Fit, by_mv: bool) -> float:
    """Return the log-likelihood of a test under a fit: its plant held as a baseline is, its effect
    as fitted, loads free.
    """
    spec = replace(fit.spec, channels=(), jumps=(), free=frozenset(), start=0.0)
    if by_mv:
        spec = replace(
            spec, valve=kernels.IDEAL, moves=None, pole="" if spec.pole == "valve" else spec.pole
        )
    pace = s.record.Ts / trial.Ts
    pair = JointEngine([JointPart(s.data), JointPart(data, pace)], load_memory(s))
    spec, theta = pair.one_of(1, replace(spec, channels=()), fit.theta)
    K = (fit.K or s.data.K) / (pace if s.integrating else 1.0)
    held = replace(data, K=K, T=theta["T"] if data.T > 0.0 else 0.0, Td=theta["Td"])
    engine = Engine(held, pair.engines[1].longest_load)
    return engine.fit(spec, theta, search=_NUISANCES, steps=3).loglik
