"""Plants and controllers of any kind against python-control, and their cycles against theory, on a
few loops.
"""

import numpy as np

from results.studies import any_loop


def test_loops_of_every_shape_and_form_are_python_controls_within_rounding():
    assert max(any_loop.difference(loop) for loop in any_loop.random_loops(6)) <= 1e-9


def test_detectors_see_the_sticky_valve_in_the_inner_record_of_a_cascade():
    shares = any_loop.found_in_pairs(4, "he")
    assert shares["he"][0] >= 0.75


def test_exact_cycles_of_any_linear_plant_are_those_of_the_simulator():
    period, amplitude = np.array(any_loop.cycles(3)).max(axis=0)
    assert period <= 0.01
    assert amplitude <= 0.02
