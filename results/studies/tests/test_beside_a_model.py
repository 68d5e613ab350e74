"""The simulator of the plain loops does what it is told, and each nuisance is in its record."""

from dataclasses import replace

import numpy as np
import pytest

from results.studies import beside_a_model as study
from simbench.detectors.signal.oscillation import find_oscillation


@pytest.mark.parametrize("i", range(3))
def test_a_sound_valve_holds_the_set_point_and_a_sticking_one_cycles(i):
    case = study.draw(np.random.default_rng(3), i, True)
    case = replace(case, steps=(), S=6.0, J=3.0, noise=1e-3 * case.K, load=0.01)
    sound, sticky = (
        study.simulate(c, np.random.default_rng(1)) for c in (replace(case, S=0.0, J=0.0), case)
    )
    assert np.std(sound.op) < 0.2
    assert np.abs(sound.pv - study.REST).max() < 0.5 * np.ptp(sticky.pv)
    assert find_oscillation(sticky.op, sticky.pv, 1.0).sustained


def test_the_file_states_the_plant_within_seven_percent_and_the_load_as_far_as_asked():
    case = study.draw(np.random.default_rng(4), 0, False)
    loops = [study.loop_file(case, np.random.default_rng(k), 0.5) for k in range(20)]
    assert max(abs(loop.plant.K / case.K - 1.0) for loop in loops) < 0.07
    assert loops[0].disturbance[0].parameters["amplitude"] == pytest.approx(0.5 * case.load)


def test_each_nuisance_changes_the_record_and_nothing_else_does():
    case, _, _ = study.made(5, 0, False)
    plain = study.simulate(case, np.random.default_rng([5, 0, 3]))
    others = {what: study.with_nuisance(case, 5, 0, what) for what in study.NUISANCES}
    assert others["slipping clock"].n != plain.n or np.any(
        np.diff(others["slipping clock"].pv) == 0
    )
    assert np.unique(others["card"].pv).size < 0.5 * plain.n
    quick = others["fast controller"]
    assert quick.n == plain.n
    assert np.std(quick.pv) == pytest.approx(np.std(plain.pv), rel=0.5)
