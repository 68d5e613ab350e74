"""One row of evidence: what one source shows of one effect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from simbench.gap.effects import Parameters

LAW = "controller's law"
SAMPLES = "single samples"
MV = "MV"
PV = "PV beside OP"
ALONE = "OP and PV without a model"


@dataclass(frozen=True)
class Evidence:
    """What one source shows of one effect: nats over no effect, and the effect's numbers in the
    units of the loop file.
    """

    effect: str
    source: str
    nats: float
    numbers: Parameters = field(default_factory=dict)


def known_by(rows: Iterable[Evidence]) -> list[str]:
    """Return the effects that the controller's law or single samples show: every model has them."""
    return list(dict.fromkeys(row.effect for row in rows if row.source in (LAW, SAMPLES)))


def nats_of(rows: Iterable[Evidence]) -> dict[str, float]:
    """Return the sum of every effect's rows."""
    total: dict[str, float] = {}
    for row in rows:
        total[row.effect] = total.get(row.effect, 0.0) + row.nats
    return total
