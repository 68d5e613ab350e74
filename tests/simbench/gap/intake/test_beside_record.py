"""What contradicts: a mode column that does not fit OP, another tuning, another loop; a sound test
is accepted.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.decide import beside_tests
from simbench.gap.decide.assess import assess
from simbench.gap.diagnosis import assess_with_tests
from simbench.gap.intake.beside_record import contradiction, model_test
from simbench.gap.intake.check import check
from simbench.gap.intake.recorded_test import RecordedTest
from simbench.gap.planning.menu import LEAD, Limits, size_test
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table({
    "plant": {"type": "foptd", "K": 2.0, "T": 10.0, "Td": 2.0},
    "controller": {"type": "PI", "Kc": 0.5, "Ti": 10.0},
    "sampling": {"Ts": 1.0, "n": 600},
    "noise": {"std": 0.2},
    "operating_point": {"op0": 50.0, "pv0": 30.0},
    "setpoint": {"value": 30.0},
    "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 20.0}],
})  # fmt: skip


@pytest.fixture(scope="module")
def situation():
    return check(simulate(LOOP, 1).record, LOOP)


def made(id_, situation, loop=LOOP, stated=LOOP):
    trial = size_test(id_, situation, {"none": LOOP}, 0.0, Limits())
    record = trial.run(loop, 5)
    manual = trial.manual & (np.arange(trial.n) >= LEAD)
    if manual.any():
        # the operator takes over from a controller, whose OP the menu's run does not show
        lead = simulate(loop.with_("sampling.n", int(np.argmax(manual))), 6).record
        op, pv = (
            np.concatenate([getattr(lead, c), getattr(record, c)[lead.n :]]) for c in ("op", "pv")
        )
        record = SimpleNamespace(op=op, pv=pv)
    from simbench.detectors.record import LoopRecord

    sp = np.full(record.op.size, 30.0) if manual.any() else record.sp
    whole = LoopRecord(op=record.op, pv=record.pv, sp=sp, Ts=1.0, op_span=(0.0, 100.0))
    return RecordedTest(f"{id_}.csv", whole, manual, None, {"test": {"id": id_}}, stated)


def refusal(test, situation):
    return contradiction(test, model_test(test, situation), situation)


@pytest.mark.parametrize("id_", ["sp_steps", "bump", "stairs", "still"])
def test_nothing_speaks_against_a_sound_test(id_, situation):
    assert refusal(made(id_, situation), situation) == ""


@pytest.mark.parametrize("id_", ["sp_steps", "bump"])
def test_a_stated_filter_is_taken_off_the_pv_of_a_test_as_off_the_records(id_):
    lagging = LOOP.with_("effect", [{"name": "sensor_lag", "tau": 4.0}])
    s = check(simulate(lagging, 1).record, lagging)
    test = model_test(made(id_, s, lagging, lagging), s)
    assert test.data.noise == pytest.approx(s.data.noise)
    quick = [float(np.std(np.diff(one.data.y, 3))) for one in (s, test)]
    assert quick[1] == pytest.approx(quick[0], rel=0.2)


@pytest.mark.parametrize(
    ("id_", "moved"),
    [
        pytest.param("sp_steps", True, marks=pytest.mark.slow),
        ("bump", True),
        ("kc_half", False),
    ],
)
def test_a_plant_is_only_compared_where_somebody_moved_sp_or_op(id_, moved, situation, monkeypatch):
    # load and plant of a loop that nobody moves are one thing, and a load of steps looks like
    # another plant
    monkeypatch.setattr(beside_tests, "_other_plant", lambda *_: "another")
    test = model_test(made(id_, situation), situation)
    assert beside_tests.other_plants(assess(situation), situation, [test]) == (
        ["another"] if moved else [""]
    )


@pytest.mark.parametrize("id_", [pytest.param("sp_steps", marks=pytest.mark.slow), "bump"])
def test_nothing_speaks_against_a_sound_test_under_a_pid(id_):
    loop = Loop.from_table(
        LOOP.to_table() | {"controller": {"type": "PID", "Kc": 0.5, "Ti": 10.0, "Td": 1.5}}
    )
    of_pid = check(simulate(loop, 1).record, loop)
    test = made(id_, of_pid, loop, loop)
    fitted = model_test(test, of_pid)
    assert fitted.law is not None
    assert fitted.law.known
    assert contradiction(test, fitted, of_pid) == ""


@pytest.mark.parametrize("shift", [-10, 10])
def test_a_mode_column_that_is_shifted_is_refused(shift, situation):
    test = made("bump", situation)
    test.manual[:] = (
        np.concatenate([test.manual[-shift:], np.ones(-shift, bool)])
        if shift < 0
        else np.roll(test.manual, shift)
    )
    test.manual[: max(shift, 0)] = False
    assert "mode column of bump.csv" in refusal(test, situation)


def test_another_tuning_than_the_stated_one_is_refused(situation):
    assert "tuning is not the one stated" in refusal(
        made("sp_steps", situation, LOOP.with_("controller.Kc", 0.25)), situation
    )
    half = LOOP.with_("controller.Kc", 0.25)
    assert refusal(made("sp_steps", situation, half, half), situation) == ""


def test_another_loops_signals_are_refused(situation):
    far = Loop.from_table(
        LOOP.to_table()
        | {"operating_point": {"op0": 50.0, "pv0": 900.0}, "setpoint": {"value": 900.0}}
    )
    assert "the loop behind sp_steps.csv is another" in refusal(
        made("sp_steps", situation, far), situation
    )


def test_in_manual_no_law_is_asked(situation):
    fitted = model_test(made("bump", situation), situation)
    assert fitted.proven == {}
    assert fitted.law is not None
    assert fitted.law.gap == 0.0


@pytest.mark.parametrize(("foreign", "settled"), [(False, True), (True, False)])
def test_a_log_without_the_archive_settles_whether_the_controller_is_another(
    foreign, settled, situation
):
    strays = replace(situation, unexplained_law="OP strays from a law that holds elsewhere")
    raw = made("raw", situation)
    if foreign:
        op = raw.record.op.copy()
        op[100:400:20] += 0.5
        raw = replace(raw, record=replace(raw.record, op=op))
    assert model_test(raw, strays).explained is settled
    left = assess_with_tests(strays, [raw]).situation.unexplained_law
    assert (left == "") is settled
    # any other test is made with the archive
    assert assess_with_tests(strays, [made("mv", situation)]).situation.unexplained_law


def with_wild_readings(record, places):
    pv = np.array(record.pv)
    pv[places] += 4.0
    return replace(record, pv=pv)


def test_wild_readings_of_a_test_are_chance_where_the_record_has_none(situation):
    test = made("sp_steps", situation)
    test = replace(test, record=with_wild_readings(test.record, [30, 55, 80]))
    assert set(check(test.record, LOOP).proven) == {"outliers"}
    assert model_test(test, situation).proven == {}
    wild = check(with_wild_readings(simulate(LOOP, 1).record, [100, 200, 300, 400]), LOOP)
    assert set(model_test(test, wild).proven) == {"outliers"}
