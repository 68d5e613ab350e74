"""Find from which size of stiction on a record denies it, as its valve was asked to move by so
much; alter an identified loop, and keep of a record the samples that were measured.

Between two samples that are too far apart a slip goes unseen, and a valve rests that nothing asks
to move.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from simbench.detectors.quality import steps
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.holds import share_on_lines
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.recorded_mv import least_band
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import Situation, load_memory
from simbench.gap.thresholds import (
    FEWEST_PER_PERIOD,
    INTEGRAL,
    LEAST_NATS,
    MAY_STAND,
    NARROWEST,
    REVERSALS,
    WORTH_REPAIRING,
)
from simbench.scenarios.parts import Part, SetPoint
from simbench.scenarios.spec import Loop

_PACE = 30.0  # samples per period that are asked for


@dataclass(frozen=True)
class Deniable:
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
        if self.open:
            return ""
        return f"S = {self.S * percent:.2g} {unit}"


def deniable(view: Assessment) -> Deniable:
    """Return which stiction a record denies, by its position of the valve where it has one."""
    # With MV the position itself decides
    s = view.situation
    if s.record.mv is not None:
        return _by_mv(s)

    # Too few samples per period hide a valve that sticks
    swing = find_oscillation(s.op, np.asarray(s.record.pv), s.record.Ts)
    if swing.sustained:
        pace = swing.period_s / s.record.Ts
    else:
        pace = math.inf
    if pace < FEWEST_PER_PERIOD:
        return Deniable(
            math.inf,
            f"{pace:.2g} samples per period are too few to rule friction out",
            f"record OP and PV every {swing.period_s / _PACE:.2g} s or faster",
        )

    # Without integral action nothing moves a valve that sticks
    if not swing.sustained and not _integral_acts(_without_friction(view), s.record.duration):
        return Deniable(
            math.inf,
            "friction cannot be ruled out: no integral action moves OP until a valve that sticks"
            f" moves, and by most of its range OP turned fewer than {REVERSALS:g} times",
        )

    # OP that hardly moves leaves a standing valve possible
    moved = op_range(s.op)
    if moved <= MAY_STAND and _stands_as_well(s):
        return Deniable(
            math.inf,
            "friction cannot be ruled out: a valve that stands still explains PV as well, and OP"
            f" moved by {moved:.2g} % only",
        )

    # Friction is denied down to a share of what OP moved
    return Deniable(max(WORTH_REPAIRING, NARROWEST * moved))


def _stands_as_well(s: Situation) -> bool:
    """Return whether PV may be what it is though the valve never moved, as far as any evidence must
    tell.
    """
    moving, standing = (
        Engine(replace(s.data, u=u), load_memory(s)).base().loglik
        for u in (s.data.u, np.full_like(s.data.u, s.data.u.mean()))
    )
    return standing > moving - LEAST_NATS


def _by_mv(s: Situation) -> Deniable:
    """Return which stiction MV would have shown: any band that it tells and OP turns through."""
    least = least_band(np.asarray(s.record.mv))
    asked = largest_asked(s.op)
    if least <= asked:
        return Deniable(least)
    why = f"OP turned by more than {asked:.2g} % under {REVERSALS:g} times, which MV hardly shows"
    return Deniable(math.inf, why)


def _without_friction(view: Assessment) -> Loop:
    """Return the loop that was fitted to a record, without friction."""
    return ClosedLoops(view, 0).loop([e for e in view.situation.proven if e != FRICTION])


def largest_asked(op: np.ndarray) -> float:
    """Return the largest S (unit of OP) by which OP (n,) turned several times: a valve is asked to
    reverse through it.
    """
    turns = [scipy.signal.find_peaks(x, prominence=1e-9)[1]["prominences"] for x in (op, -op)]
    sizes = np.sort(np.concatenate(turns))[::-1]
    if sizes.size >= REVERSALS:
        return float(sizes[int(REVERSALS) - 1])
    return 0.0


def _integral_acts(loop: Loop, duration: float) -> bool:
    Ti = loop.controller.Ti
    return Ti is not None and Ti < INTEGRAL * duration


# --- Alter an identified loop: with friction, without some effects, at a constant set point.

FRICTION = "stiction"


def with_friction(loop: Loop, S: float, J: float) -> Loop:
    """Return a loop whose stiction is replaced by S and J (%); S = 0 removes it."""
    sound = without(loop, (FRICTION,))
    if S <= 0:
        return sound
    stuck = Part(name=FRICTION, parameters={"S": float(S), "J": float(J)})
    return sound.model_copy(update={"effect": sound.effect + (stuck,)})


def without(loop: Loop, names: tuple[str, ...]) -> Loop:
    """Return a loop without some effects."""
    kept = tuple(part for part in loop.effect if part.name not in names)
    return loop.model_copy(update={"effect": kept})


def steady(loop: Loop) -> Loop:
    """Return a loop at a constant set point."""
    return loop.model_copy(update={"setpoint": SetPoint(value=loop.setpoint.value)})


# --- Keep of a record the samples that were measured, and tell how many there are.

_REGULAR = 0.9  # share of PV's changes that fall on every k-th sample, where PV is held for k
HELD = 100  # samples that are left of a PV that is held, at least


def unheld(record: LoopRecord) -> LoopRecord:
    """Return a record whose PV is held for k samples with the first of each k alone; the same where
    it is not held.
    """
    changes = np.flatnonzero(np.diff(np.asarray(record.pv))) + 1
    if changes.size < HELD:
        return record
    k = int(np.median(np.diff(changes)))
    phase = int(np.bincount(changes % k).argmax())
    regular = k > 1 and np.mean(changes % k == phase) >= _REGULAR
    if regular:
        return resample_record(record, lambda x: x[phase::k], k)
    return record


def measured_samples(record: LoopRecord) -> int:
    """Return how many samples of PV were measured: an archive repeats the others, or draws straight
    lines between them.
    """
    pv = np.asarray(record.pv)
    drawn = share_on_lines(pv, steps(pv, record.op)) + float(np.mean(np.diff(pv) == 0.0))
    return round(pv.size * max(1.0 - drawn, 0.0))


def resample_record(
    record: LoopRecord, change: Callable[[np.ndarray], np.ndarray], k: int
) -> LoopRecord:
    """Return a record in which every signal but MV, which is left out, has one sample in place of
    k.
    """
    return replace(record, mv=None).with_signals(change, Ts=record.Ts * k)


def op_range(op: np.ndarray) -> float:
    """Return the range of OP (n,) without its rarest hundredths."""
    return float(np.quantile(op, 0.99) - np.quantile(op, 0.01))
