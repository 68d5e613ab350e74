"""Record and loop file in other units, and on other clocks."""

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap import diagnose
from simbench.gap.controller.law import Law
from simbench.gap.intake.check import on_one_clock, pv_late, refuse_pv_units, refuse_time_units
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = {
    "plant": {"type": "foptd", "K": 1.0, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.2, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 2000},
    "noise": {"std": 0.1},
    "disturbance": [{"type": "coloured", "amplitude": 1.5, "period": 377.0}],
    "setpoint": {"value": 50, "steps": [[250, 54], [500, 50], [1000, 54], [1500, 50]]},
}
BASELINE = Loop.from_table(LOOP)


@pytest.fixture(scope="module")
def record():
    return simulate(BASELINE, 3).record.without_mv()


def written(record, gain, offset):
    return LoopRecord(
        record.op, offset + gain * record.pv, 1.0, offset + gain * record.sp, op_span=(0.0, 100.0)
    )


@pytest.mark.parametrize(
    ("gain", "offset", "words", "K"),
    [
        (1.8, 32.0, "deg F, the loop file in deg C", "K = 1.8, Kc = 0.6667"),
        (1.0, 273.15, "K, the loop file in deg C", "K = 1, Kc = 1.2"),
        (100.0, 0.0, "%, the loop file in a share of 1", "K = 100, Kc = 0.012"),
        (1.0 / 14.5038, 0.0, "bar, the loop file in psi", "K = 0.06895"),
    ],
)
def test_a_set_point_in_another_unit_is_refused_with_the_numbers_to_write(
    record, gain, offset, words, K
):
    with pytest.raises(RecordError, match="the record seems to be in") as refused:
        diagnose(written(record, gain, offset), BASELINE)
    assert words in str(refused.value)
    assert K in str(refused.value)


@pytest.mark.parametrize("change", ["none", "moved", "no SP"])
def test_a_set_point_that_is_the_files_or_another_one_is_not(record, change):
    given = {
        "none": record,
        "moved": written(record, 1.0, 7.0),
        "no SP": LoopRecord(record.op, 32 + 1.8 * record.pv, 1.0),
    }[change]
    refuse_pv_units(given, BASELINE, "record")


@pytest.mark.parametrize(("Ti", "refused"), [(1200.0, True), (20.0 / 60.0, True), (30.0, False)])
def test_an_integral_time_in_minutes_is_refused(Ti, refused):
    law = Law(0.0, 1.2, Ti)
    if not refused:
        refuse_time_units(law, 1.2, 20.0, "record")
        return
    with pytest.raises(RecordError, match="one seems to be in"):
        refuse_time_units(law, 1.2, 20.0, "record")


def stamped_late(record, late):
    """Return a record whose PV column is so many samples late."""
    pv = np.append(np.repeat(record.pv[0], late), record.pv[: record.n - late])
    return LoopRecord(record.op, pv, 1.0, record.sp, op_span=(0.0, 100.0))


@pytest.mark.parametrize("late", [0, 1, 6, 20])
def test_a_late_pv_is_told_by_the_law_of_the_controller(record, late):
    assert pv_late(stamped_late(record, late), record.op, BASELINE.controller) == late


def test_an_early_pv_and_an_unknown_law_are_none(record):
    early = LoopRecord(record.op, np.append(record.pv[3:], record.pv[-3:]), 1.0, record.sp)
    assert pv_late(early, record.op, BASELINE.controller) == 0
    other = BASELINE.controller.model_copy(update={"type": "PID"})
    assert pv_late(stamped_late(record, 6), record.op, other) == 0


def test_a_record_on_one_clock_has_pv_where_op_answers_it(record):
    back = on_one_clock(stamped_late(record, 6), 6)
    assert back.n == record.n - 6
    assert np.array_equal(back.pv, record.pv[: back.n])
    assert np.array_equal(back.op, record.op[: back.n])


def test_the_diagnosis_names_a_late_clock_in_its_first_line(record):
    report = diagnose(stamped_late(record, 6), BASELINE)
    assert report.effect == "none"
    assert "once PV, which is stamped late, is moved back" in report.answer()
    assert any("6 s before it is on record" in note for note in report.notes)
