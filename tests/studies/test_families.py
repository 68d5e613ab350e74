"""Valve families: rates by family, weights fitted without one, and the grid in which all stand in
the same cells.
"""

import numpy as np
import pandas as pd
import pytest

from detectors.evidence import EVIDENCE
from results.studies.families import left_out, main, read
from scenarios.grid import load_grid
from simbench.bench.execute.run import run_grid
from simbench.bench.score.families import rates
from simbench.figures.valve_families import data, draw

FAMILIES = ["choudhury", "he", "stribeck"]


def made(seed: int = 0, blind: str = "") -> pd.DataFrame:
    """Loops whose first index tells the cycling ones, but for those of the family `blind`."""
    rng, rows = np.random.default_rng(seed), []
    for group in range(60):
        process = ("foptd", "integrating")[group % 4 // 2]
        for valve in (*FAMILIES, "ideal"):
            cycled = valve != "ideal"
            seen = cycled and valve != blind
            evidence = EVIDENCE[process == "integrating"]
            for method in dict.fromkeys(e.method for e in evidence):
                indices = {
                    e.index: e.neutral + 0.3 * (seen - 0.5) for e in evidence if e.method == method
                }
                indices = {k: v + 0.01 * rng.standard_normal() for k, v in indices.items()} | {
                    "S_hat": 2.0
                }
                rows.append(
                    {
                        "scenario_id": f"{group} {valve}",
                        "method": method,
                        "group": group,
                        "process": process,
                        "valve": valve,
                        "disturbance": "none",
                        "cycled": cycled,
                        "oscillating": True,
                        "said": "stiction" if seen else "no_stiction",
                        "S": 2.0,
                        "S_lo": 1.5,
                        "S_hi": 3.0,
                        "indices": indices,
                    }
                )
    return pd.DataFrame(rows)


def test_every_family_is_in_the_same_cells():
    grid = load_grid("families")
    for index in (0, 30, grid.cells - 1):
        group = grid.group(index)
        sticky = {
            d.tags["valve"]: d.loop
            for d in group.drafts
            if str(d.tags["member"]).startswith("sticky")
        }
        assert {"choudhury", "he", "kano", "coulomb", "karnopp", "stribeck"} <= set(sticky)
        # each loop has a gain and a time scale of its own: what has no unit is the same
        cells = {
            (
                f"{abs(x.plant.K * x.controller.Kc) * (1.0 if x.plant.T else x.controller.Ti):.9g}",
                f"{x.plant.Td / (x.plant.T or x.controller.Ti):.9g}",
                f"{x.controller.Ti / (x.plant.T or x.controller.Ti):.9g}",
            )
            for x in sticky.values()
        }
        assert len(cells) == 1


def test_rates_count_verdicts():
    by_family = rates(made(blind="he")).set_index(["method", "valve"])
    assert by_family.loc[("hammerstein", "he"), "stiction"] == 0.0
    assert by_family.loc[("hammerstein", "stribeck"), "stiction"] == 1.0
    assert by_family.loc[("hammerstein", "ideal"), "n"] == 60
    assert not by_family.loc[("hammerstein", "ideal"), "cycling"]


def test_a_family_that_does_not_show_is_missed():
    by_family = {row["family"]: row for row in left_out(made(blind="he"))}
    assert by_family["he"]["found"] == 0.0
    assert by_family["he"]["less than choudhury"] == 1.0


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    axes = {"disturbance": ["none"], "tuning": ["slow"], "S_over_2J": [1.0]}
    where = tmp_path_factory.mktemp("families") / "run"
    return run_grid("families", where, ["hammerstein", "he", "horch_histogram"], axes=axes)


def test_a_run_is_read_drawn_and_printed(run, capsys):
    rows = read(run)
    assert {"choudhury", "lugre"} <= set(rows.valve)
    assert set(rows.method) == {"hammerstein", "he", "horch_histogram"}
    numbers = data(run)
    assert set(numbers.columns) == {
        "method",
        "valve",
        "cycling",
        "n",
        "stiction",
        "lo",
        "hi",
        "home",
    }
    if len(numbers):
        draw(numbers)
    main([str(run)])
    assert "S and J of sticky valves, 1 draws" in capsys.readouterr().out
