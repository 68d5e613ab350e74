"""What preprocessing decides: three ways to give a record to a method, and the shares of each."""

import numpy as np
import pytest

from results.studies.preprocessing import (
    alone,
    balanced,
    ranks,
    shares,
)


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
