"""Ask detectors again during `simbench check`: the same question twice, as one that answers
differently fails the check, and about loops whose last bits are others, which tells how many
answers another processor loses.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from simbench.bench.execute.compute_piece import judge_record, record_hash
from simbench.bench.score.check import MARGIN, Shaken, check_run
from simbench.bench.score.check_result import Check
from simbench.bench.score.pairing import Pairs
from simbench.bench.store.folder import RunError, file_digest
from simbench.bench.store.manifest import code_hash, own_methods, processor, read_manifest
from simbench.bench.store.reading import CODES, RunArrays, read_table
from simbench.detectors.compiled import one_thread
from simbench.detectors.errors import UserError
from simbench.detectors.plugins.host import SECONDS
from simbench.detectors.plugins.registry import methods as registry
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_ASKED_AGAIN = 200  # records of a run
_SHAKEN = 100  # loops of a run whose bits differ from the baseline's
_MEMBERS = (1.0 + 1e-12, 1.0 - 1e-12)  # PV of the ensemble's members over the loop's own


def check_and_ask_again(
    folder: str | Path,
    against: str | Path,
    margin: float = MARGIN,
    exact: bool = False,
    plugins: Iterable[str | Path] = (),
    seconds: float = SECONDS,
) -> Check:
    """Compare a run with a baseline as `check_run` does, and ask its methods once more about a
    share of its records; of the plug-ins' those whose files are given.
    """
    with _host_plugins(folder, plugins, seconds) as added:
        names = _askable(folder, added)
        check = check_run(folder, against, margin, exact, partial(shaken_answers, folder, names))
        return replace(check, problems=(*check.problems, *differing(folder, names)))


def _host_plugins(
    folder: str | Path, plugins: Iterable[str | Path], seconds: float
) -> AbstractContextManager[list[str]]:
    """Host the files of a run's plug-ins; RunError for one that the run did not use."""
    stated = read_manifest(folder)["plugins"]
    for file in map(Path, plugins):
        if file.is_file() and stated.get(file.stem) != file_digest(file):
            raise RunError(
                f"{file} is not the plug-in that {folder} was run with; that file is needed with"
                " --plugin"
            )
    return registry.hosted(tuple(str(Path(file).resolve()) for file in plugins), seconds)


def _askable(folder: str | Path, added: Sequence[str] = ()) -> list[str]:
    """Return the methods of a run that can be asked again: built in or added; none where another
    code ran it, as what it answers is no second answer of the same detector.
    """
    manifest = read_manifest(folder)
    if manifest["code"] != code_hash():
        return []
    own = own_methods(manifest)
    return [m for m in manifest["methods"] if m in added or (registry.built_in(m) and m not in own)]


def differing(folder: str | Path, names: Sequence[str] | None = None) -> Iterator[str]:
    """Ask methods once more about a share of a run's records, and name those that answer
    otherwise.
    """
    names = _askable(folder) if names is None else names
    if not names:
        return
    chosen = {m: registry.load(m).METHOD.defaults() for m in names}
    # elsewhere, last bits of scores are others: there the same question is asked twice
    stored = read_manifest(folder).get("processor") == processor()
    rows = read_table(folder, "scenarios", ["scenario_id", "loop", "seed", "record_hash"])
    order = np.random.default_rng(0).permutation(rows.num_rows)[:_ASKED_AGAIN]
    columns = ["scenario_id", "method", "verdict", "score"]
    verdicts = read_table(folder, "verdicts", columns).to_pylist() if stored else []
    first = {(v["scenario_id"], v["method"]): (v["verdict"], v["score"]) for v in verdicts}
    differ = dict.fromkeys(names, 0)
    asked = 0
    for row in rows.take(order).to_pylist():
        record = simulate(Loop.from_table(json.loads(row["loop"])), row["seed"]).record
        if record_hash(record) != row["record_hash"]:  # another processor: another record
            continue
        asked += 1
        ident = row["scenario_id"]
        if not stored:
            answers = judge_record(record, chosen)[1]
            first = {(ident, said.method): (said.verdict, said.score) for said, _, _ in answers}
        for second, _, _ in judge_record(record, chosen)[1]:
            verdict, score = first[ident, second.method]
            differ[second.method] += second.verdict != verdict or not np.allclose(
                second.score, np.array(score, float), 1e-6, 0, equal_nan=True
            )
    yield from (
        f"method {m} differs from itself on {k} of {asked} records asked twice"
        for m, k in differ.items()
        if k
    )


def shaken_answers(
    folder: str | Path, names: Sequence[str], now: RunArrays, pairs: Pairs
) -> Shaken | None:
    """Simulate some loops whose bits differ from the baseline's with other last bits, and return
    what methods answer; None where nobody can be asked.
    """
    other = pairs.now[~pairs.same]
    if not names or not other.size:
        return None
    drawn = np.sort(np.random.default_rng(0).permutation(other)[:_SHAKEN])
    chosen = {m: registry.load(m).METHOD.defaults() for m in names}
    rows = read_table(folder, "scenarios", ["loop", "seed"]).take(drawn).to_pylist()
    at = []
    codes = []
    with one_thread():
        for place, row in zip(drawn.tolist(), rows, strict=True):
            loop = Loop.from_table(json.loads(row["loop"]))
            said = []
            try:
                for factor in _MEMBERS:
                    nudged = loop.model_copy(update={"plant": loop.plant.with_gain(factor)})
                    record = simulate(nudged, row["seed"]).record
                    answers = judge_record(record, chosen)[1]
                    said.append([CODES[verdict.verdict] for verdict, _, _ in answers])
            except UserError:  # of a plug-in's plant, or an echo whose sibling no longer cycles
                continue
            at.append(place)
            codes.append(said)
    if not at:
        return None
    table = np.array(codes, dtype=np.int8)  # loops, members, methods
    verdict = {name: table[:, :, k].T for k, name in enumerate(names)}
    return Shaken(np.array(at), len(_MEMBERS), verdict)
