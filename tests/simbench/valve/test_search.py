"""Of many valves those that differ are kept, the best of each kind first."""

import numpy as np
import pytest

from simbench.valve.search import distinct_valves


def test_of_neighbours_the_best_is_kept_and_the_best_come_first():
    S = np.array([2.0, 2.01, 8.1, 8.12, 2.005])
    points = np.column_stack([S, [1.0, 1.005, 1.0, 1.0, 2.005]])  # the last has another J/S
    assert distinct_valves(points, np.array([3.0, 2.0, 0.5, 0.7, 1.0]), 9).tolist() == [2, 4, 1]


def test_no_more_are_kept_than_wanted_and_narrower_cells_keep_more():
    points = np.column_stack([np.geomspace(1.0, 2.0, 40), np.full(40, 0.5)])
    errors = np.arange(40.0)
    kept = [distinct_valves(points, errors, 99, share).size for share in (1.0, 0.5)]
    assert kept[0] == pytest.approx(np.log(2.0) / 0.08, abs=1.5)
    assert kept[1] > 1.7 * kept[0]
    assert distinct_valves(points, errors, 3).tolist()[0] == 0
    assert distinct_valves(points, errors, 3).size == 3
