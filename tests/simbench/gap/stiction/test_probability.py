"""One probability of stiction: monotone in its evidence, never certain, and the same whoever shows
it.
"""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from random_case import random_case

from simbench.cli import main
from simbench.detectors.judge import judge
from simbench.files import write_record
from simbench.gap.stiction.probability import (
    FrictionEvidence,
    log_odds,
    pool_log_odds,
    probability,
    verdict,
)
from simbench.gap.thresholds import CLAIMED_FROM, DENIED_BELOW, EDGE, POOLED

KEY = "probability_of_stiction"


def test_more_nats_speak_for_friction():
    odds = [log_odds(FrictionEvidence(gain)) for gain in (-20.0, -5.0, 0.0, 5.0, 20.0, 1e4)]
    assert odds == sorted(odds)
    assert odds[-1] > odds[0]


def test_the_more_often_friction_would_have_shown_the_more_it_must_explain():
    few, many, more = (log_odds(FrictionEvidence(20.0, cycles=c)) for c in (6.0, 20.0, 33.0))
    assert few > many > more
    assert log_odds(FrictionEvidence(20.0, cycles=500.0)) == more


def test_what_would_have_shown_plainly_is_denied_the_sooner():
    hardly, seen = FrictionEvidence(-5.0, 0.1, 30.0), FrictionEvidence(-5.0, 0.1, 30.0, pace=30.0)
    assert log_odds(seen) < log_odds(hardly) < 0.0
    for other in (replace(seen, cycles=19.0), replace(seen, pace=14.0)):
        assert not other.seen
    # what friction explains in full does not speak against it, however narrow its band
    assert not replace(seen, gain=60.0).seen
    claimed = FrictionEvidence(45.0, 1.0, 22.0)
    assert log_odds(claimed) == log_odds(replace(claimed, pace=30.0)) > math.log(4.0)


@pytest.mark.parametrize("gain", [-9.0, 0.0, 1.0])
def test_no_band_and_no_short_record_makes_friction_surer_than_what_it_explains(gain):
    assert log_odds(FrictionEvidence(gain, share=1.0, cycles=4.0)) <= max(gain, 0.0)


def test_a_band_that_spans_little_of_what_op_does_counts_less():
    wide, narrow = (log_odds(FrictionEvidence(100.0, share=share)) for share in (1.0, 0.05))
    none = log_odds(FrictionEvidence(0.0))
    assert wide > narrow
    assert narrow - none < 0.5 * (wide - none)


def test_no_probability_is_certain():
    assert probability(1e9) == EDGE
    assert probability(-1e9) == pytest.approx(1.0 - EDGE)
    assert probability(0.0) == 0.5


def test_records_of_one_loop_count_together_but_not_as_often_as_they_were_taken():
    assert pool_log_odds([1.5]) == 1.5
    assert pool_log_odds([1.0, 1.0]) == pytest.approx(2.0 / (1.0 + POOLED))
    assert 1.0 < pool_log_odds([1.0] * 50) < 1.0 / POOLED
    assert pool_log_odds([2.0, -2.0]) == 0.0


def test_both_errors_cost_the_same():
    assert pytest.approx(1.0) == CLAIMED_FROM + DENIED_BELOW
    # Chow (1970): an answer pays where its error is less likely than no answer is dear
    assert 0.0 < DENIED_BELOW < 0.5


def test_between_yes_and_no_there_is_no_decision():
    edges = (DENIED_BELOW - 1e-9, DENIED_BELOW, CLAIMED_FROM, CLAIMED_FROM + 1e-9)
    assert [verdict(p) for p in edges] == ["no_stiction", "no_decision", "no_decision", "stiction"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return two records of 400 samples, one of a sticky loop."""
    place = tmp_path_factory.mktemp("records")
    for name, effects in (("sticky", ("stiction",)), ("sound", ())):
        write_record(random_case(7, effects).record.window(0, 400), place / f"{name}.csv")
    return place


def answer(capsys, *words):
    assert main([str(w) for w in (*words, "--json")]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_verb_shows_the_same_number(folder, capsys):
    answers = answer(capsys, "detect", folder, "--method", "likelihood")
    listed = {one["record"]: one for one in answers}
    record = folder / "sticky.csv"
    [answered] = answer(capsys, "detect", record, "--method", "likelihood")
    shown = [
        answered[KEY],
        answered["indices"][KEY],
        answer(capsys, "diagnose", record)[KEY],
        answer(capsys, "gap", "diagnose", record, "--identify")[KEY],
        listed["sticky"][KEY],
    ]
    assert np.ptp(shown) < 1e-9
    assert math.isclose(answered["score"], math.log(shown[0] / (1 - shown[0])), abs_tol=1e-6)
    assert listed["sticky"][KEY] > listed["sound"][KEY]


def test_what_cannot_be_judged_has_no_probability(folder, tmp_path):
    from simbench.detectors.record import LoopRecord

    flat = LoopRecord(op=np.full(300, 50.0), pv=np.sin(np.arange(300.0)), Ts=1.0)
    [answered] = judge(flat, ["likelihood"])
    assert answered.verdict == "no_decision"
    assert KEY not in answered.indices
