"""Simulate a loop with several seeds: what one record of it looks like, with intervals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.oscillation import find_oscillation
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_QUANTILES = (0.05, 0.5, 0.95)  # ends and middle of a 90 % interval, as probabilities
_NUMBERS = {
    "pv_std": "PV standard deviation (PV units)",
    "op_std": "OP standard deviation (%)",
    "period_s": "period of the oscillation (s)",
    "op_travel_per_hour": "OP travel (% per hour)",
}


@dataclass(frozen=True)
class Interval:
    """The median of a number over several runs, and its 90 % interval."""

    value: float
    lo: float
    hi: float


@dataclass(frozen=True)
class Spread:
    """What records of one loop look like.

    Attributes
    ----------
    pv_std, op_std : Interval
        Standard deviations of PV (PV units) and OP (%) over one record.
    op_travel_per_hour : Interval
        Distance (%) that OP travels in an hour.
    period_s : Interval or None
        Period (s) of the records that oscillate; None where none does.
    oscillates : float
        Share of the records with a sustained oscillation.
    seeds : int
        Number of records.
    """

    pv_std: Interval
    op_std: Interval
    op_travel_per_hour: Interval
    period_s: Interval | None
    oscillates: float
    seeds: int

    def as_json(self) -> dict[str, Any]:
        """Return the numbers in JSON types."""
        return asdict(self)

    def as_text(self) -> str:
        """Return the numbers for a terminal."""
        lines = [f"{'':34s}{'median':>10s}{'90 % interval':>24s}"]
        for name, words in _NUMBERS.items():
            interval = getattr(self, name)
            value = "-"
            between = "-"
            if interval is not None:
                value = f"{interval.value:.3g}"
                between = f"{interval.lo:.3g} to {interval.hi:.3g}"
            lines.append(f"{words:34s}{value:>10s}{between:>24s}")
        count = round(self.oscillates * self.seeds)
        return "\n".join(lines + [f"{count} of {self.seeds} records oscillate"])


def simulate_seeds(loop: Loop, seeds: int, first: int = 0, kick: float = 0.0) -> Spread:
    """Simulate a loop with successive seeds, and describe one record of it.

    Parameters
    ----------
    loop : Loop
        The loop.
    seeds : int
        Number of records.
    first : int
        Seed of the first record.
    kick : float
        Offset (%) of OP at sample 0.

    Returns
    -------
    Spread
        Median and 90 % interval of the numbers of one record.

    Raises
    ------
    UserError
        For a loop that cannot be simulated.

    Notes
    -----
    The interval holds what load and noise do, not what is unknown of the loop. Two records are the
    fewest; from fewer than twenty the ends of the interval are its extremes.

    Examples
    --------
    >>> loop = Loop.from_table({
    ...     "plant": {"type": "foptd", "K": 1, "T": 10}, "sampling": {"Ts": 1, "n": 500},
    ...     "controller": {"type": "PI", "Kc": 1, "Ti": 10}, "noise": {"std": 0.1}})
    >>> simulate_seeds(loop, 5).oscillates
    0.0
    """
    # One record for every seed
    records = [simulate(loop, first + i, kick=kick).record for i in range(seeds)]
    rows = [measure(record) for record in records]

    # A column for each number; a period only of those that oscillate
    columns = {}
    for name in _NUMBERS:
        columns[name] = [row[name] for row in rows]
    periods = []
    for period in columns.pop("period_s"):
        if math.isfinite(period):
            periods.append(period)

    # Their means with intervals
    return Spread(
        **{name: _interval_of(values) for name, values in columns.items()},
        period_s=_interval_of(periods) if periods else None,
        oscillates=len(periods) / seeds,
        seeds=seeds,
    )


def measure(record: LoopRecord) -> dict[str, float]:
    """Return the numbers of one record; its period is NaN where it does not oscillate."""
    cycle = find_oscillation(record.op, record.pv, record.Ts)
    travel = np.abs(np.diff(record.op)).sum() / (record.n * record.Ts / 3600.0)
    return {
        "pv_std": float(record.pv.std()),
        "op_std": float(record.op.std()),
        "period_s": cycle.period_s if cycle.sustained else math.nan,
        "op_travel_per_hour": float(travel),
    }


def _interval_of(values: Sequence[float]) -> Interval:
    lo, middle, hi = np.quantile(values, _QUANTILES).tolist()
    return Interval(middle, lo, hi)
