"""A valve that sticks for part of a record is found for that part."""

from itertools import pairwise

import numpy as np
import pytest

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.loop.simulate import simulate
from simbench.plant.episodes import marks, over_time

LOOP = {
    "plant": {"type": "foptd", "K": 1.0, "T": 30.0, "Td": 3.0},
    "controller": {"type": "PI", "Kc": 1.2, "Ti": 20.0},
    "noise": {"std": 0.05},
    "disturbance": [{"type": "coloured", "amplitude": 0.3, "period": 20.0}],
    "sampling": {"Ts": 2.0, "n": 2500},
}


def run(seed, **more):
    return simulate(Loop.from_table(LOOP | more), seed, kick=5.0 if more else 0.0).record.without_mv()


@pytest.fixture(scope="module")
def mixed():
    stuck, sound = run(1, valve={"model": "choudhury", "S": 6.0, "J": 4.0}), run(2)
    return LoopRecord(op=np.r_[stuck.op, sound.op], pv=np.r_[stuck.pv, sound.pv], Ts=2.0, process="self-regulating")


def test_the_first_half_is_called_and_the_second_is_not(mixed):
    found = over_time(mixed, "he")
    half = mixed.duration / 2
    first = [e.verdict for e in found.episodes if e.end <= half]
    second = [e.verdict for e in found.episodes if e.start >= half]
    assert first.count("stiction") >= 0.7 * len(first)
    assert second.count("stiction") <= 0.3 * len(second)
    assert 0 < found.sticky < found.cycles
    assert f"{found.sticky} of {found.cycles} cycles" in found.sentence()


def test_windows_cover_the_record_without_a_gap(mixed):
    episodes = over_time(mixed).episodes
    assert episodes[0].start == 0.0
    assert episodes[-1].end == mixed.duration
    assert all(b.start <= a.end for a, b in pairwise(episodes))


def test_a_short_record_is_not_cut():
    found = over_time(run(2).window(0, 150))
    assert not found.several
    assert "too short" in found.sentence()


def test_only_windows_with_a_finding_are_shaded(mixed):
    found = over_time(mixed, "he")
    assert len(marks(found)) == sum(e.verdict != "no_stiction" for e in found.episodes)
