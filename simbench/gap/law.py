"""An empirical model identified from a record: block, form, parameters, where it acts, and how much
it improves unseen samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from simbench.detectors.signal.holds import runs_of
from simbench.loop.laws import LAW_FORMS


@dataclass(frozen=True, eq=False)
class FoundLaw:
    """An empirical model: its form and parameters (units of the loop file), fitted to the first
    part of a record.

    `nats` is what it brings on the samples it was not fitted to, `evidence` (n,) the same sample by
    sample over the record, `intervals` the values of each number that do little worse, `on` (n,)
    where an intermittent effect is active; `late` is the delay (samples) of the archived OP behind
    PV.
    """

    form: str
    numbers: dict[str, float]
    nats: float
    evidence: np.ndarray | None = None
    on: np.ndarray | None = None
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    late: int = 0

    @property
    def block(self) -> str:
        """Block of the form."""
        return LAW_FORMS[self.form].block

    @property
    def text(self) -> str:
        """The empirical model in words, with its parameters."""
        rules = LAW_FORMS[self.form].numbers
        terms = [
            f"{name} = {value:.3g}{f' {rules[name].unit}' if rules[name].unit != '-' else ''}"
            for name, value in self.numbers.items()
            if value != rules[name].identity
        ]
        return f"{LAW_FORMS[self.form].says}: {', '.join(terms)}"


def spells_of(evidence: np.ndarray, price: float) -> np.ndarray:
    """Return where (True) an empirical model is most likely active, from its `evidence` (n,) per
    sample; each change costs `price` (Viterbi).
    """
    n = evidence.size
    came_on, came_off = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    on, off = 0.0, 0.0
    for k, gain in enumerate(evidence.tolist()):
        came_on[k], came_off[k] = off - price > on, on - price > off
        on, off = max(on, off - price) + gain, max(off, on - price)
    state, out = on > off, np.zeros(n, dtype=bool)
    for k in range(n - 1, -1, -1):
        out[k] = state
        state = (not came_on[k]) if state else bool(came_off[k])
    return out


def windows_of(on: np.ndarray, Ts: float) -> list[list[float]]:
    """Return begin and end (s) of every interval of True."""
    return [[float(a * Ts), float(b * Ts)] for a, b in runs_of(on)]
