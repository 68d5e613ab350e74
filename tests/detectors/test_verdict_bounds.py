"""How little a method just accepts, and what it answers to less."""

import math
from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.judge import judge_one
from simbench.detectors.methods import (
    he,
    rossi_scali,
    singhal_salsbury,
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
