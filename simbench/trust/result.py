"""Trust: the answer of `simbench trust` about one record, printed as text or as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_STICTION, PROBABILITY, STICTION, Verdict
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.conclusion import Conclusion
from simbench.gap.thresholds import LIKELIER
from simbench.trust.power import POWER, Cell, Rule
from simbench.trust.remedies import Remedy

_MOST_RIVALS = 4  # names of methods that a sentence holds


@dataclass(frozen=True)
class MethodTrust:
    """One method's verdict on the record, and its error rates on simulated replicates of the loop.

    `rule` is the reading advised on this loop; false alarms, power and likelihood ratio are those
    of the published rule.
    """

    verdict: Verdict
    rule: Rule
    false_positives: float
    power: tuple[Cell, ...]
    likelihood_ratio: float

    @property
    def verdict_here(self) -> str:
        """Verdict of the method on the record, read as advised."""
        return self.rule.verdict_of(self.verdict)


@dataclass(frozen=True, eq=False)
class Trust:
    """The conclusion about one record, and how reliable each method is on its loop."""

    conclusion: Conclusion
    # those that agree with the conclusion first, the most accurate on simulated replicates first
    methods: tuple[MethodTrust, ...]
    # S and J (in the unit of the record's S) that the most accurate reading sees, and its power
    smallest_visible: tuple[float, float] | None
    power: tuple[Cell, ...]
    twins: tuple[tuple[float, float], ...]  # S and J (%) of each replicate
    helps: tuple[Remedy, ...]  # what would make the answer more reliable
    notes: tuple[str, ...]
    record: LoopRecord = field(repr=False)
    candidates: CandidateLoops | None = field(repr=False, default=None)
    # the reading that is most often right on the replicates, whether it agrees or not
    most_accurate: Rule | None = None
    # 90 % interval of the smallest visible S, inf beyond the sizes tried
    visible_range: tuple[float, float] = (np.inf, np.inf)
    # methods whose accuracy the replicates cannot tell from the first one's
    rivals: tuple[str, ...] = ()
    # that the replicates are not near the record, and what follows; "" where they are
    far: str = ""

    def __repr__(self) -> str:
        """Return one line."""
        return f"Trust: {self.sentence()}"

    def _repr_html_(self) -> str:
        return "".join(f"<p>{escape(line)}</p>" for line in self.first_lines())

    def first_lines(self) -> list[str]:
        """Return what stands above the table: whether the replicates are this loop's, the
        conclusion and the most reliable method.
        """
        far = [f"{self.far[0].upper()}{self.far[1:]}."] if self.far else []
        return [*far, *self.conclusion.as_lines(), *self.advice()]

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
                *([self.far] if self.far else []),
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
        """Return the smallest stiction that the most accurate method detects on replicates."""
        if self.most_accurate is None:
            return f"no simulated replicates: {self.notes[0]}"
        seen, (lo, hi) = self.smallest_visible, self.visible_range
        unit = self.record.S_unit
        if seen is not None:
            most = f"{hi:.2g}" if np.isfinite(hi) else "beyond the sizes tried"
            size = f"S = {seen[0]:.2g} (90 % interval {lo:.2g} to {most}), J = {seen[1]:.2g} {unit}"
        elif np.isfinite(lo):
            size = f"none of the sizes tried (90 % interval of S from {lo:.2g} {unit} on)"
        else:
            size = "none of the sizes tried"
        return (
            f"smallest stiction that {_reading(self.most_accurate)} detects in at least 4 of 5"
            f" simulated replicates of this loop: {size}"
        )

    def _asides(self) -> list[str]:
        """Return the most reliable method, where there is one."""
        best = self.best
        if best is None:
            return []
        return [f"most reliable method here: {_reading(best.rule)}{self._ties()}"]

    def _ties(self) -> str:
        """Return, after a semicolon, from which methods the first one cannot be told."""
        if not self.rivals:
            return ""
        more = len(self.rivals[_MOST_RIVALS:])
        *names, last = [*self.rivals[:_MOST_RIVALS], *([f"{more} more"] if more else [])]
        named = f"{', '.join(names)} and {last}" if names else last
        return f"; these replicates cannot tell it from {named}"

    def power_line(self) -> str:
        """Return in one line the smallest visible stiction, and the most reliable method."""
        best = self.best
        if best is None:
            return f"power: unknown ({self.notes[0]})"
        return (
            f"power: {self._seen()}; probability of stiction {self.probability:.2f}; most reliable"
            f" method here: {_reading(best.rule)}, right on {best.rule.right:.0%} of"
            f" {len(self.twins)} simulated replicates"
        )

    def as_text(self) -> str:
        """Return the conclusion, the most reliable method, the table of methods, what would help
        and the notes.
        """
        lines = self.first_lines()
        if self.best is not None:
            lines += ["", *_table(self.methods, self.record.S_unit), self._legend()]
        notes = [f"note: {n}" for n in (*self._asides()[1:], *self.notes)]
        more = [*(r.sentence() for r in self.helps), *notes]
        return "\n".join([*lines, *([""] if more else []), *more])

    def advice(self) -> list[str]:
        """Return the smallest visible stiction and the most reliable method, a line each.

        Returns
        -------
        list of str
            One or two sentences.
        """
        seen = self._seen()
        lines, best = [f"{seen[0].upper()}{seen[1:]}."], self.best
        if best is not None:
            agrees = best.verdict_here == likelier_verdict(self.probability or 0.0)
            why = (
                "the highest of the methods that agree with the conclusion"
                if agrees
                else "the highest of all methods, though none agrees with the probability"
            )
            lines.append(
                f"Most reliable method here: {_reading(best.rule)}. Its verdict:"
                f" {best.verdict_here.replace('_', ' ')}. Its accuracy on the replicates is"
                f" {best.rule.right:.0%}, {why}{self._ties()}."
            )
        return lines

    def _legend(self) -> str:
        """Return what the columns of the table mean."""
        sticky = sum(S > 0 for S, _ in self.twins)
        return (
            f"Replicates: this loop simulated {len(self.twins) - sticky} times with a healthy valve"
            f" and {sticky} times with stiction; accuracy weights both equally. Smallest S:"
            " detected in 4 of 5 replicates (-: in none of the sizes tried). Threshold: the method"
            " reports stiction above this score (empty: as published)."
        )


def likelier_verdict(probability: float) -> str:
    """Return the verdict that a probability of stiction makes the more probable one."""
    return STICTION if probability > LIKELIER else NO_STICTION


def _as_row(m: MethodTrust) -> dict[str, Any]:
    return {
        "method": m.verdict.method,
        "applicable": m.verdict.applicable,
        "verdict": m.verdict.verdict,
        "false_alarms": m.false_positives if np.isfinite(m.false_positives) else None,
        "power": [{"S": c.S, "J": c.J, "found": c.share, "lo": c.lo, "hi": c.hi} for c in m.power],
        "likelihood_ratio": m.likelihood_ratio,
    }


def _reading(rule: Rule) -> str:
    threshold = "its published threshold" if rule.cut is None else f"a threshold of {rule.cut:.3g}"
    return f"{rule.method} with {threshold}"


def _table(methods: Sequence[MethodTrust], unit: str) -> list[str]:
    """Return one row per method: its published rule, then the reading advised on this loop."""
    of_travel = "%" if unit.startswith("%") else unit
    lines = [
        f"{'':<18} with the published threshold:{'':<26}as advised for this loop:",
        f"{'':<18} {'':<15} {'false':>9} {f'smallest S ({of_travel})':>17}",
        f"{'method':<18} {'verdict':<15} {'positives':>9} {'J = S/4':>9} {'J = S':>7}"
        f" {'threshold':>14} {'accuracy':>10}",
    ]
    for m in methods:
        v = m.verdict
        published = "not applicable" if v.applicable is False else v.verdict.replace("_", " ")
        deadband, equal = (_detects_from(m, equal) for equal in (False, True))
        cut = "" if m.rule.cut is None else f"{m.rule.cut:.3g}"
        lines.append(
            f"{v.method:<18} {published:<15} {m.false_positives:>9.2f} {deadband:>9} {equal:>7}"
            f" {cut:>14} {m.rule.right:>10.2f}"
        )
    return lines


def _detects_from(m: MethodTrust, equal: bool) -> str:
    """Return the smallest S from which the method detects four of five sticky replicates, those
    with J = S or those with less; "-" where it does not at the largest size.
    """
    least = "-"
    cells = [c for c in m.power if (c.J > 0.5 * c.S) is equal]
    for cell in sorted(cells, key=lambda c: -c.S):
        if not cell.share >= POWER:
            break
        least = f"{cell.S:.2g}"
    return least
