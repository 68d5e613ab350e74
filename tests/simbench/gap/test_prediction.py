"""What the plant will do under other settings: right on a known loop, open about its range, one
sentence for bad settings.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from simbench.cli import main
from simbench.detectors.errors import UserError
from simbench.gap import command, prediction
from simbench.gap.diagnosis import diagnose
from simbench.gap.prediction import (
    MODEL_ERROR,
    Measures,
    _corrected,
    _interval,
    _moved,
    measure,
    predict,
    read_settings,
)
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

MODEL = Loop.from_table({
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 2000},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[600.0, 55.0], [1300.0, 50.0]]},
    "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 30.0}],
})  # fmt: skip
TRUE = MODEL.with_("plant.K", 1.9)
STICKY = MODEL.with_all({"valve": {"model": "choudhury", "S": 6.0, "J": 2.0}, "disturbance": []})


@pytest.fixture(scope="module")
def report():
    """The diagnosis of a loop whose gain is not the model's."""
    return diagnose(simulate(TRUE, seed=3).record, MODEL)


def fresh(loop, count=8):
    """Return the numbers of fresh records of a loop."""
    runs = [simulate(loop, seed=100 + i, kick=5.0).record for i in range(count)]
    return [measure(np.asarray(r.op), np.asarray(r.pv), r.Ts) for r in runs]


def test_half_the_gain_is_predicted_as_the_true_loop_does_it(report):
    prediction = predict(report, {"controller.Kc": 0.75})
    true = fresh(TRUE.with_("controller.Kc", 0.75))
    assert prediction.valid, prediction.reason
    for name in ("pv_std", "op_std", "op_travel_per_hour"):
        mean = np.mean([getattr(m, name) for m in true])
        assert getattr(prediction, name).value == pytest.approx(mean, rel=0.1)
        assert getattr(prediction, name).lo < mean < getattr(prediction, name).hi
    # the model as it was is off by more, or the correction would not be tested
    assert (
        abs(
            np.mean([m.op_std for m in fresh(MODEL.with_("controller.Kc", 0.75))])
            / prediction.op_std.value
            - 1.0
        )
        > 0.1
    )


@pytest.mark.slow
def test_a_cycle_of_friction_keeps_its_predicted_period():
    prediction = predict(
        diagnose(simulate(STICKY, seed=3, kick=6.0).record, MODEL), {"controller.Kc": 2.0}
    )
    true = np.nanmedian([m.period_s for m in fresh(STICKY.with_("controller.Kc", 2.0))])
    assert prediction.oscillates > 0.5
    assert prediction.period_s.value == pytest.approx(true, rel=0.1)


def test_the_json_has_the_contracts_keys_and_ordered_intervals(report):
    prediction = predict(report, {"controller.Kc": 0.75}).as_json()
    assert list(prediction) == [
        "pv_std",
        "op_std",
        "period_s",
        "op_travel_per_hour",
        "oscillates",
        "valid",
        "reason",
    ]
    for name in ("pv_std", "op_std", "op_travel_per_hour"):
        assert list(prediction[name]) == ["value", "lo", "hi"]
        assert prediction[name]["lo"] <= prediction[name]["value"] <= prediction[name]["hi"]
    assert prediction["period_s"] is None
    assert 0.0 <= prediction["oscillates"] < 0.5


@pytest.mark.parametrize(("settings", "word"), [
    ({"controller.Kc": 4.5}, "times as far as in the record"),
    ({"setpoint.value": 80.0}, "outside the record's"),
])  # fmt: skip
def test_outside_its_range_a_prediction_is_not_valid(report, settings, word):
    prediction = predict(report, settings)
    assert not prediction.valid
    assert word in prediction.reason
    assert prediction.sentence().startswith("No valid prediction: ")


def test_an_identified_loop_is_predicted_only_within_one_and_a_half_plant_floors():
    record = simulate(TRUE, seed=3).record
    found = diagnose(record, identify=True)
    near, far = (
        replace(found, gap=replace(found.gap, after=times * found.gap.plant_floor))
        for times in (1.4, 1.6)
    )
    settings = {"controller.Kc": 1.2}
    assert predict(near, settings).valid
    assert "from the record, whose parts are" in predict(far, settings).reason


def test_of_two_effects_of_an_identified_loop_each_draw_has_both():
    loop = STICKY.with_all(
        {"disturbance": [{"type": "sine", "amplitude": 2.0, "period": 37.0, "at": "output"}]}
    )
    found = diagnose(replace(simulate(loop, seed=3, kick=5.0).record, mv=None), identify=True)
    assessment = found.behind.found
    both = [e for e in assessment.parameters if e in assessment.candidates][:2]
    assert len(both) == 2
    named = tuple({"effect": e, "block": "", "parameters": {}, "probability": 0.5} for e in both)
    loops = [loop for loop, _ in prediction._draws(replace(found, effect="", effects=named), 0)]
    # the first of them named is the first of the draws' explanations
    assert any([part.name for part in loop.effect][:2] == both for loop in loops)


def test_a_moved_set_point_moves_its_steps_unless_they_are_set():
    assert _moved(MODEL, {"setpoint.value": 52.0})["setpoint.steps"] == [
        [600.0, 57.0],
        [1300.0, 52.0],
    ]
    both = {"setpoint.value": 52.0, "setpoint.steps": []}
    assert _moved(MODEL, both) == both


def measures(pv, op=1.0):
    """Return the measures of draws with these standard deviations of PV and OP."""
    rest = {"op_travel_per_hour": 1.0, "period_s": np.nan}
    return pd.DataFrame({"pv_std": pv, "op_std": op, **rest})


def test_a_second_number_of_the_record_corrects_what_the_first_does_not_show():
    rng = np.random.default_rng(1)
    model = 0.3 * rng.standard_normal(400)
    before = measures(np.exp(0.3 * rng.standard_normal(400)), np.exp(model))
    record = Measures(1.0, 2.0, 1.0, np.nan, 50.0, 40.0, 60.0)
    # OP before tells PV after
    value = _corrected("pv_std", record, before, measures(np.exp(model))).value
    assert value == pytest.approx(2.0, rel=0.05)


def test_an_interval_of_equal_draws_is_as_wide_as_the_error_of_a_model():
    prediction = _interval(np.zeros(50), 0.03)
    assert prediction.value == 1.0
    assert prediction.hi == pytest.approx(np.exp(1.645 * 0.03))
    assert prediction.lo == pytest.approx(1.0 / prediction.hi)


@pytest.mark.parametrize("common", [0.3, 0.0])
def test_the_record_corrects_what_draws_have_in_common_and_not_chance(common):
    rng, chance = np.random.default_rng(0), 0.1
    model = common * rng.standard_normal(400)
    before, after = (model + chance * rng.standard_normal(400) for _ in range(2))
    # what both runs of a draw share, the error of any model with it, over all that scatters
    shared = common**2 + MODEL_ERROR**2
    taken_over = shared / (shared + chance**2)
    # the record is twice what the model makes of it
    record = Measures(2.0, 1.0, 1.0, np.nan, 50.0, 40.0, 60.0)
    draws = measures(np.exp(before)), measures(np.exp(after))
    prediction = _corrected("pv_std", record, *draws)
    assert np.log(prediction.value) / np.log(2.0) == pytest.approx(taken_over, abs=0.08)
    # nothing to compare with: no oscillation is recorded
    assert _corrected("period_s", record, *draws) is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({}, "--set"),
        ({"plant.K": "2"}, "plant.K is not a setting"),
        ({"controller": "2"}, "not a setting"),
        ({"controller.Kcc": "2"}, "Kc"),
        ({"controller.Kc": "fast"}, "number"),
        ({"controller.Kc": "-1"}, "greater than 0"),
        ({"controller.direction": '"direct"'}, "positive feedback"),
    ],
)
def test_bad_settings_are_refused_in_one_sentence(words, message):
    with pytest.raises(Exception, match=message) as error:
        read_settings(words, MODEL)
    assert "\n" not in str(error.value)


def test_a_controller_that_is_none_is_refused_by_name(report):
    with pytest.raises(UserError, match="unknown controller 'X': known: P, PI, PID"):
        predict(report, {"controller.type": "X"})


def test_the_verb_answers_first_and_prints_json_alone(report, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command, "diagnose_files", lambda *files, **about: report)
    (tmp_path / "loop.toml").write_text(MODEL.to_toml())
    loop = str(tmp_path / "loop.toml")
    words = ["gap", "predict", "rec.csv", "--baseline", loop, "--set", "controller.Kc=0.75"]
    assert main(words) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("PV standard deviation ")
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 100
    identified = ["gap", "predict", "rec.csv", "--identify", "--set", "controller.Kc=0.75"]
    assert main(identified) == 0
    assert capsys.readouterr().out.splitlines() == lines
    assert main([*identified, "--baseline", loop]) == 2
    assert "either --baseline LOOP.toml or --identify" in capsys.readouterr().err
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == predict(report, {"controller.Kc": 0.75}).as_json()
