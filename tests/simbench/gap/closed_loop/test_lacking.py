"""What the record has and its simulation has not: nothing of its own loop, and in words what
another loop lacks.
"""

from dataclasses import replace

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
    quiet = record.pv.mean() + 0.3 * (record.pv - record.pv.mean())
    lacks = lacking(check(replace(record, pv=quiet), LOOP, trusted=False), LOOP, 0)
    assert "PV swings less" in lacks.sentence
