"""What stands in the grid `recorded` in place of a record's columns: like them, and not they."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import ks_2samp

from results.studies.recorded_grid import like, one_a_unit, without_columns
from simbench.gap.benchmark.from_records import NearLoop
from simbench.scenarios.columns import RESIDUALS
from simbench.scenarios.settled import settled_grid
from simbench.scenarios.spec import Loop

PRINTED = Path("results/recorded_grid.txt").read_text(encoding="utf-8")
DRAWS = np.random.default_rng(1)


def neighbours(x):
    return np.corrcoef(x[1:], x[:-1])[0, 1]


def test_a_drawn_column_has_the_distribution_and_the_memory_of_the_given_one():
    shocks = DRAWS.standard_t(4, size=(2000, 2)) @ [[1.0, 0.8], [0.0, 0.6]]
    given = np.empty_like(shocks)
    given[0] = shocks[0]
    for t in range(1, len(given)):
        given[t] = [0.9, -0.5] * given[t - 1] + shocks[t]
    drawn = like(given, np.random.default_rng(2))
    for was, now in zip(given.T, drawn.T, strict=True):
        assert ks_2samp(was, now).statistic < 0.02
        assert neighbours(now) == pytest.approx(neighbours(was), abs=0.05)
        # it is another draw
        assert abs(np.corrcoef(was, now)[0, 1]) < 0.2
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(np.corrcoef(given.T)[0, 1], abs=0.1)


def near(digest, **load):
    loop = Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
            "controller": {"type": "PI", "Kc": 1, "Ti": 10},
            "sampling": {"Ts": 1, "n": 400},
            "disturbance": [{"type": "resampled", "piece": 20, **load}],
        }
    )
    return NearLoop(digest, loop, 1.0)


def test_no_number_of_a_column_stays():
    given = DRAWS.normal(size=(2, 300)).round(3)
    one = near("0" * 16, op=given[0].tolist(), output=given[1].tolist())
    drawn, pairs = without_columns(one, np.random.default_rng(6))
    (load,) = drawn.loop.to_table()["disturbance"]
    assert [len(load[name]) for name in ("op", "output")] == [300, 300]
    assert len(pairs) == 2
    for was, name in zip(given, ("op", "output"), strict=True):
        assert np.mean(np.array(load[name]) == was) < 0.05
    assert drawn.loop.plant == one.loop.plant


def test_every_unit_counts_once():
    loops = {f"r{k}": near(f"{k:016x}", op=[0.1] * 30) for k in range(9)}
    units = {f"r{k}": f"u{k // 3}" for k in range(8)}
    assert len(one_a_unit(loops, units)) == 4


def test_the_table_of_the_package_is_what_was_printed():
    table = settled_grid("recorded")
    loops = {
        d.tags["record"]: json.dumps(d.loop.to_table()) for g in table.groups() for d in g.drafts
    }
    said = re.search(r"of (\d+) units.*\n.*, (\d+) scenarios", PRINTED)
    assert (len(loops), len(table)) == tuple(map(int, said.groups()))
    assert sum(any(f'"{name}"' in text for name in RESIDUALS) for text in loops.values()) > 20
