"""Apply the archive of a record (averages, rounding, delayed OP, repeated samples) to a simulated
record, so that both can be compared.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from simbench.detectors.signal.lattice import read_lattice
from simbench.gap.controller.recovered_pv import mean_like
from simbench.gap.situation import Situation

# share of a record's repeated samples from which rounding explains them; with all of 146 simulated
# records held, .44 instead of .51 are within 1.5 floors
_BY_ROUNDING = 0.5


def as_archived(
    situation: Situation, op: np.ndarray, pv: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return OP and PV of a simulated loop after the changes that the archive made to the recorded
    ones.
    """
    # Every how many samples, and how late OP is written
    op = op[:: situation.pace]
    pv = pv[:: situation.pace]
    late = situation.law.late
    if late:
        op = np.append(np.repeat(op[0], late), op[:-late])

    # Means in place of samples, where the record has them
    if situation.law.averaged and situation.law.recovered_pv is not None:
        pv = mean_like(situation.record.pv, situation.law.recovered_pv, pv)

    # Rounded as the record is
    op, pv = (
        unit * np.round(x / unit) if unit > 0.0 else x
        for x, unit in zip((op, pv), digits_of(situation))
    )

    # Held as the record is, unless an effect holds it already
    by_effect = _resting_by_effect(situation)
    recorded = situation.op, situation.record.pv
    op, pv = (
        x if known else _held_like(x, like) for x, like, known in zip((op, pv), recorded, by_effect)
    )
    return op, pv


def _held_like(x: np.ndarray, recorded: np.ndarray) -> np.ndarray:
    """Return a signal that repeats its last value where the recorded one does, unless it repeats
    itself nearly as often as that by its own rounding.
    """
    rests = np.append(False, np.diff(recorded) == 0.0)
    if np.mean(np.diff(x) == 0.0) >= _BY_ROUNDING * np.mean(rests):
        return x
    return x[np.maximum.accumulate(np.where(rests, 0, np.arange(x.size)))]


@lru_cache(maxsize=4)
def _resting_by_effect(s: Situation) -> tuple[bool, bool]:
    """Return whether OP and PV rest as an effect makes them, which is not the archive's; the
    lattice of PV is, where the loop is identified.
    """
    law = s.law
    archive = s.archive
    by_controller = law.limits is not None or law.gap > 0.0 or law.step > 0.0
    on_lattice = s.trusted and archive.rounding is not None
    return by_controller, s.frozen or on_lattice or archive.band > 0.0


@lru_cache(maxsize=4)
def digits_of(s: Situation) -> tuple[float, float]:
    """Return the steps in which OP and PV are written, or PV of an identified loop is measured;
    computed once per record because it is simulated many times.
    """
    op = read_lattice(s.op, s.record.pv).digits
    pv = read_lattice(s.record.pv, s.op).digits
    lattice = s.archive.rounding
    return op, pv if lattice is None or s.trusted else lattice[0]
