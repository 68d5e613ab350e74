"""Before a run: the estimated time is that of the run, and what nobody means by mistake is
refused.
"""

import numpy as np
import pytest

from simbench.bench.execute.grid_check import MOST_SCENARIOS, GridSize, refuse_too_large, size_of
from simbench.bench.store.manifest import RunError
from simbench.scenarios.grid import make_grid


def test_the_estimated_time_is_that_of_a_run_within_a_factor(small):
    # the chapter with the fast methods takes about two minutes of one core, and some ten MB
    from simbench.scenarios.grid import load_grid

    chapter = size_of(load_grid("chapter"), 12, 0)
    assert 40 < chapter.seconds < 400
    assert 2e6 < chapter.bytes < 40e6


def test_a_run_that_is_too_large_is_told_how_to_draw_from_its_grid():
    refuse_too_large(GridSize(1, MOST_SCENARIOS, 1.0, 1.0, 1.0), "grid")
    with pytest.raises(RunError, match=r"1000001 scenarios.*--n 10000"):
        refuse_too_large(GridSize(1, MOST_SCENARIOS + 1, 1.0, 1.0, 1.0), "grid")


def test_a_number_that_waits_for_its_scale_must_have_the_right_sign():
    from simbench.bench.execute.grid_check import refuse_wrong_parts

    table = {
        "title": "scaled",
        "seed": 1,
        "valves": {"lag": {"parameters": {"T": -0.1}, "scale": {"T": "period"}}},
        "draw": {
            "K": 1.0,
            "T": 10.0,
            "S": 3.0,
            "samples_per_period": 20,
            "periods": 18,
            "step": 0.8,
        },
        "block": [
            {
                "name": "a",
                "axes": {
                    "Td_over_T": [0.3],
                    "S_over_2J": [0.5],
                    "noise_ratio": [0.1],
                    "disturbance": ["none"],
                },
                "member": [{"name": "sticky", "valve": ["choudhury", "lag"]}],
            }
        ],
    }
    with pytest.raises(Exception, match=r"T = -0\.1; it must not be below 0"):
        refuse_wrong_parts(make_grid(table, "scaled"))
    table["valves"]["lag"]["parameters"]["T"] = 0.05
    refuse_wrong_parts(make_grid(table, "scaled"))
    assert np.isfinite(size_of(make_grid(table, "scaled"), 1, 1).seconds)


def test_an_echo_of_a_valve_without_friction_is_refused():
    from simbench.bench.execute.grid_check import refuse_wrong_parts

    draw = {"K": 1.0, "T": 10.0, "S": 3.0, "samples_per_period": 20, "periods": 18}
    axes = {"Td_over_T": [0.3], "S_over_2J": [0.5], "noise_ratio": [0.1]}
    echo = {"name": "healthy", "valve": "ideal", "echo": "smooth"}
    for valve, right in (("choudhury", True), ("ideal", False), (["choudhury", "lag"], False)):
        block = {"name": "a", "axes": axes, "member": [{"name": "first", "valve": valve}, echo]}
        grid = make_grid({"title": "echoes", "draw": draw, "block": [block]}, "echoes")
        if right:
            refuse_wrong_parts(grid)
        else:
            with pytest.raises(Exception, match="has no friction that could be echoed"):
                refuse_wrong_parts(grid)
