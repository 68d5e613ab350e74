"""No verdict changes with the units of OP and PV, nor with the sign of the plant's gain."""

from __future__ import annotations

import pytest
import units

# where a search broke a tie by rounding; where an oscillation has died out; where cycles of PV
# begin with their fall; where PV over OP is a line
ONCE_WRONG = (("chapter", 526), ("chapter", 2931), ("families", 2639), ("plant", 477))


@pytest.mark.slow  # every detector's contract asks for two units of OP and of PV
@pytest.mark.parametrize("turn", range(4))
def test_units_change_no_verdict(turn):
    # every map meets five of the records, every record four of the maps; in one turn every map
    # meets one record at least
    for number, (label, record) in enumerate(units.records(20)):
        if number % 4 == turn:
            assert not list(units.changes(record, slice((number // 4 + turn) % 4, None, 4))), label


@pytest.mark.parametrize(("name", "index"), ONCE_WRONG)
def test_what_once_changed(name, index):
    assert not list(units.changes(units.of_grid(name, index)))
