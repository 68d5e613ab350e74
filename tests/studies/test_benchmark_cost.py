"""The measurements of the benchmark itself, in this process and on a few scenarios."""

import itertools
import json
import shutil
import time
from types import SimpleNamespace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from results.studies import benchmark_cost as study
from simbench.bench.store.checksums import digest
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.bench.store.reading import read_table


@pytest.fixture
def in_process(monkeypatch, capsys):
    """Runs in this process, each noted."""
    asked = []

    def run(target, grid, methods, jobs, sets, measure=False, group=False):
        asked.append((target.name, jobs, sets))
        study._child(str(target), grid, methods, "1", json.dumps({**sets, "disturbance": "none"}))
        printed = capsys.readouterr().out.encode()
        return SimpleNamespace(wait=lambda timeout=None: 0, communicate=lambda: (printed, None))

    monkeypatch.setattr(study, "_run", run)
    # time of processes that have ended: there are none
    monkeypatch.setattr(study, "_cpu", map(float, itertools.count()).__next__)
    return asked


def changed(folder, copy, kind, column, value):
    shutil.copytree(folder, copy)
    path, manifest = copy / f"{kind}.parquet", read_manifest(copy)
    table = read_table(copy, kind)
    old = table.column(column).to_pylist()
    at = table.schema.get_field_index(column)
    new = pa.array([value, *old[1:]], table.schema.field(column).type)
    shutil.rmtree(path)  # of partitions; one file is read alike
    pq.write_table(table.set_column(at, table.schema.field(column), new), path)
    write_manifest(
        copy, {**manifest, "tables": {**manifest["tables"], kind: digest(path.read_bytes())}}
    )
    return copy


def test_tables_are_the_same_but_for_their_running_time(finished, tmp_path):
    assert study.same_tables(finished, finished)
    assert study.same_tables(
        finished, changed(finished, tmp_path / "slow", "verdicts", "runtime_s", 99.0)
    )
    assert not study.same_tables(
        finished, changed(finished, tmp_path / "score", "verdicts", "score", 99.0)
    )
    assert not study.same_tables(
        finished, changed(finished, tmp_path / "seed", "scenarios", "seed", 99)
    )


def test_sizes_are_per_scenario(in_process):
    few, more = study.sizes([1, 100], "he", "smoke")
    assert [sets["repeats"] for _, _, sets in in_process] == [1, 2]  # smoke has 48
    assert more["scenarios"] == 2 * few["scenarios"]
    for row in (few, more):
        assert 20 < row["peak_MB"] < 20_000
        assert 0.05 < row["ms_per_scenario"] < 5000
        assert 0.0 <= row["overhead"] < 1.0
        assert 50 < row["bytes"] < 50_000
    # the processor time of this very process, told after either run
    spent = [row["cpu_ms"] * row["scenarios"] / 1e3 for row in (few, more)]
    assert 0.5 < spent[0] <= spent[1] <= time.process_time()


def test_kills_that_come_too_late_are_none(monkeypatch, in_process):
    killed = []

    def slow(target, *a, group=False, **k):
        if not group:
            target.mkdir()
            return SimpleNamespace(wait=lambda timeout=None: 0)

        def wait(timeout=None):
            if timeout is not None and len(killed) < 3:
                raise study.subprocess.TimeoutExpired("run", timeout)

        return SimpleNamespace(wait=lambda timeout=None: wait(timeout), pid=7)

    monkeypatch.setattr(study, "_run", slow)
    monkeypatch.setattr(study.os, "killpg", lambda pid, how: killed.append((pid, how)))
    monkeypatch.setattr(study, "same_tables", lambda one, other: True)
    # a killed process is waited for without a limit
    result = study.kills(3)
    assert result == {"kills": 3, "runs": 1, "kills_after_first_piece": 0, "equal": True}
    assert killed == [(7, study.signal.SIGKILL)] * 3
    killed.clear()
    monkeypatch.setattr(study, "same_tables", lambda one, other: False)
    assert study.kills(3)["equal"] is False
