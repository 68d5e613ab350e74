"""Ask whether a model leaves more of a record than it leaves of its own simulations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit, logit, stdtr

from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.level import kick_of, run_with_seeds
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.effects import Parameters
from simbench.gap.intake.observed import before_sensor
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit
from simbench.gap.likelihood.residual_tests import memory_and_input, shifts
from simbench.gap.situation import Situation, load_memory, through_valve
from simbench.gap.thresholds import EDGE, LEAST_SCATTER, TAILS, UNKNOWN_BEFORE
from simbench.loop.effects import block_of

_RUNS = 24  # simulations of the model
_BLOCKS = {"memory": "disturbance", "input": "process", "shifts": "sensor"}


@dataclass(frozen=True)
class Left:
    """What speaks for something unknown: its probability, its block, and what is seen, in words."""

    probability: float
    block: str
    message: str


def left_over(
    s: Situation,
    fits: tuple[Fit, Fit],
    effects: dict[str, Parameters],
    explained: float,
    seed: int,
) -> tuple[Left, ...]:
    """Return what every residual test says of the best model of a record.

    `fits` are the best model and the one in which jumps of PV are looked for, `effects` those of
    the best model with their numbers, `explained` the nats that they bring.
    """
    # the same tests of the record and of simulations
    engine = Engine(s.data, load_memory(s))
    [seen] = _test_records([engine], [fits])
    simulated = _simulated_tests(s, fits, effects, seed)
    if not simulated:
        return ()

    # where the record lies among these
    out = []
    for name, block in _BLOCKS.items():
        others = np.array([tests[name] for tests in simulated])
        beyond = seen[name] - float(others.mean())
        p = _chance_beyond(beyond, others)
        message = (
            f"the best model does not explain everything ({name}: {seen[name]:.0f} nats, in"
            f" {len(others)} simulations of it {others.min():.0f} to {others.max():.0f})"
        )
        out.append(Left(_probability_of_unknown(p, beyond, explained), block, message))
    return tuple(out)


def _chance_beyond(beyond: float, others: np.ndarray) -> float:
    """Return the chance that one of the three tests of a record lies so far beyond the mean of its
    simulations.
    """
    scatter = max(float(others.std(ddof=1)), LEAST_SCATTER) * np.sqrt(1.0 + 1.0 / others.size)
    return min(len(_BLOCKS) * float(stdtr(TAILS, -beyond / scatter)), 1.0)


def _probability_of_unknown(chance: float, beyond: float, explained: float) -> float:
    """Return the probability that something unknown is lacking, which a test can only raise.

    A chance of p makes it 1 / (-e p ln p) times as likely at most (Sellke, Bayarri and Berger
    2001). Little that is left beside much that is explained says that the model is not quite true,
    not that it is another one.
    """
    before = float(logit(UNKNOWN_BEFORE))
    share = min(beyond / explained, 1.0)
    if chance >= np.exp(-1.0) or share <= 0.0:
        return float(expit(before))
    by_test = 2.0 * np.log(share) - np.log(-np.e * chance * np.log(chance))
    return min(float(expit(before + max(by_test, 0.0))), float(EDGE))


def _test_records(
    engines: Sequence[Engine], fits: Sequence[tuple[Fit, Fit]]
) -> list[dict[str, float]]:
    """Return the tests of one model on several records."""
    jumps = shifts(engines[0], [other for _, other in fits])
    tests = []
    for engine, (final, _), jump in zip(engines, fits, jumps):
        tests.append(memory_and_input(final, engine.data) | {"shifts": jump})
    return tests


def _simulated_tests(
    s: Situation, fits: tuple[Fit, Fit], effects: dict[str, Parameters], seed: int
) -> list[dict[str, float]]:
    """Return the tests of simulations of a model, archived as the record is; none where it cannot
    be simulated.
    """
    # the loop with what stands between OP and PV: what a load does is in every model
    inner = {}
    for e, p in effects.items():
        if block_of(e) != "disturbance":
            inner[e] = p
    loop = fixed_loop(s, fits[0], inner, jumps=False)
    kick = max(map(kick_of, inner.values()), default=0.0)
    runs = run_with_seeds(loop, seed, _RUNS, kick) or []

    # the engine with the same parameters, on each of its records
    valve = next(({"name": e, **p} for e, p in inner.items() if block_of(e) == "valve"), None)
    effect = None if s.record.mv is None else valve
    engines = []
    for run in runs:
        op, pv = as_archived(s, run.op, run.pv)
        u = through_valve(op, s.baseline, s.record.Ts, effect)
        y, _ = before_sensor(s.baseline, s.record.Ts, pv, 0.0)
        engines.append(Engine(replace(s.data, u=u, y=y), load_memory(s)))
    refits = []
    for e in engines:
        refits.append((e.at(fits[0].spec, fits[0].theta), e.at(fits[1].spec, fits[1].theta)))
    if engines:
        return _test_records(engines, refits)
    return []
