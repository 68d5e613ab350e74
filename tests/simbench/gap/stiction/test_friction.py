"""Friction asked for alone is the friction that the whole diagnosis finds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from random_case import random_case

from simbench.detectors.errors import RecordError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.gap import diagnose
from simbench.gap.decide.assess import assess
from simbench.gap.decide.identified import plausible
from simbench.gap.effects import left_out
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import exact_controller, identify
from simbench.gap.stiction import friction as module
from simbench.gap.stiction.friction import (
    ENOUGH,
    FRICTION,
    OUTSIDE,
    friction,
    without_last_bits,
)
from simbench.gap.stiction.pace import at_its_pace
from simbench.trust.trust import trust


@pytest.mark.parametrize(
    ("seed", "effects", "known"),
    [
        (5, (FRICTION,), False),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (5, (FRICTION,), True),
                (8, (OUTSIDE,), True),
                (8, (OUTSIDE,), False),
                (2, ("load_steps",), False),
                (2, ("load_steps",), True),
            )
        ),
    ],
)
def test_its_gain_and_size_are_those_of_the_diagnosis(seed, effects, known):
    case = random_case(seed, effects)
    case = replace(case, record=case.record.window(0, 800))
    loop, slow = case.baseline if known else None, at_its_pace(case.record)
    alone = friction(case.record, loop)
    whole = [diagnose(case.record, loop).behind.found]
    if not known and slow is not case.record:
        identified = identify(slow, controller=exact_controller(case.record))
        whole.append(plausible(assess(check(slow, identified, trusted=False))))
    weighed = [friction(case.record, loop, assessment) for assessment in whole]
    # what is beyond doubt as sampled is not asked again
    best = next(
        (one for one in weighed if one.evidence.gain > ENOUGH),
        max(weighed, key=lambda one: one.evidence.gain),
    )
    assert alone.evidence.gain == pytest.approx(best.evidence.gain, abs=1e-6)
    assert alone.fitted == pytest.approx(best.fitted)


@pytest.mark.slow
def test_friction_that_was_taken_out_of_the_library_is_no_fault():
    case = random_case(2, ("load_steps",))
    with left_out(FRICTION):
        report = diagnose(case.record.window(0, 300), case.baseline)
    assert report.probability_of_stiction < 0.5
    assert FRICTION not in report.behind.found.candidates


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_the_likelier_of_two_views_of_a_record_is_kept(monkeypatch, share):
    """Slips between samples are lost where samples are left out; what remains at full sampling must
    then be found.
    """
    record = random_case(5, (FRICTION,)).record
    slow = at_its_pace(record)
    assert slow is not record
    fitted = module._fitted
    asked = []

    def worse_at_pace(r, loop, given=()):
        asked.append(r.Ts)
        assessment = fitted(r, loop, given)
        gains = assessment.log_likelihood_gains | (
            {FRICTION: share * ENOUGH} if r.Ts == slow.Ts else {FRICTION: 0.8 * ENOUGH}
        )
        return replace(assessment, log_likelihood_gains=gains)

    monkeypatch.setattr(module, "_fitted", worse_at_pace)
    assert friction(record).evidence.gain == pytest.approx(0.8 * ENOUGH)
    assert asked == [record.Ts, slow.Ts]


@pytest.mark.parametrize(
    ("kind", "process"), [("foptd", "self-regulating"), ("integrating", "integrating")]
)
def test_the_kind_of_an_unknown_plant_is_judged_from_all_samples(monkeypatch, kind, process):
    """One loop has one plant: fewer samples do not make another of it."""
    record = replace(random_case(5, (FRICTION,)).record, process=None)
    plant = SimpleNamespace(integrating=kind == "integrating")
    whole = SimpleNamespace(
        log_likelihood_gains={FRICTION: 0.0},
        situation=SimpleNamespace(baseline=SimpleNamespace(plant=plant)),
    )
    asked = []

    def identified(view, all_samples):
        return whole if view is all_samples else asked.append(view.process)

    monkeypatch.setattr(module, "_identified", identified)
    monkeypatch.setattr(module, "_measured", lambda assessment: assessment)
    friction(record)
    friction(replace(record, process="integrating"))
    assert asked == [process, "integrating"]


def test_what_single_samples_prove_is_proven_by_all_of_them(monkeypatch):
    record = random_case(5, (FRICTION,)).record
    step = 0.15 * float(np.std(record.pv))
    rounded = replace(record, pv=np.round(record.pv / step) * step)
    assert at_its_pace(rounded).n < rounded.n
    identified = module._identified

    def at_pace_alone(view, all_samples):
        return None if view is all_samples else identified(view, all_samples)

    monkeypatch.setattr(module, "_identified", at_pace_alone)
    assessment = friction(rounded).assessment
    assert assessment.situation.proven["quantisation"]["step"] == pytest.approx(step)
    assert assessment.parameters["quantisation"] == assessment.situation.proven["quantisation"]
    assert assessment.situation.data.n == at_its_pace(rounded).n


@pytest.fixture
def archived():
    """Return a record of which an archive kept every eighth sample and drew lines between them."""
    rng, t = np.random.default_rng(0), np.arange(900.0)
    pv = np.sin(t / 60.0) + 0.002 * rng.standard_normal(900)
    kept = np.arange(0, 900, 8)
    drawn = np.interp(t, t[kept], pv[kept])
    return LoopRecord(op=50.0 + np.cos(t / 60.0), pv=drawn, Ts=1.0, op_span=(0.0, 100.0))


def test_an_archive_that_draws_most_samples_leaves_nothing_to_tell(archived):
    with pytest.raises(RecordError, match="samples of PV were measured"):
        friction(archived)
    assert "were measured" in judge(archived, ["likelihood"])[0].reason


@pytest.mark.slow
def test_nor_does_it_in_any_other_verb(archived):
    report = diagnose(archived)
    assert report.probability_of_stiction is None
    assert any(
        n.startswith(f"{FRICTION}: cannot tell") and "were measured" in n for n in report.notes
    )
    assert report.effect not in (FRICTION, "deadband")
    trusted = trust(archived, methods=["he"])
    assert trusted.conclusion.verdict == "no_decision"
    assert "were measured" in trusted.conclusion.reason


def test_what_another_unit_rounds_differently_decides_nothing():
    case = random_case(5, ("stiction",)).record
    rng = np.random.default_rng(0)
    plain = replace(case, pv=np.round(case.pv, 3), op=np.round(case.op, 3), mv=None)
    moved = replace(
        plain,
        pv=plain.pv + 1e-9 * plain.pv.std() * rng.standard_normal(plain.n),
        op=(plain.op + 1e6) - 1e6,
    )
    assert not np.array_equal(moved.op, plain.op)
    a, b = without_last_bits(plain), without_last_bits(moved)
    assert np.array_equal(a.pv, b.pv)
    assert np.array_equal(a.op, b.op)
    assert np.abs(a.pv - plain.pv).max() < 1e-7 * np.ptp(plain.pv)
