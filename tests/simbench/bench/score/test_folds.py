"""What is learned on some groups and judged on the others, against counts by hand."""

import numpy as np
import pytest

from simbench.bench.score.folds import folds_of, found_at, risk_coverage
from simbench.bench.score.ranks import rank_methods
from simbench.bench.statistics import mean_ranks


def test_groups_stay_whole_and_every_fold_is_used():
    groups = np.repeat(np.arange(40), 3)
    fold = folds_of(groups)
    assert all(np.unique(fold[groups == g]).size == 1 for g in range(40))
    assert np.bincount(fold).tolist() == [24] * 5


def test_detection_at_five_percent_takes_its_threshold_from_the_other_fold():
    fold = np.repeat([0, 1], 40)
    positive = np.tile(np.r_[np.ones(20, bool), np.zeros(20, bool)], 2)
    # 20 negatives: one of them, 5 %, may lie above the threshold
    ranks = np.r_[np.full(20, 30), np.arange(20), np.full(20, 18), np.arange(40, 60)]
    # fold 0 is cut at the other's second largest negative, 58: nothing is above it; fold 1 at 18:
    # ties are not above it
    assert found_at(ranks, positive, fold) == 0
    assert found_at(ranks, positive, 1 - fold) == 0
    ranks[40:60] = 19
    assert found_at(ranks, positive, fold) == 20


def test_no_score_is_never_above_the_threshold():
    positive = np.tile([True, False], 50)
    assert found_at(np.where(positive, -1, 5), positive, np.arange(100) % 5) == 0


def test_a_perfect_score_risks_nothing_and_no_score_half():
    positive = np.tile([True, False], 100)
    fold = np.arange(200) // 40
    assert risk_coverage(positive.astype(int), positive, fold)[0].max() == 0.0
    assert risk_coverage(np.full(200, -1), positive, fold)[0] == pytest.approx(0.5)


def test_the_surest_answers_come_first_in_a_risk_coverage_curve():
    rng = np.random.default_rng(2)
    positive = rng.random(2000) < 0.5
    score = positive + rng.normal(0, 0.7, 2000)
    curve = risk_coverage(np.argsort(np.argsort(score)), positive, np.arange(2000) % 5)[0]
    assert curve[199] < 0.05 < 0.2 < curve[-1]
    assert curve[-1] == pytest.approx(np.mean((score > 0.5) != positive), abs=0.02)


def by_loops(ranks, positive, fold):
    """What is wrong and how sure it is, one loop after the other."""
    wrong, sure = np.full(ranks.size, 0.5), np.full(ranks.size, -1.0)
    for i in np.flatnonzero(ranks >= 0):
        known = (fold != fold[i]) & (ranks >= 0)
        if not known.any():
            continue
        cuts = [*np.unique(ranks[known]), np.inf]
        errors = [np.sum(positive[known] & (ranks[known] < c)) for c in cuts]
        errors += np.array([np.sum(~positive[known] & (ranks[known] >= c)) for c in cuts])
        best = np.mean(ranks[known] < cuts[int(np.argmin(errors))])
        place = 0.5 * (np.mean(ranks[known] < ranks[i]) + np.mean(ranks[known] <= ranks[i]))
        wrong[i], sure[i] = (place > best) != positive[i], abs(place - best)
    return wrong, sure


@pytest.mark.parametrize("seed", range(20))
def test_risk_and_coverage_equal_those_counted_loop_by_loop(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 60))
    ranks, fold = rng.integers(-1, 12, n), rng.integers(0, rng.integers(1, 6), n)
    positive = rng.random(n) < 0.5
    wrong, sure = by_loops(ranks, positive, fold)
    levels = np.unique(sure)[::-1]
    # answers equally sure come in any order: each has the mean of them
    risk = np.concatenate([np.full(np.sum(sure == x), wrong[sure == x].mean()) for x in levels])
    curve = risk_coverage(ranks, positive, fold)[0]
    assert curve == pytest.approx(np.cumsum(risk) / np.arange(1, n + 1))


def test_equally_sure_answers_have_the_same_risk_in_any_order():
    positive = np.arange(100) < 50
    curve = risk_coverage(np.zeros(100, dtype=int), positive, np.tile(np.arange(5), 20))[0]
    assert curve == pytest.approx(curve[-1])


def test_the_area_under_risk_and_coverage_scatters_as_in_a_bootstrap_of_whole_groups():
    rng = np.random.default_rng(4)
    group = np.repeat(np.arange(150), 4)
    positive = rng.random(600) < 0.5
    score = np.round(positive + np.repeat(rng.normal(0, 0.6, 150), 4) + rng.normal(0, 0.3, 600), 1)
    ranks, fold = np.unique(score, return_inverse=True)[1], group % 5
    curve, values = risk_coverage(ranks, positive, fold)
    assert values.mean() == pytest.approx(curve.mean())
    spread = np.sqrt(np.sum(np.bincount(group, values - values.mean()) ** 2)) / 600
    drawn = []
    for _ in range(300):
        taken = (4 * rng.integers(0, 150, 150)[:, None] + np.arange(4)).ravel()
        drawn.append(risk_coverage(ranks[taken], positive[taken], fold[taken])[0].mean())
    assert spread == pytest.approx(np.std(drawn), rel=0.25)


def test_the_closed_form_is_the_group_bootstraps_variance():
    rng = np.random.default_rng(6)
    right = np.repeat(rng.random((2, 200)) < [[0.8], [0.6]], 3, axis=1)
    sums = (right[0].astype(float) - right[1]).reshape(200, 3).sum(axis=1)
    drawn = [sums[rng.integers(0, 200, 200)].sum() / 600 for _ in range(4000)]
    assert rank_methods(right, np.repeat(np.arange(200), 3)).spread / 600 == pytest.approx(
        np.var(drawn), rel=0.1
    )


def test_cases_that_hang_together_widen_the_critical_difference_and_lone_ones_do_not():
    rng = np.random.default_rng(9)
    right = rng.random((400, 5)) < 0.7
    alone = mean_ranks(right, groups=np.arange(400)).critical_difference
    thrice = np.repeat(right, 3, axis=0)
    assert mean_ranks(
        thrice, groups=np.repeat(np.arange(400), 3)
    ).critical_difference == pytest.approx(alone, rel=0.02)
    assert mean_ranks(thrice, groups=np.arange(1200)).critical_difference < 0.7 * alone
