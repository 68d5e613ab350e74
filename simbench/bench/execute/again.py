"""Ask detectors the same question twice during `simbench check`; a detector that answers
differently fails the check.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from simbench.bench.execute.work import judge_record, record_hash
from simbench.bench.score.check import MARGIN, check_run
from simbench.bench.score.check_result import Check
from simbench.bench.store.manifest import code_hash, read_manifest
from simbench.bench.store.reading import read_table
from simbench.detectors.plugins.registry import methods as registry
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

_ASKED_AGAIN = 200  # records of a run


def check_and_ask_again(
    folder: str | Path, against: str | Path, margin: float = MARGIN, exact: bool = False
) -> Check:
    """Compare a run with a baseline as `check_run` does, and ask its methods once more about a
    share of its records.
    """
    check = check_run(folder, against, margin, exact)
    return replace(check, problems=(*check.problems, *differing(folder)))


def differing(folder: str | Path) -> Iterator[str]:
    """Ask every built-in method once more about a share of a run's records, and name those that
    answer otherwise.
    """
    manifest = read_manifest(folder)
    # what another code answers is no second answer of the same detector
    if manifest["code"] != code_hash():
        return
    names = [
        m for m in manifest["methods"] if m in registry.names() and m not in manifest["plugins"]
    ]
    chosen = {m: registry.load(m).METHOD.defaults() for m in names}
    rows = read_table(folder, "scenarios", ["scenario_id", "loop", "seed", "record_hash"])
    order = np.random.default_rng(0).permutation(rows.num_rows)[:_ASKED_AGAIN]
    columns = ["scenario_id", "method", "verdict", "score"]
    verdicts = read_table(folder, "verdicts", columns).to_pylist()
    first = {(row["scenario_id"], row["method"]): row for row in verdicts}
    differ, asked = dict.fromkeys(names, 0), 0
    for row in rows.take(order).to_pylist():
        record = simulate(Loop.from_table(json.loads(row["loop"])), row["seed"]).record
        if record_hash(record) != row["record_hash"]:  # another processor: another record
            continue
        asked += 1
        for second, _, _ in judge_record(record, chosen)[1]:
            before = first[row["scenario_id"], second.method]
            differ[second.method] += second.verdict != before["verdict"] or not np.allclose(
                second.score, np.array(before["score"], float), 1e-6, 0, equal_nan=True
            )
    yield from (
        f"method {m} differs from itself on {k} of {asked} records asked twice"
        for m, k in differ.items()
        if k
    )
