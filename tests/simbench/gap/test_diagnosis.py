"""Several records of one loop: their evidence adds up, and their pace must agree."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap import diagnosis
from simbench.gap.closed_loop.gap import Shrinkage
from simbench.gap.decide.posterior import PV, SAMPLES, Evidence, known_by, nats_of
from simbench.gap.diagnosis import diagnose
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.probability import pool_log_odds, probability


def gap(before=4.0, after=1.0, *, value=0.9, lo=0.7, hi=0.95, resolvable=True):
    return Shrinkage(before, 3.0, after, 0.8, resolvable, value, lo, hi, {}, 1.1)


@dataclass
class Stub:
    record: SimpleNamespace
    notes: list


def assessment(n, gains, *, known=(), chosen=(), parameters=None, tag=""):
    s = Stub(record=SimpleNamespace(n=n, tag=tag), notes=[])
    rows = [Evidence(e, SAMPLES, 60.0) for e in known]
    rows += [Evidence(e, PV, gain) for e, gain in gains.items()]
    return diagnosis.Assessment(s, None, {}, parameters or {}, list(chosen), None, rows=tuple(rows))


LOOPS = CandidateLoops(
    record=None,
    healthy=(),
    sticky=None,
    fitted=None,
    log_odds=1.0,
    percent=1.0,
    notes=(),
)


def together(monkeypatch, *every):
    monkeypatch.setattr(diagnosis, "_assess_one", lambda r, *given, **more: (r.made, LOOPS))
    records = [SimpleNamespace(n=one.situation.record.n, made=one) for one in every]
    return diagnosis._assess_all(records, None, 1)


def test_evidence_of_several_records_adds_up_and_the_longest_carries_the_fit(monkeypatch):
    numbers = {"noise": {"factor": 3.0}, "stiction": {"S": 1.0}}
    gained = {"stiction": 9.0, "noise": 4.0}
    short = assessment(
        500, gained, known=["quantisation"], chosen=["noise", "stiction"], parameters=numbers
    )
    long = assessment(
        900, {"stiction": 7.0, "drift": 890.0}, parameters={"stiction": {"S": 2.0}}, tag="FIC1"
    )
    more = assessment(700, {"drift": 890.0}, chosen=["drift"])
    joined, loops = together(monkeypatch, short, long, more)
    assert joined.situation.record is long.situation.record
    nats = nats_of(joined.rows)
    assert (nats["stiction"], nats["noise"], nats["drift"]) == (16.0, 4.0, 1780.0)
    assert known_by(joined.rows) == ["quantisation"]
    assert joined.parameters == {"noise": {"factor": 3.0}, "stiction": {"S": 2.0}}
    assert joined.chosen == ["noise", "stiction"]
    assert [f.situation.record.n for f in joined.other_records] == [700, 500]
    assert joined.situation.notes == [
        "3 records judged together; gap and parameters are those of FIC1"
    ]
    assert (
        joined.friction == loops.probability == pytest.approx(probability(pool_log_odds([1.0] * 3)))
    )
    assert together(monkeypatch, short)[0].situation.notes == []
    [note] = together(monkeypatch, short, more)[0].situation.notes
    assert "those of the longest" in note


@pytest.mark.parametrize(("Ts", "judged"), [(1.009, True), (1.011, False)])
def test_records_of_one_pace_are_judged_together(monkeypatch, Ts, judged):
    class Reached(Exception):
        pass

    def assess_all(*a):
        raise Reached

    monkeypatch.setattr(diagnosis, "_assess_all", assess_all)
    with pytest.raises(Reached if judged else RecordError):
        diagnose(
            [LoopRecord(op=np.arange(9.0), pv=np.arange(9.0), Ts=one) for one in (1.0, Ts)], None
        )
    with pytest.raises(RecordError, match="no record"):
        diagnose([], None)
