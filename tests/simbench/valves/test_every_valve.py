"""What holds for every valve model and stage beyond its contract; a new file in valves/ is tested
here by itself.
"""

import numpy as np
import pytest

from simbench.loop.parameters import VALVES, Number
from simbench.loop.response import valve_response


def example(name):
    """Return some allowed value for each number that has no default, and a common band where one
    may be given.
    """
    schema = VALVES.load(name).PARAMETERS
    table = {"S": 4.0, "J": 2.0} if {"S", "J"} <= set(schema) else {}
    for key, rule in schema.items():
        if rule.default is None and key not in table:
            table[key] = (
                rule.names[-1]
                if not isinstance(rule, Number)
                else 4.0
                if rule.high == 100.0
                else rule.low + 10.0
            )
    return table


@pytest.fixture(params=VALVES.names())
def name(request):
    return request.param


def test_the_docstring_says_when_to_choose_it_and_when_not(name):
    module = VALVES.load(name)
    assert "When to choose it:" in module.__doc__
    assert "When not:" in module.__doc__
    assert len(module.SOURCE) > 15
    assert all(isinstance(rule.says, str) and rule.says for rule in module.PARAMETERS.values())


def test_compiled_equals_plain_python_bit_for_bit(name, wandering_op):
    for Ts, op in ((1.0, wandering_op[:60]), (0.01, wandering_op[:100])):
        fast = valve_response(name, op, example(name), Ts)
        slow = valve_response(name, op, example(name), Ts, plain=True)
        np.testing.assert_array_equal(fast, slow)


def test_position_stays_inside_its_travel_and_op_is_left_alone(name, wandering_op):
    before = wandering_op.copy()
    mv = valve_response(name, wandering_op, example(name), 0.5)
    assert mv.min() >= 0.0
    assert mv.max() <= 100.0
    np.testing.assert_array_equal(wandering_op, before)
