"""Does the share of a gap that the diagnosis claims to close agree with the share that closes in the independent simulator?

Everything but the measuring is taken out of the question: the effect's parameters are not fitted but known, and moved on a
line from "does nothing" through the truth and beyond. Knows both sides, so neither the diagnosis nor the generator imports it.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from scipy.stats import rankdata
from tqdm import tqdm

from detectors.errors import ParameterError, UserError
from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.blind.distance import RESOLVABLE, Cloud, cloud, features
from simbench.blind.making import PLANTS
from simbench.blind.world import PLANNED
from simbench.blind.worlds.own import loops, oracle, sizes
from simbench.blind.worlds.own.drawing import baseline_table
from simbench.blind.worlds.own.faults import NEEDS_PLANT, Parameters, fault
from simbench.blind.worlds.own.items import DrawnRecord, draw_item
from simbench.blind.worlds.own.loops import TrueLoop
from simbench.gap.candidates import Fitted, fit_candidates, possible_effects
from simbench.gap.closed_loop.runs import ClosedLoops
from simbench.gap.intake.check import check
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import load_memory
from simbench.loop.effects import EFFECTS, Number
from simbench.usage import exit_code

WAYS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5)  # of the way from "does nothing" to the truth
HELD = {"c", "period", "at"} | {"outliers rate", "load_steps rate"}  # what an effect keeps however weak it is
TYPICAL = 0.6  # of a wrong effect's range from barely to grossly present
SEEDS = 12
REDRAWN = 1000  # of the bootstrap
STRENGTHS = ("medium", "strong")
COLUMNS = ["record", "effect", "plant", "strength", "candidate", "way", "claimed", "lo", "hi", "before", "after", "floor",
           "resolvable", "true"]  # fmt: skip


@dataclass(frozen=True, eq=False)
class ShrinkageStudy:
    """Pairs of claimed and true shrinkage, one row per record and candidate, and why other records have none."""

    pairs: pd.DataFrame
    left_out: dict[str, int]


def on_the_way(effect: str, truth: Parameters, way: float, op_range: tuple[float, float] = (0.0, 100.0)) -> Parameters:
    """Return an effect's parameters part of the way from identity (0) to the truth (1) and beyond: ratios in their logarithm.

    Limits beyond `op_range`, that of OP without the effect (%), do nothing.
    """
    out: Parameters = {}
    for name, value in truth.items():
        quantity = EFFECTS[effect].parameters[name]
        if not isinstance(quantity, Number) or isinstance(value, str) or name in HELD or f"{effect} {name}" in HELD:
            out[name] = value
            continue
        zero = quantity.identity
        if zero == 1.0:
            moved = value**way
        elif effect == "saturation" and value != zero and way > 0.0:
            end = op_range[int(name == "hi")]
            moved = end + way * (value - end)
        else:
            moved = zero + way * (value - zero)
        out[name] = float(np.clip(moved, quantity.low, quantity.high))
    return out


def study(n: int, seed: int, jobs: int = 1) -> ShrinkageStudy:
    """Draw records with single effects and compare claimed with true shrinkage of known candidates."""
    with Parallel(n_jobs=jobs, return_as="generator") as parallel:
        found = parallel(delayed(_one)(seed, i) for i in range(n))
        done: list[Any] = list(tqdm(found, total=n, desc="records", file=sys.stderr, delay=1.0))
    rows = [row for rows, _ in done for row in rows]
    why = [reason for _, reason in done if reason]
    return ShrinkageStudy(pd.DataFrame(rows, columns=COLUMNS), {reason: why.count(reason) for reason in sorted(set(why))})


def _entry(i: int) -> dict[str, Any]:
    k, effects = i // len(PLANNED), PLANNED
    return {
        "kind": "single",
        "effect": effects[i % len(effects)],
        "strength": STRENGTHS[(i + k) % 2],
        "mv": (i + k // 2) % 3 == 0,
        "plant": PLANTS[(i + k) % 3],
    }


def _one(seed: int, index: int) -> tuple[list[dict[str, Any]], str]:
    """Return one record's rows, or none and the reason."""
    item = draw_item(seed, index, _entry(index))
    return compare(item, index, np.random.default_rng([seed, index, 1]))


def compare(item: DrawnRecord, index: int, rng: np.random.Generator) -> tuple[list[dict[str, Any]], str]:
    """Return claimed and true shrinkage of one record's candidates.

    Plant and load are those the diagnosis fits under the candidate; the candidate's own numbers are the known ones. The true
    share is measured with the generator's loop and loads: before without the fault, after with the candidate in its place.

    Returns the rows, none where the generator or the diagnosis sees no resolvable gap, or the diagnosis refuses the
    record, and why there are none.
    """
    case, seed, effect = item.case, int(item.answer["seed"]), str(item.answer["effect"])
    truth = oracle.reference(case, seed)
    values = features(item.signals, case.scale)[0]
    if truth.cloud.distance(values) < RESOLVABLE * truth.cloud.floor:
        return [], "no resolvable gap in the generator"
    wrong = _wrong(effect, case, rng)
    clean = loops.simulate(case, seed).op
    span = float(clean.min()), float(clean.max())
    candidates = [(effect, way, on_the_way(effect, item.answer["parameters"], way, span)) for way in WAYS]
    candidates.append((wrong, np.nan, sizes.scale(wrong, case, truth.habit, rng)(TYPICAL)))
    try:
        claim = claimer(item, [effect, wrong])
        claims = [claim(name, p) for name, _, p in candidates]
    except UserError as error:
        return [], f"refused: {type(error).__name__}"
    if not claims[WAYS.index(1.0)].resolvable:
        return [], "no resolvable gap in the diagnosis"
    about = {"record": index, "effect": effect} | {k: item.answer[k] for k in ("plant", "strength")}
    rows = []
    for (name, way, p), s in zip(candidates, claims, strict=True):
        share = true_share(case, seed, values, truth.cloud, name, p)
        numbers = {k: getattr(s, k) for k in ("lo", "hi", "before", "after", "floor", "resolvable")}
        rows.append({**about, "candidate": name, "way": way, "claimed": s.value, **numbers, "true": share})
    return rows, ""


def claimer(item: DrawnRecord, effects: list[str]) -> Callable[[str, Parameters], Any]:
    """Return the diagnosis's measuring of one record: effect and known parameters to a `shrink.Shrinkage`."""
    s = {name: np.char.mod("%.8g", x).astype(float) for name, x in item.signals._asdict().items()}
    record = LoopRecord(op=s["op"], pv=s["pv"], sp=s["sp"], mv=s["mv"] if item.case.mv else None, Ts=item.case.Ts)
    situation = check(record, Loop.from_table(baseline_table(item.case)))
    engine = Engine(situation.data, load_memory(situation))
    base = engine.base()
    fits = fit_candidates(engine, base, [e for e in effects if e in possible_effects(situation)])
    found = Fitted(situation, base, fits, {}, [], base)
    shared: dict = {}

    def claim(effect: str, parameters: Parameters):
        runs = ClosedLoops(replace(found, parameters={effect: dict(parameters)}), 0)
        runs.shared = shared  # the arms without the effect are the same for all its parameters
        return runs.shrink([effect])

    return claim


def true_share(case: TrueLoop, seed: int, values: np.ndarray, before: Cloud, effect: str, parameters: Parameters) -> float:
    """Return the share of the record's gap to the faultless loop that a candidate closes in the generator, from -1 to 1."""
    act = fault(effect, parameters)
    after = cloud([loops.simulate(case, seed + 5000 + i, (act,)) for i in range(SEEDS)], case.scale)
    # one yardstick for both, the candidate's own
    start, floor = after._replace(mean=before.mean).distance(values), after.floor
    share = 1.0 - max(after.distance(values) - floor, 0.0) / (start - floor) if start > floor else 0.0
    return float(np.clip(share, -1.0, 1.0))


def _wrong(effect: str, case: TrueLoop, rng: np.random.Generator) -> str:
    """Return an effect of another block that this loop can have."""
    # one band is enough for a valve
    barred = {EFFECTS[effect].block, "valve" if case.play > 0.0 else ""}
    others = [e for e in PLANNED if EFFECTS[e].block not in barred]
    return str(rng.choice([e for e in others if NEEDS_PLANT.get(e, case.plant) == case.plant]))


def summary(found: ShrinkageStudy) -> dict[str, Any]:
    """Return rank correlations of claimed with true shrinkage, with 95 % intervals over records, how often the claimed interval
    holds the truth, and medians along the way."""
    t = found.pairs[found.pairs.resolvable.astype(bool)].astype({"claimed": float, "lo": float, "hi": float})
    held = ((t.lo <= t.true) & (t.true <= t.hi)).groupby(t.record).mean()
    groups = [g[["claimed", "true"]].to_numpy().T for _, g in t.groupby("record")]
    within = np.array([_spearman(g) for g in groups])
    rng, draws = np.random.default_rng(0), []
    for _ in range(REDRAWN if groups else 0):
        picked = rng.integers(0, len(groups), len(groups))
        draws.append([_spearman(np.hstack([groups[i] for i in picked])), within[picked].mean()])
    ends = np.quantile(draws, [0.025, 0.975], axis=0).T.tolist() if draws else [None, None]
    along = t[t.way.notna()].groupby("way")[["claimed", "true"]].median()
    wrong = t[t.way.isna()]
    return {
        "records": len(groups),
        "pairs": len(t),
        "left out": found.left_out,
        "all pairs": {"spearman": _spearman(np.hstack(groups)) if groups else None, "interval": ends[0]},
        "within records, mean": {"spearman": float(within.mean()) if groups else None, "interval": ends[1]},
        "interval holds the truth": float(held.mean()) if groups else None,
        "median along the way": {f"{w:g}": {k: float(v) for k, v in row.items()} for w, row in along.iterrows()},
        "median of the wrong effect": {k: float(wrong[k].median()) for k in ("claimed", "true")},
    }


def _spearman(pairs: np.ndarray) -> float:
    """Return the rank correlation of two rows; 0 where one of them does not vary."""
    x, y = rankdata(pairs, axis=1)
    return float(np.corrcoef(x, y)[0, 1]) if np.ptp(x) > 0 and np.ptp(y) > 0 else 0.0


def draw(found: ShrinkageStudy, path: Path) -> None:
    """Draw claimed against true shrinkage."""
    from matplotlib import colormaps
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    t = found.pairs[found.pairs.resolvable.astype(bool)]
    figure = Figure(figsize=(7.4, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.plot([-1, 1], [-1, 1], color="0.7", lw=1)
    rng = np.random.default_rng(0)
    colours = colormaps["viridis"](np.linspace(0.0, 0.95, len(WAYS)))
    for (way, part), colour in zip(t[t.way.notna()].groupby("way"), colours):
        axes.scatter(part.true + rng.normal(0, 0.006, len(part)), part.claimed, s=14, color=colour, alpha=0.7, label=f"{way:g}")
    wrong = t[t.way.isna()]
    axes.scatter(wrong.true, wrong.claimed, s=18, marker="x", color="crimson", alpha=0.8, label="wrong effect")
    axes.set_xlabel("true share closed (independent simulator)")
    axes.set_ylabel("claimed share closed")
    figure.legend(title="share of the true\nparameters", fontsize=8, title_fontsize=8, loc="outside right upper")
    axes.set_title(f"{t.record.nunique()} records, parameters known", fontsize=10)
    figure.savefig(path, dpi=130)


def main(arguments: list[str] | None = None) -> int:
    """Run the study and write pairs.csv, summary.json and scatter.png."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.shrinkage", description=__doc__)
    parser.add_argument("-n", type=int, default=120, help="records")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("-o", "--out", type=Path, required=True)
    given = parser.parse_args(arguments)
    if given.n < 1:
        raise ParameterError(f"shrinkage check: n = {given.n}; at least 1 record is needed")
    found = study(given.n, given.seed, given.jobs)
    told = summary(found)
    given.out.mkdir(parents=True, exist_ok=True)
    found.pairs.to_csv(given.out / "pairs.csv", index=False, float_format="%.6g")
    (given.out / "summary.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    draw(found, given.out / "scatter.png")
    print(json.dumps(told, indent=1))
    return 0


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
