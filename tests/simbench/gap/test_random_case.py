"""Loops drawn at random: a function of the seed, with a baseline that is a little wrong."""

import numpy as np
from random_case import random_case


def test_a_case_is_a_function_of_its_seed_and_holds_what_was_asked():
    one, again, other = (random_case(seed, ("deadband",)) for seed in (4, 4, 5))
    assert one.truth == again.truth
    assert np.array_equal(one.record.pv, again.record.pv)
    assert one.truth != other.truth
    assert one.effects == tuple(e.name for e in one.truth.effect) == ("deadband",)


def test_the_baseline_is_ten_percent_off_and_knows_of_no_load():
    cases = [random_case(seed) for seed in range(20)]
    for name in ("K", "Td", "T"):
        pairs = [[getattr(x.plant, name) for x in (c.baseline, c.truth)] for c in cases]
        off = [abs(stated / true - 1.0) for stated, true in pairs if true is not None]
        assert 0.05 < max(off) <= 0.1
    for case in cases:
        assert not case.baseline.disturbance
        assert not case.baseline.effect
        assert case.truth.disturbance
        assert case.record.mv is None
    assert random_case(3, mv=True).record.mv is not None


def test_only_a_plant_with_a_time_constant_can_miss_it():
    cases = [random_case(s, ("time_constant_mismatch",)) for s in range(6)]
    assert {case.truth.plant.type for case in cases} == {"foptd"}
