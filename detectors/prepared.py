"""Prepared: a record with what several methods need of it, each piece computed once, when first asked for."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from detectors.quality import Flag, inspect
from detectors.record import LoopRecord
from detectors.signal.conditioning import band, clear_harmonics, loop_sign
from detectors.signal.half_cycles import split
from detectors.signal.oscillation import Oscillation, find_oscillation


@dataclass
class Prepared:
    """A record made ready for judging.

    Parameters
    ----------
    record : LoopRecord
        The record, blinded unless the method needs MV.
    shared : dict
        Intermediate results that methods on the same record share, by name; `share` fills it.

    Examples
    --------
    >>> t = np.arange(600.0)
    >>> p = Prepared(LoopRecord(op=np.sin(t / 8), pv=np.cos(t / 8), Ts=1.0))
    >>> p.oscillation.sustained
    True
    """

    record: LoopRecord
    shared: dict = field(default_factory=dict)

    @cached_property
    def flags(self) -> dict[str, Flag]:
        """Data-quality flags by name."""
        return inspect(self.record, self.oscillation)

    @cached_property
    def oscillation(self) -> Oscillation:
        """The common front end's finding on OP and PV."""
        return find_oscillation(self.record.op, self.record.pv, self.record.Ts)

    @property
    def integrating(self) -> bool:
        """Whether the loop is judged as integrating; an unknown process counts as self-regulating."""
        return self.record.process == "integrating"

    def valve_position(self) -> tuple[np.ndarray | None, bool | None, str]:
        """Return the signal that stands for MV, whether it may, and why.

        Returns
        -------
        signal : ndarray, shape (n,), or None
            MV where it was recorded, else PV of a flow loop or of a loop of unknown kind, turned so that it rises with the
            valve's opening, else None.
        applicable : bool or None
            False when there is no such signal, None when PV of unknown kind stands in.
        note : str
            What was used, or why nothing can be.
        """
        record = self.record
        if record.mv is not None:
            return record.mv, True, "MV"
        if record.process == "integrating":
            return None, False, "no MV recorded, and PV of an integrating process is no measure of the valve's position"
        if record.kind == "flow":
            return self._turned_pv(), True, "PV of a flow loop as MV"
        if record.kind is None:
            return self._turned_pv(), None, "PV as MV, kind of loop unknown"
        return None, False, f"no MV recorded, and PV of a {record.kind} loop is no measure of the valve's position"

    def clean(self, name: str) -> np.ndarray:
        """Return the oscillation in "op" or "pv", shape (n,), without drift and without noise beyond its clear harmonics."""
        x = getattr(self.record, name)
        period = self.oscillation.period_s / self.record.Ts
        return self.share(f"clean {name}", lambda: band(x, period, clear_harmonics(x, period)))

    def half_cycles(self, name: str) -> np.ndarray:
        """Return the half cycles of "op" or "pv" as positive humps of one length, shape (m, points).

        Those in the first and last half period are left out: drift is only guessed there.
        """
        period = self.oscillation.period_s / self.record.Ts
        inner = slice(round(period / 2), -round(period / 2))
        return self.share(f"half cycles {name}", lambda: split(self.clean(name)[inner], period))

    def sighted(self, record: LoopRecord) -> Prepared:
        """Return the same for the same record with MV; what was found without MV is kept."""
        other = replace(self, record=record, shared=dict(self.shared))
        for name in ("oscillation", "flags"):
            other.__dict__[name] = getattr(self, name)
        return other

    def _turned_pv(self) -> np.ndarray:
        period = self.oscillation.period_s / self.record.Ts
        reach = max(round(period / 8), 1) if np.isfinite(period) else 1
        return self.record.pv * loop_sign(self.record.op, self.record.pv, reach)

    def share(self, name: str, compute):
        """Return what `compute()` gives, computed once per record under `name`."""
        if name not in self.shared:
            self.shared[name] = compute()
        return self.shared[name]
