"""Valve families: rates by family, weights fitted without one, and the grid in which all stand in
the same cells.
"""

import pytest

from results.studies.families import main, read
from simbench.bench.execute.run import run_grid
from simbench.scenarios.grid import load_grid


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
        # each loop has a separate gain and time scale: what has no unit is the same
        cells = {
            (
                f"{abs(x.plant.K * x.controller.Kc) * (1.0 if x.plant.T else x.controller.Ti):.9g}",
                f"{x.plant.Td / (x.plant.T or x.controller.Ti):.9g}",
                f"{x.controller.Ti / (x.plant.T or x.controller.Ti):.9g}",
            )
            for x in sticky.values()
        }
        assert len(cells) == 1


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    axes = {"disturbance": ["none"], "tuning": ["slow"], "S_over_2J": [1.0]}
    where = tmp_path_factory.mktemp("families") / "run"
    return run_grid("families", where, ["hammerstein", "he", "horch_histogram"], axes=axes)


def test_a_run_is_read_and_printed(run, capsys):
    rows = read(run)
    assert {"choudhury", "lugre"} <= set(rows.valve)
    assert set(rows.method) == {"hammerstein", "he", "horch_histogram"}
    main([str(run)])
    assert "S and J of sticky valves, 1 draws" in capsys.readouterr().out
