"""Without a trusted baseline: what the record alone can carry."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from random_case import random_case

from simbench.gap.candidates import Candidate
from simbench.gap.decide.assess import Assessment
from simbench.gap.decide.identified import plausible, remarks
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import meaningful
from simbench.loop.effects import EFFECTS

CASE = random_case(12)
SITUATION = check(CASE.record, CASE.baseline, trusted=False)
# OP from 40 to 60 %: all but a hundredth at either end is 19.6 %
WIDE = replace(SITUATION, op=np.linspace(40.0, 60.0, SITUATION.record.n), proven={})
FIT = SimpleNamespace(name="fit")


def assessment(
    gains, *, chosen=(), situation=WIDE, parameters=None, fitted=("stiction", "deadband")
):
    candidates = {e: Candidate(e, SimpleNamespace(name=e), gains.get(e, -3.0)) for e in fitted}
    given = {"stiction": {"S": 10.0, "J": 3.0}, "deadband": {"S": 10.0}} | (parameters or {})
    every = {**dict.fromkeys(EFFECTS, -3.0), **gains}
    return Assessment(
        situation, SimpleNamespace(name="base"), candidates, given, list(chosen), FIT, every
    )


def test_what_compares_with_a_plant_is_dropped():
    judged = plausible(
        assessment({"gain_mismatch": 40.0, "dead_time_mismatch": -50.0, "stiction": 20.0})
    )
    assert judged.log_likelihood_gains["gain_mismatch"] == -10.0
    assert judged.log_likelihood_gains["dead_time_mismatch"] == -50.0
    assert judged.log_likelihood_gains["stiction"] == 20.0
    assert judged.chosen == ["stiction"]
    assert judged.final.name == "stiction"
    assert meaningful(False, False).isdisjoint({"gain_mismatch", "dead_time_mismatch"})


def test_friction_is_chosen_only_where_the_valve_is_not_held_to_be_sound():
    gains = {"stiction": 20.0, "deadband": 30.0, "load_steps": 5.0}
    judged = plausible(assessment(gains), sticky=False)
    assert judged.chosen == ["load_steps"]
    assert judged.final.name == "base"
    assert judged.log_likelihood_gains["deadband"] == 30.0
    assert plausible(assessment(gains)).chosen == ["deadband", "load_steps"]


def test_two_effects_at_most_of_two_blocks_and_the_proven_first():
    gains = {
        "stiction": 20.0,
        "deadband": 30.0,
        "noise": -2.0,
        "outliers": 1000.0,
        "quantisation": 1000.0,
        "load_steps": 5.0,
        "drift": 0.0,
    }
    judged = plausible(
        assessment(
            gains,
            chosen=["noise", "quantisation", "outliers"],
            situation=replace(WIDE, proven={"quantisation": {}, "outliers": {}}),
        )
    )
    # an identified loop has the lattice of its record: that is no effect it lacks
    assert judged.chosen == ["outliers", "deadband"]
    assert plausible(assessment(gains)).chosen == ["outliers", "deadband"]
    three = plausible(assessment({"deadband": 30.0, "load_steps": 5.0, "outliers": 4.0}))
    assert three.chosen == ["deadband", "load_steps"]


def test_what_a_record_shows_besides_the_effects_is_noted():
    bare = replace(SITUATION, record=replace(SITUATION.record, process=None))
    kind = "integrating" if SITUATION.integrating else "self-regulating"
    assert f"process: not given; judged as {kind}, the likelier of the two" in remarks(bare)
    assert not [
        r
        for r in remarks(replace(bare, record=replace(bare.record, process=kind)))
        if r.startswith("process")
    ]
    coarse = replace(bare, record=replace(bare.record, op=np.round(bare.record.op)))
    assert [r for r in remarks(coarse) if r.startswith("op_quantisation: ")]
    assert plausible(assessment({}, situation=bare)).situation.notes[-1:] == remarks(bare)[-1:]
