"""Estimate by features of closed-loop simulations the parameters that the open-loop likelihood
leaves uncertain (McFadden 1989).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from detectors.errors import UserError
from simbench.gap.closed_loop.gap import Runs, held_out, simulate_runs
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.closed_loop.summary_features import CAP, distance, features, seed_spread
from simbench.gap.discover.effect_file import lent_effect
from simbench.gap.discover.search import Finding
from simbench.gap.law import FoundLaw
from simbench.gap.likelihood.model import Fit
from simbench.gap.situation import Situation
from simbench.loop.laws import LAW_FORMS

_WARM_UP = 0.2  # share of the first part in which a loop begun at rest is not yet the record's
_SEEDS = 6  # runs of a trial ...
_APART = 100  # ... and how far their seeds lie from those that measure the gap
_LOAD = (-0.5, 0.7)  # first steps of the logarithms of the load's size and memory ...
_NUMBER = -0.3  # ... and of the share by which a number changes
_TRIALS = 30  # times the load's fit, twice that with the law's numbers
_PLAINLY = 0.8  # times the distance, below which other numbers than the likeliest are believed


def runs_with(
    s: Situation, fit: Fit, law: FoundLaw, name: str, seed: int, **more: Any
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
    return simulate_runs(s, loop, seed, law.numbers["S"] if law.form == "memory" else 0.0, **more)


def matched(s: Situation, finding: Finding, seed: int) -> Finding:
    """Return a finding with the load, and law, with which the simulated loop is nearest to the part
    that both were fitted to.

    The load's size and memory are searched. The numbers of a law that the likelihood found are
    searched too, and kept only if that plainly reduces the distance.
    """
    law, first = finding.law, held_out(s)
    if law is None:
        return finding
    part = slice(int(_WARM_UP * first), first)
    many: dict[str, Any] = {"seeds": _SEEDS, "part": part}
    tuned = simulate_runs(
        s, fixed_loop(s, finding.null, {}, load=finding.fit), seed + _APART, **many
    )
    if tuned is None:
        return finding
    ruler = seed_spread(tuned.features)
    real = np.array([*features(s.op[part], np.asarray(s.record.pv)[part], s.sp[part]).values()])
    rules = LAW_FORMS[law.form].numbers
    searched = [
        k
        for k, v in law.numbers.items()
        if finding.fit is not finding.null and v != rules[k].identity and k[0] != "q"
    ]

    def at(x: np.ndarray) -> tuple[FoundLaw, Fit]:
        theta, by = finding.fit.theta, dict(zip(("load", "load_time"), np.exp(x)))
        load = {
            k: v * by[k.replace("_jump", "")]
            for k, v in theta.items()
            if k in ("load", "load_jump", "load_time")
        }
        numbers = {k: float(law.numbers[k] * (1.0 + share)) for k, share in zip(searched, x[2:])}
        return replace(law, numbers=law.numbers | numbers), replace(
            finding.fit, theta={**theta, **load}
        )

    def off(x: np.ndarray) -> float:
        tried, fit = at(x)
        runs = runs_with(s, fit, tried, name, seed + _APART, **many)
        return 2.0 * CAP if runs is None else distance(real, runs.features, ruler)

    def nearest(steps: list[float], trials: int) -> tuple[np.ndarray, float]:
        simplex = np.vstack([np.zeros(len(steps)), np.diag(steps)])
        options = {"initial_simplex": simplex, "maxfev": trials}
        best = scipy.optimize.minimize(off, simplex[0], method="Nelder-Mead", options=options)
        return best.x, float(best.fun)

    with lent_effect(law) as name:
        x, least = nearest([*_LOAD], _TRIALS)
        if searched:
            y, less = nearest([*_LOAD, *[_NUMBER] * len(searched)], 2 * _TRIALS)
            x = y if less < _PLAINLY * least else x
    nearer, fit = at(x)
    return finding._replace(law=nearer, fit=fit)
