"""What the engine is told: bounds of every number, how two effects are joined, and a valve by its
numbers.
"""

import numpy as np
import pytest

from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.model import (
    BAND,
    Moves,
    Spec,
    lag_of,
    valve_of,
)  # fmt: skip

MOVES = Moves(lambda u, theta: u + theta["own"], (BAND,))


@pytest.mark.parametrize(
    ("spec", "names"),
    [
        (Spec(), ()),
        (Spec(valve=kernels.PLAY), ("S",)),
        (Spec(valve=kernels.ZONE), ("D", "c")),
        (Spec(valve=kernels.STICK), ("S", "J")),
        (
            Spec(valve=kernels.PLAY, pole="valve", walk=True, load_walk=True),
            ("S", "tau", "walk", "load_walk"),
        ),
        (Spec(moves=MOVES), ("S",)),
    ],
)
def test_an_effect_adds_its_numbers_to_plant_load_and_noise(spec, names):
    common = ("T", "Td", "load_time", "load_lag", "load", "noise_std", "colour")
    assert spec.names == common + names
    pink = spec.join(Spec(pink=True))
    assert pink.names == tuple(m for m in common if m != "load_lag") + names
    assert lag_of({"load_lag": 3.0}) == 3.0
    assert lag_of({}) == kernels.PINK_LOAD


@pytest.mark.parametrize(("spec", "theta", "mv"), [
    (Spec(), {}, [50.0, 52.0, 47.0]), (Spec(moves=MOVES), {"own": 2.0}, [52.0, 54.0, 49.0]),
    (Spec(valve=kernels.PLAY), {"S": 2.0}, [50.0, 51.0, 48.0]),
    # begun at the upper end of the band
    (Spec(valve=kernels.PLAY, start=1.0), {"S": 6.0}, [53.0, 53.0, 50.0]),
    (Spec(valve=kernels.STICK), {"S": 2.0, "J": 1.0}, [50.0, 51.5, 47.5]),
    (Spec(valve=kernels.CREEP, start=-1.0), {"S": 6.0, "J": 0.0}, [47.0, 49.0, 49.0]),
])  # fmt: skip
def test_a_valve_makes_mv_of_op_by_its_numbers(spec, theta, mv):
    assert valve_of(spec, theta, np.array([50.0, 52.0, 47.0])) == pytest.approx(mv)
