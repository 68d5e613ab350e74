"""From scores and probabilities to the answer: what is named, refuted, compared, advised and noted,
on stand-ins.
"""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.record import LoopRecord
from simbench.gap import diagnosis, reporting
from simbench.gap.closed_loop.gap import Compared, Shrinkage
from simbench.gap.decide.evidence import PV, SAMPLES, Evidence, known_by, nats_of
from simbench.gap.decide.posterior import Posterior
from simbench.gap.diagnosis import diagnose
from simbench.gap.reporting import name_effects, report
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.gap.stiction.deniable import Deniable
from simbench.gap.stiction.probability import pool_log_odds, probability
from simbench.loop.effects import EFFECTS

P = {
    "stiction": 0.5,
    "gain_mismatch": 0.2,
    "quantisation": 0.1,
    "none": 0.1,
    "deadband": 0.05,
    "unknown": 0.05,
}
NUMBERS = {
    "stiction": {"S": 5.0, "J": 2.0},
    "gain_mismatch": {"factor": 2.0},
    "quantisation": {"step": 0.1, "at": "loop"},
}


def weighed(**p):
    given = p or P
    return Posterior(
        {**dict.fromkeys(EFFECTS, 0.0), "none": 0.0, "unknown": 0.0, **given}, "process"
    )


def gap(before=4.0, after=1.0, *, value=0.9, lo=0.7, hi=0.95, resolvable=True):
    return Shrinkage(before, 3.0, after, 0.8, resolvable, value, lo, hi, {}, 1.1)


def situation(
    op=(45.0, 55.0), K=-1.5, *, integrating=False, known=True, faithful=True, mv=None, trusted=True
):
    pv = np.resize([1.0, -1.0], 100)
    return SimpleNamespace(
        op=np.resize(op, 100),
        data=SimpleNamespace(K=K),
        baseline=None,
        integrating=integrating,
        record=SimpleNamespace(pv=pv, mv=mv, notes=(), S_unit="%", n=100, Ts=1.0),
        law=SimpleNamespace(known=known),
        archive=SimpleNamespace(faithful=faithful),
        notes=["noted"],
        trusted=trusted,
    )


def assessed(*chosen, parameters=None, shown=(), s=None, rows=(), friction=0.5, alone=0.5):
    return SimpleNamespace(
        chosen=list(chosen),
        candidates={},
        parameters=NUMBERS if parameters is None else parameters,
        shown=lambda e: e in shown,
        situation=s or situation(),
        unexplained={"valve": "MV strays"},
        base=SimpleNamespace(theta={"noise_std": 0.1}, residual=np.array([1.0, -1.0])),
        rows=rows,
        friction=friction,
        valve_seen=False,
        mv_unexplained=False,
        friction_alone=alone,
    )


class Loops:
    """Closed loops by the effects in them: what each closes."""

    seed = 7

    def __init__(self, main=None, rivals=(), apart=None):
        self.main, self.rivals, self.shrunk, self.built = main or gap(), dict(rivals), [], []
        self.apart = apart

    def shrink(self, effects):
        self.shrunk.append(list(effects))
        return self.main

    def as_shown(self, block):
        return None

    def rival(self, effects, named):
        return self.rivals.get(tuple(effects))

    def loop(self, effects):
        self.built.append(list(effects))
        return tuple(effects)


@pytest.mark.parametrize(
    ("p", "chosen", "named"),
    [
        (P, ["stiction"], ["stiction"]),
        (P, ["stiction", "quantisation"], ["stiction", "quantisation"]),
        (P, ["quantisation", "stiction"], ["stiction", "quantisation"]),
        # one that was not found by itself is named alone
        (P, ["quantisation"], ["stiction"]),
        ({"none": 0.6, "stiction": 0.4}, ["stiction"], ["none"]),
        ({"unknown": 0.6, "stiction": 0.4}, ["stiction"], ["unknown"]),
    ],
)
def test_the_most_probable_is_named_and_a_second_of_another_block(p, chosen, named):
    assert name_effects(weighed(**p), assessed(*chosen)) == named


@pytest.fixture
def stubs(monkeypatch):
    seen = {}

    def tell_apart(ranking, mv_recorded):
        seen.update(probability={one.effect: one.probability for one in ranking})
        return "bump it"

    monkeypatch.setattr(reporting, "tell_apart", tell_apart)
    shown = Deniable(2.0)
    monkeypatch.setattr(reporting, "deniable", lambda view: shown)
    monkeypatch.setattr(reporting.resolve, "friction", lambda loop: [])
    monkeypatch.setattr(reporting, "find_look_alikes", lambda e, s, p: (e, str(p)))
    return seen


FAR = replace(
    gap(after=3.0, lo=-0.1),
    features={"op at rest": Compared(np.log(0.31), np.log(0.01), np.log(0.02), 9.0, 9.0)},
)


def test_an_effect_that_is_likely_is_named_however_far_the_simulation_stays(stubs):
    loops = Loops(FAR)
    answer = report(assessed("stiction"), weighed(stiction=0.97, none=0.03), loops)
    assert (answer.effect, answer.gap.near, answer.gap.after) == ("stiction", False, 3.0)
    assert loops.shrunk == [["stiction"]]
    # what remains is said beside it
    assert answer.remaining[0].recorded == pytest.approx(30.0)
    assert answer.conclusion.verdict == "stiction"
    assert answer.probability_of_stiction == pytest.approx(0.97)


def test_where_nothing_is_named_and_the_simulation_stays_far_the_answer_is_unknown(stubs):
    loops = Loops(FAR)
    answer = report(assessed("drift"), weighed(none=0.9, drift=0.1), loops)
    assert (answer.effect, answer.block, answer.named) == ("unknown", "controller", [])
    # the gap shown is that of the loop without an effect
    assert loops.shrunk[-1] == []
    assert answer.shrinkage is None
    assert answer.ranking[0].effect == "unknown"
    # nor is an effect in it that is not likelier than not, where it stays far
    loops = Loops(FAR)
    unlikely = report(assessed("drift"), weighed(drift=0.4, noise=0.3, none=0.3), loops)
    assert unlikely.effect == "unknown"
    assert loops.shrunk == [["drift"], []]
    # an effect that is named is the less probable
    named = report(assessed("drift"), weighed(drift=0.6, none=0.4), Loops(FAR))
    assert named.effect == "drift"
    assert named.ranking[0].probability < 0.5


def test_what_samples_prove_is_named_though_the_simulation_stays_far(stubs):
    known = (Evidence("quantisation", SAMPLES, 60.0),)
    found = assessed("quantisation", rows=known, shown=("quantisation",))
    answer = report(found, weighed(quantisation=0.45, deadband=0.4, none=0.15), Loops(FAR))
    assert answer.effect == "quantisation"


@pytest.mark.parametrize(("seen", "strays", "p"), [(1, 0, 0.1), (1, 1, 0.2), (0, 0, 0.2)])
def test_what_is_not_known_may_be_friction_unless_mv_shows_a_sound_valve(stubs, seen, strays, p):
    found = assessed()
    found.valve_seen, found.mv_unexplained = bool(seen), bool(strays)
    answer = report(found, weighed(unknown=0.9, stiction=0.1), Loops())
    assert answer.probability_of_stiction == pytest.approx(p)


def test_a_loop_file_that_contradicts_what_the_record_shows_by_itself_is_questioned(stubs):
    shown = (report(assessed(alone=p), weighed(none=1.0), Loops()) for p in (0.5, 0.95))
    reasons = [one.conclusion.reason for one in shown]
    assert ["by themselves say stiction" in reason for reason in reasons] == [False, True]


def test_an_interval_is_claimed_only_of_an_effect_and_a_gap(stubs):
    s = report(assessed("stiction"), weighed(), Loops(gap(lo=0.6, hi=0.93))).shrinkage
    assert (s["lo"], s["hi"]) == (0.6, 0.93)
    assert report(assessed(), weighed(none=1.0), Loops()).shrinkage is None
    unresolved = report(assessed("stiction"), weighed(), Loops(gap(value=None, resolvable=False)))
    assert unresolved.shrinkage is None
    assert (
        unresolved.notes[-1]
        == "the gap (4.00) does not stand out of its floor (0.80): no shrinkage is claimed"
    )


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
