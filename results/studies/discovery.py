"""What the discovery of laws is worth: foreign kinds and effects left out of the library, records
without effect, files.

`python -m results.studies.discovery` prints the table; the seed is named here, and was before the
first answer. `--real DIR` asks of recorded loops instead: the diagnosis' answer on an identified
baseline, and the law.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.stats import binomtest

from results.studies.plant.recorded_loops import records
from results.studies.worlds import WORLDS
from simbench.blind.making import write_item
from simbench.blind.world import WORLD_EFFECTS
from simbench.contract import check_file
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.detectors.records.io import read_record
from simbench.gap.closed_loop.gap import Runs, Shrinkage, held_out, measure
from simbench.gap.closed_loop.summary_features import features
from simbench.gap.diagnosis import diagnose
from simbench.gap.discover.discovery import described, discover
from simbench.gap.discover.effect_file import lent_effect, write_effect
from simbench.gap.discover.search import search
from simbench.gap.effects import left_out
from simbench.gap.intake.check import check
from simbench.gap.law import FoundLaw
from simbench.gap.situation import Situation
from simbench.loop.effects import NONE, PLUGINS, block_of
from simbench.loop.laws import forms
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, load_loop

SEED, WORLD_NAMES = 3701, ("own", "mill", "refinery")
_LOOP = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1600},
    "noise": {"std": 0.1},
    "disturbance": [{"type": "coloured", "amplitude": 0.4, "period": 30.0}],
    "setpoint": {"value": 50.0, "steps": [[100 * k, 50 + 4 * (-1) ** k] for k in range(1, 16)]},
}
_SPELLS = {
    "idle": {"share": 0.2, "length": 12.0},
    "held": {"share": 0.2, "length": 12.0},
    "rough": {"std": 0.5, "share": 0.2, "length": 40.0},
    "bursts": {"std": 10.0, "time": 5.0, "share": 0.2, "length": 60.0},
}
_WINDOWS = 12  # records of each form that comes and goes
_FLAT = (
    "stiction",
    "deadzone",
    "saturation",
    "quantisation",
)  # known effects whose law must be named after them
# share of the gap that the true effect leaves, up to which a law is asked to close it
_SOLVED = 0.2
_RUNS, _ANEW = 8, 5000  # runs of the true effect, and how far their seeds lie from the record's
_PLAIN = 0.9  # probability of a block, from which it is stated plainly
_KINDS = {"foreign": "foreign kinds", "left": "effects left out"}


def gap_left(gap: Shrinkage | None) -> float | None:
    """Return the share of a gap above its floor that is left, None where nothing exceeds the
    floor.
    """
    return (
        max(gap.after - gap.floor, 0.0) / max(gap.before - gap.floor, 1e-6)
        if gap is not None and gap.resolvable
        else None
    )


def oracle(s: Situation, world: str, answer: dict[str, Any], effect: str) -> float | None:
    """Return the share of the gap that the true effect leaves, in the baseline handed out, under
    the true load.
    """
    part, drawn_by = slice(held_out(s), None), WORLDS.load(world)

    def runs(acts: list[dict[str, Any]]) -> Runs:
        seeds = range(int(answer["seed"]) + _ANEW, int(answer["seed"]) + _ANEW + _RUNS)
        columns = [drawn_by.simulate(answer, acts, seed, nominal=True) for seed in seeds]
        op, pv = (np.array([np.asarray(c[name])[part] for c in columns]) for name in ("op", "pv"))
        return Runs(s.baseline, np.array([*features(op, pv, s.sp[part]).values()]).T, op[0], pv[0])

    before, after = runs([]), runs([{"effect": effect, "parameters": answer["parameters"]}])
    return gap_left(measure(s, before, before, after))


def asked(
    world: str, index: int, entry: dict[str, Any], place: Path, seed: int = SEED
) -> dict[str, Any]:
    """Return the discovery of one drawn record, and what a file of its law keeps."""
    drawn_by = WORLDS.load(world)
    drawn_as = {k: v for k, v in entry.items() if k != "asked"}
    item = drawn_by.draw(seed, index, drawn_as)
    files = write_item(item, place, f"{world}_{index}")
    drawn = time.process_time()
    effect = entry.get("effect", "none")
    row: dict[str, Any] = {
        "world": world,
        "effect": effect,
        "asked": entry.get("asked", ""),
    }
    try:
        record, loop = read_record(files[0]), load_loop(files[1])
        if entry["kind"] == "none":
            # what is told; the search alone shows that most have no law, and is cheap
            with one_thread():
                situation = check(record, loop)
                found = search(situation, held_out(situation)).law is not None
            law = discover(record, loop).law if found else None
            return row | {"cpu_s": time.process_time() - drawn, "form": law.form if law else None}
        with left_out(*([effect] if row["asked"] == "left" else [])):
            discovery = discover(record, loop)
    except UserError as error:
        return row | {"error": str(error)}
    row |= {
        "cpu_s": time.process_time() - drawn,
        "block": discovery.block,
        "probability": discovery.probability,
        "form": None,
        "why": discovery.why,
        "oracle": oracle(discovery.situation, world, item.answer, effect),
        "true": drawn_by.FOREIGN.get(effect) or block_of(effect),
    }
    if discovery.law is not None and discovery.gap is not None:
        row |= {
            "form": discovery.law.form,
            "left": gap_left(discovery.gap),
            "nearest": discovery.nearest,
        }
        file = place / f"law_{world}_{index}.py"
        write_effect(discovery.law, file, discovery.law.text, file.stem)
        row["kept"] = check_file(file).kept
        PLUGINS.forget(file.stem)
    return row


def entries(world: str, none: int, times: int = 3) -> list[dict[str, Any]]:
    """Return what is drawn of a world: foreign kinds, effects to be left out, four to be kept, and
    records without effect.
    """
    foreign = [
        {"kind": "foreign", "asked": "foreign", "effect": kind, "mv": (i + j) % 3 == 0}
        | {"strength": ("strong", "medium")[(i + j) % 2]}
        for j in range(times)
        for i, kind in enumerate(WORLDS.load(world).FOREIGN)
    ]
    left = [
        {
            "kind": "single",
            "asked": "left",
            "effect": e,
            "strength": "strong",
            "mv": i % 3 == 0,
            "plant": "foptd",
        }
        for i, e in enumerate(WORLD_EFFECTS)
    ]
    known = [
        {"kind": "single", "effect": e, "strength": "strong", "mv": False, "plant": "foptd"}
        for e in _FLAT
    ]
    return [*foreign, *left, *known, *({"kind": "none", "mv": i % 2 == 0} for i in range(none))]


def agreement(form: str, numbers: dict[str, float], seed: int) -> float | None:
    """Return F1 of the samples in which a law that comes and goes is active, None where no law is
    named.
    """
    true: list[np.ndarray] = []

    def kept(*args: Any) -> np.ndarray:
        true.append(drawn(*args))
        return true[-1]

    drawn = forms.spells
    with patch.object(forms, "spells", kept), lent_effect(FoundLaw(form, numbers, 0.0)) as name:
        loop = _LOOP | {"effect": [{"name": name, **numbers}]}
        record = simulate(Loop.from_table(loop), seed).record
    law = discover(record, Loop.from_table({k: v for k, v in _LOOP.items() if k != "disturbance"}))
    if law.law is None:
        return None
    on = true[0][: record.n] > 0.0
    return float(2.0 * np.sum(on & law.on) / (np.sum(on) + np.sum(law.on)))


def summary(rows: list[dict[str, Any]]) -> list[str]:
    """Return the table: shares with their n, foreign kinds, known effects and records without
    effect apart.
    """
    good = [row for row in rows if "error" not in row]
    out = [f"{len(rows)} records, {len(rows) - len(good)} refused, seed {SEED}"]
    for world in WORLD_NAMES:
        part = [row for row in good if row["world"] == world]
        out += [
            f"{world}, {title}: {_strange([r for r in part if r['asked'] == k])}"
            for k, title in _KINDS.items()
        ]
        none = [row["form"] is not None for row in part if row["effect"] == "none"]
        out.append(f"{world}, none: law found {share(none)}")
    out += [
        f"all, {title}: {_strange([r for r in good if r['asked'] == k])}"
        for k, title in _KINDS.items()
    ]
    out.append(
        "all, none: law found"
        f" {share([r['form'] is not None for r in good if r['effect'] == 'none'])}"
    )
    known = [row for row in good if row["effect"] in _FLAT and not row["asked"]]
    laws = [row for row in known if row["form"] is not None]
    out.append(
        f"known: law found {len(laws)} of {len(known)}, nearest right"
        f" {share([r['nearest'] == r['effect'] for r in laws])}, block right"
        f" {share([r['block'] == r['true'] for r in known])}"
    )
    kept = [row["kept"] for row in good if "kept" in row]
    out.append(f"effect files: {sum(kept)} of {len(kept)} keep the contract")
    cost = [row["cpu_s"] for row in good]
    out.append(f"CPU seconds a discovery: median {np.median(cost):.1f}, most {max(cost):.1f}")
    return out


def share(hits: list[bool]) -> str:
    """Return how many of how many, with the 95 % interval of their share (Wilson)."""
    if not hits:
        return "0 of 0"
    ends = binomtest(sum(hits), len(hits)).proportion_ci(method="wilson")
    return f"{sum(hits)} of {len(hits)} ({ends.low:.2f} to {ends.high:.2f})"


def _strange(rows: list[dict[str, Any]]) -> str:
    right = [row["block"] == row["true"] for row in rows]
    rightness = [hit for hit, row in zip(right, rows) if row["block"]]
    plain = [hit for hit, row in zip(right, rows) if row["block"] and row["probability"] > _PLAIN]
    laws = [row for row in rows if row["form"] is not None]
    left = [row["left"] for row in laws if row["left"] is not None]
    solved = [row for row in rows if row["oracle"] is not None and row["oracle"] <= _SOLVED]
    there = [row["left"] for row in solved if row["form"] is not None and row["left"] is not None]
    return (
        f"block right {share(right)}, wrong {len(rightness) - sum(rightness)}, cannot tell"
        f" {len(rows) - len(rightness)}, right where it is above {_PLAIN} {share(plain)}; law found"
        f" {len(laws)}, with the right block"
        f" {share([row['block'] == row['true'] for row in laws])}, gap left {_median(left)}; where"
        f" the true effect leaves at most {_SOLVED}: {_median(there)}, law found"
        f" {sum(row['form'] is not None for row in solved)} of {len(solved)}"
    )


def _median(x: list[float]) -> str:
    return f"{np.median(x) if x else np.nan:.2f} (median of {len(x)})"


def recorded(where: Path) -> list[str]:
    """Return the answers on the first record of every loop on a baseline identified from it, then
    the counts.
    """
    lines, silent, closed = [], 0, {"answer": [], "law": []}
    pairs = {line.loop: (line, record) for line, record in reversed(records(where, doubted=True))}
    for line, record in pairs.values():
        try:
            report = diagnose(record)
        except UserError as error:
            lines.append(f"{line.id}: refused, {error}")
            continue
        assessed, gap = report.behind.found, report.gap
        s = assessed.situation
        with one_thread():
            law = described(s, assessed)
        silent += report.effect == NONE and gap.resolvable
        if gap.resolvable:
            closed["answer"].append(report.shrinkage["value"] if report.shrinkage else 0.0)
            left = gap_left(law.gap)
            closed["law"].append(max(1.0 - left, 0.0) if left is not None else 0.0)
        lines.append(
            f"{line.id}: {report.effect}, gap {gap.before:.2f} to {gap.after:.2f}, floor"
            f" {gap.floor:.2f}; {law.one_line()}"
        )
    lines.append(f"{len(pairs)} loops; none beside a resolvable gap {silent}")
    lines += [
        f"share of a resolvable gap closed by the {name}: {_median(x)}"
        for name, x in closed.items()
    ]
    return lines


def main(none: int = 67, times: int = 2) -> None:
    """Print one line a record as it comes, then the table."""
    rows, drawn = (
        [],
        [(w, i, entry) for w in WORLD_NAMES for i, entry in enumerate(entries(w, none, times))],
    )
    with TemporaryDirectory() as place:
        for world, i, entry in drawn:
            rows.append(asked(world, i, entry, Path(place)))
            scores = {k: round(v, 2) if isinstance(v, float) else v for k, v in rows[-1].items()}
            print(f"{len(rows)} of {len(drawn)}", scores, file=sys.stderr, flush=True)
    print("\n".join(summary(rows)))
    for form, numbers in _SPELLS.items():
        laws = [agreement(form, numbers, SEED + i) for i in range(_WINDOWS)]
        scores = [f for f in laws if f is not None]
        print(
            f"windows of {form}: {len(scores)} of {len(laws)} laws found, F1"
            f" {np.median(scores) if scores else np.nan:.2f} (median)"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("none", nargs="?", type=int, default=67)
    parser.add_argument("times", nargs="?", type=int, default=2)
    parser.add_argument("--real", type=Path)
    given = parser.parse_args()
    if given.real:
        print("\n".join(recorded(given.real)))
    else:
        main(given.none, given.times)
