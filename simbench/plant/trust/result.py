"""Trust: what can be believed of one record as one data object, as text and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from detectors.record import LoopRecord
from detectors.verdict import NO_STICTION, PROBABILITY, STICTION, Verdict
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.conclusion import Conclusion
from simbench.plant.episodes import OverTime
from simbench.plant.trust.power import POWER, Cell, Rule
from simbench.plant.trust.remedies import Remedy


@dataclass(frozen=True)
class MethodTrust:
    """What one method is worth on this loop: its verdict on the record, and its record on the
    twins.

    `rule` is how it is to be read here; false alarms, power and likelihood ratio are those of the
    published rule.
    """

    verdict: Verdict
    rule: Rule
    false_alarms: float
    power: tuple[Cell, ...]
    likelihood_ratio: float

    @property
    def verdict_here(self) -> str:
        """Verdict of the method on the record, read as advised."""
        return self.rule.verdict_of(self.verdict)


@dataclass(frozen=True, eq=False)
class Trust:
    """What can be believed of this record.

    `methods` stand as they agree with the probability and are right on the twins;
    `smallest_visible` (S, J in the unit of the record's S) and `power` are those of the method most
    often right on the twins, as read best; `twins` are S and J (%) of each.
    """

    conclusion: Conclusion
    methods: tuple[MethodTrust, ...]
    smallest_visible: tuple[float, float] | None
    power: tuple[Cell, ...]
    twins: tuple[tuple[float, float], ...]
    helps: tuple[Remedy, ...]
    notes: tuple[str, ...]
    record: LoopRecord = field(repr=False)
    candidates: CandidateLoops | None = field(repr=False, default=None)
    over_time: OverTime | None = field(repr=False, default=None)

    @property
    def probability(self) -> float | None:
        """Probability of stiction; None where the record cannot be judged."""
        return self.conclusion.probability

    @property
    def best(self) -> MethodTrust | None:
        """The method to trust here."""
        return self.methods[0] if self.methods and self.twins else None

    def as_json(self) -> dict[str, Any]:
        """Return the answer in JSON types, keys as the contract has them."""
        seen, best = self.smallest_visible, self.best
        return {
            "methods": [_as_row(m) for m in self.methods],
            "best": best.verdict.method if best else None,
            "smallest_visible": None if seen is None else {"S": seen[0], "J": seen[1]},
            "probability": self.probability,
            PROBABILITY: self.probability,
            "twins": len(self.twins),
            "conclusion": self.conclusion.as_json(),
            "notes": [
                self.sentence(),
                self._seen(),
                *self._asides(),
                *(r.sentence() for r in self.helps),
                *self.notes,
                *self.record.notes,
            ],
        }

    def sentence(self) -> str:
        """Return the conclusion in one line."""
        return self.conclusion.sentence()

    def _seen(self) -> str:
        """Return what simulated replicates of the loop would have shown."""
        if not self.twins:
            return f"no simulated replicates: {self.notes[0]}"
        return (
            f"smallest stiction detected in at least 4 of 5 simulated replicates: {self._visible()}"
        )

    def _visible(self) -> str:
        seen = self.smallest_visible
        return "none of the sizes tried" if seen is None else (
            f"S = {seen[0]:.2g}, J = {seen[1]:.2g} {self.record.S_unit}"
        )  # fmt: skip

    def _asides(self) -> list[str]:
        """Return how the best method is to be read, and its verdicts over time, as far as there is
        something to say.
        """
        sentences = [f"best read here: {_reading(self.best.rule)}"] if self.best is not None else []
        if self.over_time is not None and self.over_time.several:
            sentences.append(f"over time: {self.over_time.sentence()}")
        return sentences

    def power_line(self) -> str:
        """Return in one line what this record could have shown, and whom to believe."""
        best = self.best
        if best is None:
            return f"power: unknown ({self.notes[0]})"
        return (
            f"power: this record would have shown {self._visible()}; probability of stiction"
            f" {self.probability:.2f}; the method to trust: {_reading(best.rule)}, right on"
            f" {best.rule.right:.0%} of its {len(self.twins)} twins"
        )

    def as_text(self) -> str:
        """Return the answer for people: the sentence, whom to trust, the table of methods, what
        would help.
        """
        lines = [*self.conclusion.as_lines(), f"{self._seen()[0].upper()}{self._seen()[1:]}."]
        best = self.best
        if best is not None:
            agrees = best.verdict_here == likely(self.probability or 0.0)
            why = (
                "the highest of the methods that agree with the conclusion"
                if agrees
                else "the highest of all methods, though none agrees with the probability"
            )
            lines += [
                (
                    f"Most reliable method here: {_reading(best.rule)}. Its verdict:"
                    f" {best.verdict_here.replace('_', ' ')}. Its accuracy on simulated"
                    f" replicates of this loop is {best.rule.right:.0%} (sticky and healthy"
                    f" weighted equally), {why}."
                ),
                "",
                *_table(self.methods),
            ]
        notes = [f"note: {n}" for n in (*self._asides()[1:], *self.notes)]
        more = [*(r.sentence() for r in self.helps), *notes]
        return "\n".join([*lines, *([""] if more else []), *more])


def likely(probability: float) -> str:
    """Return the verdict that a probability of stiction makes the more probable one."""
    return STICTION if probability > 0.5 else NO_STICTION


def _as_row(m: MethodTrust) -> dict[str, Any]:
    return {
        "method": m.verdict.method,
        "applicable": m.verdict.applicable,
        "verdict": m.verdict.verdict,
        "false_alarms": m.false_alarms if np.isfinite(m.false_alarms) else None,
        "power": [{"S": c.S, "J": c.J, "found": c.share, "lo": c.lo, "hi": c.hi} for c in m.power],
        "likelihood_ratio": m.likelihood_ratio,
    }


def _reading(rule: Rule) -> str:
    return (
        rule.method
        if rule.cut is None
        else f"{rule.method} (calling stiction from a score of {rule.cut:.3g} on)"
    )


def _table(methods: Sequence[MethodTrust]) -> list[str]:
    """Return one row per method: its verdict here, and how it does on the simulated replicates."""
    lines = [
        f"{'':<18} {'verdict':<15} {'accuracy on':>11} {'false-pos.':>10} {'detects S from':>16}"
        f" {'stiction':>12}",
        f"{'method':<18} {'here':<15} {'replicates':>11} {'rate':>10} {'J = S/4':>8}"
        f" {'J = S':>7} {'from score':>12}",
    ]
    for m in methods:
        v = m.verdict
        where = "not applicable" if v.applicable is False else v.verdict.replace("_", " ")
        deadband, equal = (_detects_from(m, equal) for equal in (False, True))
        cut = "" if m.rule.cut is None else f"{m.rule.cut:.3g}"
        lines.append(
            f"{v.method:<18} {where:<15} {m.rule.right:>11.2f} {m.false_alarms:>10.2f}"
            f" {deadband:>8} {equal:>7} {cut:>12}".rstrip()
        )
    return lines


def _detects_from(m: MethodTrust, equal: bool) -> str:
    """Return the least S from which the method finds four of five sticky replicates, of J = S or
    smaller J; "-" where it does not at the largest.
    """
    least = "-"
    cells = [c for c in m.power if (c.J > 0.5 * c.S) is equal]
    for cell in sorted(cells, key=lambda c: -c.S):
        if not cell.share >= POWER:
            break
        least = f"{cell.S:.2g}"
    return least
