"""Plants and controllers of any kind against python-control, and their cycles against theory, on a few loops."""

import numpy as np

from results.studies import any_loop


def test_loops_of_every_shape_and_form_are_python_controls_within_rounding():
    assert max(any_loop.difference(loop) for loop in any_loop.random_loops(16)) <= 1e-9


def test_exact_cycles_of_any_linear_plant_are_those_of_the_simulator():
    period, amplitude = np.array(any_loop.cycles(6)).max(axis=0)
    assert period <= 0.01
    assert amplitude <= 0.02
