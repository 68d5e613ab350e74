"""What a record shows of the law by which its controller computes OP."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class Law:
    """Result of the controller regression: the best law, what lies between error and OP, and what
    the archive hides.
    """

    residual: float  # robust size of what the best law leaves of OP's changes, over these
    Kc: float  # %/PV unit
    Ti: float  # s
    # between error and OP may lie: limits of OP (%) tighter than its range
    limits: tuple[float, float] | None = None
    gap: float = 0.0  # full width of the error (PV units) in which OP rests
    step: float = 0.0  # of OP's lattice (%)
    tuning: tuple[float, float] | None = None  # another one, as factors of the baseline's Kc and Ti
    # (n,), the PV that the controller must have seen, where it can be recovered
    recovered_pv: np.ndarray | None = None
    reason: str = ""  # why the block cannot be judged
    foreign: str = ""  # why it is another controller
    late: int = 0  # samples by which OP answers late
    averaged: bool = False  # the archive's PV is a mean
    quick: bool = False  # it runs several times in a sample, plainly
    blur: float = 0.0  # what the digits leave uncertain of the recovered PV (PV units)
    # samples that an otherwise exact law does not explain
    strays: np.ndarray = field(default_factory=lambda: np.empty(0, dtype=int))
    hidden: float = 0.0  # what an archive that reports by exception may hide of a change of OP (%)

    @property
    def known(self) -> bool:
        """Whether a PI law turns the recorded error into OP."""
        return not (self.reason or self.foreign)

    @property
    def apart(self) -> bool:
        """Whether the archive's PV is not the one that the controller saw, which OP shows."""
        return self.recovered_pv is not None and bool(self.reason)
