"""Friction asked for alone is the friction that the whole diagnosis finds."""

import pytest

from simbench.gap import diagnose
from simbench.gap.random_case import random_case
from simbench.plant.friction import FRICTION, OUTSIDE, friction


@pytest.mark.parametrize(("seed", "effects"), [(5, (FRICTION,)), (8, (OUTSIDE,)), (2, ("load_steps",))])
@pytest.mark.parametrize("known", [False, True])
def test_its_gain_and_size_are_those_of_the_diagnosis(seed, effects, known):
    case = random_case(seed, effects)
    baseline = case.baseline if known else None
    whole, alone = diagnose(case.record, baseline).behind.found, friction(case.record, baseline)
    assert alone.log_likelihood_gains[FRICTION] == pytest.approx(whole.log_likelihood_gains[FRICTION], abs=1e-6)
    assert alone.parameters.get(FRICTION) == pytest.approx(whole.parameters.get(FRICTION))
