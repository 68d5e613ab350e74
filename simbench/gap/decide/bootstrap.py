"""What chance alone does on this loop: records without effect, simulated and diagnosed like the real one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from joblib import Parallel, delayed

from detectors.errors import UserError
from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.decide.assess import LIMITS, Assessment, assess
from simbench.gap.decide.classify import Shift, classify
from simbench.gap.intake.check import check
from simbench.gap.likelihood.engine import NOMINAL
from simbench.loop.effects import NONE, UNKNOWN
from simbench.loop.simulate import simulate

TRIALS = 8
KINDER = (-1.0, 4.0)  # logits


@dataclass(frozen=True)
class Chance:
    """What is found on 95 % of records without effect: the best wrong effect's gain, residual tests, logits to correct by."""

    gain: float
    tests: dict[str, float]
    shift: Shift
    trials: int


def chance(found: Assessment, seed: int = 0, jobs: int = 1, trials: int = TRIALS) -> Chance | None:
    """Simulate and assess records without effect.

    Parameters
    ----------
    found : Assessment
        Of the real record: its set point, length, fitted load and noise are used; the nominal plant is drawn within +-10 %.
    seed : int
        Root of every random stream.
    jobs : int
        Processes.
    trials : int
        Records.

    Returns
    -------
    Chance or None
        None when the loop without effect cannot be simulated.
    """
    s = found.situation
    loop = fixed_loop(s, found.base, {}, plant="fitted", load=found.base)
    one = delayed(_trial)
    with Parallel(n_jobs=jobs) as parallel:
        results = [r for r in parallel(one(loop, s.record, s.baseline, s.trusted, [seed, 977, i]) for i in range(trials)) if r]
    if len(results) < 3:
        return None
    gain, none, unknown = (_high([r[i] for r in results]) for i in range(3))
    # the trees know what chance does on most loops; this loop may be kinder or crueller, within reason
    shift = Shift(float(np.clip(none, *KINDER)), float(np.clip(unknown, 0.0, KINDER[1])))
    usual = {name: max(r[3][name] for r in results) for name in LIMITS}
    return Chance(gain, usual, shift, len(results))


def _high(values: list[float]) -> float:
    # a Gumbel tail through mean and spread: fewer trials than its own 95 % point would need
    return float(np.mean(values)) + 1.87 * float(np.std(values, ddof=1))


def _trial(
    loop: Loop, record: LoopRecord, baseline: Loop, trusted: bool, seed: list[int]
) -> tuple[float, float, float, dict[str, float]] | None:
    """Return the best wrong gain, the logits of the best wrong effect over none and of unknown, and residual tests."""
    rng = np.random.default_rng(seed)
    table = loop.to_table()
    names = ("K", "Td", "T") if loop.plant.T is not None else ("K", "Td")
    for name in names:
        table["plant"][name] = getattr(baseline.plant, name) * float(rng.uniform(1 - NOMINAL, 1 + NOMINAL))
    try:
        run = simulate(Loop.from_table(table), seed=int(rng.integers(2**31))).record
        twin = replace(
            record, op=run.op, pv=run.pv, sp=run.sp, mv=None if record.mv is None else run.mv, op_span=(0.0, 100.0), notes=()
        )
        trial = assess(check(twin, baseline, trusted))
    except UserError:
        return None
    p = classify(trial).probability
    none, unknown = p[NONE], min(p[UNKNOWN], 1.0 - 1e-9)
    wrong = max(v for e, v in p.items() if e not in (NONE, UNKNOWN))
    return trial.best_log_likelihood_gain, float(np.log(wrong / none)), float(np.log(unknown / (1.0 - unknown))), trial.tests
