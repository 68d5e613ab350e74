"""What the probability of stiction is learned on: records as plants write them, and every simulator counted the same."""

from dataclasses import replace

import numpy as np
import pytest
from random_case import random_case

from results.studies.plant import stiction_probability as study
from results.studies.plant.stiction_probability import gains_of_halves
from simbench.gap.candidates import Candidate
from simbench.gap.decide.assess import Assessment
from simbench.gap.intake.check import check
from simbench.gap.likelihood import kernels
from simbench.gap.likelihood.engine import Engine
from simbench.gap.likelihood.model import Spec
from simbench.loop.simulate import simulate

CASE = random_case(12)
SITUATION = check(CASE.record, CASE.baseline, trusted=False)


@pytest.mark.parametrize("form", dict.fromkeys(study.FORMS))
def test_a_record_is_written_as_its_form_says(form):
    record = random_case(7, ("oscillation",)).record
    seen = study._recorded(record, form, np.random.default_rng(1))
    assert seen.n <= study.LONGEST
    changed = {
        "whole": seen.Ts == record.Ts,
        "window": seen.n < record.n,
        "seldom": seen.Ts >= record.Ts,
        "held": np.mean(np.diff(seen.pv) == 0.0) > 0.3,
        "small": 0.05 <= np.ptp(seen.op) <= 1.0,
    }
    assert changed[form]


@pytest.mark.parametrize("form", study.LOOP_FORMS)
def test_a_loop_is_run_again_as_its_form_says(form):
    loop = CASE.baseline
    rerun = [study._rerun(loop, simulate(loop, 1).record, kind, 1, np.random.default_rng(2)) for kind in (form, "whole")]
    assert rerun[0].n == rerun[1].n
    assert not np.array_equal(rerun[0].op, rerun[1].op)
    assert (np.ptp(rerun[0].sp) > np.ptp(rerun[1].sp)) == (form == "moves")


def test_every_simulator_and_both_labels_weigh_the_same():
    y, at = np.array([True, True, True, False, True, False]), ["a", "a", "a", "a", "b", "b"]
    w = study.balanced(y, at)
    assert w.sum() == pytest.approx(6.0)
    assert w[:3].sum() == pytest.approx(w[3]) == pytest.approx(w[4])


def test_a_rule_is_scored_on_a_simulator_it_was_not_learned_on():
    rng = np.random.default_rng(0)
    rows = []
    for i in range(60):
        sticky = i % 2 == 0
        evidence = [20.0 * sticky + rng.normal(), 0, [0, 0], 1, [0, 0]]
        rows.append({"simulator": ("own", "mill")[i // 30], "sticky": sticky, "form": "whole", "evidence": evidence})
    rule, y = study.RULES["gain"], np.array([r["sticky"] for r in rows])
    loss, area, _ = study.scores(study.left_out(rows, rule), y)
    assert area == 1.0
    assert loss < 0.2
    # a simulator whose labels are turned misleads the other, not itself
    turned = [r | {"sticky": not r["sticky"]} if r["simulator"] == "mill" else r for r in rows]
    p = study.left_out(turned, rule)
    assert p[:30][y[:30]].max() < p[:30][~y[:30]].min()
    assert p[30:][y[30:]].min() > p[30:][~y[30:]].max()


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
