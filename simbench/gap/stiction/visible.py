"""Find which size of stiction a record would have shown.

Given a loop file, friction is put into the loop, which is simulated and weighed as the record was.
Of a loop that was identified from its record no simulation tells, as its load has taken over what
friction did: what is denied there is no less than a share of OP's range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from simbench.detectors.errors import UserError
from simbench.detectors.judge import UNFIT
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.recorded_mv import least_band
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import Situation, load_memory
from simbench.gap.stiction.altered import FRICTION, with_friction
from simbench.gap.stiction.measured import op_range
from simbench.gap.stiction.probability import probability
from simbench.gap.thresholds import (
    CALLED,
    CLEARLY,
    FEWEST_PER_PERIOD,
    INTEGRAL,
    LEAST_NATS,
    NARROWEST,
    REVERSALS,
    TEMPERATURE,
    WORTH_REPAIRING,
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
    """The S (%) from which stiction can be denied, infinite where it cannot; `open` why not, ""
    where it can; `again` how to record again, where that is why.
    """

    S: float
    open: str = ""
    again: str = ""

    def sentence(self, percent: float, unit: str) -> str:
        """Return what is not denied, S in a unit of which one % of travel is `percent`."""
        return self.open or f"friction smaller than {self.size(percent, unit)} cannot be excluded"

    def size(self, percent: float, unit: str) -> str:
        """Return the S from which stiction is denied, in such a unit, "" where it is not."""
        return "" if self.open else f"S = {self.S * percent:.2g} {unit}"


def visible(view: Assessment) -> Visible:
    """Return which stiction a record alone would have shown, by its position of the valve where it
    has one.

    Between two samples that are too far apart a slip goes unseen, and a valve rests that nothing
    asks to move.
    """
    s = view.situation
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
    if not swing.sustained and not _integrates(_without_friction(view), s.record.duration):
        return Visible(
            math.inf,
            "friction cannot be ruled out: no integral action moves OP until a valve that sticks"
            f" moves, and by most of its range OP turned fewer than {REVERSALS:g} times",
        )
    return Visible(max(WORTH_REPAIRING, NARROWEST * op_range(s.op)))


def visible_in(view: Assessment) -> Visible:
    """Return which stiction a record would have shown, were it in the loop whose file was given."""
    seen = visible(view)
    if seen.open or view.situation.record.mv is not None:
        return seen
    asked = largest_asked(view.situation.op)
    loop = _without_friction(view)
    smallest = math.inf
    for k in range(_MOST_SIZES):
        S = asked * _FINER**-k
        if S <= 0.0 or not _shows(view, loop, S):
            break
        smallest = S
    why = "no size of stiction that was tried would have shown in this record"
    return Visible(smallest, why if math.isinf(smallest) else "")


def _by_mv(s: Situation) -> Visible:
    """Return which stiction MV would have shown: any band that it tells and OP turns through."""
    least = least_band(np.asarray(s.record.mv))
    asked = largest_asked(s.op)
    if least <= asked:
        return Visible(least)
    why = f"OP turned by more than {asked:.2g} % under {REVERSALS:g} times, which MV hardly shows"
    return Visible(math.inf, why)


def _without_friction(view: Assessment) -> Loop:
    """Return the loop that was fitted to a record, without friction."""
    return ClosedLoops(view, 0).loop([e for e in view.situation.proven if e != FRICTION])


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


def _shows(view: Assessment, loop: Loop, S: float) -> bool:
    """Return whether stiction of a size is called in three quarters of simulations."""
    called = 0
    for seed in range(_SEEDS):
        called += _is_called(view, loop, S, seed)
        if called == CALLED or seed + 1 - called > _SEEDS - CALLED:
            break
    return called == CALLED


def _is_called(view: Assessment, loop: Loop, S: float, seed: int) -> bool:
    """Return whether stiction of a size, put into a loop, is called in one simulation of it."""
    s = view.situation
    try:
        run = simulate(with_friction(loop, S, _JUMP * S), seed, kick=S).record
    except UserError:
        return False
    op, pv = as_archived(s, run.op, run.pv)
    if not set(UNFIT).isdisjoint(Prepared(LoopRecord(op, pv, s.record.Ts)).flags):
        return False
    return _probability(view, op, pv, S) > CLEARLY


def _probability(view: Assessment, op: np.ndarray, pv: np.ndarray, S: float) -> float:
    """Return the probability of stiction of a simulated record whose S is known, so that no search
    is needed: fits begin at the true numbers.
    """
    s = view.situation
    start = view.base
    data = replace(s.data, u=op, y=np.ascontiguousarray(pv, dtype=float))
    engine = Engine(data, load_memory(s))
    spec = replace(start.spec, valve=kernels.STICK)
    names = tuple(name for name in spec.names if name not in ("S", "J"))
    sound = engine.fit(start.spec, start.theta)
    at = {**start.theta, "S": S, "J": _JUMP * S}
    sticky = engine.fit(spec, at, search=names, steps=3)
    return probability(TEMPERATURE * (sticky.loglik - sound.loglik - LEAST_NATS))
