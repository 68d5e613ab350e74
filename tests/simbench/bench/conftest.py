"""A grid small enough to run in a second, and one finished run of it."""

import pytest

from scenarios.grid import make_grid
from simbench.bench.run import run_grid

SMALL = {
    "title": "small",
    "seed": 3,
    "disturbances": {"sine": {"type": "sine", "amplitude": [0.7, 2.0], "period": [0.4, 2.5]}},
    "draw": {"K": [0.5, 2], "T": [5, 50], "S": [2, 5], "samples_per_period": [20, 40], "periods": [18, 25], "step": 0.8},
    "block": [
        {
            "name": "a",
            "axes": {"Td_over_T": [0.3, 1.0], "S_over_2J": [0.5], "noise_ratio": [0.1], "disturbance": ["none", "sine"]},
            "member": [{"name": "sticky", "valve": "choudhury"}, {"name": "healthy", "valve": "ideal"}],
        },
        {
            "name": "b",
            "process": "integrating",
            "axes": {"Td_over_Ti": [0.05], "S_over_2J": [0.5, 2.0], "noise_ratio": [0.1], "disturbance": ["none", "sine"]},
            "member": [{"name": "sticky", "valve": "choudhury"}, {"name": "healthy", "valve": "ideal"}],
        },
    ],
}


@pytest.fixture
def small():
    return make_grid(SMALL, "small", {"repeats": 2})


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """One run of the small grid with two methods, never to be changed."""
    return run_grid(make_grid(SMALL, "small", {"repeats": 2}), tmp_path_factory.mktemp("runs") / "done", ["he", "yamashita"])
