"""Diagnose the records of a withheld folder in processes that can read nothing but the records."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from results.studies.withheld import outcomes
from simbench.detectors.errors import ParameterError
from simbench.files import folder as make_folder
from simbench.files import remove_stale_temporaries
from simbench.progress import Progress
from simbench.sealed.handout import ask_in_processes

_Diagnose = Callable[..., dict[str, Any]]
COST = "cost.csv"
MOST_TESTS = 2  # a record


def answer(folder: str | Path, diagnose: _Diagnose, jobs: int = 1, tests: int = 0) -> int:
    """Write answers/ID.json for every record that has none yet, and with tests answers-1/ID.json,
    answers-2/ID.json.

    After each round the test that an answer asks for is opened and logged; where none is asked for,
    or it is refused, an answer is kept.
    """
    folder = Path(folder).resolve()
    if not 0 <= tests <= MOST_TESTS:
        raise ParameterError(f"withheld: --tests {tests}; 0 to {MOST_TESTS} a record are allowed")
    done = _round(folder, diagnose, jobs, {}, folder / "answers")
    opened: dict[str, list[str]] = {}
    for order in range(1, tests + 1):
        before, place = answers_after(folder, order - 1), make_folder(answers_after(folder, order))
        answers = {
            file.name: file.read_text(encoding="utf-8") for file in sorted(before.glob("*.json"))
        }
        for name, text in answers.items():
            asked = (json.loads(text).get("next_test") or {}).get("test")
            if asked is None:
                outcomes.write_whole(place / name, text)
            else:
                record = name.removesuffix(".json")
                opened.setdefault(record, []).append(
                    str(outcomes.open_one(folder, record, asked, order))
                )
        _round(folder, diagnose, jobs, opened, place)
        for name in answers:
            if not _answered(place / name):
                print(
                    f"{name}: {(place / name).read_text(encoding='utf-8')}; the answer before"
                    " stands"
                )
                outcomes.write_whole(place / name, answers[name])
    return done


def answers_after(folder: Path, tests: int) -> Path:
    """Return where the answers after so many tests lie."""
    return folder / (f"answers-{tests}" if tests else "answers")


def _round(
    folder: Path, diagnose: _Diagnose, jobs: int, tests: dict[str, list[str]], place: Path
) -> int:
    """Diagnose every record that has no answer in `place` yet, each with its tests."""
    records = sorted((folder / "records").glob("*.csv"))
    if not records:
        raise ParameterError(f"withheld: no records/*.csv in {folder}")
    bare = [r.name for r in records if not r.with_suffix(".toml").exists()]
    if bare:
        raise ParameterError(
            f"withheld: {bare[0]} has no baseline {Path(bare[0]).with_suffix('.toml')} beside it"
        )
    remove_stale_temporaries(make_folder(place))
    remove_stale_temporaries(folder)
    todo = [r for r in records if not _answered(place / f"{r.stem}.json")]
    cost = folder / COST
    costs = cost.read_text(encoding="utf-8") if cost.exists() else "id,cpu_s\n"
    questions = {r.stem: (diagnose, str(r), tests.get(r.stem, [])) for r in todo}
    bar = Progress(
        total=len(records), initial=len(records) - len(todo), desc="diagnosed", delay=1.0
    )
    with bar:
        for name, (reply, cpu) in ask_in_processes(_one, questions, jobs, _blindfold, str(folder)):
            costs += f"{name},{cpu:.3f}\n"
            outcomes.write_whole(place / f"{name}.json", json.dumps(reply, indent=1))
            outcomes.write_whole(cost, costs)
            bar.update()
    return len(todo)


def _answered(path: Path) -> bool:
    try:
        return "error" not in json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False


def _one(diagnose: _Diagnose, record: str, tests: list[str]) -> tuple[dict[str, Any], float]:
    start = time.process_time()
    try:
        reply = diagnose(
            Path(record), Path(record).with_suffix(".toml"), *([tests] if tests else [])
        )
    except Exception as error:  # one bad record must not cost the others
        reply = {"error": f"{type(error).__name__}: {error}"}
    return reply, time.process_time() - start


def _blindfold(folder: str) -> None:
    """Make this process unable to open anything of the folder but its records and the tests that
    were opened.
    """
    allowed = tuple(os.path.join(folder, name) + os.sep for name in ("records", outcomes.OPENED))
    root = folder + os.sep

    def watch(event: str, args: tuple[Any, ...]) -> None:
        if event == "open" and isinstance(args[0], (str, bytes, os.PathLike)):
            path = os.path.realpath(os.fsdecode(args[0]))
            if path.startswith(root) and not path.startswith(allowed):
                raise PermissionError(f"withheld: {path} must not be read while answering")

    sys.addaudithook(watch)
