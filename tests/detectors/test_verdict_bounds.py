"""How little a method just accepts, what lies outside its numbers, and scores and levels that
are known beforehand.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.errors import ParameterError
from simbench.detectors.judge import check_thresholds, judge, judge_one
from simbench.detectors.methods import (
    hammerstein,
    he,
    horch,
    rossi_scali,
    singhal_salsbury,
    srinivasan,
)
from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared
from simbench.detectors.record import LoopRecord

HUMP = np.sin(np.pi * (np.arange(40) + 0.5) / 40)


class Seen:
    """A prepared record some of whose answers are given; everything else is the real one's."""

    def __init__(self, real=None, **given):
        self.real, self.given = real, given

    def __getattr__(self, name):
        return self.given[name] if name in self.given else getattr(self.real, name)


@pytest.fixture(scope="module")
def sticky(loop):
    return Prepared(replace(loop(J=2.5, kick=6.0, n=1500, noise=0.02), kind="flow"))


@pytest.mark.parametrize("module", [he, rossi_scali, singhal_salsbury])
def test_four_half_cycles_are_enough_and_three_are_not(module):
    few, enough = (
        module.detect(
            Seen(
                integrating=False, half_cycles=lambda name, cleaned=True, n=n: np.tile(HUMP, (n, 1))
            ),
            **module.METHOD.defaults(),
        )
        for n in (3, 4)
    )
    assert few.verdict == "no_decision"
    assert few.reason.startswith("3 half cycles")
    assert math.isnan(few.score)
    assert np.isfinite(enough.score)


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("hammerstein", 8),
        ("stenman", 8),
        ("horch_isaksson", 8),
        ("srinivasan", 8),
        ("surrogate", 7),
    ],
)
def test_samples_per_cycle_that_are_just_enough(sticky, name, least):
    module = methods.load(name)
    answers = [
        module.detect(Seen(Prepared(sticky.record), period=period), **module.METHOD.defaults())
        for period in (least - 1e-6, least)
    ]
    assert answers[0].verdict == "no_decision"
    assert f"at least {least} are needed" in answers[0].reason
    assert math.isnan(answers[0].score)
    assert "are needed" not in answers[1].reason or "samples per cycle" not in answers[1].reason


@pytest.mark.parametrize("phase", [0.0, math.pi / 6, math.pi / 4, math.pi / 3, math.pi / 2])
def test_horchs_score_is_the_phase_in_quarters_of_a_turn(monkeypatch, phase):
    """Of two sinusoids both indices are functions of the phase: 2 phi/pi and tan(phi/2)^2 (Eqs 11.6
    and 11.7).
    """
    monkeypatch.setattr(
        horch, "correlation_indices", lambda *a: (2 * phase / math.pi, math.tan(phase / 2) ** 2)
    )
    answer = horch.detect(Seen(record=Seen(op=None, pv=None)), **horch.METHOD.defaults())
    assert answer.score == pytest.approx(2 * phase / math.pi)


@pytest.mark.parametrize(
    ("dtau", "drho", "verdict"),
    [
        (0.7, 0.4, "stiction"),
        (0.7, 0.3, "no_decision"),
        (0.6, 0.4, "no_decision"),
        (0.3, 0.05, "no_stiction"),
        (0.3, 0.1, "no_decision"),
        (0.4, 0.05, "no_decision"),
        (math.nan, 0.4, "no_decision"),
    ],
)
def test_both_of_horchs_indices_must_agree(monkeypatch, dtau, drho, verdict):
    monkeypatch.setattr(horch, "correlation_indices", lambda *a: (dtau, drho))
    assert (
        horch.detect(Seen(record=Seen(op=None, pv=None)), **horch.METHOD.defaults()).verdict
        == verdict
    )


TABLE_11_2 = {
    False: {("triangle", "square"), ("square", "square"), ("triangle", "sine")},
    True: {("triangle", "triangle"), ("sine", "triangle")},
}


@pytest.mark.parametrize("integrating", [False, True])
@pytest.mark.parametrize("op", ["square", "triangle", "sawtooth", "sine"])
@pytest.mark.parametrize("pv", ["square", "triangle", "sawtooth", "sine"])
def test_every_pair_of_shapes(monkeypatch, integrating, op, pv):
    monkeypatch.setattr(srinivasan, "cycles", lambda shape, period: [shape] * 3)
    monkeypatch.setattr(
        srinivasan,
        "label_shares",
        lambda shapes: np.where([w == shapes[0] for w in srinivasan.SHAPES], 0.7, 0.1),
    )
    answer = srinivasan.detect(
        Seen(
            period=8.0,
            integrating=integrating,
            band=lambda name, shortest: {"op": op, "pv": pv}[name],
        )
    )
    alike = tuple(x.replace("sawtooth", "triangle") for x in (op, pv))
    expected = (
        "stiction"
        if alike in TABLE_11_2[integrating]
        else "no_stiction"
        if alike == ("sine", "sine")
        else "no_decision"
    )
    assert answer.verdict == expected
    assert answer.score == pytest.approx(0.3 if (pv if integrating else op) == "sine" else 0.9)


def test_two_whole_cycles_show_no_shape(monkeypatch):
    monkeypatch.setattr(srinivasan, "cycles", lambda shape, period: [shape] * 2)
    answer = srinivasan.detect(Seen(period=8.0, integrating=False, band=lambda *a: 0.0))
    assert answer.verdict == "no_decision"
    assert answer.reason.startswith("2 whole cycles in OP")


def test_width_and_stuck_op_are_scaled_by_the_span_of_op(sticky):
    for name, index in (("kano_a", "stuck_op"), ("kano_b", "width")):
        plain, spanned = (
            judge(replace(sticky.record, op_span=span), [name], raw=True)[0]
            for span in ((0.0, 100.0), (-100.0, 300.0))
        )
        assert plain.verdict == spanned.verdict == "stiction", name
        assert plain.indices[index] == pytest.approx(spanned.indices[index])
        assert plain.S == pytest.approx(4.0 * spanned.S)


def test_the_share_of_a_sticky_band_is_that_of_the_swing_of_op(sticky):
    answer = hammerstein.detect(sticky, **hammerstein.METHOD.defaults())
    swing = hammerstein.swing(sticky.searchable("travel"), sticky.period)
    assert answer.indices["share"] == pytest.approx(
        (answer.indices["S_hat"] + answer.indices["J_hat"]) / swing
    )
    assert answer.score == pytest.approx(answer.indices["gain"] * min(answer.indices["share"], 1.0))
    assert answer.S[0] <= answer.indices["S_hat"] <= answer.S[1]
    assert np.min(answer.J) <= answer.indices["J_hat"] <= np.max(answer.J)


# what a method's source has where this package has something else as its default
AS_PUBLISHED = {
    "ellipse": {"harmonics": 0.0},
    "hammerstein": {"output_error": 0.0, "score_low": 0.0, "score_high": 0.0},
    "he": {"cleaned": 0.0},
    "horch_histogram": {"least_A": 0.0},
    "horch_isaksson": {"score_low": 0.5, "score_high": 0.5},
    "procedure": {"weighted": 0.0, "veto": 1.0, "follow_min": 1.0},
    "rossi_scali": {"left_out": 0.0},
    "singhal_salsbury": {"cleaned": 0.0},
    "srinivasan": {"by_kind": 1.0},
}
NEEDS = {
    "bicoherence": (256, None),
    "choudhury": (256, None),
    "surrogate": (None, 12.0),
}  # four segments of 64; Thornhill (2005)


@pytest.mark.parametrize("name", methods.names())
def test_a_method_as_published_and_what_it_needs(name):
    method = methods.load(name).METHOD
    assert method.published == AS_PUBLISHED.get(name, {})
    for has, wants in zip(
        (method.min_samples, method.min_periods), NEEDS.get(name, ()), strict=False
    ):
        assert wants is None or has == wants


@pytest.mark.parametrize("name", methods.names())
def test_a_share_is_asked_for_between_nought_and_one(name):
    method = methods.load(name).METHOD
    for key in (
        "share_min",
        "op_min",
        "width_min",
        "still_min",
        "fitness_low",
        "eta_low",
        "eta_high",
        "score_low",
        "score_high",
    ):
        if key in method.thresholds:
            assert (method.thresholds[key].low, method.thresholds[key].high) == (0.0, 1.0), key


T = np.arange(0, 400, 0.5)
RECORD = LoopRecord(50 + np.arcsin(np.sin(T)), np.cos(T), 0.5, process="self-regulating")


def test_a_method_takes_a_record_of_just_its_least_number_of_samples():
    module = methods.load("bicoherence")
    for n, enough in ((255, False), (256, True)):
        record = LoopRecord(RECORD.op[:n], RECORD.pv[:n], 0.5, process="self-regulating")
        answer = judge_one("bicoherence", module, Prepared(record), True, module.METHOD.defaults())
        assert ("at least 256 are needed" in answer.reason) is not enough


@pytest.mark.parametrize("name", ["kano_a", "kano_b", "yamashita"])
def test_without_any_position_of_the_valve_a_method_that_needs_it_does_not_apply(name):
    module = methods.load(name)
    answer = module.detect(Prepared(replace(RECORD, kind="level")), **module.METHOD.defaults())
    assert (answer.method, answer.verdict, answer.applicable) == (name, "no_decision", False)
    assert answer.reason.startswith("no MV recorded")


@pytest.mark.parametrize(
    ("name", "key", "low", "high"),
    [
        ("horch_histogram", "bound", 0.0, 1.0),
        ("procedure", "odds_low", -20.0, 20.0),
        ("procedure", "odds_high", -20.0, 20.0),
        ("procedure", "follow_min", 0.0, 1.0),
        ("procedure", "weighted", 0.0, 1.0),
        ("procedure", "veto", 0.0, 1.0),
    ],
)
def test_a_threshold_may_be_set_to_either_end_of_its_range_and_no_further(name, key, low, high):
    method = methods.load(name).METHOD
    for allowed in (low, high):
        assert check_thresholds(name, method, {key: allowed})[key] == allowed
    for refused in (low - 0.01, high + 0.01):
        with pytest.raises(ParameterError, match=key):
            check_thresholds(name, method, {key: refused})
