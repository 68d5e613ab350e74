"""The result of a verification: what was compared, what contradicts the run, and what was not
checked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from simbench.bench.store.benchmark import BENCHMARK
from simbench.detectors.report.report import columns

_SURE = 0.95  # probability with which a change of the stated size is detected


@dataclass(frozen=True)
class Verification:
    """What a verification compared, and what contradicted the run."""

    folder: str
    origin: str  # the run's benchmark, and where its grid comes from
    scenarios: int  # of the run
    simulated: int = 0  # how many of them were simulated again
    # on how many records each method was asked again
    asked: dict[str, int] = field(default_factory=dict)
    unchecked: tuple[str, ...] = ()  # what was not checked
    contradictions: tuple[str, ...] = ()
    unverified: tuple[str, ...] = ()  # methods that were not asked again

    @property
    def holds(self) -> bool:
        """Whether nothing contradicts the run, and every one of its methods was asked again."""
        return not (self.contradictions or self.unverified)

    def as_text(self) -> str:
        """Return one paragraph where nothing contradicts the run, else every contradiction."""
        if self.contradictions:
            return "\n".join(
                [f"{self.folder} is refuted:", *(f"- {c}" for c in self.contradictions)]
            )
        groups: dict[int, list[str]] = {}
        for method, n in self.asked.items():
            groups.setdefault(n, []).append(method)
        asked = "; ".join(
            f"{', '.join(some)} on {n}{_escape(n, self.scenarios)}"
            for n, some in sorted(groups.items())
        )
        begin = f"{self.folder} is verified as a run of {self.origin}."
        if self.unverified:
            begin = "\n".join(
                [
                    f"{self.folder} is not verified: {', '.join(self.unverified)} of its methods"
                    f" {'was' if len(self.unverified) == 1 else 'were'} not asked again; give the"
                    " file of each plug-in with --plugin.",
                    "",
                    *self._by_method(),
                    "",
                    f"The rest agrees with a run of {self.origin}.",
                ]
            )
        return (
            f"{begin} Computed again, with the same"
            f" result: the definitions of all {self.scenarios} scenarios and every score;"
            f" {self.simulated} simulations, drawn at random; the verdicts of these methods:"
            f" {asked or 'none'}. Not checked: {', '.join(self.unchecked)}."
        )

    def _by_method(self) -> list[str]:
        """Return a table of the methods: on how many records each was asked again."""
        rows = [(m, str(n), "verified") for m, n in self.asked.items()]
        rows += [(m, "0", "unverified") for m in self.unverified]
        return columns([("method", "records asked again", "verdicts"), *rows])

    def as_json(self) -> dict[str, Any]:
        """Return the same as JSON types."""
        numbers = {"scenarios": self.scenarios, "simulated": self.simulated, "asked": self.asked}
        lists = {
            "unverified": list(self.unverified),
            "unchecked": list(self.unchecked),
            "contradictions": list(self.contradictions),
        }
        return {
            "verified": self.holds,
            BENCHMARK: self.origin,
            **numbers,
            **lists,
            "text": self.as_text(),
        }


class Notes:
    """Contradictions by what they concern, counted, each with its first example."""

    def __init__(self) -> None:
        self.entries: dict[str, tuple[int, str, Any, Any]] = {}

    def add(self, what: str, where: str, stated: Any, again: Any) -> None:
        """Note one contradiction: what differs, in which scenario or file, what the run states,
        what was computed again.
        """
        count, *first = self.entries.get(what, (0, where, stated, again))
        self.entries[what] = (count + 1, *first)

    def compare(self, what: str, where: str, stated: Any, again: Any) -> None:
        """Note a contradiction unless both are equal; of tables, one for every key."""
        if isinstance(stated, dict) and isinstance(again, dict):
            for key in {**stated, **again}:
                self.compare(f"{what}: {key}", where, stated.get(key), again.get(key))
        elif stated != again:
            self.add(what, where, stated, again)

    def merge(self, other: Notes) -> None:
        """Take over the contradictions of a piece."""
        for what, (count, *first) in other.entries.items():
            before, *earlier = self.entries.get(what, (0, *first))
            self.entries[what] = (before + count, *earlier)

    def sentences(self) -> Iterator[str]:
        """Yield a sentence about each kind of contradiction."""
        if "scenario: record_hash" in self.entries:
            yield (
                "records differ; they also do on a processor of another kind, which this cannot"
                " tell from a change"
            )
        for what, (count, where, stated, again) in self.entries.items():
            times = f" {count} times, first in {where}" if where else ""
            yield (
                f"{what} differs{times}: the run states {str(stated)[:200]}, computed again it is"
                f" {str(again)[:200]}"
            )


def _escape(asked: int, scenarios: int) -> str:
    if asked >= scenarios:
        return " (all)"
    least = math.ceil(math.log(1 - _SURE) / math.log1p(-asked / scenarios))
    return (
        f" (fewer than {least} changed verdicts of a method can escape with a probability above"
        f" {1 - _SURE:.0%})"
    )
