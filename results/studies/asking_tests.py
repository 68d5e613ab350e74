"""What a diagnosis refuses of tests, what planned tests do to the plant, whether gaps close as far
as is claimed after them.

On loops of the blind check's worlds; printed by `python -m results.studies.asking DIR
--contradictions N`, `--plans N` and `--claims N`.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy import stats
from tqdm import tqdm

from results.studies.worlds import WORLDS
from simbench.blind import outcomes
from simbench.blind.levels import Share
from simbench.blind.making import PLANTS, write_item
from simbench.blind.menu import TestPlan
from simbench.blind.world import PLANNED, Item
from simbench.detectors.errors import UserError
from simbench.detectors.records.io import read_record
from simbench.gap.closed_loop.gap import closed, measure
from simbench.gap.diagnosis import assess_with_tests, diagnose
from simbench.gap.intake.check import check
from simbench.gap.intake.recorded_test import read_test
from simbench.gap.plan.menu import Limits
from simbench.gap.plan.order import plan
from simbench.gap.report.result import GapReport
from simbench.loop.effects import NONE
from simbench.scenarios.spec import load_loop

OTHER_LOOP, TUNING, SHIFTED = (
    "test of another loop",
    "tuning not as stated",
    "mode shifted by a minute",
)
_FRESH = 3  # records of the true loop on which a claimed shrinkage is looked at
_KINDS = {
    OTHER_LOOP: ("mv", "sp_steps", "bump", "stairs"),
    TUNING: ("kc_half",),
    SHIFTED: ("bump", "stairs"),
}


def contradicted(seeds: Mapping[str, int], n: int, jobs: int = 1) -> pd.DataFrame:
    """Return how many of `n` contradictory tests are detected, and how many of as many valid ones
    refused, by kind.
    """
    bar = tqdm(range(n), desc="contradictions", file=sys.stderr, delay=1.0)
    rows = pd.DataFrame(
        Parallel(n_jobs=jobs)(delayed(_contradict)(list(seeds.items()), i) for i in bar)
    )
    kinds = [(kind, rows[rows.kind == kind]) for kind in _KINDS] + [("all", rows)]
    return pd.DataFrame(
        {
            "kind": kind,
            "n": len(one),
            "found": int(one.found.sum()),
            "sound ones refused": int(one.wrongly.sum()),
        }
        for kind, one in kinds
    )


def _contradict(seeds: list[tuple[str, int]], i: int) -> dict[str, Any]:
    world, seed = seeds[i // len(_KINDS) % len(seeds)]
    kind, ids = list(_KINDS.items())[i % len(_KINDS)]
    w, id_ = WORLDS.load(world), ids[i // len(_KINDS) % len(ids)]
    item, other = (w.draw(seed, k, _entry(seed, k)) for k in (2 * i, 2 * i + 1))
    simulated = outcomes.outcome(w.test, item, id_)
    false = outcomes.outcome(w.test, other, id_) if kind == OTHER_LOOP else dict(simulated)
    if kind == TUNING:
        false["toml"] = false["toml"].split("[controller]")[0]
    if kind == SHIFTED:
        false["csv"] = _shifted(false["csv"], item, -1 if i % 2 else 1)
    result, wrongly = (_refused(item, texts) for texts in (false, simulated))
    return {
        "kind": kind,
        "world": world,
        "test": id_,
        "found": bool(result),
        "wrongly": bool(wrongly),
        "said": wrongly or result,
    }


def _entry(seed: int, i: int) -> dict[str, Any]:
    """Return a record of a single effect, or every fourth of none."""
    if i % 4 == 3:
        return {"kind": "none", "mv": i % 3 == 0}
    effect = str(np.random.default_rng([seed, i]).choice(PLANNED))
    plant = PLANTS[0] if effect == "time_constant_mismatch" else PLANTS[i % 3]
    return {
        "kind": "single",
        "effect": effect,
        "strength": ("medium", "strong")[i % 2],
        "mv": i % 3 == 0,
        "plant": plant,
    }


def _shifted(csv: str, item: Item, way: int) -> str:
    """Return a test whose column of modes lies a minute, at least a sample, early or late."""
    head, *rows = [line.split(",") for line in csv.splitlines()]
    at, steps = head.index("mode"), max(1, round(60.0 / float(item.baseline["sampling"]["Ts"])))
    modes = [row[at] for row in rows]
    moved = np.clip(np.arange(len(rows)) - way * steps, 0, len(rows) - 1)
    for row, k in zip(rows, moved):
        row[at] = modes[k]
    return "\n".join(map(",".join, [head, *rows])) + "\n"


def _refused(item: Item, texts: Mapping[str, str]) -> str:
    """Return why the diagnosis rejects a test, "" where it counts it."""
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        loop = load_loop(baseline)
        situation = check(read_record(record), loop)
        try:
            test = read_test(str(outcomes.shown(Path(place), "test", texts)), loop)
            notes = assess_with_tests(situation, [test]).situation.notes
        except UserError as error:
            return str(error)
    return next((note for note in notes if "contradicts the record" in note), "")


def planned(seeds: Mapping[str, int], n: int, jobs: int = 1) -> str:
    """Return in a sentence how many planned tests leave their limits on the true loops of `n`
    records.
    """
    bar = tqdm(range(n), desc="plans", file=sys.stderr, delay=1.0)
    runs: Any = Parallel(n_jobs=jobs)(delayed(_run_plan)(list(seeds.items()), i) for i in bar)
    kept = [left for one in runs for left in one]
    return (
        f"planned tests run on the true loops of {n} records: {sum(kept)} of {len(kept)} left"
        " their limits"
    )


def _run_plan(seeds: list[tuple[str, int]], i: int) -> list[bool]:
    """Return of every test planned for one record within drawn limits whether the true loop leaves
    them.
    """
    world, seed = seeds[i % len(seeds)]
    w, rng = WORLDS.load(world), np.random.default_rng([seed, i, 1])
    item = w.draw(seed, i, _entry(seed, i))
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        report = diagnose(read_record(record), load_loop(baseline))
    op, pv, sp = (np.asarray(item.columns[name]) for name in ("op", "pv", "sp"))
    limits = Limits(
        pv_excursion=float(rng.uniform(1.2, 4.0) * np.abs(pv - sp).max()),
        op_travel=float(rng.uniform(2.0, 15.0)),
        op=(max(float(op.min()) - 5.0, 0.0), min(float(op.max()) + 5.0, 100.0)),
    )
    # as if nothing were settled, or hardly any test would be planned
    doubted = {r.effect: min(r.probability, 0.5) for r in report.ranking}
    tests = plan(report.behind.found, doubted, report.behind.loops, limits)
    true = item.answer["effect"]
    acts = [] if true == NONE else [{"effect": true, "parameters": item.answer["parameters"]}]
    out = []
    for test in (x for x in tests.tests if x.op_travel or x.id == "sp_steps"):
        levels = np.asarray(test.op)
        run = w.test(
            item.answer,
            acts,
            int(item.answer["seed"]) + 9500,
            TestPlan(test.id, test.n, np.asarray(test.sp), levels),
        )
        start, lead = (
            float(run["sp"][0]),
            int(np.argmax(np.isfinite(levels) | (np.asarray(test.sp) != 0.0))),
        )
        far = float(np.abs(np.asarray(run["pv"])[lead:] - start).max())
        moved = np.asarray(run["op"])[lead:]
        out.append(
            far > limits.pv_excursion
            or bool(moved.min() < limits.op[0] - 1e-6 or moved.max() > limits.op[1] + 1e-6)
        )
    return out


def claimed(seeds: Mapping[str, int], n: int, jobs: int = 1, most: int = 2) -> str:
    """Return in sentences whether the shrinkage claimed after at most `most` tests holds on fresh
    records of `n` true loops.
    """
    bar = tqdm(range(n), desc="claims", file=sys.stderr, delay=1.0)
    runs: Any = Parallel(n_jobs=jobs)(delayed(_claim)(list(seeds.items()), i, most) for i in bar)
    rows = pd.DataFrame(
        [one for one in runs if one is not None], columns=["value", "lo", "hi", "true", "right"]
    )
    if len(rows) < 3:
        return f"{len(rows)} claims on {n} loops: too few"
    verdicts = [
        f"shrinkage of the user's own simulation claimed after at most {most} tests on {n} loops,"
        " weak, medium, strong,"
    ]
    verdicts += [
        f"every sixth with two effects; the true one by {_FRESH} fresh records of the true loop"
        " each:"
    ]
    for name, part in (("all", rows), ("effect named rightly", rows[rows.right])):
        inside = Share("", int(part.true.between(part.lo, part.hi).sum()), len(part))
        low, high = inside.interval
        rank = stats.spearmanr(part.value, part.true).statistic
        quarters = ", ".join(f"{q:.2f}" for q in part.true.quantile([0.25, 0.5, 0.75]))
        verdicts.append(
            f"{name}: interval holds {inside.k} of {inside.n} [{low:.2f}, {high:.2f}], rank"
            f" correlation {rank:.2f},"
        )
        verdicts.append(f"  true quartiles {quarters}")
    return "\n".join(verdicts)


def _claim(
    seeds: list[tuple[str, int]], i: int, most: int
) -> tuple[float, float, float, float, bool] | None:
    """Return a claimed shrinkage, its interval, the true one and whether the effect was right; None
    where none is claimed.
    """
    world, seed = seeds[i % len(seeds)]
    w = WORLDS.load(world)
    single = {
        **_entry(seed, 4 * i),
        "strength": ("weak", "medium", "strong")[i // 3 % 3],
        "mv": i % 2 == 0,
    }
    item = w.draw(seed, i, {"kind": "two", "mv": i % 2 == 0} if i % 6 == 5 else single)
    with TemporaryDirectory() as place:
        record, baseline = write_item(item, Path(place), "record")
        loop, run = load_loop(baseline), []
        try:
            report = diagnose(read_record(record), loop)
            while len(run) < most and report.next_test is not None:
                texts = outcomes.outcome(w.test, item, report.next_test["test"])
                run.append(
                    read_test(str(outcomes.shown(Path(place), f"test-{len(run)}", texts)), loop)
                )
                report = diagnose(read_record(record), loop, tests=run)
        except UserError:
            return None
    if report.shrinkage is None:
        return None
    a = item.answer
    acts = [
        {"effect": a[e], "parameters": a[p]}
        for e, p in (("effect", "parameters"), ("effect2", "parameters2"))
        if a[e]
    ]
    fresh = [w.simulate(a, acts, int(a["seed"]) + 7000 + k) for k in range(_FRESH)]
    right = report.effect in (a["effect"], a["effect2"])
    return (
        report.shrinkage["value"],
        report.shrinkage["lo"],
        report.shrinkage["hi"],
        _closes(report, fresh),
        right,
    )


def _closes(report: GapReport, fresh: list[dict[str, np.ndarray]]) -> float:
    """Return how far what was named closes the gap of the user's simulation to fresh records, by
    the means of their gaps.
    """
    s, runs = report.behind.found.situation, report.behind.loops.runs_with(report.named)
    gaps = []
    for columns in fresh:
        op, pv = (np.asarray(columns[name], dtype=float) for name in ("op", "pv"))
        gaps.append(measure(replace(s, op=op, record=replace(s.record, op=op, pv=pv)), *runs))
    return closed(
        float(np.mean([g.before for g in gaps])),
        float(np.mean([g.after for g in gaps])),
        gaps[0].floor,
    )
