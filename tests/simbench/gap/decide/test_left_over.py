"""A record that a model makes lies among the model's own simulations, and another one beyond them;
what is left beside much that is explained is no other model.
"""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.signal.filters import lfilter
from simbench.gap.decide.assess import assess
from simbench.gap.decide.left_over import _chance_beyond, left_over
from simbench.gap.intake.check import check
from simbench.gap.thresholds import LIKELIER
from simbench.loop.simulate import simulate
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.5, "T": 15.0, "Td": 3.0},
        "controller": {"type": "PI", "Kc": 0.8, "Ti": 15.0},
        "sampling": {"Ts": 1.0, "n": 1500},
        "noise": {"std": 0.2},
        "disturbance": [{"type": "coloured", "amplitude": 0.4, "period": 40.0}],
    }
)
OTHERS = np.array([-2.0, 0.0, 1.0, 2.0, -1.0] * 5)


def left_of(pv=lambda x: x, valve=None, explained=7.0):
    loop = LOOP if valve is None else LOOP.replace(effect=[Part(name="stiction", parameters=valve)])
    record = simulate(loop, seed=5, kick=8.0 if valve else 0.0).record
    found = assess(check(replace(record, pv=pv(np.asarray(record.pv))), LOOP))
    inside = {e: found.parameters[e] for e in found.chosen}
    return left_over(found.situation, (found.final, found.final), inside, explained, 0)


@pytest.mark.parametrize("valve", [None, {"S": 5.0, "J": 2.0}])
def test_a_model_leaves_no_more_of_its_own_record_than_of_simulations(valve):
    left = left_of(valve=valve)
    assert [one.block for one in left] == ["disturbance", "process", "sensor"]
    assert max(one.probability for one in left) < LIKELIER


def test_what_no_effect_makes_of_pv_lies_beyond_all_simulations():
    # a resonance of the transmitter
    rings = left_of(lambda pv: pv[0] + lfilter([0.6], [1.0, -1.3, 0.9], pv - pv[0]))
    worst = max(rings, key=lambda one: one.probability)
    assert worst.probability > 0.9
    assert "nats, in 24 simulations of it" in worst.message


def test_the_farther_beyond_the_simulations_the_smaller_is_the_chance():
    chances = [_chance_beyond(beyond, OTHERS) for beyond in (-5.0, 0.0, 5.0, 50.0)]
    assert chances[:2] == [1.0, 1.0]
    assert 0.0 < chances[3] < chances[2] < 0.15
    # simulations without noise are all the same: a nat is the least by which a test scatters
    assert _chance_beyond(1.0, np.zeros(24)) > 0.1
