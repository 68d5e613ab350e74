"""What preprocessing decides: three ways to give a record to a method, and the shares of each."""

import numpy as np
import pytest

from results.studies import preprocessing
from results.studies.preprocessing import (
    WAYS,
    AsItCame,
    alone,
    as_it_came,
    as_prepared_here,
    as_published,
    balanced,
    by_chance,
    losses,
    ranks,
    resampled,
    shares,
)
from simbench.detectors.example_loop import example_loop
from simbench.detectors.judge import judge
from simbench.detectors.prepared import prepare

RECORD = example_loop(noise=0.3)


def test_as_it_came_nothing_but_the_mean_is_taken_off():
    view = AsItCame(RECORD)
    for name in ("op", "pv"):
        x = getattr(RECORD, name)
        assert view.clean(name) == pytest.approx(x - x.mean())
        assert view.band(name, 5.0) == pytest.approx(x - x.mean())
    raw = prepare(RECORD).half_cycles("pv", cleaned=False)
    assert view.half_cycles("pv") == pytest.approx(raw)


def test_the_ways_differ_in_signals_and_not_in_bounds():
    published = judge(RECORD, ["he@published"])[0]
    assert as_published(RECORD, "he") == published
    # He's paper takes nothing off either
    assert as_it_came(RECORD, "he").score == pytest.approx(published.score)
    here = as_prepared_here(RECORD, "he")
    assert here.score != pytest.approx(published.score, abs=1e-6)
    assert here == judge(RECORD, ["he"])[0]


def test_a_wrong_answer_costs_one_and_none_a_half(monkeypatch):
    said = iter(["stiction", "no_stiction", "no_decision"])
    verdict = type("V", (), {})
    answers = dict.fromkeys(WAYS, lambda *_: verdict)

    def next_verdict(*_):
        verdict.verdict = next(said)
        return verdict

    monkeypatch.setattr(preprocessing, "ANSWERS", dict.fromkeys(answers, next_verdict))
    assert losses(RECORD, True, ["he"]).tolist() == [[0.0, 1.0, 0.5]]


def test_ranks_of_each_way_and_of_a_method_that_alone_changes_its_way():
    cost = np.array([[0.1, 0.3, 0.3], [0.2, 0.2, 0.2], [0.3, 0.4, 0.1]])
    assert ranks(cost).tolist() == [[1, 2, 3], [2, 1, 2], [3, 3, 1]]
    assert alone(cost).tolist() == [[1, 2, 2], [1, 1, 1], [2, 3, 1]]


def test_shares_of_methods_ways_and_both_add_up():
    of_methods = np.array([[0.1], [0.4], [0.7]]) * np.ones(3)
    of_ways = of_methods.T
    both = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    assert shares(of_methods) == pytest.approx((1.0, 0.0, 0.0))
    assert shares(of_ways) == pytest.approx((0.0, 1.0, 0.0))
    assert shares(both) == pytest.approx((0.0, 0.0, 1.0))
    assert sum(shares(of_methods + of_ways + 0.1 * both)) == pytest.approx(1.0)


def test_sticky_loops_and_others_weigh_the_same():
    lost = np.array([1.0, 0.0, 0.0, 0.0])[:, None, None] * np.ones((4, 1, 3))
    assert balanced(lost, np.array([True, False, False, False])).tolist() == [[0.5] * 3]


def test_chance_decides_little_of_many_loops_and_much_of_few():
    rng, sticky = np.random.default_rng(0), np.arange(400) % 2 == 0
    level = np.array([0.2, 0.5, 0.8])[:, None]
    lost = (rng.random((400, 3, 3)) < level).astype(float)
    many, few = by_chance(lost, sticky), by_chance(lost[:20], sticky[:20])
    assert np.median(many) < 0.05 < np.median(few)
    drawn = resampled(lost, sticky)
    assert drawn.mean(axis=0) == pytest.approx(balanced(lost, sticky), abs=0.01)
