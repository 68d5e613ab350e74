"""One probability of stiction: monotone in its evidence, never certain, and the same whoever shows it."""

import contextlib
import json
import math
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from random_case import random_case

from detectors.errors import UserError
from detectors.judge import judge
from detectors.records.io import read_record
from results.studies.plant import stiction_probability as study
from simbench.cli import main
from simbench.files import write_record
from simbench.gap.decide.assess import Assessment
from simbench.gap.diagnosis import _assess_all
from simbench.gap.stiction.friction import friction
from simbench.gap.stiction.probability import (
    CLAIMED_FROM,
    DENIED_BELOW,
    EDGE,
    SHARED,
    FrictionEvidence,
    log_odds,
    pooled,
    probability,
    verdict,
)
from simbench.plant.command import causes_of
from simbench.plant.report.fleet import _one as survey_one
from simbench.plant.report.fleet import survey
from simbench.plant.report.page import table
from simbench.plant.trust.trust import trust

KEY = "probability_of_stiction"
REAL = Path(__file__).parents[5] / "shared" / "data" / "real"
COUNT, SHORT = int(os.environ.get("RECORDS", "200")), 200  # records, and samples of each


def test_more_nats_speak_for_friction_and_what_an_oscillation_explains_does_not():
    odds = [log_odds(FrictionEvidence(gain)) for gain in (-20.0, -5.0, 0.0, 5.0, 20.0, 1e4)]
    assert odds == sorted(odds)
    assert odds[-1] > odds[0]
    swung = FrictionEvidence(20.0, outside=20.0)
    assert log_odds(swung) == pytest.approx(log_odds(FrictionEvidence(0.0)))


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
    assert pooled([1.5]) == 1.5
    assert pooled([1.0, 1.0]) == pytest.approx(2.0 / (1.0 + SHARED))
    assert 1.0 < pooled([1.0] * 50) < 1.0 / SHARED
    assert pooled([2.0, -2.0]) == 0.0


def test_between_yes_and_no_it_cannot_be_told():
    edges = (DENIED_BELOW - 1e-9, DENIED_BELOW, CLAIMED_FROM, CLAIMED_FROM + 1e-9)
    assert [verdict(p) for p in edges] == ["no_stiction", "no_decision", "no_decision", "stiction"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return two records of 600 samples, one of a sticky loop."""
    place = tmp_path_factory.mktemp("records")
    for name, effects in (("sticky", ("stiction",)), ("sound", ())):
        write_record(random_case(7, effects).record.window(0, 600), place / f"{name}.csv")
    return place


def answer(capsys, *words):
    assert main([str(w) for w in (*words, "--json")]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_verb_shows_the_same_number(folder, capsys, monkeypatch):
    monkeypatch.setattr("simbench.plant.trust.trust.draw_twins", lambda *a, **k: [])
    listed = table(survey(folder, jobs=1)).set_index("loop")
    for name in ("sticky", "sound"):
        record = folder / f"{name}.csv"
        [said] = answer(capsys, "detect", record, "--method", "likelihood")
        shown = [
            said[KEY],
            said["indices"][KEY],
            answer(capsys, "diagnose", record)[KEY],
            answer(capsys, "trust", record, "--method", "he")[KEY],
            answer(capsys, "gap", "diagnose", record, "--identify")[KEY],
            listed.loc[name, KEY],
        ]
        assert np.ptp(shown) < 1e-9
        assert math.isclose(said["score"], math.log(shown[0] / (1 - shown[0])), abs_tol=1e-6)
    assert listed.loc["sticky", KEY] > listed.loc["sound", KEY]


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_200_records_have_one_probability_whichever_verb_asks(monkeypatch):
    """Simulated loops, blind ones, and recorded ones where they are at hand; what adds nothing to the number is left out.

    Verbs that hand on the same bits are answered once.
    """
    asked = {}

    def once(record, loop=None, found=None):  # what was found before saves time and changes no number
        signals = (None if x is None else x.tobytes() for x in (record.op, record.pv, record.sp, record.mv))
        key = (*signals, record.Ts, record.op_span, record.process, record.kind, record.notes, loop)
        if key not in asked:
            try:
                asked[key] = friction(record, loop)
            except UserError as why:
                asked[key] = why
        if isinstance(asked[key], UserError):
            raise asked[key]
        return asked[key]

    for room in ("gap.stiction.method", "gap.diagnosis", "gap.stiction.candidate_loops"):
        monkeypatch.setattr(f"simbench.{room}.friction", once)
    monkeypatch.setattr("simbench.gap.diagnosis.beside_tests", lambda s, tests: Assessment(s, None, {}, {}, [], None))
    monkeypatch.setattr("simbench.gap.diagnosis.plausible", lambda found, sticky: found)
    monkeypatch.setattr("simbench.plant.trust.trust.draw_twins", lambda *a, **k: [])
    monkeypatch.setattr("simbench.plant.trust.trust.over_time", lambda *a: None)
    monkeypatch.setattr("simbench.plant.report.fleet.what_if", lambda *a: ())
    names = pd.read_csv(REAL / "records.csv").id[: COUNT // 4] if REAL.is_dir() else []
    records = [read_record(REAL / f"{name}.csv") for name in names]
    records += [study.drawn(s, i)[0] for i in range((COUNT - len(records)) // 4 + 1) for s in study.SIMULATORS]
    told = 0
    for record in records[:COUNT]:
        record = record.window(0, min(record.n, SHORT))
        shown = [
            judge(record, ["likelihood"])[0].indices.get(KEY),
            causes_of(record)[1],
            trust(record, methods=["he"]).probability,
            survey_one("", record, ["he"], "", 0).found.probability,
        ]
        with contextlib.suppress(UserError):  # where the gap refuses a record it shows nothing
            shown.append(_assess_all([record], None, 1)[0].stiction)
        assert all(x is None for x in shown) or (None not in shown and np.ptp(shown) < 1e-9), (record.tag, shown)
        told += shown[0] is not None
    assert told > 0.8 * COUNT


def test_what_cannot_be_judged_has_no_probability(folder, tmp_path):
    from detectors.record import LoopRecord

    flat = LoopRecord(op=np.full(300, 50.0), pv=np.sin(np.arange(300.0)), Ts=1.0)
    [said] = judge(flat, ["likelihood"])
    assert said.verdict == "no_decision"
    assert KEY not in said.indices
