"""Friction asked for alone is the friction that the whole diagnosis finds."""

from dataclasses import replace

import numpy as np
import pytest
from random_case import random_case

from simbench.gap import diagnose
from simbench.gap.candidates import Candidate
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.identified import plausible
from simbench.gap.intake.check import check
from simbench.gap.intake.identify import exact_controller, identify
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Spec
from simbench.gap.stiction import friction as module
from simbench.gap.stiction.friction import ENOUGH, FRICTION, OUTSIDE, friction, gains_of_halves
from simbench.gap.stiction.pace import at_its_pace

CASE = random_case(12)
SITUATION = check(CASE.record, CASE.baseline, trusted=False)


@pytest.mark.parametrize(("seed", "effects"), [(5, (FRICTION,)), (8, (OUTSIDE,)), (2, ("load_steps",))])
@pytest.mark.parametrize("known", [False, True])
def test_its_gain_and_size_are_those_of_the_diagnosis(seed, effects, known):
    case = random_case(seed, effects)
    alone, slow = friction(case.record, case.baseline if known else None).found, at_its_pace(case.record)
    whole = [diagnose(case.record, case.baseline if known else None).behind.found]
    if not known and slow is not case.record:
        whole.append(plausible(assess(check(slow, identify(slow, controller=exact_controller(case.record)), trusted=False))))
    best = max(whole, key=lambda found: found.log_likelihood_gains[FRICTION])
    # what is beyond doubt as sampled is not asked again
    if best.log_likelihood_gains[FRICTION] > ENOUGH:
        best = next(f for f in whole if f.log_likelihood_gains[FRICTION] > ENOUGH)
    assert alone.log_likelihood_gains[FRICTION] == pytest.approx(best.log_likelihood_gains[FRICTION], abs=1e-6)
    assert alone.parameters.get(FRICTION) == pytest.approx(best.parameters.get(FRICTION))


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_the_likelier_of_two_views_of_a_record_is_kept(monkeypatch, share):
    """Slips between samples are lost where samples are left out; what remains at full sampling must then be found."""
    record = random_case(5, (FRICTION,)).record
    slow = at_its_pace(record)
    assert slow is not record
    fitted = module._fitted
    asked = []

    def worse_at_pace(r, loop, given=()):
        asked.append(r.Ts)
        found = fitted(r, loop, given)
        gains = found.log_likelihood_gains | ({FRICTION: share * ENOUGH} if r.Ts == slow.Ts else {FRICTION: 0.8 * ENOUGH})
        return replace(found, log_likelihood_gains=gains)

    monkeypatch.setattr(module, "_fitted", worse_at_pace)
    assert friction(record).evidence.gain == pytest.approx(0.8 * ENOUGH)
    assert asked == [record.Ts, slow.Ts]


def test_what_single_samples_prove_is_proven_by_all_of_them(monkeypatch):
    record = random_case(5, (FRICTION,)).record
    step = 0.15 * float(np.std(record.pv))
    rounded = replace(record, pv=np.round(record.pv / step) * step)
    assert at_its_pace(rounded).n < rounded.n
    monkeypatch.setattr(module, "_as_it_is", lambda record: None)
    found = friction(rounded).found
    assert found.situation.proven["quantisation"]["step"] == pytest.approx(step)
    assert found.parameters["quantisation"] == found.situation.proven["quantisation"]
    assert found.situation.data.n == at_its_pace(rounded).n


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
    candidates = {"deadband": Candidate("deadband", fit, 20.0)}
    return Assessment(replace(SITUATION, data=data), base, candidates, {}, [], fit)


@pytest.mark.parametrize(("half", "shows"), [(False, True), (True, False)])
def test_each_half_says_for_itself_how_much_likelier_friction_is(half, shows):
    early, late = gains_of_halves(stuck_record(half), "deadband")
    assert late > 10.0
    assert (early > 10.0) == shows
