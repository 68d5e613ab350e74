"""LoopRecord: the one time-series type of a control loop."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from simbench.detectors.errors import RecordError, nearest

if TYPE_CHECKING:
    import pandas as pd

PROCESSES = ("self-regulating", "integrating")
RECORDED_SIGNALS = ("op", "pv", "sp", "mv")
KINDS = ("flow", "level", "pressure", "temperature", "analyser")
KIND_ALIASES = {
    "diff-pressure": "pressure",
    "differential-pressure": "pressure",
    "analyzer": "analyser",
    "concentration": "analyser",
}


# Beyond these a power of four, as statistics use it, leaves the range of double numbers.
LARGEST = 1e60
_SMALLEST = 1e-60
_FASTEST = 1e-12  # s between samples
_SLOWEST = 1e12
# of its span by which a sound signal may go beyond it: 4..20 mA means 3.8 to 20.5, a fault 3.6 or
# 21
_OVER_RANGE = 0.1
# An OP that moves and never exceeds this opens no valve, neither as % nor as a share of 1: its unit
# is another one.
_SHUT = 1e-3
# share of the samples that may lie further out, before the span is taken for another signal's
MOST_OUTSIDE = 0.05


@dataclass(frozen=True, eq=False)
class LoopRecord:
    """What was recorded of one control loop, checked once and read-only from then on.

    Parameters
    ----------
    op : array_like, shape (n,)
        Controller output; % of valve travel unless `op_span` is given.
    pv : array_like, shape (n,)
        Process variable, in its units.
    Ts : float
        Sampling period (s), > 0.
    sp : array_like, shape (n,), optional
        Set point, in units of PV; None = not recorded.
    mv : array_like, shape (n,), optional
        Valve position (%); None = not recorded.
    process : {"self-regulating", "integrating"}, optional
        None = unknown.
    kind : {"flow", "level", "pressure", "temperature", "analyser"}, optional
        What the loop controls; None = unknown.
    op_span, pv_span : (lo, hi), optional
        The values that mean 0 % and 100 %.
    tag : str
        Name of the loop.
    meta : dict
        Anything else that came with the record; hidden from detectors.
    notes : tuple of str
        What the loader had to do to the data, as "flag: evidence"; data quality reports it.

    Raises
    ------
    RecordError
        When a signal is not one-dimensional, not finite, of another length than PV, shorter than 3
        samples, or of a size that no transmitter sends, or when the sampling period is none.

    Notes
    -----
    Not for records with holes: `simbench.detectors.records.io` bridges or cuts these first.

    Examples
    --------
    >>> r = LoopRecord(op=[50, 51, 52], pv=[1.0, 1.1, 1.2], Ts=2.0)
    >>> r.n, r.duration
    (3, 6.0)
    """

    op: np.ndarray
    pv: np.ndarray
    Ts: float
    sp: np.ndarray | None = None
    mv: np.ndarray | None = None
    process: str | None = None
    kind: str | None = None
    op_span: tuple[float, float] | None = None
    pv_span: tuple[float, float] | None = None
    tag: str = ""
    meta: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check every field once, so that no later code has to."""
        # The name that errors begin with
        if self.tag:
            where = f"record {self.tag!r}"
        else:
            where = "record"

        # Signals: equal lengths, finite numbers, write-protected
        n = np.size(self.pv)
        for name in RECORDED_SIGNALS:
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _check_signal(value, name, n, where))
        if n < 3:
            raise RecordError(f"{where}: {n} samples; at least 3 are needed")

        # The sampling period
        Ts = float(self.Ts)
        if not (np.isfinite(Ts) and Ts > 0):
            raise RecordError(
                f"{where}: Ts = {self.Ts} s; the sampling period must be a number above 0"
            )
        if not _FASTEST <= Ts <= _SLOWEST:
            raise RecordError(
                f"{where}: Ts = {Ts:g} s; a sampling period is {_FASTEST:g} to {_SLOWEST:g} s"
            )

        # Words of the fixed vocabularies, and the spans
        object.__setattr__(self, "Ts", Ts)
        object.__setattr__(
            self, "process", _check_word(self.process, "process", PROCESSES, {}, where)
        )
        object.__setattr__(self, "kind", _check_word(self.kind, "kind", KINDS, KIND_ALIASES, where))
        for name in ("op_span", "pv_span"):
            object.__setattr__(self, name, _check_span(getattr(self, name), name, where))

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.pv.size

    @property
    def duration(self) -> float:
        """Length of the record in seconds, n Ts."""
        return self.n * self.Ts

    @property
    def t(self) -> np.ndarray:
        """Time of each sample (s), shape (n,), starting at 0."""
        return np.arange(self.n) * self.Ts

    @property
    def e(self) -> np.ndarray:
        """Control error SP - PV, shape (n,); the mean of PV replaces a set point that was not
        recorded.
        """
        return (self.pv.mean() if self.sp is None else self.sp) - self.pv

    @cached_property
    def op_percent(self) -> np.ndarray | None:
        """OP in % of valve travel, shape (n,), or None when neither the span nor the values tell
        the unit.
        """
        if self.op_span is not None:
            lo, hi = self.op_span
            percent = (self.op - lo) * (100.0 / (hi - lo))
            percent.flags.writeable = False
            return percent
        lo = float(self.op.min())
        hi = float(self.op.max())
        opens = lo == hi or hi > _SHUT
        return self.op if 0.0 <= lo and hi <= 100.0 and opens and not self.op_share else None

    @cached_property
    def op_share(self) -> bool:
        """Whether OP moves within 0..1 and no span tells its unit: a share of 1 judged as % would
        be wrong by a factor 100.
        """
        lo = float(self.op.min())
        hi = float(self.op.max())
        return self.op_span is None and 0.0 <= lo < hi <= 1.0 and hi > _SHUT

    def outside(self, name: str, margin: float = _OVER_RANGE) -> float:
        """Return the share of samples that lie beyond the signal's span.

        Parameters
        ----------
        name : {"op", "pv"}
            The signal.
        margin : float
            Share of the span that a sample may lie beyond it.

        Returns
        -------
        float
            0 without a span.
        """
        span = getattr(self, f"{name}_span")
        x = getattr(self, name)
        if span is None:
            return 0.0
        over = margin * (span[1] - span[0])
        return float(np.mean((x < span[0] - over) | (x > span[1] + over)))

    @property
    def S_unit(self) -> str:
        """Unit of S and J estimated from this record."""
        return "% of travel" if self.op_percent is not None else "OP units"

    def to_frame(self) -> pd.DataFrame:
        """Return the record as a table that `simbench.detect` reads.

        Returns
        -------
        DataFrame
            t_s, sp, op, pv, mv; what was not recorded is left out.

        Examples
        --------
        >>> list(LoopRecord(op=[50, 51, 52], pv=[1.0, 1.1, 1.2], Ts=2.0).to_frame())
        ['t_s', 'op', 'pv']
        """
        import pandas as pd

        columns = {"t_s": self.t, "sp": self.sp, "op": self.op, "pv": self.pv, "mv": self.mv}
        return pd.DataFrame(
            {name: signal for name, signal in columns.items() if signal is not None}
        )

    def plot(self, **options: Any) -> Any:
        """Draw PV with SP above OP with MV, over time.

        Parameters
        ----------
        **options
            As `pandas.DataFrame.plot` takes them, such as figsize.

        Returns
        -------
        ndarray of matplotlib.axes.Axes, shape (2,)
            PV with SP above, OP with MV below.

        Raises
        ------
        ImportError
            Without matplotlib, which this package alone does not need.
        """
        frame = self.to_frame().set_index("t_s")
        groups = [tuple(c for c in pair if c in frame) for pair in (("pv", "sp"), ("op", "mv"))]
        axes = frame[[c for pair in groups for c in pair]].plot(
            **{"subplots": groups, "xlabel": "t (s)", "title": self.tag or None, **options}
        )
        axes[1].set_ylabel("OP, MV (%)" if self.op_percent is self.op else "OP")
        axes[0].set_ylabel("PV")
        return axes

    def _repr_html_(self) -> str:
        from simbench.detectors.views import page_part

        facts = [
            f"{self.n} samples",
            f"Ts = {self.Ts:g} s",
            f"{self.duration:g} s",
            self.kind,
            self.process,
            *self.notes,
        ]
        about = ", ".join(fact for fact in facts if fact)
        frame = self.to_frame().drop(columns="t_s").describe().T[["min", "mean", "max", "std"]]
        return page_part(f"{self.tag or 'record'}: {about}", frame.reset_index(names="signal"))

    def without_mv(self) -> LoopRecord:
        """Return the record as a detector may see it.

        Returns
        -------
        LoopRecord
            The same without `mv` and `meta`.
        """
        other = copy(self)  # its fields were checked when this record was made
        other.__dict__.update(mv=None, meta={})
        return other

    def window(self, start: int, stop: int) -> LoopRecord:
        """Return samples start..stop-1 as a separate record.

        Parameters
        ----------
        start, stop : int
            Sample indices as in a slice.

        Returns
        -------
        LoopRecord
            The samples with everything else that is known of the record.

        Raises
        ------
        RecordError
            When fewer than 3 samples are left.
        """
        return self.with_signals(lambda x: x[start:stop])

    def with_signals(self, change: Callable[[np.ndarray], np.ndarray], **others: Any) -> LoopRecord:
        """Return the record with every recorded signal changed in the same way.

        Parameters
        ----------
        change : callable
            Gives the new signal, shape (m,), of one of shape (n,).
        **others
            Other fields with their new values.

        Returns
        -------
        LoopRecord
            Signals of shape (m,), and the other fields as they were or as given.

        Raises
        ------
        RecordError
            When the new signals make no record.

        Examples
        --------
        >>> r = LoopRecord(op=[50, 51, 52, 53], pv=[1.0, 1.1, 1.2, 1.3], Ts=2.0)
        >>> r.with_signals(lambda x: x[::-1]).op.tolist()
        [53.0, 52.0, 51.0, 50.0]
        """
        signals = {}
        for s in RECORDED_SIGNALS:
            signals[s] = getattr(self, s)
        changed = {}
        for s, x in signals.items():
            if x is not None:
                changed[s] = change(x)
        return replace(self, **changed, **others)


def _check_signal(value: Any, name: str, n: int, where: str) -> np.ndarray:
    # A one-dimensional array of numbers
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise RecordError(f"{where}: {name.upper()} holds something that is no number") from None
    if array.ndim != 1:
        raise RecordError(
            f"{where}: {name.upper()} has shape {array.shape}; one dimension is needed"
        )

    # As long as PV, and finite
    if array.size != n:
        raise RecordError(f"{where}: {name.upper()} has {array.size} samples, PV has {n}")
    if not np.isfinite(array).all():
        bad = int(np.argmin(np.isfinite(array)))
        raise RecordError(
            f"{where}: {name.upper()} is {array[bad]} at sample {bad}; finite numbers are needed"
        )

    # Sizes whose squares are still numbers
    largest = float(np.abs(array).max(initial=0.0))
    if largest > LARGEST or 0.0 < largest < _SMALLEST:
        allowed = f"0, or sizes from {_SMALLEST:g} to {LARGEST:g}, are needed"
        raise RecordError(f"{where}: the largest {name.upper()} is {largest:g} in size; {allowed}")

    # Nobody writes into a record
    array.flags.writeable = False
    return array


def _check_word(
    value: str | None, name: str, allowed: tuple[str, ...], aliases: dict[str, str], where: str
) -> str | None:
    if value is None or value == "":
        return None
    word = hyphenated(str(value))
    word = aliases.get(word, word)
    if word not in allowed:
        raise RecordError(f"{where}: {name} {value!r} is unknown, {nearest(word, allowed)}")
    return word


def hyphenated(word: str) -> str:
    """Return a word in small letters with hyphens for underscores and spaces."""
    return word.strip().lower().replace("_", "-").replace(" ", "-")


def _check_span(value: Any, name: str, where: str) -> tuple[float, float] | None:
    if value is None:
        return None
    try:
        lo, hi = map(float, value)
    except (TypeError, ValueError):
        lo = hi = np.nan
    if not (np.isfinite(lo) and np.isfinite(hi) and lo < hi):
        raise RecordError(f"{where}: {name} = {value}; two finite numbers lo < hi are needed")
    return lo, hi
