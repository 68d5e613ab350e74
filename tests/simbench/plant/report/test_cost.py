"""What a cycle carries of a variance, how far a valve travels, and what would help a loop whose
friction is known.
"""

import numpy as np
import pytest

from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.gap.stiction.candidate_loops import CandidateLoops, with_friction
from simbench.loop.simulate import simulate
from simbench.plant.report.cost import cost_of, cycle_share, reversals
from simbench.plant.report.what_if import (
    COMPENSATE,
    LEAVE,
    REPAIR,
    RETUNE,
    compare,
    retuned,
    what_if,
)
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table({
    "plant": {"type": "foptd", "K": 1.0, "T": 30.0, "Td": 6.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 30.0},
    "noise": {"std": 0.05},
    "sampling": {"Ts": 2.0, "n": 1500},
})  # fmt: skip


@pytest.mark.parametrize("noise", [0.2, 0.7, 1.5])
def test_the_share_of_a_cycle_is_that_of_its_variance(noise):
    rng, t = np.random.default_rng(0), np.arange(8000.0)
    x = np.sign(np.sin(t / 12)) + noise * rng.standard_normal(t.size)
    assert cycle_share(x, 2 * np.pi * 12) == pytest.approx(1 / (1 + noise**2), abs=0.06)


def test_a_valve_s_travel_and_reversals_are_counted_per_day():
    t = np.arange(8640.0)
    op = 50 + 10 * np.sin(2 * np.pi * t / 86.4)  # of 10 s: a day, a hundred cycles
    record = LoopRecord(op, op, 10.0, meta={"automatic": 0.8})
    cost = cost_of(Prepared(record), record)
    assert cost.travel == pytest.approx(100 * 40.0, rel=0.01)
    assert cost.reversals == pytest.approx(200, abs=2)
    assert cost.automatic == 0.8
    assert "in automatic 80%" in cost.sentence()


def test_noise_is_no_reversal():
    rng = np.random.default_rng(0)
    x = np.concatenate(
        [np.linspace(0, 50, 500), np.linspace(50, 0, 500)]
    ) + 0.3 * rng.standard_normal(1000)
    assert reversals(x) == 1


def test_a_sticky_loop_is_best_repaired_and_a_sound_one_is_not_offered_it():
    actions = {a.name: a for a in compare(LOOP, 6.0, 4.0)}
    assert min(actions.values(), key=lambda a: a.variance).name == REPAIR
    assert actions[LEAVE].variance == 1.0
    assert actions[REPAIR].lo <= actions[REPAIR].variance <= actions[REPAIR].hi < 0.2
    assert {a.name for a in compare(LOOP, 0.0, 0.0)} == {LEAVE, RETUNE}
    assert COMPENSATE not in {a.name for a in compare(LOOP, 6.0, 6.0)}


def test_retuning_gives_the_settings_of_simc():
    settings = retuned(LOOP)
    assert settings["Kc"] == pytest.approx(30.0 / (3 * 7.0))
    assert settings["Ti"] == 30.0


def test_a_valve_wider_than_any_kick_still_swings_today():
    assert {a.name: a for a in compare(LOOP, 9.0, 7.0)}[REPAIR].variance < 0.1


def test_where_the_valve_has_two_positions_the_interval_holds_another_jump_with_another_gain():
    table = LOOP.to_table()
    true = {a.name: a.variance for a in compare(LOOP, 6.0, 3.0, spread=0.0)}
    table["plant"]["K"] *= 3.0 / 6.0
    offered = compare(Loop.from_table(table), 6.0, 6.0, hidden=True)
    assert all(a.lo <= true[a.name] <= a.hi for a in offered if a.name in (REPAIR, LEAVE))
    assert {a.name: a for a in offered}[
        RETUNE
    ].hi > 1.0  # settings for half the gain may be too tight


@pytest.mark.parametrize("S", [3.0, 6.0])  # 3.0: OP spans more than the two positions
def test_another_oscillation_remains_when_the_valve_is_repaired(S):
    table = LOOP.to_table()
    table["disturbance"] = [{"type": "sine", "amplitude": 2.0, "period": 300.0, "at": "output"}]
    swung = Loop.from_table(table)
    known = with_friction(LOOP, S, 0.7 * S)
    record = simulate(with_friction(swung, S, 0.7 * S), 1, kick=S + 1.0).record.without_mv()
    candidates = CandidateLoops(
        record, (LOOP,), known, (S, 0.7 * S), 500.0, 9.0, False, 300.0, 1.0, ()
    )
    claimed = {a.name: a for a in what_if(candidates)}[REPAIR]
    true = {a.name: a.variance for a in compare(swung, S, 0.7 * S, spread=0.0)}[REPAIR]
    assert true > 0.1
    assert claimed.lo <= true <= claimed.hi
    assert claimed.variance == pytest.approx(true, abs=0.2)
