"""Frozen tables: the scenarios that a grid of the package asks for, settled once for all."""

import io
import json
import pickle

import pyarrow.parquet as pq
import pytest

from results.studies.freeze import frozen
from simbench.scenarios.grid import grid_names, load_grid
from simbench.scenarios.settled import SettledGrid, settled_grid, table_file, table_of

MOST_BYTES = 6_000_000  # of all tables in the wheel


@pytest.mark.parametrize("name", grid_names())
def test_a_table_has_what_its_grid_asks_for_but_echoes_of_what_does_not_cycle(name):
    asked = {
        draft.id: (group.index, draft.tags, draft.echo is not None)
        for group in load_grid(name).groups()
        for draft in group.drafts
    }
    table = settled_grid(name)
    there = {d.id: g.index for g in table.groups() for d in g.drafts}
    assert len(table) == len(asked)
    assert table.group_count == load_grid(name).group_count
    assert sum(map(table.size, range(table.group_count))) == len(there)
    assert there.items() <= {ident: index for ident, (index, *_) in asked.items()}.items()
    lacking = [asked[ident] for ident in asked.keys() - there]
    assert all(is_echo for *_, is_echo in lacking)
    assert len(lacking) < 0.1 * len(asked)


def stored(name):
    return table_file(name).read_bytes()


def test_all_tables_are_small():
    assert sum(len(stored(name)) for name in grid_names()) < MOST_BYTES


def test_the_table_of_smoke_is_what_settling_gives():
    settled, there = (pq.read_table(io.BytesIO(x)) for x in (frozen("smoke"), stored("smoke")))
    assert settled.to_pylist() == there.to_pylist()


def test_a_group_of_a_table_has_nothing_left_to_settle():
    table = settled_grid("smoke")
    group = table.group(3)
    assert group.rules.empty
    assert [d.rules.empty for d in group.drafts] == [True] * table.size(3)
    assert all(json.loads(json.dumps(d.tags)) == d.tags for d in group.drafts)
    assert group == pickle.loads(pickle.dumps(table)).group(3)


def test_a_group_that_lost_all_its_scenarios_is_empty():
    table = settled_grid("smoke")
    rows = [row for index in (0, 2) for row in table._rows[index]]
    other = SettledGrid(table.name, table.content, {}, table_of(rows), len(rows))
    assert (other.group_count, other.size(1), other.group(1).drafts) == (3, 0, ())
    assert other.group(2) == table.group(2)
    assert other.samples() == [0]
    nothing = SettledGrid(table.name, table.content, {}, table_of([]), 0)
    assert (nothing.group_count, nothing.samples()) == (0, [])


def test_a_grid_is_known_by_its_table():
    table = settled_grid("smoke")
    assert table.of_package_table
    assert table.hash != load_grid("smoke").hash
    other = SettledGrid(table.name, table.content, {}, settled_grid("ci").table, len(table))
    assert not other.of_package_table
    assert other.hash != table.hash
