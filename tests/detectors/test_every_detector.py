"""Every detector on every problem; a new file in methods/ is tested here by itself."""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.contract import check_detector
from simbench.detectors.example_loop import example_loop
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods

STICKY = replace(example_loop(noise=0.1), process="self-regulating", kind="flow")
NOISE = np.random.default_rng(0).standard_normal((2, STICKY.n))
# a record that shows no valve at work, and the answers that are no false alarm
NOTHING = {
    "OP at rest": (replace(STICKY, op=np.full(STICKY.n, 50.0)), {"no_decision"}),
    "PV at rest": (replace(STICKY, pv=np.full(STICKY.n, 50.0)), {"no_decision"}),
    "ten samples": (STICKY.window(0, 10), {"no_decision"}),
    "noise alone": (
        replace(STICKY, op=50.0 + NOISE[0], pv=50.0 + NOISE[1], mv=None),
        {"no_decision", "no_stiction"},
    ),
}


@pytest.mark.parametrize("problem", NOTHING)
@pytest.mark.parametrize("name", methods.every_name())
def test_no_stiction_is_claimed_where_nothing_shows_it_and_the_reason_is_given(name, problem):
    record, allowed = NOTHING[problem]
    (answer,) = judge(record, [name])
    assert answer.verdict in allowed
    assert len(answer.reason) > 10


@pytest.mark.parametrize("name", methods.every_name())
def test_its_answer_is_the_same_twice_and_in_another_unit_and_its_file_keeps_the_contract(name):
    assert check_detector(methods.load(name).__file__).broken == ()
