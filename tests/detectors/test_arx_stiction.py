"""ARX with a sticking valve: friction is claimed where a valve sticks, and not where a load moves
the loop as a sticky valve would, without its corners.
"""

import numpy as np
import pytest
from plain_loops import DELAYED, LEVEL

from simbench.bench.scenario.resolve import resolve
from simbench.detectors.judge import judge
from simbench.detectors.methods.arx_stiction import METHOD, detect
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord
from simbench.loop.simulate import simulate
from simbench.scenarios.grid import load_grid


@pytest.mark.parametrize("plant", [DELAYED, LEVEL], ids=["self-regulating", "level"])
def test_a_sticky_valve_is_found_with_its_size(loop, plant):
    record = loop(**plant, Ts=0.5, n=3000, noise=0.05, seed=2)
    answer = judge(record, ["arx_stiction"])[0]
    assert answer.verdict == "stiction"
    assert answer.S is not None
    assert answer.indices["gain"] == answer.score > METHOD.thresholds["gain_high"].default


def test_of_a_sticky_loop_and_its_echo_only_the_sticky_one_is_claimed():
    sticky, echo = resolve(load_grid("ci").group(15))
    records = [simulate(s.loop, s.seed).record for s in (sticky, echo)]
    found, other = (judge(r.without_mv(), ["arx_stiction"])[0] for r in records)
    assert echo.tags["echo"] != "none"
    assert found.verdict == "stiction"
    assert other.verdict != "stiction"
    assert found.score > other.score + 20.0


def test_a_signal_that_rests_is_no_decision():
    rests = Prepared(LoopRecord(op=np.full(600, 50.0), pv=np.sin(np.arange(600.0)), Ts=1.0))
    assert detect(rests, **METHOD.defaults()).verdict == "no_decision"
