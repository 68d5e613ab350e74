"""Records of a world in fixed numbers of kinds, as the study of predictions draws them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from results.studies.withheld.making import PLANTS
from results.studies.withheld.world import PLANNED

_NEEDS_T = "time_constant_mismatch"


@dataclass(frozen=True)
class Mixture:
    """Medium and strong single effects, none, two and foreign, in fixed numbers; effects drawn
    without return.
    """

    seed: int
    single: int = 6
    none: int = 3
    two: int = 0
    foreign: int = 1

    def entries(self, foreign: list[str]) -> list[dict[str, Any]]:
        """Return one entry per record, as a world draws it."""
        rng = np.random.default_rng(self.seed)
        turns = -(-self.single // len(PLANNED))
        effects = [str(e) for _ in range(turns) for e in rng.permutation(PLANNED)][: self.single]
        out = [
            {
                "kind": "single",
                "effect": e,
                "strength": ("medium", "strong")[i % 2],
                "mv": i % 3 == 0,
                "plant": PLANTS[0] if e == _NEEDS_T else PLANTS[i % 3],
            }
            for i, e in enumerate(effects)
        ]
        strange = [str(e) for e in rng.permutation(foreign)]
        out += [
            {
                "kind": "foreign",
                "effect": strange[i % len(strange)],
                "strength": ("medium", "strong")[i % 2],
                "mv": i % 3 == 0,
            }
            for i in range(self.foreign)
        ]
        return out + [
            {"kind": k, "mv": i % 3 == 0} for k in ("none", "two") for i in range(getattr(self, k))
        ]
