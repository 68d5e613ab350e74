"""The score map shows what the run's tables hold."""

import numpy as np
import pandas as pd
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.store.manifest import read_manifest
from simbench.bench.store.reading import RunArrays
from simbench.figures import make_figures
from simbench.figures.score_map import data, draw, levels
from simbench.figures.score_overview import ROW_GROUPS, overview
from simbench.figures.score_overview import draw as draw_overview


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_grid("smoke", tmp_path_factory.mktemp("map") / "run", ["he", "horch", "yamashita"])


def test_every_cell_holds_the_share_of_right_answers(run):
    numbers = data(run)
    both = pd.read_parquet(run / "verdicts.parquet").merge(
        pd.read_parquet(run / "scenarios.parquet"), on="scenario_id"
    )
    both = both[both.cycled.isin(["yes", "no"])]
    right = (both.verdict == "stiction") == (both.cycled == "yes")
    both["right"] = right & (both.verdict != "no_decision")
    for row in numbers.itertuples():
        ratio = both.Td_over_T if row.plant == "self-regulating" else both.Td_over_Ti
        cell = both[
            (both.method == row.method) & (ratio == row.ratio) & (both.S_over_2J == row.S_over_2J)
        ]
        covered = row.method != "horch" or row.plant == "self-regulating"
        assert (row.n, row.applicable) == (len(cell), len(cell) * covered)
        assert row.right == cell.right.mean() if covered else np.isnan(row.right)
    assert numbers.n.sum() == len(both)


def test_a_continuous_axis_is_put_into_few_levels_and_healthy_and_dead_band_keep_theirs():
    drawn = np.r_[np.zeros(50), np.random.default_rng(1).uniform(0.3, 9, 400), np.full(50, np.inf)]
    grouped = levels(drawn)
    assert np.unique(grouped).size <= 8
    assert (grouped[:50] == 0).all()
    assert np.isinf(grouped[-50:]).all()
    order = np.argsort(drawn[50:450])
    assert (np.diff(grouped[50:450][order]) >= 0).all()


def test_what_a_method_is_not_made_for_is_hatched_and_no_share(run):
    numbers = data(run)
    assert (
        numbers[(numbers.method == "horch") & (numbers.plant == "integrating")].right.isna().all()
    )
    alone = draw(numbers[numbers.method == "horch"])
    integrating = next(a for a in alone.axes if a.get_xlabel() == "Td/Ti")
    assert {p.get_hatch() for p in integrating.patches} == {"////"}
    assert not integrating.texts


def test_the_overview_sorts_methods_and_keeps_healthy_and_sticky_apart(run):
    numbers = overview(RunArrays.read(run))
    methods = numbers.drop_duplicates("method")
    assert methods.kind.tolist() == sorted(methods.kind, key=ROW_GROUPS.index)
    fair = methods[(methods.kind == "OP and PV") & methods["rank"].notna()]
    assert fair.accuracy.is_monotonic_decreasing
    both = pd.read_parquet(run / "verdicts.parquet").merge(
        pd.read_parquet(run / "scenarios.parquet"), on="scenario_id"
    )
    he = both[(both.method == "he") & both.cycled.isin(["yes", "no"])]
    healthy = he[~he.sticky & (he.process == "foptd") & (he.disturbance == "none")]
    row = numbers.query(
        "method == 'he' and process == 'self-regulating' and loops == 'healthy'"
    ).iloc[0]
    assert (row.n, row.right) == (len(healthy), (healthy.verdict == "no_stiction").mean())
    assert numbers[numbers.method == "he"].n.sum() == len(he)
    assert len(draw_overview(numbers).axes) == 4


def test_plants_are_drawn_apart_with_healthy_and_dead_band_named(run, tmp_path):
    axes = [a for a in draw(data(run)).axes if a.get_title(loc="left")]
    assert {a.get_xlabel() for a in axes} == {"Td/T", "Td/Ti"}
    assert len(axes) == 6
    integrating = next(a for a in axes if a.get_xlabel() == "Td/Ti")
    assert [t.get_text() for t in integrating.get_yticklabels()] == ["none", "0.5", "∞"]
    (drawn,) = make_figures(["score-map"], tmp_path, run=run)
    assert [f.suffix for f in drawn.files] == [".svg", ".png", ".csv"]
    stated = read_manifest(run)["benchmark"]
    version = f"{stated['name']} ({stated['hash']})"
    assert pd.read_csv(drawn.files[2]).benchmark.unique().tolist() == [version]


def test_values_are_shares(run):
    numbers = data(run)
    assert numbers.right.dropna().between(0, 1).all()
    assert not (numbers.right + numbers.no_decision > 1 + 1e-12).any()
    assert np.isfinite(numbers.ratio).all()
