"""Friction asked for alone is the friction that the whole diagnosis finds."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.gap import diagnose
from simbench.gap.decide.assess import assess
from simbench.gap.decide.identified import plausible
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import exact_controller, identify
from simbench.gap.random_case import random_case
from simbench.plant.friction import FRICTION, OUTSIDE, friction
from simbench.plant.pace import at_its_pace


@pytest.mark.parametrize(("seed", "effects"), [(5, (FRICTION,)), (8, (OUTSIDE,)), (2, ("load_steps",))])
@pytest.mark.parametrize("known", [False, True])
def test_its_gain_and_size_are_those_of_the_diagnosis(seed, effects, known):
    case = random_case(seed, effects)
    alone = friction(case.record, case.baseline if known else None)
    if known:
        whole = diagnose(case.record, case.baseline).behind.found
    else:
        # an identified loop is asked at its own pace, its controller at the controller's
        slow = at_its_pace(case.record)
        whole = plausible(assess(check(slow, identify(slow, controller=exact_controller(case.record)), trusted=False)))
    assert alone.log_likelihood_gains[FRICTION] == pytest.approx(whole.log_likelihood_gains[FRICTION], abs=1e-6)
    assert alone.parameters.get(FRICTION) == pytest.approx(whole.parameters.get(FRICTION))


def test_what_single_samples_prove_is_proven_by_all_of_them():
    record = random_case(5, (FRICTION,)).record
    step = 0.15 * float(np.std(record.pv))
    rounded = replace(record, pv=np.round(record.pv / step) * step)
    assert at_its_pace(rounded).n < rounded.n
    found = friction(rounded)
    assert found.situation.proven["quantisation"]["step"] == pytest.approx(step)
    assert found.parameters["quantisation"] == found.situation.proven["quantisation"]
    assert found.situation.data.n == at_its_pace(rounded).n
