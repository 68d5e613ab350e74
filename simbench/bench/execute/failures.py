"""Count the failures of a run: scenarios that could not be simulated, and methods that raised an
exception.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow.compute as pc

from simbench.bench.store.manifest import read_manifest
from simbench.bench.store.reading import read_table


@dataclass(frozen=True)
class Failures:
    """What went wrong in a run without ending it."""

    of: int  # scenarios of the run
    scenarios: int  # how many could not be simulated
    # on how many of the others each method raised; those that never did are left out
    methods: dict[str, int] = field(default_factory=dict)
    # error texts of scenarios ("simulation: ...") and methods ("ID: ..."), most frequent first
    reasons: dict[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        """One sentence; empty when nothing failed."""
        clauses = []
        if self.scenarios:
            clauses.append(f"{self.scenarios} of {self.of} scenarios could not be simulated")
        for m, n in self.methods.items():
            clauses.append(f"method {m} failed on {n} of {self.of - self.scenarios} records")
        first = next(iter(self.reasons), "")
        if clauses:
            return f"{'; '.join(clauses)} (most often: {first})"
        return ""

    def above(self, share: float) -> bool:
        """Return whether more than a share of the scenarios, or of the records of one method,
        failed.
        """
        judged = max(self.of - self.scenarios, 1)
        return (
            max([self.scenarios / max(self.of, 1)] + [n / judged for n in self.methods.values()])
            > share
        )

    def as_json(self) -> dict[str, Any]:
        """Return JSON types."""
        return {
            "scenarios": self.scenarios,
            "of": self.of,
            "methods": self.methods,
            "reasons": self.reasons,
        }


def read_failures(folder: str | Path) -> Failures:
    """Count what failed in a finished run."""
    manifest = read_manifest(folder)
    filled = pc.field("error").is_valid()
    unrun = read_table(folder, "scenarios", ["scenario_id", "error"], filled).to_pydict()
    raised = read_table(folder, "verdicts", ["scenario_id", "method", "error"], filled).to_pylist()
    lost = set(unrun["scenario_id"])
    rows = [(r["method"], r["error"]) for r in raised if r["scenario_id"] not in lost]
    reasons = Counter([f"simulation: {e}" for e in unrun["error"]] + [f"{m}: {e}" for m, e in rows])
    methods = Counter(m for m, _ in rows)
    of = manifest["counts"]["scenarios"]
    return Failures(of, len(lost), dict(methods), dict(reasons.most_common(20)))
