"""Diagnose the records of a withheld folder, one process after another, and run the tests on the
plant that a diagnosis asks for.

What answers sees records, baselines and tests alone; the key is for the plant, which runs tests.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from results.studies.withheld.files import write_whole
from results.studies.withheld.on_plant import run_test
from results.studies.withheld.truth import read_any, rows_of
from simbench.detectors.errors import ParameterError, UserError
from simbench.files import folder as make_folder
from simbench.files import remove_stale_temporaries
from simbench.gap.command import diagnose_files
from simbench.gap.planning.menu import Trial
from simbench.progress import Progress
from simbench.safe_path import safe_path
from simbench.scenarios.toml import read_toml

# of a record, its baseline and tests: the answer in JSON types and the test that it asks for
_Diagnose = Callable[[Path, Path, Sequence[str]], tuple[dict[str, Any], Trial | None]]
COST, TESTS = "cost.csv", "tests"
MOST_TESTS = 2  # a record


def diagnosed(
    record: Path, baseline: Path, tests: Sequence[str]
) -> tuple[dict[str, Any], Trial | None]:
    """Return the product's answer about a record, and the test that it recommends."""
    report = diagnose_files([record], baseline, tests=tests)
    return report.as_json(), report.behind.trial


def answer(
    folder: str | Path,
    jobs: int = 1,
    tests: int = 0,
    key: str | Path | None = None,
    diagnose: _Diagnose = diagnosed,
) -> int:
    """Write answers/ID.json for every record that has none yet, and with tests answers-1/ID.json,
    answers-2/ID.json; return how many were asked about.

    Where no test is asked for, or it is refused, an answer is kept.
    """
    folder = Path(folder).resolve()
    if not 0 <= tests <= MOST_TESTS:
        raise ParameterError(f"withheld: --tests {tests}; 0 to {MOST_TESTS} a record are allowed")
    records = sorted((folder / "records").glob("*.csv"))
    if not records:
        raise ParameterError(f"withheld: no records/*.csv in {folder}")
    bare = [r.name for r in records if not r.with_suffix(".toml").exists()]
    if bare:
        raise ParameterError(
            f"withheld: {bare[0]} has no baseline {Path(bare[0]).with_suffix('.toml')} beside it"
        )
    places = [make_folder(answers_after(folder, i)) for i in range(tests + 1)]
    for place in (*places, folder):
        remove_stale_temporaries(place)
    plants: dict[str, dict[str, Any]] = {}
    if tests:
        make_folder(folder / TESTS)
        text, _ = read_any(folder, Path(key) if key is not None else None)
        plants = {row["id"]: row for row in rows_of(text)}
    todo = [r for r in records if not all(_answered(p / f"{r.stem}.json") for p in places)]
    cost = folder / COST
    costs = cost.read_text(encoding="utf-8") if cost.exists() else "id,cpu_s\n"
    questions = [(r, plants.get(r.stem)) for r in todo]
    bar = Progress(
        total=len(records), initial=len(records) - len(todo), desc="diagnosed", delay=1.0
    )
    one = delayed(_one)
    parallel: Any = Parallel(jobs, return_as="generator_unordered", batch_size=1)
    with safe_path(), bar:
        for name, replies, cpu in parallel(one(diagnose, tests, *asked) for asked in questions):
            for place, reply in zip(places, replies, strict=True):
                write_whole(place / f"{name}.json", json.dumps(reply, indent=1))
            costs += f"{name},{cpu:.3f}\n"
            write_whole(cost, costs)
            bar.update()
    return len(todo)


def answers_after(folder: Path, tests: int) -> Path:
    """Return where the answers after so many tests lie."""
    return folder / (f"answers-{tests}" if tests else "answers")


def _answered(path: Path) -> bool:
    try:
        return "error" not in json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False


def _one(
    diagnose: _Diagnose, tests: int, record: Path, plant: Mapping[str, Any] | None
) -> tuple[str, list[dict[str, Any]], float]:
    """Return the name of a record, the answers about it alone and after each of its tests, and the
    CPU seconds of the first.
    """
    baseline, opened = record.with_suffix(".toml"), []
    start = time.process_time()
    try:
        reply, trial = diagnose(record, baseline, [])
    except Exception as error:  # one bad record must not cost the others
        reply, trial = {"error": f"{type(error).__name__}: {error}"}, None
    replies, cpu = [reply], time.process_time() - start
    for _ in range(tests):
        if trial is not None and plant is not None:
            place = record.parent.parent / TESTS
            opened.append(str(run_test(plant, trial, read_toml(baseline), place)))
            try:
                reply, trial = diagnose(record, baseline, opened)
            except UserError:
                trial = None
        replies.append(reply)
    return record.stem, replies, cpu
