"""What parts none from unknown: the study's numbers by hand, and that it learns what is there."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from results.studies.missing import covering, found, learned, regressors, table
from simbench.bench.statistics import auc
from simbench.gap.report.result import CONFIDENCE


def rows(n=400, seed=0, far=2.0):
    """Records of which every other one lacks something, and is then `far` times as far away."""
    rng = np.random.default_rng(seed)
    lacks = np.arange(n) % 2 == 1
    apart = np.exp(0.3 * rng.standard_normal(n)) * np.where(lacks, far, 1.0)
    unknown = rng.uniform(0.05, 0.5, n)
    kind = np.where(lacks, np.array(["single", "foreign", "two"])[np.arange(n) // 2 % 3], "none")
    return pd.DataFrame(
        {"kind": kind, "none": 0.9 - unknown, "unknown": unknown, "apart": apart, "answer": apart}
    )


def test_how_often_one_number_is_larger_by_hand():
    assert auc([1.0, 3.0, 1.0, 2.0], [True, True, False, False]).value == 0.625
    # one of forty may be accused
    assert found(np.array([0.5, 38.5, 39.5]), np.arange(40.0)) == pytest.approx(2 / 3)


def test_only_what_tells_gets_a_weight():
    constant, tested, distance = learned(rows())
    assert distance > 3.0
    assert abs(tested) < 0.4
    # half of those that are as far as the middle of both lack something
    assert constant + distance * np.log(2.0) / 2.0 == pytest.approx(-tested * -1.1, abs=0.6)


def test_a_record_of_which_an_effect_is_sure_teaches_nothing():
    sure = rows(far=0.1).assign(none=0.01, unknown=0.01)
    np.testing.assert_allclose(learned(pd.concat([rows(), sure])), learned(rows()))


def test_the_table_asks_of_every_kind_how_well_each_tells():
    data = rows()
    shown = table(data, np.array([0.0, 0.0, 1.0]))
    assert shown.n.tolist() == [67] * 4 + [66] * 4 + [67] * 4
    alone = shown[shown.asked == "distance alone"].AUC
    assert (alone > 0.9).all()
    np.testing.assert_allclose(regressors(data)[:, 0], 1.0)


@pytest.mark.parametrize("n", [30, 150])
def test_sets_that_reach_the_learned_probability_hold_the_truth_as_often_as_is_said(n):
    rng = np.random.default_rng(n)
    draws = rng.random((400, n + 1)) ** 3
    often = np.mean([one[-1] <= covering(one[:-1]) for one in draws])
    assert often == pytest.approx(CONFIDENCE, abs=0.04)
    # of few records the largest one that was seen
    assert covering(np.array([0.2, 0.7])) == 0.7
