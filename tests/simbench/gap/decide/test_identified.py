"""Without a trusted baseline: what the record alone can carry, and what must show in both of its halves."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from random_case import random_case

from simbench.gap.candidates import Candidate
from simbench.gap.decide import identified
from simbench.gap.decide.assess import FAINT, Assessment
from simbench.gap.decide.identified import in_both_halves, plausible, remarks
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import meaningful
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Spec
from simbench.loop.effects import EFFECTS

CASE = random_case(12)
SITUATION = check(CASE.record, CASE.baseline, trusted=False)
# OP from 40 to 60 %: all but a hundredth at either end is 19.6 %
WIDE = replace(SITUATION, op=np.linspace(40.0, 60.0, SITUATION.record.n), proven={})
FIT = SimpleNamespace(name="fit")


def found(gains, *, chosen=(), situation=WIDE, parameters=None, fitted=("stiction", "deadband")):
    candidates = {e: Candidate(e, SimpleNamespace(name=e), gains.get(e, -3.0)) for e in fitted}
    given = {"stiction": {"S": 10.0, "J": 3.0}, "deadband": {"S": 10.0}} | (parameters or {})
    every = {**dict.fromkeys(EFFECTS, -3.0), **gains}
    return Assessment(situation, SimpleNamespace(name="base"), candidates, given, list(chosen), FIT, every)


@pytest.fixture
def both(monkeypatch):
    monkeypatch.setattr(identified, "in_both_halves", lambda *a: True)


def test_what_compares_with_a_plant_is_dropped(both):
    judged = plausible(found({"gain_mismatch": 40.0, "dead_time_mismatch": -50.0, "stiction": 20.0}))
    assert judged.log_likelihood_gains["gain_mismatch"] == -10.0
    assert judged.log_likelihood_gains["dead_time_mismatch"] == -50.0
    assert judged.log_likelihood_gains["stiction"] == 20.0
    assert judged.chosen == ["stiction"]
    assert judged.final.name == "stiction"
    assert meaningful(False, False).isdisjoint({"gain_mismatch", "dead_time_mismatch"})


@pytest.mark.parametrize(("band", "kept"), [(2.8, False), (3.1, True)])
@pytest.mark.parametrize("effect", ["stiction", "deadband"])
def test_friction_spans_a_good_part_of_ops_range(both, effect, band, kept):
    # 0.15 of 19.6 %
    judged = plausible(found({effect: 20.0}, parameters={effect: {"S": band, "J": 1.0}}))
    assert judged.log_likelihood_gains[effect] == (20.0 if kept else FAINT)
    assert judged.chosen == ([effect] if kept else [])
    assert judged.final.name == (effect if kept else "base")


def test_friction_shows_in_both_halves_or_in_mv(monkeypatch):
    monkeypatch.setattr(identified, "in_both_halves", lambda found, effect: effect == "stiction")
    assert plausible(found({"stiction": 20.0})).chosen == ["stiction"]
    assert plausible(found({"deadband": 20.0})).chosen == []
    seen = replace(WIDE, record=replace(WIDE.record, mv=WIDE.op))
    narrow = {"deadband": {"S": 0.1}}
    assert plausible(found({"deadband": 20.0}, situation=seen, parameters=narrow)).chosen == ["deadband"]


def test_two_effects_at_most_of_two_blocks_and_the_proven_first(both):
    gains = {"stiction": 20.0, "deadband": 30.0, "noise": -2.0, "quantisation": 1000.0, "load_steps": 5.0, "drift": 0.0}
    judged = plausible(found(gains, chosen=["noise", "quantisation"], situation=replace(WIDE, proven={"quantisation": {}})))
    assert judged.chosen == ["quantisation", "deadband"]
    assert plausible(found(gains)).chosen == ["quantisation", "deadband"]
    three = plausible(found({"deadband": 30.0, "load_steps": 5.0, "quantisation": 4.0}))
    assert three.chosen == ["deadband", "load_steps"]


def test_what_a_record_shows_beside_the_effects_is_said():
    bare = replace(SITUATION, record=replace(SITUATION.record, process=None))
    kind = "integrating" if SITUATION.integrating else "self-regulating"
    assert f"process: not given; judged as {kind}, the likelier of the two" in remarks(bare)
    assert not [r for r in remarks(replace(bare, record=replace(bare.record, process=kind))) if r.startswith("process")]
    coarse = replace(bare, record=replace(bare.record, op=np.round(bare.record.op)))
    assert [r for r in remarks(coarse) if r.startswith("op_quantisation: ")]
    assert plausible(found({}, situation=bare)).situation.notes[-1:] == remarks(bare)[-1:]


N = 1200


def stuck_record(half):
    """Return a plant behind a dead-band of 6 % in all, or only the second half, of a record, and the engine's fit of it."""
    rng = np.random.default_rng(0)
    u = 50.0 + 6.0 * np.sin(np.arange(N) / 21.0) + 2.0 * np.sin(np.arange(N) / 57.0)
    v = kernels.valve(u, kernels.PLAY, 6.0, 0.0, 0.0)
    if half:
        v[: N // 2] = u[: N // 2]
    y = 1.5 * kernels.plant(v, 12.0, 3.0, 0.0) + 0.2 * rng.standard_normal(N)
    data = replace(SITUATION.data, u=u, y=y, K=1.5, T=12.0, Td=3.0, noise=0.0, trusted=False)
    engine = Engine(data, 60.0)
    base = engine.fit(Spec(), engine.start(), steps=20)
    fit = engine.at(base.spec.join(Spec(valve=kernels.PLAY)), {**base.theta, "T": 12.0, "Td": 3.0, "S": 6.0})
    return found({"deadband": 20.0}, situation=replace(WIDE, data=data)), base, fit


@pytest.mark.parametrize(("half", "both_show"), [(False, True), (True, False)])
def test_a_band_explains_each_half_or_is_none(half, both_show):
    assessed, base, fit = stuck_record(half)
    assessed = replace(assessed, base=base, candidates={"deadband": Candidate("deadband", fit, 20.0)})
    assert in_both_halves(assessed, "deadband") == both_show
    assert not in_both_halves(assessed, "stiction")
