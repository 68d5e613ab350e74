"""A diagnosis that asks: sealed records of every world, scored alone, after tests it chose, a fixed pair and a random one.

`python -m results.studies.asking DIR` makes, answers and opens what is not there yet, and prints all of its results.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from scenarios.spec import read_toml
from simbench.blind import outcomes
from simbench.blind.answering import answer, answers_after
from simbench.blind.claims import true_shrinkages
from simbench.blind.making import PLANTS, make
from simbench.blind.menu import MENU
from simbench.blind.opening import open_
from simbench.blind.score import judge_record, true_circumstances
from simbench.blind.world import PLANNED
from simbench.files import folder as make_folder
from simbench.files import whole_file
from simbench.gap.command import one_file
from simbench.loop.effects import NONE, UNKNOWN

SEEDS = {"own": 312041, "mill": 312042, "refinery": 312043}  # named before anything was answered
TESTS = 2
PAIR = ("mv", "bump")  # the best fixed pair on development draws of another simulator
FIXED, RANDOM = " + ".join(PAIR), "two at random"
_NEEDS_T = "time_constant_mismatch"
FIGURES = {
    "first": ("single", "first"), "group": ("single", "in_group"), "block": ("single", "block_right"),
    "called unknown": ("single", "called_unknown"), "both of two": ("two", "both_named"),
}  # fmt: skip


@dataclass(frozen=True)
class Mixture:
    """Medium and strong single effects, none, two and foreign, in fixed numbers; effects drawn without return."""

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
                "kind": "single", "effect": e, "strength": ("medium", "strong")[i % 2], "mv": i % 3 == 0,
                "plant": PLANTS[0] if e == _NEEDS_T else PLANTS[i % 3],
            }
            for i, e in enumerate(effects)
        ]  # fmt: skip
        strange = [str(e) for e in rng.permutation(foreign)]
        out += [
            {"kind": "foreign", "effect": strange[i % len(strange)], "strength": ("medium", "strong")[i % 2], "mv": i % 3 == 0}
            for i in range(self.foreign)
        ]
        return out + [{"kind": k, "mv": i % 3 == 0} for k in ("none", "two") for i in range(getattr(self, k))]


def answer_otherwise(check: Path, strategy: str, seed: int) -> None:
    """Write answers after two tests that the diagnosis did not choose; nothing is known of the record."""
    place = make_folder(check.parent / f"{check.name}-{strategy.replace(' ', '')}")
    rng = np.random.default_rng(seed)
    for record in sorted((check / "records").glob("*.csv")):
        drawn = [str(x) for x in rng.choice(MENU, TESTS, replace=False)]
        file = place / f"{record.stem}.json"
        if not file.exists():
            ids = PAIR if strategy == FIXED else drawn
            tests = [str(outcomes.open_one(check, record.stem, id_, i + 1)) for i, id_ in enumerate(ids)]
            with whole_file(file) as f:
                f.write(json.dumps(one_file(record, record.with_suffix(".toml"), tests)))


def judged(check: Path, score: Path, strategy: str) -> pd.DataFrame:
    """Return the answers of a strategy judged as `open_` judges the others."""
    rows = []
    for truth in truths(score):
        file = check.parent / f"{check.name}-{strategy.replace(' ', '')}" / f"{truth['id']}.json"
        rows.append(judge_record(truth, _read(file), true_circumstances(truth, *_baseline_and_record(check, truth))))
    return pd.DataFrame(rows)


def truths(score: Path) -> list[dict[str, Any]]:
    """Return the opened answers."""
    rows = pd.read_csv(score / "answers.csv", dtype=str, keep_default_na=False).to_dict("records")
    return [{str(k): json.loads(v) if v.startswith("{") else v for k, v in row.items()} for row in rows]


def learned(folder: Path) -> list[tuple[float, float]]:
    """Return of every test asked for what it was to add to a right answer's probability, and added to the truth's."""
    pairs = []
    for world in SEEDS:
        for truth, tests in [(t, i) for t in truths(folder / f"{world}-score") for i in range(TESTS)]:
            before, after = (_read(answers_after(folder / world, tests + i) / f"{truth['id']}.json") for i in (0, 1))
            expected = (before.get("next_test") or {}).get("p_right_after")
            if expected is not None:
                ranks = [{r["effect"]: r["probability"] for r in found["ranking"]} for found in (before, after)]
                name = UNKNOWN if truth["foreign"] else truth["effect"]
                pairs.append((expected - max(ranks[0].values()), ranks[1].get(name, 0.0) - ranks[0].get(name, 0.0)))
    return pairs


def shrinkages(folder: Path) -> list[tuple[float, float, float, float]]:
    """Return claimed shrinkage after all tests, its interval, and the true one on fresh records of the true loop."""
    rows = []
    for world in SEEDS:
        check = folder / world
        for truth in truths(folder / f"{world}-score"):
            found = _read(answers_after(check, TESTS) / f"{truth['id']}.json")
            claimed = found["shrinkage"]
            if claimed is None or truth["foreign"] or truth["effect"] == NONE or truth["effect2"]:
                continue
            baseline, record = _baseline_and_record(check, truth)
            here = true_circumstances(truth, baseline, record)
            true = {c["effect"]: c["true"] for c in true_shrinkages(truth, found, record, baseline, here, world)}
            if found["effect"] in true:
                rows.append((claimed["value"], claimed["lo"], claimed["hi"], true[found["effect"]]))
    return rows


def _baseline_and_record(check: Path, truth: dict[str, Any]) -> tuple[Any, pd.DataFrame]:
    file = check / "records" / f"{truth['id']}.csv"
    return read_toml(file.with_suffix(".toml")), pd.read_csv(file)


def _read(file: Path) -> dict[str, Any]:
    return json.loads(file.read_text(encoding="utf-8"))


def table(folder: Path, against: Sequence[str] = ()) -> pd.DataFrame:
    """Return a row per world and way of testing, and for all worlds together."""
    found: dict[str, dict[str, pd.DataFrame]] = {}
    for world in SEEDS:
        score = folder / f"{world}-score"
        for tests in range(TESTS + 1):
            file = score / (f"records-{tests}.csv" if tests else "records.csv")
            if file.exists():
                found.setdefault(f"chosen {tests}" if tests else "alone", {})[world] = pd.read_csv(file, keep_default_na=False)
        for strategy in against:
            found.setdefault(strategy, {})[world] = judged(folder / world, score, strategy)
    rows = [_row(world, tests, one) for tests, worlds in found.items() for world, one in worlds.items()]
    rows += [_row("all", tests, pd.concat(worlds.values())) for tests, worlds in found.items() if len(worlds) > 1]
    return pd.DataFrame(rows)


def _row(world: str, tests: str, found: pd.DataFrame) -> dict[str, Any]:
    row: dict[str, Any] = {"world": world, "tests": tests, "n": len(found)}
    for name, (kind, column) in FIGURES.items():
        row[name] = _share(_true(found[found.kind == kind][column]))
    none, foreign = found[found.kind == "none"], found[found.kind == "foreign"]
    row["named where none is"] = _share(~_true(none.called_none) & ~_true(none.called_unknown))
    row["none unknown"] = _share(_true(none.called_unknown))
    row["foreign unknown or block"] = _share(_true(foreign.called_unknown) | _true(foreign.block_right))
    known = found[found.kind.isin(["single", "none"])]
    row["right where p > .9"] = _share(_true(known[known.probability.astype(float) > 0.9]["first"]))
    return row


def _true(x: pd.Series) -> pd.Series:
    return x.astype(str) == "True"


def _share(x: pd.Series) -> str:
    return f"{int(x.sum())}/{len(x)}"


def main() -> None:
    """Make, answer and open what is not there yet; print seeds, sizes and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--against", nargs="*", default=[], choices=(FIXED, RANDOM), help="Answer with such tests too.")
    given = parser.parse_args()
    for world, seed in SEEDS.items():
        check, key = given.folder / world, given.folder / f"{world}.key"
        if not (check / "records").exists():
            make(check, key, seed, plan=Mixture(seed), world=world, tests=True)
        answer(check, one_file, 1, TESTS)
        open_(check, key, given.folder / f"{world}-score", world)
    for strategy in given.against:
        for world, seed in SEEDS.items():
            answer_otherwise(given.folder / world, strategy, seed)
    plan = Mixture(0)
    print(f"seeds {', '.join(f'{world} {seed}' for world, seed in SEEDS.items())}; answered sealed; of each world")
    print(f"{plan.single} single effects (medium, strong), {plan.none} none, {plan.two} two, {plan.foreign} foreign")
    print("chosen: the tests that the diagnosis asked for, at most so many; a shown or settled record asks for none")
    print(table(given.folder, given.against).to_string(index=False))
    pairs = np.array(learned(given.folder))
    rank = stats.spearmanr(*pairs.T).statistic
    print(f"what tests were to add to the probability of a right answer, and added to the truth's: {len(pairs)} tests,")
    print(f"rank correlation {rank:.2f}")
    value, lo, hi, true = np.array(shrinkages(given.folder)).T
    inside, rank = int(((lo <= true) & (true <= hi)).sum()), stats.spearmanr(value, true).statistic
    print(f"shrinkage after tests: interval holds {inside}/{len(true)}, rank correlation {rank:.2f}")


if __name__ == "__main__":
    main()
