"""Claims of the literature: what each rebuilt detector sees, and how its answers are counted."""

import numpy as np
import pytest

from results.studies.claims import (
    five_cycles,
    label_rules,
    scalogram,
    slow_feature,
)
from results.studies.claims.judged import (
    CANNOT_TELL,
    NO,
    YES,
    Answers,
    Loops,
    balanced_accuracy,
    decided,
    echoed,
    learned_threshold,
)
from simbench.detectors.record import LoopRecord

T = np.arange(1200) / 30.37  # periods


def loops_of(sticky, group=None):
    sticky = np.array(sticky, dtype=bool)
    return Loops("some", (), sticky, np.arange(sticky.size) if group is None else np.array(group))


def test_no_answer_counts_as_half_a_right_one_and_always_no_is_worth_nothing():
    sticky = np.array([True, True, False, False, False])
    nothing = np.zeros(5)
    assert balanced_accuracy(Answers(nothing, np.full(5, CANNOT_TELL)), sticky) == 0.5
    assert balanced_accuracy(Answers(nothing, np.full(5, NO)), sticky) == 0.5
    assert balanced_accuracy(Answers(nothing, np.where(sticky, YES, NO)), sticky) == 1.0
    assert balanced_accuracy(Answers(nothing, np.where(sticky, NO, YES)), sticky) == 0.0


def test_a_score_between_two_thresholds_or_without_a_value_is_no_answer():
    said = decided(np.array([0.4, 0.41, 0.6, np.nan]), 0.4, 0.6).said
    assert said.tolist() == [NO, CANNOT_TELL, YES, CANNOT_TELL]


def test_a_threshold_is_learned_on_other_groups_only():
    score = np.array([0.0, 1.0, 2.0, 3.0, 10.0, 11.0])
    sticky = [False, False, True, True, False, True]
    said = learned_threshold(score, loops_of(sticky, [0, 0, 0, 0, 1, 1])).said
    # the second group alone would have its threshold at 10.5, the first has it at 1.5
    assert said[4:].tolist() == [YES, YES]
    assert said[:4].tolist() == [NO, NO, NO, NO]


def test_on_the_autocorrelation_a_triangle_wave_looks_like_a_sine():
    sine, triangle = np.sin(2 * np.pi * T), np.arcsin(np.sin(2 * np.pi * T))
    right = five_cycles.RIGHT
    assert five_cycles.index(sine, right) < 0.4
    assert five_cycles.index(triangle, right) > 0.6
    seen = [five_cycles.index(five_cycles.autocorrelation(x), right) for x in (sine, triangle)]
    assert max(seen) < 0.4


def test_by_the_printed_sine_any_slow_oscillation_is_stiction():
    for x in (np.sin(2 * np.pi * T), np.arcsin(np.sin(2 * np.pi * T))):
        assert five_cycles.index(five_cycles.autocorrelation(x), five_cycles.PRINTED) > 0.9


def test_two_lines_fit_a_triangle_and_not_a_square():
    triangle = np.concatenate([np.arange(8.0), np.arange(8.0, -1.0, -1.0)])
    assert five_cycles.triangle_error(triangle) == pytest.approx(0.0, abs=1e-20)
    assert five_cycles.triangle_error(np.array([0.0, 1, 1, 1, 1, 1, 0])) > 0.01


def test_the_exponents_of_noise_and_of_its_sum():
    noise = np.random.default_rng(5).standard_normal(20_000)
    assert slow_feature.fluctuation(noise) == pytest.approx(0.5, abs=0.05)
    assert slow_feature.fluctuation(np.cumsum(noise)) == pytest.approx(1.5, abs=0.1)
    # the rescaled range of short windows is known to lie above one half
    assert slow_feature.rescaled_range(noise) == pytest.approx(0.55, abs=0.05)
    assert slow_feature.rescaled_range(np.cumsum(noise)) == pytest.approx(1.0, abs=0.05)


def test_the_picture_of_a_sine_has_its_largest_magnitude_at_its_own_frequency_in_every_period():
    t = np.arange(scalogram.PERIODS * scalogram.POINTS) / scalogram.POINTS
    window = np.array([np.sin(2 * np.pi * t), np.sin(2 * np.pi * 4 * t)])
    picture = scalogram.scalogram(window).reshape(2, scalogram.SCALES, scalogram.TIMES)
    centres = np.geomspace(scalogram.LOWEST, scalogram.HIGHEST, scalogram.SCALES)
    for of, f in zip(picture, (1.0, 4.0)):
        assert (of.argmax(axis=0) == np.abs(np.log(centres / f)).argmin()).all()


def test_ellipse_and_kano_give_a_label_only_where_they_agree(monkeypatch):
    record = LoopRecord(np.sin(2 * np.pi * T), np.cos(2 * np.pi * T), 1.0)
    for said, label in ((("stiction", "stiction"), YES), (("stiction", "no_stiction"), 0)):
        verdicts = [type("V", (), {"verdict": v, "score": 0.5}) for v in said]
        monkeypatch.setattr(label_rules, "judge", lambda *_, v=verdicts: v)
        assert label_rules.both_agree(record) == (0.5, label)


def test_both_members_of_a_pair_are_in_one_group():
    loops = echoed(2, 5)
    assert loops.group.tolist() == [0, 0, 1, 1]
    assert loops.sticky.tolist() == [True, False] * 2
    assert all(record.mv is None for record in loops.records)
