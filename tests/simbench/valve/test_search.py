"""Of many valves those that differ are kept, the best of each kind first."""

import numpy as np

from simbench.valve.maps import distinct_valves


def test_of_neighbours_the_best_is_kept_and_the_best_come_first():
    S = np.array([2.0, 2.01, 8.1, 8.12, 2.005])
    points = np.column_stack([S, [1.0, 1.005, 1.0, 1.0, 2.005]])  # the last has another J/S
    assert distinct_valves(points, np.array([3.0, 2.0, 0.5, 0.7, 1.0]), 9).tolist() == [2, 4, 1]
