"""The valve from MV given OP: every map's numbers are found again, and what they are worth in
nats.
"""

import numpy as np
import pytest

from simbench.detectors.compiled import compiled
from simbench.gap.effects import recogniser
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.valve_map import MapSearch, lag_signal, squares_within

N, TS = 500, 2.0
OP = 50.0 + 4.0 * np.sin(np.arange(N) / 17.0) + 2.5 * np.sin(np.arange(N) / 6.1)
SPAN = float(np.ptp(OP))
NOISE = 0.01 * np.random.default_rng(1).standard_normal(N)


def search(mv, **more):
    return MapSearch(OP, mv, TS, OP, **more)


@pytest.mark.parametrize(("effect", "mv", "numbers"), [
    ("deadband", kernels.valve(OP, kernels.PLAY, 3.17, 0.4, 0.0), {"S": 3.17}),
    ("stiction", kernels.valve(OP, kernels.STICK, 3.17, 1.3, 0.4), {"S": 3.17, "J": 1.3}),
    ("stiction", kernels.valve(OP, kernels.CREEP, 3.17, 1.3, 0.4), {"S": 3.17, "J": 1.3}),
    ("deadzone", kernels.valve(OP, kernels.ZONE, 3.17, 49.3, 0.0), {"D": 3.17, "c": 49.3}),
    ("valve_characteristic", kernels.valve(OP, kernels.CURVE, 3.17, 0.0, 0.0), {"R": 3.17}),
    ("valve_characteristic", kernels.valve(OP, kernels.CURVE, 0.31, 0.0, 0.0), {"R": 0.31}),
    ("valve_lag", lag_signal(OP, 3.17), {"tau": 6.34}),
    ("valve_lag", lag_signal(OP, 45.0), {"tau": 90.0}),
])  # fmt: skip
def test_the_map_of_a_valve_is_identified_and_explains_mv(effect, mv, numbers):
    gain, identified = recogniser(effect).by_mv(search(mv + NOISE))
    # lags are tried on a grid of 5 %, all else is followed down
    assert identified == pytest.approx(numbers, rel=0.025 if effect == "valve_lag" else 0.01)
    left = float(np.mean((mv - OP) ** 2))
    # the price of a number or two is some three nats each
    fine = (1e-3 * SPAN) ** 2 + 1e-4
    assert gain == pytest.approx(0.5 * N * np.log((left + fine) / fine), rel=0.15)


@pytest.mark.parametrize(
    "effect", ["deadband", "stiction", "deadzone", "valve_characteristic", "valve_lag"]
)
def test_a_valve_that_follows_op_has_none_of_them(effect):
    assert recogniser(effect).by_mv(search(OP + NOISE))[0] < 0.0


@pytest.mark.parametrize("side", [-1, 1])
def test_the_squares_within_a_sample_are_those_of_a_regression(side):
    rng = np.random.default_rng(3)
    mv, v = OP + NOISE, OP + 0.1 * rng.standard_normal(N)
    way = np.append(v[0], v[:-1]) - v if side < 0 else np.append(v[1:], v[-1]) - v
    share = np.clip((mv - v) @ way / (way @ way), 0.0, 1.0)
    expected = np.sum((mv - v - share * way) ** 2)
    assert squares_within(mv, v, side) == pytest.approx(expected, rel=1e-12)
    assert compiled(squares_within)(mv, v, side) == squares_within(mv, v, side)
