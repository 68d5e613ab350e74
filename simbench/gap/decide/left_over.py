"""Ask whether a model leaves more of a record than it leaves of its own simulations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from scipy.special import expit, logit, stdtr

from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.level import kick_of, run_with_seeds
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.effects import Parameters
from simbench.gap.intake.observed import before_sensor
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data, Fit
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

    # The same tests on what both models leave of each run
    refits = []
    for e in engines:
        refits.append((e.at(fits[0].spec, fits[0].theta), e.at(fits[1].spec, fits[1].theta)))
    if engines:
        return _test_records(engines, refits)
    return []


# --- Test the prediction errors of a fit: the nats that a plain model of these errors would
# explain, beyond what chance brings.

# share of PV's standard deviation: innovations below it are a simulation's, and nothing can be
# missing from them
_NOTHING = 1e-4
_LAGS = 25  # samples over which innovations may remember, or follow from OP
# samples over which a jump of PV is compared with what it may be else, and the first that are not
# asked
_REACH = 400
_START = 10
_BESIDE = 7  # samples about a jump in which the others may lie


def memory_and_input(fit: Fit, data: Data) -> dict[str, float]:
    """Return the nats of correlations of innovations over 25 lags, with themselves (`memory`) and
    with past OP (`input`); 0 where the model explains PV to the last digit.
    """
    if innovation_std(fit) < _NOTHING * data.size:
        return {"memory": 0.0, "input": 0.0}

    # innovations and changes of OP of unit size
    x = np.asarray(fit.residual)[kernels.SKIP :]
    x = np.clip(x, -6.0, 6.0) - np.mean(x)
    n = x.size
    power = float(np.mean(x**2)) or 1.0
    du = np.diff(data.u)[kernels.SKIP - 1 :]
    du = (du - du.mean()) / (float(np.std(du)) or 1.0)

    # a squared correlation of chance is worth half a nat for each of its n samples
    lags = range(1, min(_LAGS, n // 4) + 1)
    rho = np.array([float(np.mean(x[k:] * x[:-k])) / power for k in lags])
    cross = np.array([float(np.mean(x[k:] * du[: n - k])) / np.sqrt(power) for k in lags])
    seen = {"memory": rho, "input": cross}
    return {name: 0.5 * float(n * np.sum(r**2) - r.size) for name, r in seen.items()}


def shifts(engine: Engine, fits: Sequence[Fit]) -> list[float]:
    """Return, of fits of one model to several records, the nats of the clearest jump of PV within a
    sample, to stay, on top of a wild sample and of a jump of the load in its place, less those that
    chance brings.
    """
    # what each of the three leaves in the innovations
    n = engine.data.n
    reach = min(_REACH, n // 3)
    model = engine.noise_model(fits[0].spec, fits[0].theta)
    step = (np.arange(n) >= reach).astype(float)
    wild = (np.arange(n) == reach).astype(float)
    load = np.roll(kernels.plant(step, model.T, 0.0, model.tau), -1)
    seen = kernels.whiten(np.array([step, wild, load]), model, kernels.NO_JUMPS)[0]
    seen = seen[:, reach : 2 * reach]

    def nats(along: np.ndarray, rows: slice) -> np.ndarray:
        squares = seen[rows] @ seen[rows].T
        least = _NOTHING**2 * np.trace(squares) * np.eye(len(squares))
        return 0.5 * np.sum(along[rows] * np.linalg.solve(squares + least, along[rows]), axis=0)

    # where each record's innovations are most like the three together
    found = []
    for fit in fits:
        residual = np.asarray(fit.residual).copy()
        residual[: kernels.SKIP] = 0.0
        along = np.array([scipy.signal.correlate(residual, one, "valid") for one in seen])
        # what is beside explains a part of it too
        others = scipy.ndimage.maximum_filter1d(nats(along, slice(1, 3)), _BESIDE)
        found.append(float((nats(along, slice(3)) - others)[_START:].max() - np.log(n)))
    return found


def innovation_std(fit: Fit) -> float:
    """Return the innovations' standard deviation (PV units), from the likelihood."""
    left = np.asarray(fit.residual)[kernels.SKIP :]
    log_variance = (
        -2.0 * fit.loglik / left.size - float(left @ left) / left.size - np.log(2.0 * np.pi)
    )
    return float(np.exp(0.5 * log_variance))
