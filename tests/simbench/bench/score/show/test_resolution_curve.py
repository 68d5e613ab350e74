"""The resolution curve counts echoes by where they end, beside the sticky loops of their blocks."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.score.show.resolution_curve import resolution_curve
from simbench.bench.statistics import rate
from simbench.figures._resolution_curve import draw

N = 600
CUTS = (1.5, 3.0, 8.0)


@pytest.fixture
def run(book):
    """A run of two methods with and one without a sense for corners."""
    rng = np.random.default_rng(3)
    kind = rng.integers(0, 4, N)  # 0 sticky, else the echo that ends at CUTS[kind - 1]
    cut = np.array([np.nan, *CUTS])[kind]
    sharp = np.where(kind == 0, 1, rng.random(N) < np.array([0.0, 0.0, 0.1, 0.5])[kind])
    said = [rng.integers(0, 2, N), sharp, np.where(rng.random(N) < 0.2, 2, sharp)]
    made = book(said, np.where(kind == 0, 1, 0), methods=("blind", "sharp", "shy"))
    block = np.where(rng.random(N) < 0.1, "other", "corners").astype(object)
    block[kind > 0] = "corners"
    return replace(made, axes={**made.axes, "cut": cut, "block": block})


def test_shares_are_those_of_the_echoes_and_of_the_sticky_loops_beside_them(run):
    run.applicable[1, :100] = 0
    table = resolution_curve(run)
    assert len(table) == 9
    for r in table.itertuples():
        k = run.methods.index(r.method)
        covered = run.applicable[k] != 0
        echoes = covered & (run.axes["cut"] == r.cut)
        beside = covered & np.isnan(run.axes["cut"]) & (run.axes["block"] == "corners")
        for (n, *shares), here in (
            ((r.n, r.called, r.called_lo, r.called_hi), echoes),
            (
                (r.siblings, r.called_siblings, r.called_siblings_lo, r.called_siblings_hi),
                beside,
            ),
        ):
            said = run.verdict[k][here] == 1
            assert n == here.sum()
            assert shares == pytest.approx(rate(int(said.sum()), n))


def test_who_tells_echoes_from_sticky_loops_comes_first(run):
    table = resolution_curve(run)
    assert list(dict.fromkeys(table.method)) == ["sharp", "shy", "blind"]
    assert list(table.cut[:3]) == list(CUTS)
    ends = table.drop_duplicates("method").set_index("method")
    mean = table[table.method == "sharp"].called.mean()
    assert ends.told_apart["sharp"] == pytest.approx(1.0 - mean)
    assert ends.told_apart_lo["blind"] < 0.0 < ends.told_apart_hi["blind"]
    assert ends.told_apart_lo["sharp"] > ends.told_apart_hi["blind"]
    assert ends.told_apart_hi["sharp"] - ends.told_apart_lo["sharp"] < 0.1


def test_an_interval_holds_the_difference_nineteen_times_in_twenty(book):
    rng, held = np.random.default_rng(8), 0
    for _ in range(200):
        kind = rng.integers(0, 3, 200)
        said = rng.random(200) < np.array([0.8, 0.2, 0.6])[kind]
        made = book([said], np.where(kind == 0, 1, 0))
        axes = {"cut": np.array([np.nan, 2.0, 4.0])[kind], "block": np.full(200, "b", object)}
        row = resolution_curve(replace(made, axes={**made.axes, **axes})).iloc[0]
        held += row.told_apart_lo <= 0.4 <= row.told_apart_hi
    assert 180 <= held <= 199


def test_a_run_without_echoes_of_several_cuts_has_no_curve(run):
    one = replace(run, axes={**run.axes, "cut": np.where(run.axes["cut"] > 0, 2.0, np.nan)})
    assert resolution_curve(one).empty
    alone = replace(run, truth={**run.truth, "cycled": np.zeros(N, dtype=np.int8)})
    assert resolution_curve(alone).empty


def test_the_picture_has_a_panel_for_every_method(run):
    table = resolution_curve(run)
    drawn = draw(table)
    titles = [axes.get_title(loc="left") for axes in drawn.axes]
    assert [title.split()[0] for title in titles] == ["sharp", "shy", "blind"]
