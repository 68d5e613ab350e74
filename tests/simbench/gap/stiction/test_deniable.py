"""Only friction of a size that the valve was asked to move by is denied, and the size is said."""

from dataclasses import replace
from pathlib import Path

import pytest
from recorded import LOADED_FAST

from simbench.detectors.records.io import read_record
from simbench.detectors.verdict import NO_STICTION, STICTION
from simbench.gap.diagnosis import conclude
from simbench.gap.stiction.conclusion import judged
from simbench.gap.stiction.deniable import op_range
from simbench.gap.stiction.friction import friction
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

PUBLISHED = Path(__file__).parents[3] / "data" / "published"
SOUND = LOADED_FAST | {
    "controller": {"type": "PI", "Kc": 4.2, "Ti": 30.0},
    "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 15.0}],
    "sampling": {"Ts": 2.0, "n": 2000},
}


@pytest.fixture(scope="module")
def denied():
    return friction(simulate(Loop.from_table(SOUND), 3).record.without_mv())


def test_what_is_denied_is_no_less_than_a_share_of_what_op_did(denied):
    assert denied.probability < 0.2
    moved = op_range(denied.assessment.situation.op)
    assert pytest.approx(max(1.0, 0.2 * moved)) == denied.shown.S


def test_with_few_samples_a_period_nothing_is_denied_and_the_pace_is_said():
    found = judged(read_record(PUBLISHED / "idv14_15s.csv"))[0]
    assert found.verdict not in (STICTION, NO_STICTION)
    assert "8.3 samples per period are too few" in found.reason
    assert found.next.startswith("record OP and PV every")


def test_a_valve_that_op_does_not_turn_back_shows_nothing_without_integral_action():
    found = judged(read_record(PUBLISHED / "quiet_sticky_2.csv"))[0]
    assert found.verdict not in (STICTION, NO_STICTION)
    assert "no integral action" in found.reason


@pytest.mark.parametrize("valve", [{}, {"valve": {"model": "choudhury", "S": 8.0, "J": 2.0}}])
@pytest.mark.parametrize(("load", "told"), [(0.4, False), (4.0, True)])
def test_a_loop_file_denies_nothing_where_a_valve_that_stands_explains_pv_as_well(
    valve, load, told
):
    quiet = LOADED_FAST | {
        "controller": {"type": "PI", "Kc": 0.5, "Ti": 40.0},
        "disturbance": [{"type": "coloured", "amplitude": load, "period": 60.0}],
    }
    record = simulate(Loop.from_table(quiet | valve), 3).record.without_mv()
    found = conclude(record, Loop.from_table(quiet))
    assert (found.verdict == NO_STICTION) == (told and not valve)
    assert ("a valve that stands still" in found.reason) == (not told and not valve)


def test_the_same_size_is_said_by_every_verb(denied):
    record = simulate(Loop.from_table(SOUND), 3).record.without_mv()
    scaled = replace(record, op=0.16 * record.op + 4.0, op_span=(4.0, 20.0))
    size = f"S = {denied.shown.S:.2g} % of travel"
    for one in (record, scaled):
        found = judged(one)[0]
        assert found.verdict == NO_STICTION
        assert found.sentence().startswith(f"No stiction worth repairing, {size} or more (")
        assert f"friction smaller than {size} cannot be excluded" in found.reason
