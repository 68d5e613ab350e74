"""The fit of an effect that more than a number must tell: kicks of the load from its steps."""

import numpy as np
import pytest

from simbench.detectors.signal.filters import lfilter
from simbench.gap.effects import load_steps
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Data


@pytest.mark.parametrize("fade", [True, False])
def test_kicks_of_the_load_are_told_from_steps(fade):
    n, T, rng = 2000, 8.0, np.random.default_rng(11)
    keep, places = np.exp(-1.0 / 25.0), np.arange(150, n, 210)
    heights = np.zeros(n)
    heights[places] = 6.0 * rng.choice([-1.0, 1.0], places.size)
    if fade:
        load = lfilter([1.0], [1.0, -keep], heights + 0.1 * rng.standard_normal(n))
    else:
        load = 0.5 * np.cumsum(heights) + lfilter([0.1], [1.0, -keep], rng.standard_normal(n))
    u, a = 50.0 + np.cumsum(0.1 * rng.standard_normal(n)), np.exp(-1.0 / T)
    y = lfilter([0.0, 1.0 - a], [1.0, -a], u - 50.0 + load) + 0.1 * rng.standard_normal(n)
    engine = Engine(Data(u, y, K=1.0, T=T, Td=0.0, noise=0.1), 40.0)
    found = load_steps.fit(engine, engine.base())[0]
    assert found.spec.jumps
    assert found.spec.fade == fade
