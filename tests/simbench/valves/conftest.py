import numpy as np
import pytest


@pytest.fixture
def wandering_op():
    """OP that wanders, pauses and runs into both limits (n = 5000, %)."""
    rng = np.random.default_rng(1)
    steps = rng.normal(0.0, 2.0, 5000) * (rng.random(5000) > 0.25)
    return np.clip(
        50.0 + 4.0 * np.cumsum(steps) - 45.0 * np.sin(np.arange(5000) / 300.0), -10.0, 110.0
    )
