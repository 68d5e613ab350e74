"""Statistics against scipy, scikit-learn, hand numbers and simulation."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from sklearn.metrics import roc_auc_score

from simbench.bench.statistics import (
    auc,
    auc_drop,
    holm,
    mcnemar,
    wilson,
)


@given(n=st.integers(1, 500), share=st.floats(0, 1))
def test_wilson_is_scipys(n, share):
    k = round(share * n)
    theirs = stats.binomtest(k, n).proportion_ci(method="wilson")
    lo, hi = wilson(k, n)
    assert lo == pytest.approx(theirs.low, abs=1e-12)
    assert hi == pytest.approx(theirs.high, abs=1e-12)


@pytest.mark.parametrize(
    ("lost", "won", "p"), [(0, 0, 1.0), (6, 0, 2 / 64), (1, 5, 14 / 64), (3, 3, 1.0)]
)
def test_mcnemar_by_hand(lost, won, p):
    assert mcnemar(lost, won) == pytest.approx(p)


def naive_holm(p):
    rejected_at = []
    order = sorted(range(len(p)), key=lambda i: p[i])
    worst = 0.0
    corrected = [0.0] * len(p)
    for place, i in enumerate(order):
        worst = max(worst, (len(p) - place) * p[i])
        corrected[i] = min(worst, 1.0)
        rejected_at.append(worst)
    return corrected


@given(st.lists(st.floats(0, 1), max_size=12))
def test_holm_is_its_definition(p):
    assert holm(p).tolist() == pytest.approx(naive_holm(p))
    assert np.all(holm(p) >= np.array(p))


@given(st.integers(0, 2**31))
def test_auc_is_sklearns_ties_included(seed):
    rng = np.random.default_rng(seed)
    score, truth = rng.integers(0, 6, 40).astype(float), rng.random(40) < 0.4
    if truth.any() and not truth.all():
        assert auc(score, truth).value == pytest.approx(roc_auc_score(truth, score))


def placements(score, positive):
    """Pair by pair: what each case wins of the other class, ties half."""
    wins = np.sign(score[positive][:, None] - score[~positive][None, :]) / 2 + 0.5
    return wins.mean(axis=1), wins.mean(axis=0)


@pytest.mark.parametrize("level", [0.9, 0.95])
def test_delong_by_pairs(level):
    rng = np.random.default_rng(2)
    positive = np.arange(70) < 30
    score = np.round(positive + rng.normal(0, 1.0, 70), 1)  # ties
    one, other = placements(score, positive)
    sd = math.sqrt(one.var(ddof=1) / one.size + other.var(ddof=1) / other.size)
    area = one.mean()
    result = auc(score, positive, level)
    assert result.value == pytest.approx(area)
    z = stats.norm.ppf(0.5 + level / 2)
    logit = math.log(area / (1 - area))
    for bound, sign in ((result.lo, -1), (result.hi, 1)):
        assert math.log(bound / (1 - bound)) == pytest.approx(
            logit + sign * z * sd / (area * (1 - area))
        )


def test_a_paired_fall_by_pairs():
    rng = np.random.default_rng(3)
    positive = np.arange(60) < 25
    before = positive + rng.normal(0, 0.8, 60)
    now = before + rng.normal(0, 0.7, 60)
    falls = [a - b for a, b in zip(placements(before, positive), placements(now, positive))]
    z = falls[0].mean() / math.sqrt(sum(f.var(ddof=1) / f.size for f in falls))
    assert auc_drop(before, now, positive) == pytest.approx(stats.norm.sf(z))
