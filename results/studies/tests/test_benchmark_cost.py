"""The measurements of the benchmark itself, in this process and on a few scenarios."""

import shutil

import pyarrow as pa
import pyarrow.parquet as pq

from results.studies import benchmark_cost as study
from simbench.bench.store.reading import read_table


def changed(folder, copy, kind, column, value):
    shutil.copytree(folder, copy)
    path = copy / f"{kind}.parquet"
    table = read_table(copy, kind)
    old = table.column(column).to_pylist()
    at = table.schema.get_field_index(column)
    new = pa.array([value, *old[1:]], table.schema.field(column).type)
    shutil.rmtree(path)  # of partitions; one file is read alike
    pq.write_table(table.set_column(at, table.schema.field(column), new), path)
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
