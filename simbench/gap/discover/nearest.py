"""The known effect that a law resembles most: its recogniser says which laws act as it does."""

from __future__ import annotations

import numpy as np

from simbench.gap.effects import recogniser
from simbench.gap.law import FoundLaw
from simbench.loop.effects import EFFECTS

_SLIPS = 0.12  # share of the band that a slip must make up for the law to have one
_FLAT = 0.3  # of a curve's slope, that its flattest stretch may keep to be flat


def nearest(law: FoundLaw, op: np.ndarray) -> str | None:
    """Return the id of the known effect that a law resembles; None where none does."""
    n = law.numbers
    if law.form == "memory":
        said = ["memory J" if n.get("J", 0.0) > _SLIPS * n["S"] else "memory S"]
    elif law.form == "curve":
        slopes = np.diff(curve_of(n, np.linspace(float(op.min()), float(op.max()), 60)))
        inside = 0 < slopes.argmin() < slopes.size - 1
        said = ["curve flat" if slopes.min() < _FLAT * slopes.max() and inside else "curve bent"]
    else:
        said = [law.form, *(f"{law.form} {name}" for name, value in n.items() if value)]
    # an effect whose first law this is comes before one that only acts alike
    order = sorted(EFFECTS, key=lambda e: said[0] not in recogniser(e).laws[:1])
    return next((e for e in order if set(said) & set(recogniser(e).laws)), None)


def curve_of(numbers: dict[str, float], u: np.ndarray) -> np.ndarray:
    """Return MV (n,) of OP `u` (n,) by the numbers of a static curve."""
    return u + sum(numbers.get(f"k{i}", 0.0) * np.maximum(u - numbers.get(f"q{i}", 50.0), 0.0) for i in (1, 2, 3))
