"""Study of the gate: what it lets pass and what it stops, measured on a grid with every fault put in on purpose."""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from detectors.judge import judge_one
from detectors.plugins.registry import methods as registry
from detectors.prepared import prepare
from detectors.record import LoopRecord
from detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from scenarios.grid import load_grid
from scenarios.spec import Loop
from simbench.bench.execute.run import run_grid
from simbench.bench.execute.work import record_hash
from simbench.bench.score.check import compare_books
from simbench.bench.store.reading import CODES, Book, read_table
from simbench.files import folder as make_folder
from simbench.files import whole_file
from simbench.loop.simulate import simulate
from simbench.usage import exit_code

KICK = 1e-12  # % of OP at the first sample: a sticky loop makes another record of it
MOVES = (0.8, 1.2)
ALARMS = 1  # of 20 repeats
# what a detector broken on purpose answers, from its true codes and scores
BROKEN = {
    "always stiction": lambda said, score: (np.full_like(said, CODES[STICTION]), score),
    "never stiction": lambda said, score: (np.full_like(said, CODES[NO_STICTION]), score),
    "never decides": lambda said, score: (np.full_like(said, CODES[NO_DECISION]), np.full_like(score, np.nan)),
    "answers another record": lambda said, score: (np.roll(said, 7), np.roll(score, 7)),
    "score upside down": lambda said, score: (said, -score),
}


@dataclass(frozen=True, eq=False)
class GateStudy:
    """What the gate did.

    Parameters
    ----------
    table : DataFrame
        kind ("same", "perturbed", "fresh seed", "threshold", "broken"), method, what, flips (changed verdicts, NaN for
        fresh seeds), failed.
    scenarios : int
        Of one run.
    """

    table: pd.DataFrame
    scenarios: int

    @property
    def holds(self) -> dict[str, bool]:
        """Each promise, and whether it held; a promise that was not tried is left out."""
        t = self.table
        moved, alarms = t[t["kind"] == "threshold"], t.loc[t["kind"] == "fresh seed", "failed"]
        seen = moved.groupby("method")["failed"].any()
        unseen = ", ".join(seen.index[~seen]) or "none"
        return {
            "the same records pass": not t.loc[t["kind"] == "same", "failed"].any(),
            "records perturbed by 1e-12 pass": not t.loc[t["kind"] == "perturbed", "failed"].any(),
            f"every method has a threshold whose move by 20 % fails (without: {unseen})": bool(seen.all()),
            "a broken detector fails": bool(t.loc[t["kind"] == "broken", "failed"].all()),
            **({f"fresh seeds: at most {ALARMS} alarm in 20": int(alarms.sum()) <= ALARMS} if len(alarms) else {}),
        }

    def as_text(self) -> str:
        """Return promises, counts by kind, and every fault that passed."""
        counts = self.table.groupby("kind", sort=False)["failed"].agg(["sum", "count"])
        lines = [f"{'held' if held else 'NOT HELD':9s}{what}" for what, held in self.holds.items()]
        lines += [
            "",
            f"{self.scenarios} scenarios a run",
            *(f"{k}: {r['sum']} of {r['count']} failed" for k, r in counts.iterrows()),
        ]
        passed = self.table[self.table["kind"].isin(["threshold", "broken"]) & ~self.table["failed"]]
        if len(passed):
            lines += ["", "faults that passed", passed.to_string(index=False)]
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        """Return everything as JSON types."""
        rows = self.table.astype(object).where(self.table.notna(), None).to_dict("records")
        return {"scenarios": self.scenarios, "holds": self.holds, "rows": rows}


def study(grid: str = "ci", repeats: int = 20, half: bool = False, methods=("fast",), jobs: int = 1) -> GateStudy:
    """Measure the gate on a grid.

    Parameters
    ----------
    grid : str
        Name or file.
    repeats : int
        Runs with fresh seeds.
    half : bool
        Run the fresh seeds over the grid's cells once, however often the grid repeats them.
    methods : iterable of str
        Method ids, "fast" or "full".
    jobs : int
        Worker processes of the runs.

    Returns
    -------
    GateStudy

    Notes
    -----
    Perturbed: every loop starts with OP off by 1e-12 %, and what the sticky ones make of it is judged. Thresholds are moved
    one at a time to 0.8 and 1.2 of their default (those of 0 cannot be moved so). Not a part of continuous integration: on
    grid `ci` it takes about half an hour.
    """
    fresh = {"repeats": 1} if half else {}
    first = load_grid(grid).content.seed + 1000
    with tempfile.TemporaryDirectory() as home:
        base_folder = run_grid(grid, Path(home) / "base", methods, jobs)
        base = Book.read(base_folder)
        rows = [_row("same", "all", "nothing", base, base)]
        rows += [_row("broken", m, how, _broken(base, m, how), base) for m in base.methods for how in BROKEN]
        rows += _varied(base, base_folder)
        print(GateStudy(pd.DataFrame(rows), base.ids.size).as_text(), file=sys.stderr)
        for i in range(repeats):
            other = run_grid(grid, Path(home) / f"seed{i}", methods, jobs, sets={**fresh, "seed": first + i})
            rows.append(_row("fresh seed", "all", f"seed {first + i}", Book.read(other), base))
            print(f"fresh seed {i + 1} of {repeats}: {'alarm' if rows[-1]['failed'] else 'quiet'}", file=sys.stderr)
    return GateStudy(pd.DataFrame(rows), base.ids.size)


def _row(kind: str, method: str, what: str, now: Book, before: Book) -> dict[str, Any]:
    check = compare_books(now, before)
    flips = len(check.flips) if kind != "fresh seed" else None
    return {"kind": kind, "method": method, "what": what, "flips": flips, "failed": check.failed}


def _broken(base: Book, method: str, how: str) -> Book:
    i = base.methods.index(method)
    return _with(base, i, *BROKEN[how](base.verdict[i], base.score[i]))


def _with(base: Book, i: int, said: np.ndarray, score: np.ndarray) -> Book:
    verdict, scores = base.verdict.copy(), base.score.copy()
    verdict[i], scores[i] = said, score
    return replace(base, verdict=verdict, score=scores)


def _varied(base: Book, folder: Path) -> Iterator[dict[str, Any]]:
    """Simulate every record again, once as it was for the moved thresholds, once with the kick."""
    from tqdm import tqdm

    moves = list(_moves(base.methods))
    n, m = base.ids.size, len(base.methods)
    said, score = np.empty((len(moves), n), np.int8), np.empty((len(moves), n), np.float32)
    kicked, kicked_score = np.empty((m, n), np.int8), np.empty((m, n), np.float32)
    hashes = np.empty(n, dtype="S16")
    defaults = {name: registry.load(name).METHOD.defaults() for name in base.methods}
    scenarios = read_table(folder, "scenarios", ["loop", "seed"]).to_pylist()
    for k, row in enumerate(tqdm(scenarios, unit=" records", file=sys.stderr, disable=None)):
        loop = Loop.from_table(json.loads(row["loop"]))
        answers = _answers(simulate(loop, row["seed"]).record, [(name, defaults[name] | {key: to}) for name, key, to in moves])
        said[:, k], score[:, k] = zip(*answers)
        record = simulate(loop, row["seed"], kick=KICK).record
        kicked[:, k], kicked_score[:, k] = zip(*_answers(record, list(defaults.items())))
        hashes[k] = record_hash(record)
    perturbed = replace(base, hashes=hashes, verdict=kicked, score=kicked_score)
    yield _row("perturbed", "all", f"{(hashes != base.hashes).mean():.0%} of the records differ", perturbed, base)
    for j, (name, key, to) in enumerate(moves):
        now = _with(base, base.methods.index(name), said[j], score[j])
        yield {**_row("threshold", name, key, now, base), "to": to}


def _moves(methods: tuple[str, ...]) -> Iterator[tuple[str, str, float]]:
    for name in methods:
        for key, rule in registry.load(name).METHOD.thresholds.items():
            for factor in MOVES:
                to = rule.default * factor
                if rule.default != 0 and rule.low <= to <= rule.high:
                    yield name, key, to


def _answers(record: LoopRecord, chosen: list[tuple[str, dict[str, float]]]) -> list[tuple[int, float]]:
    blind = prepare(record.blind())
    sighted = blind.sighted(record)
    found = []
    for name, values in chosen:
        module = registry.load(name)
        verdict = judge_one(name, module, sighted if module.METHOD.needs_mv else blind, False, values)
        unheard = module.METHOD.front_end and not blind.oscillation.sustained and verdict.verdict != NO_DECISION
        found.append((CODES[verdict.verdict], -np.inf if unheard else verdict.score))
    return found


def main(arguments: list[str] | None = None) -> int:
    """Run the study, write study.json and study.txt; exit code 1 when a promise did not hold."""
    parser = argparse.ArgumentParser(prog="python -m results.studies.check_study", description=__doc__)
    parser.add_argument("grid", nargs="?", default="ci", help="name or file")
    parser.add_argument("--repeats", type=int, default=20, help="runs with fresh seeds")
    parser.add_argument("--half", action="store_true", help="fresh seeds over the grid's cells once")
    parser.add_argument("-j", "--jobs", type=int, default=1)
    parser.add_argument("-o", "--out", default="results/check", help="folder for study.json and study.txt")
    chosen = parser.parse_args(arguments)
    found = study(chosen.grid, chosen.repeats, chosen.half, jobs=chosen.jobs)
    where = make_folder(chosen.out)
    for name, text in (("study.json", json.dumps(found.as_json(), indent=1)), ("study.txt", found.as_text())):
        with whole_file(where / name) as f:
            f.write(text + "\n")
    print(found.as_text())
    return int(not all(found.holds.values()))


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
