"""Add methods to a finished run: ask them about its loops, or take the answers from a file."""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Unpack

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from simbench.bench.execute import pieces
from simbench.bench.execute.answers_file import Answers, read_answers
from simbench.bench.execute.compute_piece import Answer, Receipt, verdict_row
from simbench.bench.execute.run import choose_with_oracle, run_scored
from simbench.bench.execute.run_options import RunOptions, find_deciding
from simbench.bench.scenario.oracle import ORACLE
from simbench.bench.score.result import Scores
from simbench.bench.score.shipped import REFERENCE, shipped
from simbench.bench.store.folder import (
    RunError,
    file_digest,
    partition_file,
    refuse_unfinished,
    visible_names,
    write_file,
)
from simbench.bench.store.manifest import (
    ADDING,
    FROM_FILE,
    SOURCES,
    UNANSWERED,
    WHOLE,
    put_in_place,
    read_manifest,
    refuse_other_code,
)
from simbench.bench.store.reading import read_table, table_parts
from simbench.bench.store.tables import VERDICT_SCHEMA, as_parquet, as_table
from simbench.detectors.errors import masked, printable
from simbench.detectors.sources import Detector, Methods, named_methods, split_names
from simbench.detectors.verdict import NO_DECISION, Verdict
from simbench.files import refuse_taken

# where a call works: a run of the methods that are asked, and the run with its further methods
_ADDED = "added"
_JOINED = "joined"
# what a run's manifest holds of a method that was answered from a file
_ABOUT = {
    "front_end": False,
    "needs_mv": False,
    "role": "stiction",
    "budget": "fast",
    "fitted_on": [],
    "stated": [],
    "division": None,
    "changed": {},
    "answered": FROM_FILE,
}


class Added(NamedTuple):
    """A run with methods that were added to it.

    Attributes
    ----------
    folder : Path
        Folder of the run.
    scores : Scores
        Its scores.
    told : str
        What was added, and which answers are missing.
    """

    folder: Path
    scores: Scores
    told: str


@dataclass(frozen=True)
class _Addition:
    """Methods that are added to a run."""

    about: dict[str, Any]  # what the manifest holds of each method
    plugins: dict[str, str]  # digests of the plug-ins among them
    verdicts: pa.Table  # their rows of the table of verdicts
    told: str  # what the user is told of them
    sources: Path | None = None  # folder of the plug-ins' files


def add_to_run(
    folder: str | Path,
    methods: Methods = (),
    out: str | Path | None = None,
    jobs: int = 1,
    *,
    add: bool = True,
    answers: Iterable[str | Path] = (),
    **options: Unpack[RunOptions],
) -> Added:
    """Add methods to a finished run.

    Parameters
    ----------
    folder : str or Path
        Folder of the run, which stays as it is until the run with the further methods is complete.
    methods : str, function, object with `detect`, or iterable of them
        Ids of methods, groups of them, and detectors of the caller, that are asked about the loops
        of the run; those of the package that the run has are left out.
    out : str or Path, optional
        New folder for the run with the further methods; `folder` then stays as it is.
    jobs : int
        Worker processes; -1 uses all cores.
    add : bool
        Whether methods and plug-ins are asked; without it answers alone are joined.
    answers : iterable of str or Path
        Files of answers, as `read_answers` reads them. A method that left out a record gave no
        decision there.
    **options
        Keys of `RunOptions`, but for those that decide the loops; with `with_reference` the run is
        scored with the shipped verdicts on its grid from here on.

    Returns
    -------
    Added
        The run, its scores, and what was added.

    Raises
    ------
    RunError
        When the folder holds no finished run with its loops, the run was made by other code, or has
        the methods already.

    Examples
    --------
    >>> import tempfile
    >>> from simbench.bench.execute.run import run_grid
    >>> place = Path(tempfile.mkdtemp())
    >>> first = run_grid("smoke", place / "run", ["he"], n=4)
    >>> add_to_run(first, ["horch"]).told
    'added: horch'
    """
    deciding = find_deciding(options, but=["with_reference"])
    if deciding:
        raise RunError(
            f"--add and --answers take the loops of {folder} as they stand; leave out"
            f" {', '.join(deciding)}"
        )
    with_reference = options.pop("with_reference", False)

    # the run that is added to, and the folder that is to hold the methods
    shown = Path(folder if out is None else out)
    folder = Path(folder).resolve()
    target = shown.resolve()

    # no other process works there, and what is wrong is refused before anything is asked
    work = target / ADDING
    with pieces.held(target):
        try:
            stated = _read_finished(folder)
            if out is not None and visible_names(shown):
                refuse_taken(out)
            if with_reference:
                shipped(str(stated["grid"]))
            if add:
                asked = _methods_to_ask(folder, stated, methods, options)
            else:
                asked = {}
            records = _records_of(folder)
            given = [(Path(file), read_answers(file, records)) for file in answers]
            _refuse_known(folder, stated, asked, given)

            # answers of files, then those of methods, which are asked in a run of their own
            if not options.get("resume"):
                shutil.rmtree(work / _ADDED, ignore_errors=True)  # of a call that was killed
            additions = [_join_answers(folder, file, of) for file, of in given]
            if add:
                run_scored(folder, work / _ADDED, asked.values(), jobs, **options)
                additions.append(_read_added(folder, work / _ADDED))
            scores = _write_joined_run(folder, work / _JOINED, stated, additions, with_reference)

            # from this one change of a name on, the run has the further methods
            (work / _JOINED).replace(work / WHOLE)
            put_in_place(target)
        finally:
            # a call that was interrupted goes on from what it has asked
            if not (work / _ADDED).exists():
                shutil.rmtree(work, ignore_errors=True)
    return Added(shown, scores, "; ".join(addition.told for addition in additions))


def _read_finished(folder: Path) -> dict[str, Any]:
    """Return the manifest of a finished run with its loops; RunError for anything else."""
    stated = read_manifest(folder)
    refuse_unfinished(folder, stated)
    if "times" not in stated:
        raise RunError(
            f"{folder} is a baseline, no run; `simbench run {folder} -o RUN` makes a run of its"
            " loops"
        )
    return stated


def _methods_to_ask(
    folder: Path, stated: Mapping[str, Any], methods: Methods, options: RunOptions
) -> dict[str, Detector]:
    """Return by their names the methods of the package that the run lacks, then the detectors that
    are given as files or by the caller.
    """
    # The same code must have made the run
    refuse_other_code(folder, stated)

    # Detectors of one's own have names that the run does not use
    words, own = named_methods(methods)
    plugins = {Path(file).stem: Path(file).stem for file in options.get("plugins", ())} | own
    for name in plugins:
        if name in stated["methods"]:
            raise RunError(f"{folder} has a method {name!r} already; another name is needed")

    # Methods of the package that the run lacks
    names = choose_with_oracle([word for word in split_names(words) if word not in plugins], [])
    lacking = [name for name in names if name not in stated["methods"]]
    if not lacking and not plugins:
        known = ", ".join(names) or "no method is named"
        raise RunError(
            f"{folder} has all methods that are asked for ({known}); name others with --method or"
            " --plugin"
        )
    return {name: name for name in lacking} | plugins


def _records_of(folder: Path) -> set[str]:
    """Return the ids of the records of a run."""
    return set(read_table(folder, "scenarios", ["scenario_id"]).column(0).to_pylist())


def _refuse_known(
    folder: Path,
    stated: Mapping[str, Any],
    asked: Iterable[str],
    given: Sequence[tuple[Path, Answers]],
) -> None:
    """Refuse answers of a method that the run has, or that another file has."""
    there = {}
    for name in tuple(stated["methods"]) + tuple(asked):
        there[name] = str(folder)
    for file, answers in given:
        for name in answers:
            if name in there:
                raise RunError(
                    f"{file}: {there[name]} has a method {name!r} already; another name is needed"
                )
            there[name] = str(file)


def _read_added(folder: Path, place: Path) -> _Addition:
    """Return the methods that were asked about the loops of a run in a run of their own."""
    # Both runs' records, in the order of their ids
    manifest = read_manifest(place)
    hashes = []
    for where in (folder, place):
        hashes.append(
            read_table(where, "scenarios", ["scenario_id", "record_hash"]).sort_by("scenario_id")
        )

    # Records whose bits differ on this machine are told
    before, now = (table.column("record_hash").to_pylist() for table in hashes)
    other = sum(a != b for a, b in zip(before, now, strict=True) if a is not None)
    told = f"added: {', '.join(manifest['methods'])}"
    if (place / SOURCES).is_dir():
        sources = place / SOURCES
    else:
        sources = None
    if other:
        told += f"; {other} of {len(now)} records have other bits on this machine"

    # The verdicts, and the sources of plug-ins
    verdicts = read_table(place, "verdicts").cast(VERDICT_SCHEMA)
    return _Addition(manifest["methods"], manifest["plugins"], verdicts, told, sources)


def _join_answers(folder: Path, file: Path, answers: Answers) -> _Addition:
    """Return the answers of a file as those of methods; what they left out is no decision."""
    # the records that could be answered
    scenarios = read_table(folder, "scenarios", ["scenario_id", "error"]).to_pylist()
    records = [row["scenario_id"] for row in scenarios if row["error"] is None]

    # a row for each of them and each method, and what is said of the method
    rows = []
    told = []
    about = {}
    source = f"answers of {printable(file.name)} (sha256 {file_digest(file)})"
    for name, of in answers.items():
        for record in records:
            verdict = of.get(record) or Verdict(name, NO_DECISION, reason="not answered")
            answer = Answer(verdict.but(applicable=True), None, math.nan)
            rows.append(verdict_row(record, answer))
        missing = len(records) - sum(record in of for record in records)
        about[name] = {**_ABOUT, "source": source, UNANSWERED: missing}
        if missing:
            left = f", {missing} of {len(records)} records not answered"
        else:
            left = ""
        told.append(f"answered by {file}: {name}{left}")
    return _Addition(about, {}, as_table(rows, VERDICT_SCHEMA), "; ".join(told))


def _write_joined_run(
    folder: Path,
    into: Path,
    stated: Mapping[str, Any],
    additions: Sequence[_Addition],
    with_reference: bool,
) -> Scores:
    """Write the run with the verdicts that are added to it into another folder."""
    # The run without its verdicts, and sources of what is added
    shutil.rmtree(into, ignore_errors=True)
    shutil.copytree(folder, into, ignore=shutil.ignore_patterns("verdicts.parquet", ".*"))
    for sources in (addition.sources for addition in additions if addition.sources is not None):
        shutil.copytree(sources, into / SOURCES, dirs_exist_ok=True)

    # All methods, the oracle last
    new = {}
    for addition in additions:
        new |= addition.about
    about = {**stated["methods"], **new}
    methods = sorted(about, key=lambda name: name == ORACLE)  # last, as where it is asked at once

    # The added verdicts in the order of the scenarios
    scenarios = read_table(folder, "scenarios", ["scenario_id", "error"]).to_pylist()
    added = _in_order(
        _with_failures(pa.concat_tables(a.verdicts for a in additions), scenarios, list(new)),
        [row["scenario_id"] for row in scenarios],
        list(new),
    )

    # Piece by piece: the old verdicts and the new ones
    receipts = []
    start = 0
    for number, part in enumerate(table_parts(folder, "verdicts", stated)):
        ids = part.column("scenario_id").unique().to_pylist()
        more = added.slice(start * len(new), len(ids) * len(new))
        table = _in_order(
            pa.concat_tables([part.replace_schema_metadata(), more]), ids, list(methods)
        )
        write_file(into / partition_file("verdicts", number), as_parquet(table, number))
        digests = pieces.digests_of_piece(into, number)
        failures = table.num_rows - table.column("error").null_count
        receipts.append(Receipt(number, len(ids), failures, 0.0, 0.0, 0.0, digests))
        start += len(ids)

    # The manifest states what was added and by which command
    manifest = {
        **stated,
        "methods": {name: about[name] for name in methods},
        "plugins": {**stated["plugins"], **{k: v for a in additions for k, v in a.plugins.items()}},
        "added": [*stated.get("added", ()), printable(masked(" ".join(sys.argv)))],
        **({REFERENCE: True} if with_reference else {}),
    }
    return pieces.finish(into, receipts, manifest)


def _with_failures(
    verdicts: pa.Table, scenarios: Sequence[Mapping[str, Any]], methods: Sequence[str]
) -> pa.Table:
    """Return verdicts with those of scenarios that the run could not simulate, about which no
    method is asked.
    """
    # Scenarios that failed answer nothing
    failed = {}
    for row in scenarios:
        if row["error"] is not None:
            failed[row["scenario_id"]] = row["error"]
    rows = []
    for ident, error in failed.items():
        for name in methods:
            rows.append(
                verdict_row(
                    ident, Answer(Verdict(name, NO_DECISION, reason=f"failed: {error}"), error, 0.0)
                )
            )

    # In place of what was asked about them
    asked = pc.invert(pc.is_in(verdicts.column("scenario_id"), pa.array(failed, pa.string())))
    return pa.concat_tables([verdicts.filter(asked), as_table(rows, VERDICT_SCHEMA)])


def _in_order(verdicts: pa.Table, ids: Sequence[str], methods: Sequence[str]) -> pa.Table:
    """Return verdicts scenario by scenario, of each scenario in the order of the methods."""
    keys = []
    for name, values in (("method", methods), ("scenario_id", ids)):
        keys.append(pc.index_in(verdicts.column(name), pa.array(values, pa.string())).to_numpy())
    return verdicts.take(pa.array(np.lexsort(keys)))
