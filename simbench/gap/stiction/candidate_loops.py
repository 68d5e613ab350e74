"""Identify from a record the loops that may have produced it: one with a healthy valve and one with
friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.decide.assess import Assessment
from simbench.gap.intake.partial import Partial
from simbench.gap.likelihood.valve_map import MapSearch, positioner
from simbench.gap.stiction.deniable import Deniable, steady
from simbench.gap.stiction.friction import (
    FRICTION,
    OUTSIDE,
    friction,
    friction_of,
    in_percent,
)
from simbench.gap.stiction.probability import probability
from simbench.gap.stiction.sizes import Size, sizes_of
from simbench.gap.stiction.slow import SlowValve, slow_valve
from simbench.scenarios.spec import Loop

_ARCHIVE = (
    "quantisation",
    "compression",
    "outliers",
    "op_quantisation",
)  # effects that single samples prove


@dataclass(frozen=True, eq=False)
class CandidateLoops:
    """The loops that may have produced a record (OP in %): those without friction, the most
    plausible first, and the one with friction.

    `fitted` are S and J (%) of `sticky`; `gain` and `outside` the nats that friction, and an
    oscillation from outside, bring over none; `percent` how many of the record's `S_unit` one % is;
    `shown` is which stiction would have shown, where the evidence speaks against it, `unclaimed`
    why friction is not claimed, `of_mv` what is wrong with MV; `closed` simulates them.
    """

    record: LoopRecord
    healthy: tuple[Loop, ...]
    sticky: Loop | None
    fitted: tuple[float, float] | None
    log_odds: float
    percent: float
    notes: tuple[str, ...]
    gain: float = 0.0
    outside: float = 0.0
    shown: Deniable | None = None
    unclaimed: str = ""
    of_mv: tuple[str, ...] = ()
    closed: ClosedLoops | None = None

    @property
    def probability(self) -> float:
        """Probability of stiction."""
        return probability(self.log_odds)

    @cached_property
    def alone(self) -> Loop:
        """The sound loop that nothing swings from outside, at a constant set point."""
        sound = (x for x in self.healthy if all(part.name != OUTSIDE for part in x.effect))
        return steady(next(sound, self.healthy[0]))

    @cached_property
    def positioner(self) -> Mapping[str, Any] | None:
        """Time constant (s) and damping of a valve that overshoots OP without friction, as MV shows
        it; None where it does not, or was not recorded.
        """
        if self._search_mv is None:
            return None
        found = positioner(self._search_mv)
        if found is None:
            return None
        return found[1]

    @cached_property
    def slow(self) -> SlowValve | None:
        """The valve whose speed is limited, as MV shows it; None as for `positioner`."""
        if self._search_mv is None:
            return None
        found = slow_valve(self._search_mv)
        if found is None:
            return None
        return found[1]

    @cached_property
    def _search_mv(self) -> MapSearch | None:
        """The search for what the valve makes of OP; None where MV was not recorded."""
        if self.closed is None:
            return None
        s = self.closed.fitted.situation
        if s.record.mv is None:
            return None
        return MapSearch(s.op, np.asarray(s.record.mv), s.record.Ts, s.op)

    @cached_property
    def sizes(self) -> tuple[Size, Size] | None:
        """S and J of `sticky` with their intervals, in the record's `S_unit`."""
        if self.closed is None or self.fitted is None:
            return None
        sizes = sizes_of(self.closed.fitted, FRICTION)
        if sizes is None:
            return None
        S, J = sizes
        return S.scaled(self.percent), J.scaled(self.percent)


def candidate_loops(record: LoopRecord, known: Partial | None = None) -> CandidateLoops:
    """Identify the loop of a record, but for what is `known` of it, with a healthy valve and with
    friction.
    """
    # The record weighed alone, or with what is known of its loop
    if known is None:
        weighed = friction_of(record)
    else:
        weighed = friction(record, known)

    # The loops, with what the weighing told
    found = loops_of(record, weighed.assessment, weighed.log_odds)
    if weighed.told is None:
        of_mv = ()
    else:
        of_mv = weighed.told.notes
    return replace(
        found,
        gain=weighed.evidence.gain,
        shown=weighed.shown,
        unclaimed=weighed.unclaimed,
        of_mv=of_mv,
    )


def loops_of(record: LoopRecord, found: Assessment, log_odds: float) -> CandidateLoops:
    """Return the loops of an assessment of a record, with and without friction, whose probability
    was weighed.
    """
    # Effects that the archive proves belong to every loop
    record, percent = in_percent(record)
    loops = ClosedLoops(found, 0)
    archive = [e for e in _ARCHIVE if e in found.situation.proven]

    # A sound valve, with an outside oscillation and without
    sound = [archive]
    swung = found.candidates.get(OUTSIDE)
    if swung:
        outside = max(float(swung.log_likelihood_gain), 0.0)
    else:
        outside = 0.0
    if OUTSIDE in found.parameters:
        sound.append(archive + [OUTSIDE])
        if outside:
            sound.reverse()

    # A sticking valve of the fitted sizes
    sizes = found.parameters.get(FRICTION)
    if sizes is None:
        sticky = None
    else:
        sticky = loops.loop(archive + [FRICTION])

    # All of them, the likelier healthy one first
    return CandidateLoops(
        record=record,
        healthy=tuple(loops.loop(effects) for effects in sound),
        sticky=sticky,
        fitted=None if sizes is None else (float(sizes["S"]), float(sizes["J"])),
        log_odds=log_odds,
        percent=percent,
        notes=tuple(found.situation.notes),
        outside=outside,
        closed=loops,
    )
