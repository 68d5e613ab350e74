"""`Prepared`: a record with the quantities that several methods need, such as the oscillation and
filtered signals; each is computed once, when first needed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from simbench.detectors.errors import RecordError
from simbench.detectors.method import Method
from simbench.detectors.quality import Flag, inspect
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.autocorrelation import acf, detrend
from simbench.detectors.signal.conditioning import (
    clear_harmonics,
    drift,
    loop_sign,
    mirrored_spectrum,
    smooth,
    snapped,
)
from simbench.detectors.signal.half_cycles import midline, split
from simbench.detectors.signal.oscillation import LASTING, Oscillation, find_oscillation, wandering
from simbench.detectors.signal.standstill import steady_valve

_STILL = 1e-9  # of a signal's range: less is rounding
# samples per period that are judged (Jelali 2013, section 11.7.2); a denser record is halved until
# it has no more
DENSEST = 250.0
# samples per period at which a half is still searched for an oscillation that it hides more densely
_COARSEST = 64.0


@dataclass
class Prepared:
    """A record made ready for judging."""

    record: LoopRecord  # the record, blinded unless the method needs MV
    # intermediate results that methods on the same record share, by name; `share` fills it
    shared: dict = field(default_factory=dict)
    # samples start..stop-1 of the record that was given, where not all of it is judged; `prepare`
    # finds them
    part: tuple[int, int] | None = None
    step: int = 1  # samples of the record that was given to one of `record`
    # the same record as other methods are given it; `seen_by` fills it
    views: dict = field(default_factory=dict)

    @cached_property
    def flags(self) -> dict[str, Flag]:
        """Data-quality flags by name."""
        return inspect(self.record, self.oscillation)

    @cached_property
    def oscillation(self) -> Oscillation:
        """The oscillation of OP and PV, as the common oscillation test finds it."""
        record = self.record
        return find_oscillation(record.op, record.pv, record.Ts)

    @property
    def integrating(self) -> bool:
        """Whether the loop is judged as integrating; an unknown process counts as
        self-regulating.
        """
        return self.record.process == "integrating"

    def valve_position(self) -> tuple[np.ndarray | None, bool | None, str]:
        """Return the signal used as MV (or None), with the sign that rises when the valve opens;
        whether it may be used; and why.

        MV where it was recorded, else PV of a flow loop or, `applicable` None, of a loop of unknown
        kind.
        """
        # MV itself, where it is recorded
        record = self.record
        if record.mv is not None:
            return record.mv, True, "MV"
        if record.process == "integrating":
            return (
                None,
                False,
                (
                    "no MV recorded, and PV of an integrating process is no measure of the valve's"
                    " position"
                ),
            )

        # PV of a flow loop follows the valve; of an unknown loop it may
        if record.kind == "flow":
            return self._turned_pv(), True, "PV of a flow loop as MV"
        if record.kind is None:
            return self._turned_pv(), None, "PV as MV, kind of loop unknown"

        # PV of any other loop lags the valve
        loop = f"{'an' if record.kind[0] in 'aeiou' else 'a'} {record.kind} loop"
        return (
            None,
            False,
            f"no MV recorded, and PV of {loop} is no measure of the valve's position",
        )

    def clean(self, name: str) -> np.ndarray:
        """Return the oscillation in "op" or "pv", shape (n,), without drift and without noise
        beyond its clear harmonics.
        """
        return self.share(
            f"clean {name}", lambda: self.band(name, self.period / self.clear_harmonics(name))
        )

    @property
    def period(self) -> float:
        """Period of the oscillation in samples; RecordError without one."""
        if not np.isfinite(self.oscillation.period_s):
            raise RecordError("no period found in OP or PV")
        # what is cut by it shall not depend on the last digits, which the unit decides
        return round(self.oscillation.period_s / self.record.Ts, 6)

    def signal(self, name: str) -> np.ndarray:
        """Return "op", "pv", or "travel": OP in % where its unit is known; shape (n,)."""
        if name == "travel":
            if self.record.op_percent is None:
                return self.record.op
            return self.record.op_percent
        return getattr(self.record, name)

    def searchable(self, name: str) -> np.ndarray:
        """Return "travel", or "pv" about the middle of its range and in shares of that; shape (n,).

        Searches meet candidates that are equally good. Which one wins shall not depend on how a
        unit rounds: both signals are set on a grid of 1e-6 % of travel and 1e-7 of PV's range. Nor
        shall it depend on which way is up: both are turned so that OP leaves the middle half of its
        range upward first.
        """
        turn = self.share("searchable turn", lambda: _first_way(self.record.op))

        # PV about the middle of its range, turned as OP first moves
        if name == "pv":
            pv = self.record.pv
            low = float(pv.min())
            high = float(pv.max())
            return self.share(
                "searchable pv",
                lambda: turn * snapped((pv - 0.5 * (low + high)) / ((high - low) or 1.0)),
            )

        # OP in % of travel, rounded so that rounding of the record decides nothing
        if self.record.op_percent is None:
            return turn * self.record.op
        travel = self.signal("travel")
        return self.share(
            "searchable travel",
            lambda: snapped(travel if turn > 0.0 else 100.0 - travel, 2.0**-20),
        )

    def clear_harmonics(self, name: str) -> float:
        """Return up to which harmonic a signal exceeds its noise, see
        `simbench.detectors.signal.conditioning`.
        """
        return self.share(
            f"harmonics {name}", lambda: clear_harmonics(self.signal(name), self.period)
        )

    def band(self, name: str, shortest: float) -> np.ndarray:
        """Return the oscillation in a signal, shape (n,), without drift and without periods below
        `shortest` samples.
        """
        if name == "travel" and self.record.op_span in (None, (0.0, 100.0)):
            name = "op"  # the same numbers
        level = self.share(f"level {name}", lambda: self._level_of(name))
        return smooth(
            level,
            shortest,
            lambda: self.share(f"spectrum {name}", lambda: mirrored_spectrum(level)),
        )

    def _level_of(self, name: str) -> np.ndarray:
        x = self.signal(name)

        # a mean over one period would take part of the longer cycles away
        if self.oscillation.swings:
            at = wandering(self.record.op)
            if name == "pv" or at is None:
                level = -self.record.e
            else:
                level = x - midline(x, at)
        else:
            level = x - drift(x, self.period)

        # a signal that stood still for a period leaves rounding, whose signs hang on the unit
        level[np.abs(level) <= _STILL * np.ptp(x)] = 0.0
        return level

    def smooth_op(self) -> np.ndarray:
        """Return OP without noise beyond its clear harmonics, shape (n,)."""
        return self.share(
            "smooth op", lambda: smooth(self.record.op, self.period / self.clear_harmonics("op"))
        )

    def steady_valve(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
        """Return the intervals in which the signal used as MV rests, see
        `simbench.detectors.signal.standstill`.
        """
        return self.share(
            f"steady valve {self.record.mv is None}", lambda: steady_valve(position, self.period)
        )

    def half_cycles(self, name: str, cleaned: bool = True) -> np.ndarray:
        """Return the half cycles of "op" or "pv" as positive humps of one length, shape (m,
        points).

        Those in the first and last half period are left out: drift is only guessed there. Not
        cleaned: between the zero crossings of the signal less its mean, as the sources have it.
        """
        period = self.period
        if not cleaned:
            x = self.signal(name)
            return self.share(f"raw half cycles {name}", lambda: split(x - x.mean(), period))
        if self.oscillation.swings:
            edge = 0
            longest = np.inf
        else:
            edge = round(period / 2)
            longest = 1.0
        inner = slice(edge, self.record.n - edge)
        return self.share(
            f"half cycles {name}", lambda: split(self.clean(name)[inner], period, longest=longest)
        )

    def with_mv(self, record: LoopRecord) -> Prepared:
        """Return the same prepared record with MV; what was computed without MV is kept."""
        record = thin_record(record if self.part is None else record.window(*self.part), self.step)
        other = Prepared(record, dict(self.shared), self.part, self.step)
        other.__dict__.update(oscillation=self.oscillation, flags=self.flags)
        return other

    def seen_by(self, method: Method, record: LoopRecord) -> Prepared:
        """Return what a method gets: the prepared record, with MV if the method may see it.

        The front end's result holds for every view of a record.
        """
        # A method may see the whole record, or the part that is judged; with MV or without
        whole = method.whole and (self.part is not None or self.step > 1)
        key = (whole, record.mv is None)
        if key not in self.views:
            if whole:
                view = Prepared(record)
                view.__dict__["oscillation"] = self.oscillation
            else:
                if record.mv is None:
                    view = self
                else:
                    view = self.with_mv(record)
            self.views[key] = view
        return self.views[key]

    def _turned_pv(self) -> np.ndarray:
        period = self.oscillation.period_s / self.record.Ts
        if np.isfinite(period):
            reach = max(round(period / 8), 1)
        else:
            reach = 1
        return self.record.pv * loop_sign(self.record.op, self.record.pv, reach)

    def share(self, name: str, compute):
        """Return the result of `compute()`, computed once per record and kept under `name`."""
        if name not in self.shared:
            self.shared[name] = compute()
        return self.shared[name]


def _first_way(x: np.ndarray) -> float:
    """Return the side, 1 or -1, on which a signal first leaves the middle half of its range."""
    low = float(x.min())
    high = float(x.max())
    away = x - 0.5 * (low + high)
    return -1.0 if away[np.argmax(np.abs(away) > 0.25 * (high - low))] < 0.0 else 1.0


def thin_record(record: LoopRecord, step: int) -> LoopRecord:
    """Return the record with every n-th sample; averages would blur the jumps of a valve."""
    if step == 1:
        return record
    return record.with_signals(lambda x: x[::step], Ts=record.Ts * step)


def _pace_of_op(op: np.ndarray) -> float:
    """Return the period (samples) of an OP that need not oscillate: four times the lag at which its
    ACF first vanishes.
    """
    flat = detrend(op)
    if flat.any():
        return 4.0 * float(np.argmax(acf(flat) < 0.0))
    return 0.0


def _at_density(
    record: LoopRecord, part: tuple[int, int] | None = None, pace: float = 0.0
) -> Prepared:
    """Prepare a record at no more than `DENSEST` samples per period, by powers of two: so that the
    density it came at, of those a factor of two apart, makes no difference. Where it does not
    oscillate it is looked at more coarsely, down to `_COARSEST` samples of a period `pace`.
    """
    dense = Prepared(record, part=part)
    oscillation = dense.oscillation
    coarse = 1
    while not oscillation.sustained and pace > _COARSEST * coarse:
        coarse *= 2
        oscillation = Prepared(thin_record(record, coarse)).oscillation
    if not oscillation.sustained:
        oscillation = dense.oscillation
        coarse = 1
    step = 1
    last = oscillation.period_s

    # step by step, each asked for the period itself: near a bound a denser record may say another
    while last > DENSEST * step * record.Ts and record.n >= 8 * step:
        step *= 2
        if step > coarse:
            period = Prepared(thin_record(record, step)).oscillation.period_s
            last = last if np.isnan(period) else period
    if step > 1 and part is not None:  # a start that every density has
        late = -part[0] % step
        record = record.window(late, record.n)
        part = (part[0] + late, part[1])
    if step == 1:
        thin = dense
    else:
        thin = Prepared(thin_record(record, step), part=part, step=step)

    # else it is asked itself: a finer record may oscillate by chance, and this one is judged
    if coarse > step:
        thin.__dict__["oscillation"] = oscillation

    # what oscillates in neither way is left as it came: its valve may be seen all the same
    return thin if thin.oscillation.sustained or oscillation.sustained else dense


def prepare(record: LoopRecord) -> Prepared:
    """Prepare a record for judging: the whole record, or, if it does not oscillate as a whole, the
    first of its last, middle and first half that does.

    Step 3 of Choudhury, Shah, Thornhill and Shook (2006), Control Engineering Practice 14, 1395. A
    move of the set point or a valve that rests for a while breaks the regularity of a whole record,
    not of each half. In a half an amplitude may fall as fast as in a whole record, and no faster.
    Every second, fourth, ... sample where a period has more than 250.
    """
    # The whole record, if it oscillates
    whole = _at_density(record)
    if whole.oscillation.sustained:
        return whole

    # Else its parts, at the density at which OP turns
    pace = _pace_of_op(record.op)
    step = 1
    while pace > _COARSEST * step:
        step *= 2

    # starts and ends that every density has: half a swing earlier or later a half may seem to
    # oscillate or not
    quarter = -(-record.n // (4 * step)) * step
    middle = -(-record.n // (2 * step)) * step
    for part in ((middle, record.n), (quarter, quarter + middle), (0, middle)):
        if part[1] - part[0] < 3:
            return whole
        half = _at_density(record.window(*part), part, pace)
        oscillation = half.oscillation
        # the unit of S and J is the whole record's
        if (
            oscillation.sustained
            and oscillation.lasting > LASTING**0.5
            and half.record.S_unit == record.S_unit
        ):
            return half
    return whole
