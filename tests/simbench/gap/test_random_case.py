"""Loops drawn at random: a function of the seed, with a baseline that is a little wrong."""

import numpy as np
from random_case import random_case


def test_a_case_is_a_function_of_its_seed_and_holds_what_was_asked():
    one, again, other = (random_case(seed, ("deadband",)) for seed in (4, 4, 5))
    assert one.truth == again.truth
    assert np.array_equal(one.record.pv, again.record.pv)
    assert one.truth != other.truth
    assert one.effects == tuple(e.name for e in one.truth.effect) == ("deadband",)
