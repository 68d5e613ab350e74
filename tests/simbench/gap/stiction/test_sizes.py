"""S and J come with an interval, which holds the truth in most loops and is wide where the record
says little.
"""

import numpy as np
from recorded import LOADED_FAST

from simbench.gap.stiction.candidate_loops import candidate_loops
from simbench.gap.stiction.sizes import Size, _spread_of_sizes, describe_sizes
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = LOADED_FAST | {"sampling": {"Ts": 2.0, "n": 1200}}


def test_the_interval_holds_the_size_that_was_simulated():
    held = 0
    for seed, S in enumerate((3.0, 4.0, 5.0, 6.0, 7.0, 8.0)):
        loop = Loop.from_table(LOOP | {"valve": {"model": "choudhury", "S": S, "J": 0.5 * S}})
        record = simulate(loop, seed, kick=S).record.without_mv()
        [size, jump] = candidate_loops(record).sizes
        assert size.lo <= size.value <= size.hi < 1.5 * S
        held += size.lo <= S <= size.hi and jump.lo <= 0.5 * S <= jump.hi
    assert held >= 5


def test_with_the_valve_position_the_interval_holds_the_size_too():
    loop = Loop.from_table(LOOP | {"valve": {"model": "choudhury", "S": 5.0, "J": 2.0}})
    [size, jump] = candidate_loops(simulate(loop, 4, kick=5.0).record).sizes
    assert size.lo <= 5.0 <= size.hi
    assert jump.lo <= 2.0 <= jump.hi


def test_what_explains_nothing_has_an_interval_down_to_none():
    def flat(points):
        return np.zeros(len(points))

    size, jump = _spread_of_sizes(flat, 2.0, 1.0)
    assert size.lo == 0.0
    assert size.hi > 5.0
    assert jump.lo < 0.1 < 2.0 < jump.hi


def test_a_j_that_may_be_nearly_anything_is_not_identifiable():
    S = Size(5.0, 4.8, 5.2)
    assert describe_sizes(S, Size(2.0, 0.09, 5.0), "%") == (
        "S = 5 (4.8 to 5.2), J is not identifiable (0.09 to 5) %"
    )
    assert "J = 2 (1.5 to 2.6)" in describe_sizes(S, Size(2.0, 1.5, 2.6), "%")
