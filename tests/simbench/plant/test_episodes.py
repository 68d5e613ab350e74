"""A valve that sticks for part of a record is detected in that part."""

from itertools import pairwise

import numpy as np
import pytest
from recorded import resting

from simbench.detectors.record import LoopRecord
from simbench.plant.episodes import marks, over_time


def run(seed, **more):
    return resting(seed, 2500, **more)


@pytest.fixture(scope="module")
def mixed():
    stuck, sound = run(1, valve={"model": "choudhury", "S": 6.0, "J": 4.0}), run(2)
    return LoopRecord(
        op=np.r_[stuck.op, sound.op],
        pv=np.r_[stuck.pv, sound.pv],
        Ts=2.0,
        process="self-regulating",
    )


def test_the_first_half_is_called_and_the_second_is_not(mixed):
    verdicts = over_time(mixed, "he")
    half = mixed.duration / 2
    first = [e.verdict for e in verdicts.episodes if e.end <= half]
    second = [e.verdict for e in verdicts.episodes if e.start >= half]
    assert first.count("stiction") >= 0.7 * len(first)
    assert second.count("stiction") <= 0.3 * len(second)
    assert 0 < verdicts.sticky < verdicts.cycles
    assert f"{verdicts.sticky} of {verdicts.cycles} cycles" in verdicts.sentence()


def test_windows_cover_the_record_without_a_gap(mixed):
    episodes = over_time(mixed).episodes
    assert episodes[0].start == 0.0
    assert episodes[-1].end == mixed.duration
    assert all(b.start <= a.end for a, b in pairwise(episodes))


def test_a_short_record_is_not_cut():
    verdicts = over_time(run(2).window(0, 150))
    assert not verdicts.several
    assert "too short" in verdicts.sentence()


def test_only_windows_with_a_finding_are_shaded(mixed):
    verdicts = over_time(mixed, "he")
    assert len(marks(verdicts)) == sum(e.verdict != "no_stiction" for e in verdicts.episodes)
