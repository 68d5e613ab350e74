"""`Study`: the comparison of a set of records with a grid, as text and as JSON."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

_HALF_A_POINT = 0.005  # of accuracy, from which a cost is named


@dataclass(frozen=True)
class Contribution:
    """One effect: share of loops that have it, distance once it has joined those before it, what it
    alone costs each method.
    """

    effect: str
    share: float
    distance_after: float
    costs: dict[str, float]
    strengths: tuple[dict[str, Any], ...] = field(repr=False)

    def costly(self) -> dict[str, float]:
        """Return what it costs the methods that it costs half a point or more, the dearest
        first.
        """
        return {
            m: c for m, c in sorted(self.costs.items(), key=lambda kv: kv[1]) if c <= -_HALF_A_POINT
        }


@dataclass(frozen=True, eq=False)
class Study:
    """Records against a grid; the fields are those of the JSON, and the classifier's AUC with its
    p-value.

    `simulated` and `real` are accuracies of every method, no decision counting as wrong; `moved`
    once all effects have joined.
    """

    records: int
    loops: int
    distance: dict[str, float]
    classifier: tuple[float, float]
    features: list[dict[str, float | str]]
    effects: tuple[Contribution, ...]
    simulated: dict[str, float]
    real: dict[str, dict[str, float]]
    moved: dict[str, float]
    notes: tuple[str, ...]
    grid: str

    def as_json(self) -> dict[str, Any]:
        """Return the study in JSON types, keys as the contract has them."""
        return {
            "records": self.records,
            "loops": self.loops,
            "distance": self.distance,
            "features": self.features,
            "effects": [
                {
                    "effect": e.effect,
                    "share": e.share,
                    "distance_after": e.distance_after,
                    "costs": e.costs,
                }
                for e in self.effects
            ],
            "simulated": self.simulated,
            "real": self.real,
            "notes": list(self.notes),
        }

    def as_text(self) -> str:
        """Return the study for people."""
        d, auc = self.distance, self.classifier
        lines = [
            f"{self.records} records of {self.loops} loops against grid {self.grid}:",
            (
                f"distance {d['value']:.2f} ({d['lo']:.2f} to {d['hi']:.2f}), p = {d['p']:.3f}; "
                f"a classifier tells them apart with AUC {auc[0]:.2f}, p = {auc[1]:.2f}"
            ),
            "features that differ: "
            + (
                ", ".join(
                    f"{f['name']} ({f['shift']:+.1f})"
                    for f in self.features[:6]
                    if float(f["p"]) < 0.05
                )
                or "none for certain"
            ),
        ]
        for e in self.effects:
            costly = ", ".join(f"{m} {100 * c:+.0f}" for m, c in [*e.costly().items()][:4])
            price = f"accuracy {costly} points" if costly else "no method is less often right"
            lines.append(
                f"+ {e.effect}: in {e.share:.0%} of the loops; distance then"
                f" {e.distance_after:.2f}; {price}"
            )
        for m, value in self.simulated.items():
            real = self.real.get(m)
            measured = (
                ""
                if real is None
                else f", on these loops {real['value']:.2f} ({real['lo']:.2f} to {real['hi']:.2f})"
            )
            lines.append(
                f"{m:<18} on the grid {value:.2f}, with the effects {self.moved[m]:.2f}{measured}"
            )
        return "\n".join([*lines, *(f"note: {n}" for n in self.notes)])
