"""The score map shows what the run's tables hold."""

import numpy as np
import pandas as pd
import pytest

from simbench.bench.run import run_grid
from simbench.figures import make_figures
from simbench.figures.score_map import data, draw


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_grid("smoke", tmp_path_factory.mktemp("map") / "run", ["he", "yamashita"])


def test_every_cell_holds_the_share_of_right_answers(run):
    numbers = data(run)
    both = pd.read_parquet(run / "verdicts.parquet").merge(pd.read_parquet(run / "scenarios.parquet"), on="scenario_id")
    both = both[both.cycled.isin(["yes", "no"])]
    right = (both.verdict == "stiction") == (both.cycled == "yes")
    both["right"] = right & (both.verdict != "no_decision")
    for row in numbers.itertuples():
        ratio = both.Td_over_T if row.plant == "self-regulating" else both.Td_over_Ti
        cell = both[(both.method == row.method) & (ratio == row.ratio) & (both.S_over_2J == row.S_over_2J)]
        assert (row.n, row.right) == (len(cell), cell.right.mean())
    assert numbers.n.sum() == len(both)


def test_plants_are_drawn_apart_with_healthy_and_dead_band_named(run, tmp_path):
    axes = [a for a in draw(data(run)).axes if a.get_title(loc="left")]
    assert {a.get_xlabel() for a in axes} == {"Td/T", "Td/Ti"}
    assert len(axes) == 4
    integrating = next(a for a in axes if a.get_xlabel() == "Td/Ti")
    assert [t.get_text() for t in integrating.get_yticklabels()] == ["none", "0.5", "∞"]
    (drawn,) = make_figures(["score-map"], tmp_path, run=run)
    assert [f.suffix for f in drawn.files] == [".svg", ".png", ".csv"]


def test_values_are_shares(run):
    numbers = data(run)
    assert numbers.right.between(0, 1).all()
    assert (numbers.right + numbers.no_decision <= 1 + 1e-12).all()
    assert np.isfinite(numbers.ratio).all()
