"""Power on twins: shares by cell, the smallest size that shows, the threshold to use."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.verdict import Verdict
from simbench.trust.power import (
    Cell,
    Rule,
    cannot_tell_apart,
    cells_of,
    likelihood_ratio,
    range_of_visible,
    readings,
    smallest_visible,
)


def line(shares, ratio=1.0):
    return [Cell(s, ratio * s, f, 0.0, 1.0, 12) for s, f in zip((1.0, 2.0, 4.0, 8.0), shares)]


@pytest.mark.parametrize(
    ("cells", "smallest"),
    [
        (line([0.0, 0.6, 1.0, 1.0]), 2 * 2**0.5),  # between the cells that bracket it
        (line([0.0, 0.1, 0.3, 0.7]), None),
        (line([1.0, 0.0, 0.1, 0.2]), None),  # a lucky small cell
        # of two slip-jumps the one that shows at the smaller band
        ([*line([0.0, 0.0, 0.0, 0.9], 0.25), *line([0.0, 0.9, 1.0, 1.0])], 2 ** (8 / 9)),
    ],
)
def test_the_smallest_visible_size_is_interpolated_between_cells(cells, smallest):
    visible = smallest_visible(cells)
    assert visible == (None if smallest is None else pytest.approx((smallest, smallest)))


@pytest.mark.parametrize(
    ("shares", "least", "most"),
    [
        ([0.0, 0.5, 1.0, 1.0], 2.0, 4.0),
        ([0.0, 0.0, 0.4, 0.8], 4.0, np.inf),
        ([0.0] * 4, np.inf, np.inf),
    ],
)
def test_the_range_of_the_smallest_visible_size_holds_it_and_shrinks_with_more_replicates(
    shares, least, most
):
    few, many = (range_of_visible([replace(c, n=n) for c in line(shares)], 0) for n in (12, 1200))
    assert few[0] <= many[0] <= many[1] <= few[1]
    assert least <= many[0]
    assert many[1] <= most
    visible = smallest_visible(line(shares))
    assert few[0] <= (visible or (np.inf,))[0] <= few[1]


@pytest.mark.parametrize(("more", "apart"), [(0, False), (6, False), (40, True)])
def test_methods_are_told_apart_by_replicates_that_only_one_answers_right(more, apart):
    sticky = np.arange(200) < 120
    hits = np.random.default_rng(1).random(200) < 0.7
    better = hits.copy()
    better[np.flatnonzero(~hits)[:more]] = True
    one, other = (
        Rule("m", None, 0.5 * (h[sticky].mean() + h[~sticky].mean()), h) for h in (better, hits)
    )
    assert cannot_tell_apart(one, other, sticky) == cannot_tell_apart(other, one, sticky)
    assert cannot_tell_apart(one, other, sticky) != apart


def test_cells_count_only_their_twins():
    S, J = np.array([0.0, 1.0, 1.0, 2.0]), np.array([0.0, 1.0, 1.0, 2.0])
    cells = cells_of(S, J, np.array([True, True, False, True]))
    assert [(c.S, c.share) for c in cells] == [(1.0, 0.5), (2.0, 1.0)]
    assert all(c.lo <= c.share <= c.hi for c in cells)


def test_a_threshold_reads_nothing_out_of_a_missing_score():
    answers = {
        s: Verdict("m", "no_decision", score=s, reason="-") for s in (0.2, 0.8, float("nan"))
    }
    assert [Rule("m", 0.5, 0.9).verdict_of(v) for v in answers.values()] == [
        "no_stiction",
        "stiction",
        "no_decision",
    ]
    assert {Rule("m", None, 0.9).verdict_of(v) for v in answers.values()} == {"no_decision"}


def test_the_likelihood_ratio_is_one_for_a_verdict_that_everybody_gets():
    sticky = np.arange(40) < 20
    assert likelihood_ratio("stiction", ["stiction"] * 40, sticky) == pytest.approx(1.0)
    assert likelihood_ratio("stiction", ["stiction"] * 20 + ["no_stiction"] * 20, sticky) > 10


@pytest.mark.parametrize(
    ("score", "right", "rules"),
    [
        (lambda sticky, noise: noise + 4.0 * sticky, False, [False, True]),
        (lambda sticky, noise: noise + 4.0 * sticky, True, [True, False]),
        (lambda sticky, noise: np.full(200, np.nan), False, [True]),
        (lambda sticky, noise: np.full(200, -np.inf), False, [True]),  # did not oscillate
    ],
)
def test_a_threshold_is_advised_only_where_the_published_rule_is_worse(score, right, rules):
    sticky = np.arange(200) < 100
    scores = score(sticky, np.random.default_rng(0).standard_normal(200))
    verdicts = [
        Verdict("m", "stiction" if k and right else "no_stiction", score=float(s), reason="-")
        for k, s in zip(sticky, scores)
    ]
    ways = readings("m", verdicts, sticky)
    assert [way.cut is None for way in ways] == rules
    assert ways[0].right == max(way.right for way in ways)
    assert (ways[0].right > 0.9) == (len(rules) > 1)
