"""A diagnosis that asks: sealed records of every world, scored alone, after one and two tests of
its order, and after two at random.

`python -m results.studies.asking DIR -n 40 --none 15 --two 8 --foreign 12 -j 2` makes, answers and
opens what is not there yet (a call that was cut off goes on where it was) and prints a table a
world. `--contradictions 60` gives the diagnosis tests that contradict their records and as many
valid ones; `--plans 60` runs planned tests on the loops of the worlds against their limits;
`--claims 100` compares claimed shrinkages with fresh records of the true loops.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy import stats
from tqdm import tqdm

from results.studies.asking_tests import claimed, contradicted, planned
from results.studies.worlds import WORLDS
from simbench.blind import outcomes
from simbench.blind.answering import answer, answers_after
from simbench.blind.claims import true_shrinkages
from simbench.blind.levels import Share
from simbench.blind.making import PLANTS, make
from simbench.blind.menu import MENU
from simbench.blind.opening import open_
from simbench.blind.score import judge_record, true_circumstances
from simbench.blind.world import PLANNED
from simbench.detectors.errors import ParameterError, UserError
from simbench.files import folder as make_folder
from simbench.files import whole_file
from simbench.gap.command import one_file
from simbench.loop.effects import NONE
from simbench.scenarios.spec import read_toml

# named before anything was answered: the first world's, the next ones' are the next numbers
SEED = 423041
THREE = ("own", "mill", "refinery")
TESTS = 2
_COLUMNS = ("alone", "one test", "two tests")
RANDOM = "two at random"
_FRESH = 3  # records of the true loop on which a claimed shrinkage is looked at
_NEEDS_T = "time_constant_mismatch"
_OF_KIND = {
    "first": ("single", "first"),
    "group": ("single", "in_group"),
    "block": ("single", "block_right"),
    "called unknown": ("single", "called_unknown"),
    "both of two": ("two", "both_named"),
}


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


def answer_sealed(folder: Path, world: str, plan: Mixture, jobs: int) -> None:
    """Make, answer with the tests that the diagnosis asks for and open a world's records, as far as
    it is not done.
    """
    check, key = folder / world, folder / f"{world}.key"
    if not (check / "records").exists():
        make(check, key, plan.seed, plan=plan, jobs=jobs, world=world, tests=True)
    there, asked = (
        len(list((check / "records").glob("*.csv"))),
        plan.single + plan.none + plan.two + plan.foreign,
    )
    if there != asked:
        raise ParameterError(
            f"{check}: {there} records, {asked} were asked for; another folder is needed"
        )
    if not (folder / f"{world}-score" / f"records-{TESTS}.csv").exists():
        answer(check, one_file, jobs, TESTS)
        open_(check, key, folder / f"{world}-score", world)


def answer_at_random(check: Path, seed: int, jobs: int = 1) -> None:
    """Write answers after two tests drawn at random; nothing is known of the record."""
    place, rng, todo = _at_random(check), np.random.default_rng(seed), []
    for record in sorted((check / "records").glob("*.csv")):
        ids = [str(x) for x in rng.choice(MENU, TESTS, replace=False)]
        if not (place / f"{record.stem}.json").exists():
            todo.append((record, ids))
    bar = tqdm(todo, desc=f"{check.name}, {RANDOM}", file=sys.stderr, delay=1.0)
    Parallel(n_jobs=jobs)(
        delayed(_answer_one)(check, make_folder(place), record, ids) for record, ids in bar
    )


def _answer_one(check: Path, place: Path, record: Path, ids: Sequence[str]) -> None:
    tests = [str(outcomes.open_one(check, record.stem, id_, i + 1)) for i, id_ in enumerate(ids)]
    try:
        report = one_file(record, record.with_suffix(".toml"), tests)
    # where a test is refused the answer before it remains, as it does where the diagnosis asked
    except UserError:
        report = _read(answers_after(check, 0) / f"{record.stem}.json")
    with whole_file(place / f"{record.stem}.json") as f:
        f.write(json.dumps(report))


def _at_random(check: Path) -> Path:
    return check.parent / f"{check.name}-{RANDOM.replace(' ', '')}"


def judged(check: Path, score: Path) -> pd.DataFrame:
    """Return the answers after random tests judged as `open_` judges the others."""
    rows = []
    for truth in truths(score):
        scored = _read(_at_random(check) / f"{truth['id']}.json")
        rows.append(
            judge_record(
                truth, scored, true_circumstances(truth, *_baseline_and_record(check, truth))
            )
        )
    return pd.DataFrame(rows)


def truths(score: Path) -> list[dict[str, Any]]:
    """Return the opened answers."""
    rows = pd.read_csv(score / "answers.csv", dtype=str, keep_default_na=False).to_dict("records")
    return [
        {str(k): json.loads(v) if v.startswith("{") else v for k, v in row.items()} for row in rows
    ]


def shrinkages(folder: Path, worlds: Sequence[str]) -> list[tuple[float, float, float, float]]:
    """Return claimed shrinkage after all tests, its interval, and the true one on fresh records of
    the true loop.
    """
    rows = []
    for world in worlds:
        for truth in truths(folder / f"{world}-score"):
            claims = _read(answers_after(folder / world, TESTS) / f"{truth['id']}.json")
            claimed = claims.get("shrinkage")
            if (
                claimed is None
                or truth["foreign"]
                or truth["effect"] == NONE
                or truth["effect2"]
                or len(claims["effects"]) > 1
            ):
                continue
            true = fresh_shrinkage(
                truth, claims, *_baseline_and_record(folder / world, truth), world
            )
            if true is not None:
                rows.append((claimed["value"], claimed["lo"], claimed["hi"], true))
    return rows


def fresh_shrinkage(
    truth: dict[str, Any], values: dict[str, Any], baseline: Any, record: pd.DataFrame, world: str
) -> float | None:
    """Return how far the effect named narrows the gap to other records of the true loop, their
    mean; None without a gap.
    """
    here = true_circumstances(truth, baseline, record)
    named = {**values, "ranking": [r for r in values["ranking"] if r["effect"] == values["effect"]]}
    true, acts = [], [{"effect": truth["effect"], "parameters": truth["parameters"]}]
    for i in range(_FRESH):
        columns = WORLDS.load(world).simulate(truth, acts, int(truth["seed"]) + 7000 + i)
        fresh = pd.DataFrame({name: columns[name] for name in ("sp", "op", "pv")})
        true += [c["true"] for c in true_shrinkages(truth, named, fresh, baseline, here, world)]
    return float(np.mean(true)) if true else None


def _baseline_and_record(check: Path, truth: dict[str, Any]) -> tuple[Any, pd.DataFrame]:
    file = check / "records" / f"{truth['id']}.csv"
    return read_toml(file.with_suffix(".toml")), pd.read_csv(file)


def _read(file: Path) -> dict[str, Any]:
    return json.loads(file.read_text(encoding="utf-8"))


def table(folder: Path, worlds: Sequence[str] = THREE) -> pd.DataFrame:
    """Return shares by figure, a column per way of testing, for each world and for all worlds
    together.
    """
    columns: dict[str, dict[str, pd.DataFrame]] = {}
    for world in worlds:
        score = folder / f"{world}-score"
        for tests in range(TESTS + 1):
            file = score / (f"records-{tests}.csv" if tests else "records.csv")
            if file.exists():
                columns.setdefault(_COLUMNS[tests], {})[world] = pd.read_csv(
                    file, keep_default_na=False
                )
        if _at_random(folder / world).exists():
            columns.setdefault(RANDOM, {})[world] = judged(folder / world, score)
    for by_world in columns.values():
        if len(by_world) > 1:
            by_world["all"] = pd.concat(by_world.values())
    rows = [
        (world, _shares(one), tests)
        for tests, by_world in columns.items()
        for world, one in by_world.items()
    ]
    out = {
        tests: {
            (w, figure): x for w, shares, t in rows for figure, x in shares.items() if t == tests
        }
        for tests in columns
    }
    order = [(world, figure) for world in (*worlds, "all") for figure in rows[0][1]]
    return pd.DataFrame(out).reindex(pd.MultiIndex.from_tuples(order)).dropna(how="all")


def _shares(columns: pd.DataFrame) -> dict[str, str]:
    out = {
        name: _share(_true(columns[columns.kind == kind][column]))
        for name, (kind, column) in _OF_KIND.items()
    }
    none, foreign = columns[columns.kind == "none"], columns[columns.kind == "foreign"]
    out["named where none is"] = _share(~_true(none.called_none) & ~_true(none.called_unknown))
    out["none unknown"] = _share(_true(none.called_unknown))
    out["foreign unknown or block"] = _share(
        _true(foreign.called_unknown) | _true(foreign.block_right)
    )
    known = columns[columns.kind.isin(["single", "none"])]
    out["right where p > .9"] = _share(_true(known[known.probability.astype(float) > 0.9]["first"]))
    return out


def _true(x: pd.Series) -> pd.Series:
    return x.astype(str) == "True"


def _share(x: pd.Series) -> str:
    share = Share("", int(x.sum()), len(x))
    return (
        f"{share.k}/{share.n} [{share.interval[0]:.2f}, {share.interval[1]:.2f}]"
        if share.n
        else "-"
    )


def print_sealed(folder: Path, worlds: Sequence[str]) -> None:
    """Print the table of every world, and whether claimed shrinkages hold."""
    print(
        "one test, two tests: the first ones of the fixed order that the diagnosis asks for; an"
        " answer that is settled asks for none"
    )
    print("95 % Wilson intervals")
    counts = table(folder, worlds)
    for world in counts.index.unique(0):
        print(f"\n{world}\n{counts.loc[world].to_string()}")
    value, lo, hi, true = np.array(shrinkages(folder, worlds)).reshape(-1, 4).T
    rank = stats.spearmanr(value, true).statistic if true.size > 2 else np.nan
    print(
        f"\nshrinkage after tests, on {_FRESH} fresh records of the true loop each: {true.size}"
        " claims,"
    )
    print(
        f"interval holds {_share(pd.Series((lo <= true) & (true <= hi)))}, rank correlation"
        f" {rank:.2f}"
    )
    for name, x in (("claimed", value), ("true", true)):
        quarters = (
            ", ".join(f"{q:.2f}" for q in np.quantile(x, (0.0, 0.25, 0.5, 0.75, 1.0)))
            if x.size
            else "-"
        )
        print(f"{name}: least, quartiles, most {quarters}")


def main() -> None:
    """Make, answer and open what is not there yet; print seeds, sizes and the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "-n",
        "--single",
        type=int,
        default=Mixture.single,
        help="Records of one effect in each world.",
    )
    for kind in ("none", "two", "foreign"):
        parser.add_argument(
            f"--{kind}",
            type=int,
            default=getattr(Mixture, kind),
            help=f"Records of kind {kind} in each world.",
        )
    parser.add_argument(
        "--seed", type=int, default=SEED, help=f"Of {THREE[0]}; the next worlds have the next."
    )
    parser.add_argument("--worlds", nargs="*", default=THREE, choices=THREE)
    parser.add_argument(
        "--random", action="store_true", help="Answer after two random tests of each record too."
    )
    parser.add_argument(
        "--contradictions",
        type=int,
        default=0,
        metavar="N",
        help="Contradictory tests, and valid ones.",
    )
    parser.add_argument(
        "--plans", type=int, default=0, metavar="N", help="Records whose planned tests are run."
    )
    parser.add_argument(
        "--claims",
        type=int,
        default=0,
        metavar="N",
        help="Loops whose claimed shrinkage is looked at again.",
    )
    parser.add_argument("-j", "--jobs", type=int, default=1)
    given = parser.parse_args()
    seeds = {world: given.seed + i for i, world in enumerate(THREE) if world in given.worlds}
    print(f"seeds {', '.join(f'{world} {seed}' for world, seed in seeds.items())}")
    if given.contradictions:
        print(contradicted(seeds, given.contradictions, given.jobs).to_string(index=False))
    if given.plans:
        print(planned(seeds, given.plans, given.jobs))
    if given.claims:
        print(claimed(seeds, given.claims, given.jobs))
    if given.contradictions or given.plans or given.claims:
        return
    for world, seed in seeds.items():
        answer_sealed(
            given.folder,
            world,
            Mixture(seed, given.single, given.none, given.two, given.foreign),
            given.jobs,
        )
        if given.random:
            answer_at_random(given.folder / world, seed, given.jobs)
    print(
        f"answered sealed; of each world {given.single} single effects (medium, strong),"
        f" {given.none} none, {given.two} two,"
    )
    print(f"{given.foreign} foreign")
    print_sealed(given.folder, list(seeds))


if __name__ == "__main__":
    main()
