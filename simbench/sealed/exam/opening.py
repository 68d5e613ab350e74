"""Open an exam: check key and records, join the answers with the labels, and pass both to the
scoring of runs.
"""

from __future__ import annotations

import contextlib
import math
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from simbench.bench.execute import pieces
from simbench.bench.execute.compute_piece import (
    Answer,
    SimulatedScenario,
    judge_record,
    piece_of,
    scenario_row,
    verdict_row,
)
from simbench.bench.execute.plugin_host import oracle_of
from simbench.bench.execute.run import about_method
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.store.benchmark import evaluator_hash, grid_settings
from simbench.bench.store.manifest import describe, run_key
from simbench.bench.store.place import place_of
from simbench.bench.store.tables import AXES
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import ParameterError, UserError
from simbench.detectors.plugins.registry import methods as registry
from simbench.detectors.prepared import prepare
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, Verdict
from simbench.sealed.exam.answers import Answers, read_answers
from simbench.sealed.exam.commitments import answered_late, note_opening
from simbench.sealed.exam.folder import LOOPS, RECORDS, Exam, mark_of, read_exam
from simbench.sealed.exam.loops import grid_in_key
from simbench.sealed.exam.simulating import simulate_picks
from simbench.sealed.handout import read_key

_LABELS = (
    "cycled",
    "sticky",
    "predicted",
    "oscillates",
    "block",
    "member",
    "process",
    "controller",
    "valve",
    *AXES,
)
_ASKED_AGAIN = 100  # records about which methods of the package are asked again
_FOREIGN = {"front_end": False, "role": "stiction", "budget": "fast", "fitted_on": [], "stated": []}


@dataclass(frozen=True)
class Opened:
    """An exam with its truth."""

    run: Path  # a folder that holds truth and answers as a run does; it goes with the exam
    missing: dict[str, int]  # records that a method left out, of methods that left any
    late: list[str]  # methods whose answers were not committed to before the first opening
    labels: pd.DataFrame  # one row a record, in the order of the exam


@contextlib.contextmanager
def opened_exam(
    folder: str | Path, key: str | Path, answers: Iterable[str | Path], jobs: int = 1
) -> Iterator[Opened]:
    """Open an exam for as long as the context lasts.

    Parameters
    ----------
    folder, key : str or Path
        Folder of the exam, and the file that `make_exam` wrote with it.
    answers : iterable of str or Path
        Files of answers; methods may be spread over several.
    jobs : int
        Worker processes.

    Yields
    ------
    Opened
        An answer that is missing counts as no_decision. The opening is noted beside the key.

    Raises
    ------
    ParameterError
        When the key does not match the commitment, another version of simbench made the exam, a
        record is not the one that its seed gives, or a file of answers holds what is no answer to
        this exam.

    Examples
    --------
    >>> import tempfile
    >>> from simbench.sealed.exam.making import make_exam
    >>> from simbench.sealed.exam.folder import read_exam
    >>> with tempfile.TemporaryDirectory() as place:
    ...     _ = make_exam("smoke", f"{place}/exam", f"{place}/exam.key", n=2)
    ...     name = next(iter(read_exam(f"{place}/exam").records))
    ...     rows = f"method,record,verdict,score\\nmine,{name},stiction,0.7\\n"
    ...     _ = Path(place, "mine.csv").write_text(rows)
    ...     with opened_exam(f"{place}/exam", f"{place}/exam.key", [f"{place}/mine.csv"]) as opened:
    ...         opened.missing
    {'mine': 1}
    """
    exam, key = read_exam(folder), Path(key)
    secret = read_key("exam", key, exam.folder, exam.about["commitment"])
    try:
        places = {
            ident: (int(p["group"]), int(p["place"])) for ident, p in secret["records"].items()
        }
        grid, stated = grid_in_key(secret), secret["benchmark"]
        made_by = str(stated["parts"]["evaluator"])
    except (KeyError, TypeError, ValueError, AttributeError):
        raise ParameterError(f"exam: {key} is no key file of an exam") from None
    if exam.about["benchmark"] != stated or set(places) != set(exam.records):
        raise ParameterError(
            f"exam: {exam.folder} states another benchmark or other records than its key;"
            " restore it"
        )
    if made_by != evaluator_hash():
        made = (
            f"was made by another version of simbench (its evaluator is {made_by}, here it is"
            f" {evaluator_hash()})"
        )
        raise ParameterError(f"exam: {exam.folder} {made}; open it with the version that made it")
    files = [Path(file) for file in answers]
    given = read_answers(files, exam.records)
    late = read_answers(answered_late(exam, key, files), exam.records)
    names = {place: ident for ident, place in places.items()}
    simulated = simulate_picks(grid, names, jobs, _with_truth)
    for place, ident in names.items():
        if place not in simulated or simulated[place][0] != exam.marks[ident]:
            changed = (
                f"record {ident!r} in {RECORDS} or its line in {LOOPS} is not what its seed gives"
            )
            cure = "restore it, or open it on the kind of machine that made it"
            raise ParameterError(f"exam: {exam.folder}: {changed}; {cure}")
    _refuse_forged(given, exam.records)
    note_opening(exam, key, files)
    rows = {
        names[place]: truth for place, (_, *truth) in simulated.items()
    }  # in the order of the grid
    settings = {
        **grid_settings(grid),
        "scenarios": len(rows),
        "methods": {name: _about(name, name in late) for name in given}
        | {ORACLE: about_method(ORACLE)},
        "plugins": {},
        "command": "simbench exam open",
        "exam": exam.about["commitment"],
    }
    with tempfile.TemporaryDirectory() as place:
        run = Path(place) / "run"
        _write_run(run, describe(settings), rows, given)
        missing = {name: len(rows) - len(of) for name, of in given.items() if len(of) < len(rows)}
        foreign = [name for name in late if not registry.built_in(name)]
        labels = _labels(exam, {ident: row for ident, (row, *_) in rows.items()})
        yield Opened(run, missing, foreign, labels)


def _with_truth(it: SimulatedScenario) -> tuple[Any, ...]:
    """Return the mark of a scenario's record, its row, its process and the oracle's row."""
    if it.run is None:
        return ("",)
    record = it.run.record
    verdict, wrong = oracle_of(it.scenario, it.run)
    oracle = verdict_row(it.ident, Answer(verdict, wrong, math.nan))
    return (
        mark_of(record, record.t),
        scenario_row(it, prepare(record.without_mv())),
        record.process,
        oracle,
    )


def _refuse_forged(given: Answers, records: Mapping[str, LoopRecord]) -> None:
    """Ask the methods of the package about some records again, and raise ParameterError where
    answers under their names are others: whoever wrote them has to choose a name of their own.
    """
    chosen = {
        name: registry.load(name).METHOD.defaults() for name in given if registry.built_in(name)
    }
    drawn = np.random.default_rng().permutation([*records])[:_ASKED_AGAIN].tolist()
    if not chosen:
        return
    with one_thread():
        for ident in drawn:
            for again, *_ in judge_record(records[ident], chosen)[1]:
                stated = given[again.method].get(ident)
                if stated is not None and stated.verdict != again.verdict:
                    raise ParameterError(
                        f"exam: {again.method!r} is a method of the package, which answers"
                        f" {again.verdict} to record {ident!r}, where {stated.verdict} stands; give"
                        " these answers another name"
                    )


def _about(name: str, late: bool) -> dict[str, Any]:
    """Return what is known of a method and of its answers; whatever its name, it saw no MV here."""
    own = registry.built_in(name)  # and asked again
    answered = "package" if own else "after opening" if late else "before opening"
    try:
        known = about_method(name)
    except UserError:
        known = _FOREIGN
    return {**known, "needs_mv": False, "verified": own, "answered": answered}


def _write_run(
    run: Path, manifest: dict[str, Any], rows: Mapping[str, Sequence], given: Answers
) -> None:
    """Write truth and answers as one piece of a run."""
    verdicts = []
    for ident, (row, process, oracle) in rows.items():
        for name, of in given.items():
            verdict = of.get(ident, Verdict(name, NO_DECISION, reason="not answered"))
            answered = verdict.verdict != NO_DECISION and not _needs_mv(name)
            verdict = verdict.but(applicable=_covers(name, process) or answered)
            verdicts.append(verdict_row(row["scenario_id"], Answer(verdict, None, math.nan)))
        verdicts.append(oracle)
    piece = piece_of(0, [row for row, *_ in rows.values()], verdicts)
    place = pieces.open_run(place_of(run), manifest, resume=False)
    pieces.finish(place, [pieces.write_piece(place, piece, run_key(manifest))], manifest)


def _covers(name: str, process: str) -> bool:
    """Return whether a method is made for the records of an exam, which hold no MV, and for a
    process; one that is not of the package is made for all.
    """
    try:
        method = registry.load(name).METHOD
    except UserError:
        return True
    return process in method.process and not method.needs_mv


def _needs_mv(name: str) -> bool:
    try:
        return registry.load(name).METHOD.needs_mv
    except UserError:
        return False


def _labels(exam: Exam, rows: Mapping[str, dict[str, Any]]) -> pd.DataFrame:
    table = pd.DataFrame(
        [
            {**rows[ident], "record": ident, "oscillates": rows[ident]["oscillating"]}
            for ident in exam.records
        ]
    )
    return table.reindex(columns=["record", *_LABELS])
