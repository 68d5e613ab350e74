"""What remains between a record and its simulations: nothing of its own loop; in numbers of the
plant what another loop lacks.
"""

from types import SimpleNamespace

import pytest

from simbench.gap.closed_loop.gap import measure, simulate_runs
from simbench.gap.closed_loop.remaining import remaining
from simbench.gap.intake.check import check
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
        "sampling": {"Ts": 2.0, "n": 1500},
        "noise": {"std": 0.2},
        "disturbance": [{"type": "coloured", "amplitude": 1, "period": 30}],
    }
)


def left(record, loop=LOOP):
    situation = check(record, LOOP, trusted=False)
    runs = simulate_runs(situation, loop, 0)
    return {
        one.feature: one for one in remaining(situation, measure(situation, *[runs] * 3).features)
    }


def test_of_a_loop_itself_nothing_remains():
    assert left(simulate(LOOP, 9).record) == {}


@pytest.mark.parametrize(("distance", "recorded", "shown"), [
    (3.1, 2.0, True), (2.9, 2.0, False), (3.1, 1.0, False),
])  # fmt: skip
def test_a_difference_counts_from_three_standard_deviations_beyond_what_the_simulations_do(
    distance, recorded, shown
):
    s = SimpleNamespace(record=SimpleNamespace(n=400, Ts=2.0, S_unit="%"))
    one = SimpleNamespace(recorded=recorded, lo=0.5, hi=1.5, distance=distance)
    # of neighbouring lags the farthest stands for all
    near = SimpleNamespace(recorded=recorded, lo=0.5, hi=1.5, distance=distance - 0.05)
    found = remaining(s, {"op memory 3": near, "op memory 10": one})
    assert [d.feature for d in found] == ["correlation of OP with itself 20 s before"] * shown
