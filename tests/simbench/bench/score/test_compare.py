"""Comparisons: paired by scenario, corrected for their number, honest about axes."""

import json
from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.score.compare import compare
from simbench.bench.score.scoring import score_book, score_run
from simbench.bench.statistics import mcnemar
from simbench.bench.store.reading import read_book
from simbench.detectors.errors import UserError

N = 400
TRUTH = np.arange(N) % 2


@pytest.fixture
def run(book, noisy):
    rng = np.random.default_rng(0)
    parts = [noisy(rng, TRUTH, accuracy, methods=1)[0][0] for accuracy in (0.95, 0.7, 0.7)]
    return book(parts, TRUTH, methods=("good", "fair", "also_fair"))


def test_pairs_are_counted_by_scenario(run):
    comparison = compare(run)
    (pair,) = comparison.pairs[
        (comparison.pairs["first"] == "good") & (comparison.pairs["second"] == "fair")
    ].to_dict("records")
    good, fair = (run.verdict[i] == TRUTH for i in (0, 1))
    assert pair["win"] == sum(bool(a and not b) for a, b in zip(good, fair))
    assert pair["loss"] == sum(bool(b and not a) for a, b in zip(good, fair))
    assert pair["p"] >= mcnemar(pair["win"], pair["loss"])
    assert pair["differ"]


def test_equals_are_not_separated_and_the_best_comes_first(run):
    comparison = compare(run)
    assert comparison.ranking["method"].iloc[0] == "good"
    assert not comparison.pairs.set_index(["first", "second"]).loc[("fair", "also_fair"), "differ"]


def test_scenarios_without_a_label_are_left_out(run, book):
    truth = TRUTH.copy()
    truth[:100] = -1
    assert compare(book(run.verdict, truth)).cases == 300


def test_no_decision_is_never_right(book):
    comparison = compare(book([np.full(N, 2), TRUTH, TRUTH], TRUTH))
    assert comparison.ranking.set_index("method").loc["m0", "accuracy"] == 0.0


def test_from_folders_with_texts_that_hold_the_numbers(tmp_path):
    folder = run_grid("smoke", tmp_path / "run", ["horch", "he", "yamashita"], progress=False)
    comparison = compare(read_book(folder))
    assert comparison.cases == 48
    assert "yamashita" in comparison.as_text()
    content = json.loads(json.dumps(comparison.as_json(), allow_nan=False))
    assert len(content["pairs"]) == 3
    assert score_run(folder).compare().pairs.equals(comparison.pairs)
    with pytest.raises(UserError, match="cycled"):
        score_run(folder).compare("cicled")


def test_every_pair_stands_in_the_matrix(run):
    comparison = compare(run)
    wins, ties, losses, n = (comparison.matrix(x) for x in ("win", "tie", "loss", "n"))
    names = list(comparison.ranking.method)
    for first in names:
        for second in names:
            if first == second:
                assert np.isnan(wins.loc[first, second])
                continue
            i, j = (run.methods.index(m) for m in (first, second))
            one, other = (run.verdict[k] == TRUTH for k in (i, j))
            assert wins.loc[first, second] == (one & ~other).sum() == losses.loc[second, first]
            assert ties.loc[first, second] == (one == other).sum()
            assert n.loc[first, second] == N
    assert np.allclose(comparison.matrix(), comparison.matrix().T, equal_nan=True)
    with pytest.raises(UserError, match="win"):
        comparison.matrix("wins")


def test_a_method_that_failed_is_marked(run):
    failed = np.zeros((3, N), dtype=bool)
    failed[1, :38] = True
    comparison = compare(replace(run, failed=failed))
    assert comparison.ranking.set_index("method").failed.to_dict() == {
        "good": 0,
        "fair": 38,
        "also_fair": 0,
    }
    assert f"! fair failed on 38 of {N} records" in comparison.as_text()
    assert "fair!" in comparison.as_text()


def test_scores_compare_their_methods(run):
    scores = score_book(run)
    assert scores.compare().pairs.equals(compare(run).pairs)
    assert "\n" not in repr(scores.compare())
    assert "<table" in scores.compare()._repr_html_()
