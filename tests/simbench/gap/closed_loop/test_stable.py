"""A loop that was identified beyond its margin of stability is brought back to it, its loads kept;
all others are left alone.
"""

import pytest

from simbench.gap.closed_loop.loop_from_fit import stable
from simbench.scenarios.spec import Loop
from simbench.theory.sampled import sampled_loop, ultimate_gain

PLANT = {"type": "foptd", "K": 4.0, "T": 10.0, "Td": 5.0}
LOADS = [
    {"type": "coloured", "amplitude": 0.3, "period": 20.0},
    {"type": "coloured", "amplitude": 0.2, "period": 20.0, "at": "output"},
]


def loop(**changes):
    return Loop.from_table(
        {
            "plant": PLANT,
            "controller": {"type": "PI", "Kc": 2.0, "Ti": 10.0},
            "sampling": {"Ts": 1.0, "n": 400},
            "disturbance": LOADS,
        }
        | changes
    )


def test_an_unstable_loop_gets_the_gain_at_which_it_just_swings():
    before = loop()
    margin = ultimate_gain(sampled_loop(before))
    assert margin < 0.6
    after = stable(before)
    assert ultimate_gain(sampled_loop(after)) == pytest.approx(1.0, rel=1e-3)
    assert after.plant.K == pytest.approx(margin * before.plant.K)
    # what the load does to PV is what was fitted: the one at the input passes the smaller gain
    sizes = [part.parameters["amplitude"] for part in after.disturbance]
    assert sizes == pytest.approx([0.3 / margin, 0.2])


def test_an_effect_does_not_hide_that_the_loop_is_unstable():
    one = loop(effect=[{"name": "deadband", "S": 1.0}])
    assert stable(one).plant.K < one.plant.K
    assert stable(one).effect == one.effect


@pytest.mark.parametrize(
    "changes",
    [
        {"plant": PLANT | {"K": 0.5}},
        {"effect": [{"name": "deadband", "S": 1.0}], "plant": PLANT | {"K": 0.5}},
    ],
)
def test_other_loops_are_left_as_they_are(changes):
    one = loop(**changes)
    assert stable(one) is one
