"""Estimate by features of closed-loop simulations the load that the open-loop likelihood leaves
uncertain (McFadden 1989).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from simbench.detectors.errors import UserError
from simbench.gap.closed_loop.gap import Runs, held_out, simulate_runs
from simbench.gap.closed_loop.level import RUNS
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.closed_loop.summary_features import CAP, distance, features, seed_spread
from simbench.gap.law import FoundLaw
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation

_WARM_UP = 0.2  # share of the first part in which a loop begun at rest is not yet the record's
_SEEDS = 6  # runs of a trial ...
_APART = 100  # ... and how far their seeds lie from those that measure the gap
_STEPS = (-0.5, 0.7)  # first steps of the logarithms of the load's size and memory
_TRIALS = 30  # loads that are tried


def runs_with(
    s: Situation,
    fit: Fit,
    law: FoundLaw,
    name: str,
    seed: int,
    seeds: int = RUNS,
    part: slice | None = None,
) -> Runs | None:
    """Simulate the loop with a law that is lent under a name; None where it cannot be simulated or
    runs away.
    """
    # a law of another gain or time belongs to the baseline's plant
    plant = "baseline" if law.form == "size" else "fitted"
    try:
        loop = fixed_loop(s, fit, {name: dict(law.numbers)}, plant=plant, load=fit)
    except UserError:
        return None
    kick = law.numbers["S"] if law.form == "memory" else 0.0
    return simulate_runs(s, loop, seed, kick, seeds, part)


def matched(s: Situation, null: Fit, fit: Fit, law: FoundLaw, name: str, seed: int) -> Fit:
    """Return the fit of a law, lent under a name, with the load with which the simulated loop is
    nearest to the part that both were fitted to; `null` is the fit without it.
    """
    first = held_out(s)
    part = slice(int(_WARM_UP * first), first)
    bare = fixed_loop(s, null, {}, load=fit)
    runs = simulate_runs(s, bare, seed + _APART, seeds=_SEEDS, part=part)
    if runs is None:
        return fit
    ruler = seed_spread(runs.features)
    real = np.array([*features(s.op[part], np.asarray(s.record.pv)[part], s.sp[part]).values()])

    def with_load(x: np.ndarray) -> Fit:
        more = {k: fit.theta[k] * np.exp(y) for k, y in zip(("load", "load_time"), x)}
        return replace(fit, theta={**fit.theta, **more})

    def off(x: np.ndarray) -> float:
        tried = runs_with(s, with_load(x), law, name, seed + _APART, _SEEDS, part)
        return 2.0 * CAP if tried is None else distance(real, tried.features, ruler)

    simplex = np.vstack([np.zeros(2), np.diag(_STEPS)])
    options = {"initial_simplex": simplex, "maxfev": _TRIALS}
    best = scipy.optimize.minimize(off, simplex[0], method="Nelder-Mead", options=options)
    return with_load(best.x)
