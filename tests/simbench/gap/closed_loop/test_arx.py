"""Regressions of controller and plant on their past."""

import numpy as np
import pytest
from scipy.signal import lfilter

from simbench.gap.closed_loop.copies import regress_law, regress_plant

N = 1500
RNG = np.random.default_rng(4)
MOVED = np.cumsum(RNG.standard_normal(N)) * 0.1


def test_a_plant_of_second_order_is_found_by_its_samples():
    white = 0.01 * RNG.standard_normal(N)
    pv = lfilter([0.0, 0.0, 0.2, 0.1], [1.0, -1.5, 0.56], MOVED) + lfilter(
        [1.0], [1.0, -1.5, 0.56], white
    )
    found = regress_plant(MOVED, pv + 20.0)
    assert found.den[:3] == pytest.approx([1.0, -1.5, 0.56], abs=0.02)
    assert found.driven[:3] == pytest.approx([0.0, 0.2, 0.1], abs=0.02)
    assert found.constant / found.den.sum() == pytest.approx(20.0, rel=0.01)
    assert found.left.size == N - 20
    assert found.left.std() == pytest.approx(0.01, rel=0.1)


def test_a_plant_that_integrates_has_a_pole_at_one():
    pv = np.cumsum(lfilter([0.0, 0.3], [1.0], MOVED)) + 0.1 * np.cumsum(RNG.standard_normal(N))
    found = regress_plant(MOVED, pv)
    assert abs(found.den.sum()) < 1e-12
    assert found.driven[0] == pytest.approx(0.3, abs=0.02)


def test_a_law_with_a_filter_is_found_exactly():
    error = RNG.standard_normal(N)
    change = lfilter([0.8, -0.7], [1.0, -0.4], error)
    law = regress_law(50.0 + np.cumsum(change), error)
    assert law.past[0] == pytest.approx(0.4, abs=1e-6)
    assert law.driven[:2] == pytest.approx([0.8, -0.7], abs=1e-6)
    assert np.abs(law.left).max() < 1e-6
