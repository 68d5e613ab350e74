"""Frozen tables: the scenarios that a grid of the package asks for, settled once for all."""

import io
import json
import pickle

import pyarrow.parquet as pq
import pytest

from results.studies.freeze import frozen
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid, packaged_grid
from simbench.scenarios.packaged import grid_names
from simbench.scenarios.settled import settled_grid, table_file

FROZEN = "recorded"  # the grid whose scenarios are nowhere but in its table


def stored(name):
    return table_file(name).read_bytes()


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


def test_only_the_grid_of_recorded_loops_stands_in_its_table_alone():
    assert [n for n in grid_names() if packaged_grid(n).frozen] == [FROZEN]
    table = settled_grid(FROZEN)
    drafts = [d for g in table.groups() for d in g.drafts]
    assert len({d.id for d in drafts}) == len(drafts) == len(table) == table.content.expected
    assert {d.tags["benchmark"] for d in drafts} == {table.benchmark}
    for key, value in {"seed": 3, "noise_ratio": 0.1}.items():
        with pytest.raises(SpecError, match=f"{FROZEN}: {key} = .* only --n"):
            load_grid(FROZEN, {key: value})


def test_some_scenarios_of_a_table_are_scenarios_of_it():
    table = settled_grid(FROZEN)
    all_of_them = {d.id: d for g in table.groups() for d in g.drafts}
    some = table.some(50)
    drawn = [d for g in some.groups() for d in g.drafts]
    assert len(some) == len({d.id for d in drawn}) == 50
    assert all(all_of_them[d.id] == d for d in drawn)
    assert table.some(50).hash == some.hash != table.some(49).hash
    assert len(table.some(len(table))) == len(table)
    for points in (0, len(table) + 1):
        with pytest.raises(SpecError, match=f"1 to {len(table)} are allowed"):
            table.some(points)
