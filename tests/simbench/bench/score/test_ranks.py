"""Ranks on planted runs: equals share one, a known difference is resolved at the number of loops
that the tool proposes.
"""

import numpy as np
import pytest

from simbench.bench.score.ranks import loops_needed, rank_methods
from simbench.bench.score.scoring import score_book

RUNS = 100


def planted(rng, n, accuracy):
    """Return the truth of n loops and one method's verdicts, right with a probability, undecided on
    a tenth of its errors.
    """
    truth = (rng.random(n) < 0.5).astype(int)
    verdict = np.where(rng.random(n) < accuracy, truth, 1 - truth)
    verdict[(verdict != truth) & (rng.random(n) < 0.1)] = 2
    return truth, verdict


@pytest.mark.parametrize("accuracy", [0.55, 0.72, 0.9])
def test_two_equal_methods_share_a_rank(book, accuracy):
    """The second is the first with the verdicts of 1 % of the loops turned round."""
    rng, shared = np.random.default_rng(int(100 * accuracy)), 0
    for _ in range(RUNS):
        truth, verdict = planted(rng, 3500, accuracy)
        other = np.where(rng.random(verdict.size) < 0.01, 1 - np.minimum(verdict, 1), verdict)
        shared += rank_methods(np.array([verdict == truth, other == truth])).rank.tolist() == [1, 1]
    assert shared >= 0.95 * RUNS
    block = score_book(book([verdict, other], truth)).rows().set_index("method")
    assert block["rank"][["m0", "m1"]].tolist() == [1, 1]


def test_unrelated_equal_methods_are_separated_in_one_run_of_twenty():
    rng = np.random.default_rng(11)
    apart = sum(len(set(rank_methods(rng.random((2, 2000)) < 0.7).rank)) > 1 for _ in range(400))
    assert 0.02 <= apart / 400 <= 0.08


def test_more_loops_resolve_less_in_proportion_to_the_root():
    rng = np.random.default_rng(5)
    few, many = (rank_methods(rng.random((3, n)) < 0.7).resolution for n in (1000, 16000))
    assert few / many == pytest.approx(4.0, rel=0.1)


def test_no_rank_moves_when_a_copy_of_a_method_joins():
    rng = np.random.default_rng(17)
    right = np.array([rng.random(300) < p for p in (0.85, 0.8, 0.7, 0.62, 0.5)]).astype(float)
    silent = np.full(300, 0.5)  # a method that never decides
    before = rank_methods(np.vstack([right, silent]))
    for copied in range(6):
        rows = np.vstack([right, silent])
        after = rank_methods(np.vstack([rows, rows[copied]]))
        assert after.rank[:6].tolist() == before.rank.tolist()
        assert after.rank[6] == before.rank[copied]
        assert after.resolution == before.resolution
    assert before.rank[5] > before.rank[0]


@pytest.mark.parametrize("overlap", [0.0, 0.8], ids=["unrelated errors", "errors mostly shared"])
def test_three_points_are_separated_at_the_number_of_loops_proposed(overlap):
    rng, separated = np.random.default_rng(7), 0
    pilot = np.array([rng.random(3500) < p for p in (0.72, 0.69)])
    n = loops_needed(0.03, rank_methods(pilot).spread)
    for _ in range(RUNS):
        common = rng.random(n) < overlap
        draws = np.where(common, rng.random(n), [rng.random(n), rng.random(n)])
        separated += rank_methods(draws < np.array([[0.72], [0.69]])).rank.tolist() == [1, 2]
    assert separated >= 0.80 * RUNS
