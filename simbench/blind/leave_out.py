"""Test the diagnosis with one effect missing from the library at a time: what it answers then, and
how far the gap shrinks once the effect is back.

Knows the truth and the diagnosis, so neither a world nor the diagnosis imports it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd
from joblib import Parallel, delayed
from scipy.stats import binomtest

from simbench.blind import outcomes
from simbench.blind.making import PLANTS, write_item
from simbench.blind.score import true_circumstances
from simbench.blind.world import OWN, WORLD_EFFECTS, WORLDS
from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.records.io import read_record
from simbench.files import folder, remove_stale_temporaries, write_table
from simbench.gap.diagnosis import diagnose
from simbench.gap.effects import left_out
from simbench.gap.intake.recorded_test import read_test
from simbench.loop.effects import NONE, UNKNOWN, block_of
from simbench.loop.effects._alike import indistinguishable
from simbench.progress import Progress
from simbench.safe_path import safe_path
from simbench.scenarios.spec import load_loop

_STRENGTHS = ("strong", "medium")
LEAVE_OUT_COLUMNS = (
    "record",
    "effect",
    "strength",
    "said",
    "right",
    "block",
    "nearest",
    "before",
    "left",
    "floor",
    "resolvable",
    "back",
    "after",
    "asked",
    "error",
)


def leave_out(
    out: str | Path, world: str = OWN, n: int = 4, seed: int = 0, jobs: int = 1, tests: int = 0
) -> pd.DataFrame:
    """Diagnose records of every effect without and with the effect in the library, each with at
    most so many tests asked for.

    `right` is "unknown" or an effect alike; `left` the gap with what was named, or with the law
    that describes what has no name; `resolvable` is whether the gap exceeds its floor at
    all: of the others nothing is known.
    """
    out = Path(out)
    drawn_by = WORLDS.load(world)
    if tests and not hasattr(drawn_by, "test"):
        raise ParameterError(
            f"leave-out: world {world!r} runs no tests; it has no function test(answer, effects,"
            " seed, plan)"
        )
    one = (f"after-{tests}-" if tests else "") + f"{world}-{seed}-"
    names = {f"{one}{e}-{i}": (i, e) for e in WORLD_EFFECTS for i in range(n)}
    table = out / "leave_out.csv"
    remove_stale_temporaries(folder(out))
    # as text: numbers that are written once more must not lose a digit
    done = (
        pd.read_csv(table, keep_default_na=False, dtype=str)
        if table.exists()
        else pd.DataFrame(columns=LEAVE_OUT_COLUMNS)
    )
    strange = [r for r in done.record if not str(r).startswith(one)]
    if strange:
        raise ParameterError(
            f"leave-out: {table} holds {strange[0]}, not what begins with {one!r}; choose a new"
            " folder"
        )
    remove_stale_temporaries(folder(out / "records"))
    todo = [name for name in names if name not in set(done.record)]
    # processes that live on from another call may stand in another folder
    records = (out / "records").absolute()
    with safe_path(), Parallel(n_jobs=jobs, return_as="generator") as parallel:
        world_of = drawn_by.draw, getattr(drawn_by, "test", None)
        rows = parallel(
            delayed(_one)(records, name, *names[name], *world_of, seed, tests) for name in todo
        )
        for row in Progress(
            rows, total=len(names), initial=len(names) - len(todo), desc="left out", delay=1.0
        ):
            done = pd.DataFrame([*done.to_dict("records"), row], columns=LEAVE_OUT_COLUMNS)
            write_table(done, table)
    finished = pd.read_csv(table, keep_default_na=False)
    finished = finished.loc[finished.record.isin(list(names))].reset_index(drop=True)
    write_table(summary(finished), out / "table.csv")
    return finished


def _one(
    place: Path,
    name: str,
    i: int,
    effect: str,
    draw_item: Any,
    run_test: Any,
    seed: int,
    tests: int,
) -> dict[str, Any]:
    """Draw one record, and diagnose it without and with its effect, with the tests that were
    asked for without it.
    """
    strength = _STRENGTHS[i % 2]
    hidden = {"effect": effect, "strength": strength}
    row = dict.fromkeys(LEAVE_OUT_COLUMNS, "") | {"record": name, **hidden}
    number = 1000 * list(WORLD_EFFECTS).index(effect) + i
    entry = {"kind": "single", **hidden, "mv": i % 4 < 2, "plant": PLANTS[i % 3]}
    try:
        item = draw_item(seed, number, entry)
        record_file, baseline_file = write_item(item, place, name)
        record, baseline = read_record(record_file), load_loop(baseline_file)
        asked, run = [], []
        with left_out(effect):
            without = diagnose(record, baseline)
            while len(run) < tests and without.next_test is not None:
                asked.append(without.next_test["test"])
                texts = outcomes.outcome(run_test, item, asked[-1])
                run.append(
                    read_test(str(outcomes.shown(place, f"{name}-{asked[-1]}", texts)), baseline)
                )
                without = diagnose(record, baseline, tests=run)
        whole = diagnose(record, baseline, tests=run)
    except UserError as e:
        return row | {"error": str(e)}
    known = [r.effect for r in without.ranking if r.effect not in (NONE, UNKNOWN)]
    like = without.looks_like
    gap = (None if like is None or like.law is None else like.gap) or without.gap
    here = true_circumstances(item.answer, item.baseline, pd.DataFrame(item.columns))
    return row | {
        "said": without.effect,
        "right": without.effect in {UNKNOWN, *indistinguishable(effect, here)},
        "block": without.block,
        "nearest": known[0],
        "before": gap.before,
        "left": gap.after,
        "floor": gap.floor,
        "resolvable": without.gap.resolvable,
        "back": whole.effect,
        "after": whole.gap.after,
        "asked": " ".join(asked),
    }


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row per effect, in the vocabulary's order, and one for all."""
    rows = [_summary(effect, table[table.effect == effect]) for effect in WORLD_EFFECTS]
    return pd.DataFrame([*rows, _summary("all", table)])


def _summary(effect: str, part: pd.DataFrame) -> dict[str, Any]:
    failed = int((part.error != "").sum())
    seen = part[(part.error == "") & (part.resolvable.astype(str) == "True")]
    block = block_of(effect) if effect in WORLD_EFFECTS else ""
    row: dict[str, Any] = {"effect": effect, "block": block, "n": len(seen), "failed": failed}
    if seen.empty:
        return row
    shares = {
        "unknown": seen.said == UNKNOWN, "right": seen.right.astype(str) == "True",
        "block_right": seen.block == seen.effect.map(block_of),
    }  # fmt: skip
    before, left, floor, after = (
        seen[c].astype(float) for c in ("before", "left", "floor", "after")
    )
    wrong = seen.nearest[~seen.said.isin([UNKNOWN, NONE])]
    row |= {name: float(hits.mean()) for name, hits in shares.items()} | {
        "nearest": wrong.mode().iloc[0] if not wrong.empty else "",
        "left": float(((left - floor).clip(lower=0.0) / (before - floor)).median()),
        "back": float(((after - floor).clip(lower=0.0) / (before - floor)).median()),
        "named": float((seen.back == seen.effect).mean()),
    }  # fmt: skip
    if effect == "all":
        for name, hits in shares.items():
            interval = binomtest(int(hits.sum()), len(seen)).proportion_ci(method="wilson")
            row |= {f"{name}_lo": float(interval.low), f"{name}_hi": float(interval.high)}
    return row
