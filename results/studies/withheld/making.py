"""Draw records for the blind test, write them under neutral names, and keep the answers in the
key.
"""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from joblib import delayed

from results.studies.withheld import truth
from results.studies.withheld.files import write_item
from results.studies.withheld.handout import commitment_of, refuse_key_inside, refuse_unwritable_key
from results.studies.withheld.world import PLANNED
from results.studies.worlds import NAMES, load_world
from simbench.detectors.errors import ParameterError
from simbench.files import folder
from simbench.parallel import run_parallel

PLANTS = ("foptd", "foptd", "integrating")
_NEEDS_T = "time_constant_mismatch"
STRENGTHS = ("weak", "medium", "strong")
_ANSWER_COLUMNS = (
    "id",
    "world",
    "kind",
    "block",
    "effect",
    "block2",
    "effect2",
    "strength",
    "ratio",
    "shrinkage",
    "gap_before",
    "gap_after",
    "floor",
    "parameters",
    "parameters2",
    "foreign",
    "mv",
    "plant",
    "controller",
    "sp_moves",
    "case",
    "seed",
)


_ALL_KINDS = 100  # records, from which every effect comes in every strength


@dataclass(frozen=True)
class Plan:
    """Numbers of records of each kind in a blind test."""

    per_cell: int = 5  # single-effect records per effect and strength
    # none, two, foreign: records without effect, with two effects from different blocks, with a
    # foreign fault
    none: int = 120
    two: int = 75
    foreign: int = 75
    # effects, strengths: restrict the cells
    effects: tuple[str, ...] = PLANNED
    strengths: tuple[str, ...] = STRENGTHS
    most: int | None = None  # of these records, spread evenly over all kinds

    @classmethod
    def of(cls, n: int) -> Plan:
        """Return the usual shares for about `n` records: 55 % single effects, 20 % none, the rest
        two effects and foreign, of fewer than 100 a selection.
        """
        if n < 1:
            raise ParameterError(f"withheld: {n} records asked for; at least 1 is needed")
        if n < _ALL_KINDS:
            return replace(cls.of(_ALL_KINDS), most=n)
        per_cell = max(1, round(0.55 * n / (len(PLANNED) * len(STRENGTHS))))
        rest = n - per_cell * len(PLANNED) * len(STRENGTHS)
        none = round(rest * 0.45)
        two = (rest - none) // 2
        return cls(per_cell=per_cell, none=none, two=two, foreign=rest - none - two)

    def entries(self, foreign: Sequence[str]) -> list[dict[str, Any]]:
        """Return one entry per record, in order, with the effects that it must have; `foreign` are
        kinds that the diagnosis does not know.
        """
        single = [
            {
                "kind": "single",
                "effect": e,
                "strength": s,
                "mv": (i + j + k) % 2 == 0,
                "plant": _plant(e, i + j + 2 * k),
            }
            for j, e in enumerate(self.effects)
            for k, s in enumerate(self.strengths)
            for i in range(self.per_cell)
        ]
        unexplained = [
            {
                "kind": "foreign",
                "effect": foreign[i % len(foreign)],
                "strength": ("medium", "strong", "weak")[i // len(foreign) % 3],
                "mv": i % 2 == 0,
            }
            for i in range(self.foreign)
        ]
        others = [
            {"kind": kind, "mv": i % 2 == 0}
            for kind in ("none", "two")
            for i in range(getattr(self, kind))
        ]
        every = single + others + unexplained
        count = len(every) if self.most is None else self.most
        return [every[i * len(every) // count] for i in range(count)]


def _plant(effect: str, turn: int) -> str:
    # an integrating plant has no time constant that could be another one
    return PLANTS[0] if effect == _NEEDS_T else PLANTS[turn % 3]


def _answers_csv(answers: list[dict[str, Any]]) -> str:
    """Return the answers as the text of answers.csv; tables inside a cell are JSON."""
    text = io.StringIO()
    writer = csv.DictWriter(text, _ANSWER_COLUMNS, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {k: json.dumps(v, sort_keys=True) if isinstance(v, dict) else v for k, v in row.items()}
        for row in answers
    )
    return text.getvalue()


def make(
    out: str | Path,
    key: str | Path,
    seed: int,
    n: int = 600,
    plan: Plan | None = None,
    jobs: int = 1,
    world: str = NAMES[0],
) -> str:
    """Write a withheld folder and, elsewhere, the key to its answers."""
    out, key = Path(out), Path(key)
    refuse_key_inside("withheld", key, out)
    if seed < 0:
        raise ParameterError(f"withheld: --seed {seed}; an integer from 0 on is needed")
    if (out / "records").exists():
        raise ParameterError(f"withheld: {out} holds records already; choose a new folder")
    # one without records is of a call that was killed: it begins anew
    if key.exists() and not truth.is_key_of(key, out):
        raise ParameterError(f"withheld: {key} exists already; choose a new file")
    drawn_by = load_world(world)
    refuse_unwritable_key(key)
    folder(out)
    plan = plan or Plan.of(n)
    entries = plan.entries(list(drawn_by.FOREIGN))
    calls = [delayed(drawn_by.draw)(seed, i, entry) for i, entry in enumerate(entries)]
    items = run_parallel(calls, jobs, "records")
    order = np.random.default_rng([seed, len(entries)]).permutation(len(items))
    items = [items[i] for i in order]
    names = [f"r{i:0{max(4, int(math.log10(len(items))) + 1)}d}" for i in range(1, len(items) + 1)]
    named = dict(zip(names, items, strict=True))
    answers = [item.answer | {"world": world, "id": name} for name, item in named.items()]
    content = truth.key_to(_answers_csv(answers))
    print(f"commitment {commitment_of(content)}", file=sys.stderr, flush=True)
    half = out / ".records"  # until all of it is written; a call that was killed begins anew
    rmtree(half, ignore_errors=True)
    try:
        for name, item in named.items():
            write_item(item, folder(half), name)
        truth.write(content, out, key)
        half.rename(out / "records")
    finally:
        rmtree(half, ignore_errors=True)
    return commitment_of(content)
