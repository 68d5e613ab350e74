"""What remains between a record and its simulations: nothing of its own loop; in numbers of the
plant what another loop lacks.
"""

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
