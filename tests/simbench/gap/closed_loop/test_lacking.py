"""What the record has and its simulation has not: nothing of its own loop, and in words what
another loop lacks.
"""

from dataclasses import replace

import numpy as np

from simbench.gap.closed_loop.lacking import lacking
from simbench.gap.intake.check import check
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
        "sampling": {"Ts": 1.0, "n": 1500},
        "noise": {"std": 0.2},
        "disturbance": [{"type": "coloured", "amplitude": 1, "period": 30}],
    }
)


def test_a_loop_lacks_nothing_of_a_record_of_itself():
    lacks = lacking(check(simulate(LOOP, 9).record, LOOP), LOOP, 0)
    assert lacks.features == ()


def test_what_stays_along_the_record_is_put_in_words():
    record = simulate(LOOP, 9).record
    held = np.repeat(np.asarray(record.op)[::5], 5)[: record.n]
    lacks = lacking(check(replace(record, op=held), LOOP), LOOP, 0)
    assert "OP stands still more often" in lacks.sentence
