"""Diagnose the records of a withheld folder, one process after another.

What answers sees records and baselines alone, never the key.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from results.studies.withheld.files import write_whole
from simbench.detectors.errors import ParameterError
from simbench.files import folder as make_folder
from simbench.files import remove_stale_temporaries
from simbench.gap.command import diagnose_files
from simbench.progress import Progress
from simbench.safe_path import safe_path

# of a record and its baseline: the answer in JSON types
_Diagnose = Callable[[Path, Path], dict[str, Any]]
COST = "cost.csv"


def diagnosed(record: Path, baseline: Path) -> dict[str, Any]:
    """Return the product's answer about a record."""
    return diagnose_files([record], baseline).as_json()


def answer(folder: str | Path, jobs: int = 1, diagnose: _Diagnose = diagnosed) -> int:
    """Write answers/ID.json for every record that has none yet; return how many were asked
    about.
    """
    # every record needs its baseline
    folder = Path(folder).resolve()
    records = sorted((folder / "records").glob("*.csv"))
    if not records:
        raise ParameterError(f"withheld: no records/*.csv in {folder}")
    bare = [r.name for r in records if not r.with_suffix(".toml").exists()]
    if bare:
        raise ParameterError(
            f"withheld: {bare[0]} has no baseline {Path(bare[0]).with_suffix('.toml')} beside it"
        )

    # those that are answered already are kept
    place = make_folder(folder / "answers")
    for one in (place, folder):
        remove_stale_temporaries(one)
    todo = [r for r in records if not _answered(place / f"{r.stem}.json")]

    # every answer is written as soon as it is there
    cost = folder / COST
    costs = cost.read_text(encoding="utf-8") if cost.exists() else "id,cpu_s\n"
    bar = Progress(
        total=len(records), initial=len(records) - len(todo), desc="diagnosed", delay=1.0
    )
    ask = delayed(_one)
    parallel: Any = Parallel(jobs, return_as="generator_unordered", batch_size=1)
    with safe_path(), bar:
        for name, reply, cpu in parallel(ask(diagnose, record) for record in todo):
            write_whole(place / f"{name}.json", json.dumps(reply, indent=1))
            costs += f"{name},{cpu:.3f}\n"
            write_whole(cost, costs)
            bar.update()
    return len(todo)


def _answered(path: Path) -> bool:
    try:
        return "error" not in json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False


def _one(diagnose: _Diagnose, record: Path) -> tuple[str, dict[str, Any], float]:
    """Return the name of a record, the answer about it, and its CPU seconds."""
    start = time.process_time()
    try:
        reply = diagnose(record, record.with_suffix(".toml"))
    except Exception as error:  # one bad record must not cost the others
        reply = {"error": f"{type(error).__name__}: {error}"}
    return record.stem, reply, time.process_time() - start
