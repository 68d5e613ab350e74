"""Claims of the literature: what each rebuilt detector sees, and how its answers are counted."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from results.studies.claims import (
    circle_distance,
    five_cycles,
    label_rules,
    scalogram,
    slow_feature,
)
from results.studies.claims.__main__ import NAMES, main, outcome
from results.studies.claims.judged import (
    CANNOT_TELL,
    HEAD,
    NO,
    YES,
    Answers,
    Loops,
    balanced_accuracy,
    counted,
    decided,
    echoed,
    learned_threshold,
)
from simbench.detectors.errors import ParameterError
from simbench.detectors.record import LoopRecord

RNG = np.random.default_rng(3)
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


def test_a_line_counts_sticky_loops_and_others_apart():
    answers = Answers(np.array([3.0, 1.0, 2.0, np.nan]), np.array([YES, NO, YES, CANNOT_TELL]))
    line = dict(zip(HEAD, counted("x", loops_of([1, 1, 0, 0]), answers), strict=True))
    assert line["sticky loops found"].startswith("1 of 2 ")
    assert line["others called sticky"].startswith("1 of 2 ")
    assert (line["n"], line["cannot tell"], line["balanced accuracy"]) == ("4", "1", "0.38")


def test_the_autocorrelation_is_the_mean_product_over_the_lag():
    x = RNG.standard_normal(60)
    r, y = five_cycles.autocorrelation(x), x - x.mean()
    plain = [y[: y.size - k] @ y[k:] / (y @ y) for k in range(30)]
    assert r == pytest.approx(plain, abs=1e-12)


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


def test_an_irregular_signal_does_not_pass_the_gates():
    noise = np.cumsum(RNG.standard_normal(800))
    assert np.isnan(five_cycles.index(noise[:40], five_cycles.RIGHT))
    assert not five_cycles.regular([np.ones(3), np.ones(30), np.ones(9), np.ones(50)])
    assert five_cycles.regular([np.ones(9), np.ones(10), np.ones(9), np.ones(10)])
    assert not five_cycles.regular([np.ones(10)] * 3)


def test_two_lines_fit_a_triangle_and_not_a_square():
    triangle = np.concatenate([np.arange(8.0), np.arange(8.0, -1.0, -1.0)])
    assert five_cycles.triangle_error(triangle) == pytest.approx(0.0, abs=1e-20)
    assert five_cycles.triangle_error(np.array([0.0, 1, 1, 1, 1, 1, 0])) > 0.01


def test_the_slowest_feature_of_two_mixed_signals_is_the_slower_one():
    slow, fast = np.sin(2 * np.pi * T / 4), np.sin(2 * np.pi * T * 3)
    record = LoopRecord(slow + 2 * fast, 3 * slow - fast, 1.0)
    assert abs(np.corrcoef(slow_feature.slowest(record, 0), slow)[0, 1]) > 0.999


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


def test_the_slope_ratio_counts_windows_in_which_op_is_steep_and_pv_flat():
    op, pv = np.tile(np.arange(6.0), 4), np.zeros(24)
    pv[:12] = np.tile(np.arange(6.0), 2)
    assert label_rules.slope_ratio_share(LoopRecord(op, pv, 1.0)) == 0.5
    assert label_rules.slope_ratio_share(LoopRecord(op, op, 1.0)) == 0.0
    record = LoopRecord(100.0 * op, pv + 0.01 * op, 1.0)
    assert label_rules.standardised(record).op.std() == pytest.approx(1.0)


def test_ellipse_and_kano_give_a_label_only_where_they_agree(monkeypatch):
    record = LoopRecord(np.sin(2 * np.pi * T), np.cos(2 * np.pi * T), 1.0)
    for said, label in ((("stiction", "stiction"), YES), (("stiction", "no_stiction"), 0)):
        verdicts = [type("V", (), {"verdict": v, "score": 0.5}) for v in said]
        monkeypatch.setattr(label_rules, "judge", lambda *_, v=verdicts: v)
        assert label_rules.both_agree(record) == (0.5, label)


def test_the_network_sees_500_samples_whatever_the_amplitude_and_the_offset():
    op, pv = np.sin(2 * np.pi * T), np.cos(2 * np.pi * T)
    record = LoopRecord(op, pv, 1.0)
    for feature in (circle_distance.distance, circle_distance.first_component):
        x = circle_distance.seen(record, feature)
        assert x.shape == (circle_distance.POINTS,)
        larger = replace(record, op=50.0 + 3.0 * op, pv=7.0 * pv)
        assert circle_distance.seen(larger, feature) == pytest.approx(x, abs=1e-9)
    # a circle has one distance; two signals that are one have all of it in one component
    circle = circle_distance.seen(record, circle_distance.distance)
    assert circle == pytest.approx(np.full(500, np.sqrt(2.0)), abs=0.05)
    same = circle_distance.seen(replace(record, pv=op), circle_distance.first_component)
    assert same.std() == pytest.approx(np.sqrt(2.0), abs=0.01)


def test_at_home_half_of_the_loops_stick_and_the_others_oscillate_without():
    records, sticky = circle_distance.home(4, np.random.default_rng(1))
    assert sticky.tolist() == [True] * 4 + [False] * 4
    for record, sticks in zip(records, sticky):
        rests = np.mean(np.abs(np.diff(record.mv)) < 1e-9)
        assert (rests > 0.2) == sticks
        assert record.op[-300:].std() > 0.1


def test_what_comes_out_counts_the_variants_whose_interval_lies_above_one_half():
    rows = [
        ("x", "recorded", "0.70 (0.51 to 0.80)"),
        ("y", "recorded", "0.70 (0.49 to 0.80)"),
        ("x", "echoes", "-"),
    ]
    assert outcome(rows).endswith("on recorded 1 of 2, on echoes 0 of 1")


def test_a_claim_is_printed_with_its_table(capsys):
    assert main(["-n", "2", "--seed", "5", "--claim", "five_cycles"]) == 0
    text = capsys.readouterr().out
    for word in ("claimed: He's index", "protocol:", "chosen here:", "arx_stiction", "echoes"):
        assert word in text
    assert "recorded  " not in text
    claims = [import_module(f"results.studies.claims.{name}").CLAIM for name in NAMES]
    assert len(claims) >= 5
    assert all(claim.claimed and claim.protocol and claim.stand_in for claim in claims)


def test_no_pair_is_refused():
    with pytest.raises(ParameterError, match="-n 0: at least 1 pair"):
        echoed(0, 5)


def test_both_members_of_a_pair_are_in_one_group():
    loops = echoed(2, 5)
    assert loops.group.tolist() == [0, 0, 1, 1]
    assert loops.sticky.tolist() == [True, False] * 2
    assert all(record.mv is None for record in loops.records)


def test_a_line_of_the_network_has_the_median_and_the_range_over_its_starts():
    op, pv = np.sin(2 * np.pi * T), np.cos(2 * np.pi * T)
    x = np.array([op[:500], pv[:500]] * 4)
    networks = [circle_distance._network((2, 2), start).fit(x, [1, 0] * 4) for start in (0, 1, 2)]
    line = dict(
        zip(HEAD, circle_distance._row("x", loops_of([1, 0] * 4), x, networks), strict=True)
    )
    assert line["sticky loops found"] == "1.00 (median of 3)"
    assert line["others called sticky"] == "0.00"
    assert line["balanced accuracy"] == "1.00 (1.00 to 1.00)"
