"""A sample of a grid: the same scenarios as the whole grid has, each as likely, of a grid of any
size.
"""

import pickle
import time
import tracemalloc
from collections import Counter

import pytest

from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid, make_grid
from simbench.scenarios.grid_check import MOST_CELLS
from simbench.scenarios.sample import Sample

AXES = {f"controller.{key}": [round(1 + 0.01 * k, 2) for k in range(100)] for key in ("Kc", "Ti")}
AXES["noise.std"] = [round(0.01 * k, 2) for k in range(100)]
MILLION = {
    "loop": {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "valve": {"model": "choudhury", "S": 5, "J": 2},
        "sampling": {"Ts": 1, "n": 600},
    },
    "axes": AXES,
}


def listed(grid):
    """Every scenario of a grid: the number of its group and the name of its member."""
    return {(i, d.tags["member"]) for i in range(grid.group_count) for d in grid.group(i).drafts}


@pytest.mark.parametrize("points", [1, 7, 30, 47, 48])
def test_a_sample_has_so_many_scenarios_of_the_grid_each_once(points):
    grid = load_grid("smoke")
    sample = Sample.of(grid, points)
    drawn = [(group, name) for group, names in sample.drawn.items() for name in names]
    assert len(drawn) == len(set(drawn)) == len(sample) == points
    assert set(drawn) <= listed(grid)


def test_a_sample_is_a_function_of_grid_seed_and_size():
    one, other = (Sample.of(load_grid("smoke"), 10) for _ in range(2))
    assert one.drawn == other.drawn
    assert one.hash == other.hash
    assert pickle.loads(pickle.dumps(one)).drawn == one.drawn
    assert Sample.of(load_grid("smoke", {"seed": 99}), 10).drawn != one.drawn
    assert Sample.of(load_grid("smoke"), 11).hash != one.hash != load_grid("smoke").hash


def test_a_sample_is_spread_over_the_first_axis():
    grid = make_grid(MILLION, "million")
    cells = [group // 10_000 for group in Sample.of(grid, 1000).drawn]
    assert set(Counter(cells).values()) == {10}


def test_of_a_million_cells_only_those_drawn_are_held():
    grid = make_grid(MILLION, "million")
    tracemalloc.start()
    began = time.process_time()
    sample = Sample.of(grid, 2000)
    assert len(sample.drawn) == 2000
    sample.group(1999)
    assert time.process_time() - began < 5.0
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


def test_a_grid_too_large_to_run_whole_can_be_sampled():
    axes = {**AXES, "valve.S": [round(1 + 0.01 * k, 2) for k in range(1000)]}
    with pytest.raises(SpecError, match=f"1e\\+09 cells; at most {MOST_CELLS} are simulated"):
        make_grid({**MILLION, "axes": axes}, "large")
    grid = make_grid({**MILLION, "axes": axes}, "large", most_cells=10**15)
    assert len(grid) == 10**9
    assert len(Sample.of(grid, 50).drawn) == 50
