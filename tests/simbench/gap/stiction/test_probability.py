"""One probability of stiction: monotone in its evidence, never certain, and the same whoever shows
it.
"""

import json
import math

import numpy as np
import pytest
from recorded import LOADED, STICKY, recorded

from simbench.cli import main
from simbench.files import write_record
from simbench.gap.stiction.probability import (
    FrictionEvidence,
    log_odds,
    pool_log_odds,
    probability,
)
from simbench.gap.thresholds import EDGE, POOLED

KEY = "probability_of_stiction"


def test_more_nats_speak_for_friction():
    odds = [log_odds(FrictionEvidence(gain)) for gain in (-20.0, -5.0, 0.0, 5.0, 20.0, 1e4)]
    assert odds == sorted(odds)
    assert odds[-1] > odds[0]


@pytest.mark.parametrize("gain", [-9.0, 0.0, 1.0])
def test_no_band_and_no_short_record_makes_friction_surer_than_what_it_explains(gain):
    assert log_odds(FrictionEvidence(gain, share=1.0, cycles=4.0)) <= max(gain, 0.0)


def test_no_probability_is_certain():
    assert probability(1e9) == EDGE
    assert probability(-1e9) == pytest.approx(1.0 - EDGE)
    assert probability(0.0) == 0.5


def test_records_of_one_loop_count_together_but_not_as_often_as_they_were_taken():
    assert pool_log_odds([1.5]) == 1.5
    assert pool_log_odds([1.0, 1.0]) == pytest.approx(2.0 / (1.0 + POOLED))
    assert 1.0 < pool_log_odds([1.0] * 50) < 1.0 / POOLED
    assert pool_log_odds([2.0, -2.0]) == 0.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return two records of 400 samples, one of a sticky loop."""
    place = tmp_path_factory.mktemp("records")
    for name, valve in (("sticky", STICKY), ("sound", {})):
        write_record(recorded(LOADED | valve).window(0, 400), place / f"{name}.csv")
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
