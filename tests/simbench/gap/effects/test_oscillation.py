"""An oscillation from outside is named only where the record swings with it, four samples a period
at least.
"""

from dataclasses import replace

import numpy as np
import pytest
from recorded import LOADED_FAST

from simbench.gap.candidates import fit_candidates
from simbench.gap.intake.check import check
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import load_memory
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = LOADED_FAST | {
    "disturbance": [{"type": "coloured", "amplitude": 0.5, "period": 30.0}],
    "sampling": {"Ts": 2.0, "n": 1200},
}


def candidate(sine=None, added=0.0, period=3.0):
    """Return the oscillation fitted to a loop with a sine on its load, or one added to PV."""
    loads = [*LOOP["disturbance"], *([] if sine is None else [sine])]
    record = simulate(Loop.from_table(LOOP | {"disturbance": loads}), 3).record.without_mv()
    wave = added * np.sin(2.0 * np.pi * np.arange(record.n) / period)
    s = check(replace(record, pv=record.pv + wave), Loop.from_table(LOOP))
    engine = Engine(s.data, load_memory(s))
    return fit_candidates(engine, engine.base(), ["oscillation"])["oscillation"]


def test_a_sine_from_outside_is_found_with_its_period():
    found = candidate({"type": "sine", "amplitude": 2.0, "period": 120.0})
    assert found.used
    assert found.log_likelihood_gain > 20.0
    assert found.fit.theta["period"] == pytest.approx(60.0, rel=0.02)


def test_a_loop_that_does_not_swing_has_none():
    found = candidate()
    assert not found.used
    assert found.log_likelihood_gain < 0.0


def test_a_sine_of_fewer_than_four_samples_is_not_named():
    found = candidate(added=0.3)
    assert not found.used or found.fit.theta["period"] >= 4.0
