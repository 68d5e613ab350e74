"""Find which size of stiction a record would have shown: friction is put into the loop that was
fitted to it, the loop is simulated, and what it shows is weighed as the record was.

Stiction is denied only where friction as large as the record's own swing asks for would have shown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from simbench.detectors.errors import UserError
from simbench.detectors.judge import UNFIT
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.fits.regression import friction_nats
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.beside_tests import least_band
from simbench.gap.effects.stiction import NUMBERS
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Fit, size_penalty
from simbench.gap.likelihood.valves import valve_regressed
from simbench.gap.situation import Situation, load_memory
from simbench.gap.stiction.altered import FRICTION, with_friction
from simbench.gap.stiction.any_spectrum import nats_of
from simbench.gap.stiction.measured import op_range
from simbench.gap.stiction.probability import FrictionEvidence, log_odds, probability
from simbench.gap.thresholds import (
    CALLED,
    CLEARLY,
    FEWEST_PER_PERIOD,
    INTEGRAL,
    LEAST_NATS,
    LEAST_REGRESSED,
    REVERSALS,
    TEMPERATURE,
)
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

# simulations of each size
_SEEDS = 8
_FINER = 1.5  # factor between sizes that are tried
_MOST_SIZES = 5
_JUMP = 0.5  # J over S of the friction that is tried
_PACE = 30.0  # samples per period that are asked for


@dataclass(frozen=True)
class Visible:
    """The smallest S (%) that would have shown, infinite where none does that was tried; `open` why
    stiction cannot be denied, "" where it can; `again` how to record again, where that is why.
    """

    S: float
    open: str = ""
    again: str = ""

    def sentence(self, percent: float, unit: str) -> str:
        """Return what would have shown, S in a unit of which one % of travel is `percent`."""
        if self.open:
            return self.open
        S = self.S * percent
        return f"stiction from about S = {S:.2g} {unit} on would have shown in this record"


def visible(views: Sequence[Assessment]) -> Visible:
    """Return which stiction a record would have shown, were it in the loop that was fitted to it;
    `views` are its assessments with each plant that it may have, the likelier first.
    """
    s = views[0].situation
    if s.record.mv is not None:
        return _by_mv(s)
    swing = find_oscillation(s.op, np.asarray(s.record.pv), s.record.Ts)
    pace = swing.period_s / s.record.Ts if swing.sustained else math.inf
    if pace < FEWEST_PER_PERIOD:
        return Visible(
            math.inf,
            f"{pace:.2g} samples per period are too few to rule friction out",
            f"record OP and PV every {swing.period_s / _PACE:.2g} s or faster",
        )
    asked = largest_asked(s.op)
    loop = ClosedLoops(views[0], 0).loop([e for e in s.proven if e != FRICTION])
    if not swing.sustained and not _integrates(loop, s.record.duration):
        return Visible(
            math.inf,
            "friction cannot be ruled out: no integral action moves OP until a valve that sticks"
            f" moves, and by most of its range OP turned fewer than {REVERSALS:g} times",
        )
    smallest = math.inf
    for k in range(_MOST_SIZES):
        S = asked * _FINER**-k
        if S <= 0.0 or not _shows(views, loop, S):
            break
        smallest = S
    if math.isinf(smallest):
        why = "no size of stiction that was tried would have shown in this record"
        return Visible(smallest, why)
    return Visible(smallest)


def _by_mv(s: Situation) -> Visible:
    """Return which stiction MV would have shown: any band that it tells and OP turns through."""
    least, asked = least_band(np.asarray(s.record.mv)), largest_asked(s.op)
    if least <= asked:
        return Visible(least)
    why = f"OP turned by more than {asked:.2g} % under {REVERSALS:g} times, which MV hardly shows"
    return Visible(math.inf, why)


def largest_asked(op: np.ndarray) -> float:
    """Return the largest S (unit of OP) by which OP (n,) turned several times: a valve is asked to
    reverse through it.
    """
    turns = [scipy.signal.find_peaks(x, prominence=1e-9)[1]["prominences"] for x in (op, -op)]
    sizes = np.sort(np.concatenate(turns))[::-1]
    return float(sizes[int(REVERSALS) - 1]) if sizes.size >= REVERSALS else 0.0


def _integrates(loop: Loop, duration: float) -> bool:
    Ti = loop.controller.Ti
    return Ti is not None and Ti < INTEGRAL * duration


def _shows(views: Sequence[Assessment], loop: Loop, S: float) -> bool:
    """Return whether stiction of a size is called in three quarters of simulations."""
    called = 0
    for seed in range(_SEEDS):
        called += _called(views, loop, S, seed)
        if called == CALLED or seed + 1 - called > _SEEDS - CALLED:
            break
    return called == CALLED


def _called(views: Sequence[Assessment], loop: Loop, S: float, seed: int) -> bool:
    """Return whether stiction of a size, put into a loop, is called in one simulation of it."""
    s = views[0].situation
    try:
        run = simulate(with_friction(loop, S, _JUMP * S), seed, kick=S).record
    except UserError:
        return False
    op, pv = as_archived(s, run.op, run.pv)
    if not set(UNFIT).isdisjoint(Prepared(LoopRecord(op, pv, s.record.Ts)).flags):
        return False
    return _probability(views, op, pv, S) > CLEARLY


def _probability(views: Sequence[Assessment], op: np.ndarray, pv: np.ndarray, S: float) -> float:
    """Return the probability of stiction of a simulated record whose S is known, so that no search
    is needed: fits begin at the true numbers, and at those of each plant that may be the loop's.
    """
    pairs = [_refitted(view, op, pv, S) for view in views]
    if views[0].situation.trusted:
        [(sound, sticky)] = pairs
        return probability(TEMPERATURE * (sticky.loglik - sound.loglik - LEAST_NATS))
    prices = [0.0 if v.situation.integrating else size_penalty(op.size, 1.0) for v in views]
    sound, sticky = (
        max((nats_of(fit, price) for fit, price in zip(fits, prices)), key=np.sum)
        for fits in zip(*pairs)
    )
    regressed, cycles = valve_regressed(op, pv, S, _JUMP * S)
    gain = (
        friction_nats(sticky, sound)
        - size_penalty(op.size, NUMBERS)
        + max(regressed, LEAST_REGRESSED)
    )
    share = S / (op_range(op) or 1.0)
    return probability(log_odds(FrictionEvidence(gain, share, cycles)))


def _refitted(view: Assessment, op: np.ndarray, pv: np.ndarray, S: float) -> tuple[Fit, Fit]:
    """Return the fits of a simulated record with a sound valve and with known friction."""
    s, start = view.situation, view.base
    data = replace(s.data, u=op, y=np.ascontiguousarray(pv, dtype=float))
    engine = Engine(data, load_memory(s))
    spec = replace(start.spec, valve=kernels.STICK)
    names = tuple(name for name in spec.names if name not in ("S", "J"))
    at = {**start.theta, "S": S, "J": _JUMP * S}
    return engine.fit(start.spec, start.theta), engine.fit(spec, at, search=names, steps=3)
