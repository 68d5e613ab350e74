"""What is learned on some groups and judged on the others, against counts by hand."""

import numpy as np
import pytest

from simbench.bench.score.no_waveform import folds_of, found_at
from simbench.bench.score.ranks import rank_methods


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


def test_the_closed_form_is_the_group_bootstraps_variance():
    rng = np.random.default_rng(6)
    right = np.repeat(rng.random((2, 200)) < [[0.8], [0.6]], 3, axis=1)
    sums = (right[0].astype(float) - right[1]).reshape(200, 3).sum(axis=1)
    drawn = [sums[rng.integers(0, 200, 200)].sum() / 600 for _ in range(4000)]
    assert rank_methods(right, np.repeat(np.arange(200), 3)).spread / 600 == pytest.approx(
        np.var(drawn), rel=0.1
    )
