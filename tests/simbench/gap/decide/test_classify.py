"""From gains to probabilities: they sum to one, have no unit, and every constant moves only what it
should.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from random_case import random_case

from simbench.gap.decide.assess import RESIDUAL_LIMITS, Assessment, assess
from simbench.gap.decide.classify import PLAIN_SECOND_NATS, SECOND_EFFECT_NATS, classify
from simbench.gap.intake.check import check
from simbench.gap.thresholds import LEAST_NATS, TEMPERATURE
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of

CASES = {"mv": (8, ("oscillation",), True), "blind": (12, ("gain_mismatch",), False)}


@cache
def assessed(name: str) -> Assessment:
    seed, effects, mv = CASES[name]
    case = random_case(seed, effects, mv=mv)
    return assess(check(case.record.window(0, 500), case.baseline))


@pytest.fixture(params=list(CASES))
def case(request) -> Assessment:
    return assessed(request.param)


def quiet(case: Assessment, **gains: float) -> Assessment:
    """Return the assessment with no residual test failing and all gains but those given at -3."""
    return replace(
        case,
        situation=replace(case.situation, unexplained_law="", frozen=False),
        tests=dict.fromkeys(case.tests, 0.0),
        mv_unexplained=False,
        chosen=list(gains)[:1],
        log_likelihood_gains_on_top=dict.fromkeys(EFFECTS, -3.0),
        log_likelihood_gains={**dict.fromkeys(EFFECTS, -3.0), **gains},
    )


def test_probabilities_are_in_the_contracts_order_and_sum_to_one(case):
    p = classify(case).probability
    assert list(p) == [*EFFECTS, NONE, UNKNOWN]
    assert sum(p.values()) == pytest.approx(1.0)
    assert min(p.values()) >= 0.0


def test_friction_keeps_its_probability_where_its_gains_are_too_low_for_numbers(case):
    low = {"stiction": -1e6, "deadband": -1e5}
    far = replace(quiet(case, noise=9.0), stiction=0.01)
    far = replace(far, situation=replace(far.situation, trusted=False))
    far.log_likelihood_gains.update(low)
    p = classify(far).probability
    assert p["stiction"] == p["deadband"] == pytest.approx(0.005)
    assert list(p) == [*EFFECTS, NONE, UNKNOWN]
    assert sum(p.values()) == pytest.approx(1.0)


def test_an_effect_is_as_likely_as_none_at_the_price_of_asking(case):
    p = classify(quiet(case, noise=LEAST_NATS)).probability
    assert p["noise"] == pytest.approx(p[NONE])
    assert p["noise"] > 3 * p["drift"]


@pytest.mark.parametrize("level", [10.0, 800.0])
def test_a_nat_of_lead_counts_by_the_temperature_whatever_both_gained(case, level):
    p = classify(quiet(case, noise=level, drift=level - 2.0)).probability
    assert np.log(p["noise"] / p["drift"]) == pytest.approx(2 * TEMPERATURE)


def test_unknown_is_even_where_the_best_model_just_fails_a_test_and_takes_from_all_alike(case):
    sound = quiet(case, noise=20.0, drift=15.0)
    failing = replace(sound, tests={**sound.tests, "memory": RESIDUAL_LIMITS["memory"][0]})
    one, other = classify(sound), classify(failing)
    assert other.probability[UNKNOWN] == pytest.approx(0.5)
    assert other.probability["noise"] / other.probability["drift"] == pytest.approx(
        one.probability["noise"] / one.probability["drift"]
    )
    assert one.probability[UNKNOWN] < 0.01
    assert other.unknown_block == RESIDUAL_LIMITS["memory"][1]


def test_what_needs_no_statistics_makes_the_answer_unknown_and_gives_its_block(case):
    strange = quiet(case, noise=100.0)
    strange = replace(
        strange, situation=replace(strange.situation, unexplained_law="OP stands still")
    )
    weights = classify(strange)
    assert max(weights.probability, key=lambda e: weights.probability[e]) == UNKNOWN
    assert weights.block(UNKNOWN) == "controller"
    assert strange.worst_test[0] > 1.0


def test_a_second_effect_follows_the_first_by_what_it_brings_on_top(case):
    alone = quiet(case, noise=40.0)
    rows = []
    for nats in (-3.0, 3.0, 9.0, 16.0, 200.0):
        on_top = {**alone.log_likelihood_gains_on_top, "stiction": nats}
        p = classify(replace(alone, log_likelihood_gains_on_top=on_top)).probability
        rows.append(p["stiction"] / p["noise"])
        if nats > 0.0:
            assert sorted(EFFECTS, key=lambda e: -p[e])[:2] == ["noise", "stiction"]
    assert np.diff(rows).min() > -1e-12
    assert rows[-1] == pytest.approx(rows[-2])
    assert 0.1 < rows[-1] < 0.5
    assert rows[0] < 0.01


def test_no_second_effect_of_the_first_ones_block_follows_it(case):
    alone = quiet(case, noise=40.0)
    on_top = {**alone.log_likelihood_gains_on_top, "outliers": 30.0}
    p = classify(replace(alone, log_likelihood_gains_on_top=on_top)).probability
    assert p["outliers"] / p["noise"] < 1e-4


def test_with_an_effect_that_needs_no_fit_every_gain_came_on_top(case):
    proven = quiet(case, quantisation=1000.0, stiction=15.0)
    p = classify(replace(proven, log_likelihood_gains_on_top={})).probability
    assert p["stiction"] / p["quantisation"] == pytest.approx(
        np.exp(-TEMPERATURE * (SECOND_EFFECT_NATS + PLAIN_SECOND_NATS - 15.0))
    )


def test_residual_tests_do_not_judge_a_plant_that_was_identified(case):
    loose = quiet(case, noise=12.0)
    loose = replace(
        loose,
        situation=replace(loose.situation, trusted=False),
        tests=dict.fromkeys(case.tests, 1e3),
    )
    p = classify(loose).probability
    assert max(p, key=lambda a: p[a]) == "noise"
    assert p[UNKNOWN] < 0.01


def test_the_blocks_shares_are_the_sums_of_what_lies_in_them(case):
    weights = classify(quiet(case, noise=12.0, drift=10.0))
    p = weights.probability
    sums = {b: sum(p[e] for e in EFFECTS if block_of(e) == b) for b in BLOCKS}
    sums[weights.unknown_block] += p[UNKNOWN]
    whole = sum(sums.values())
    assert weights.shares == pytest.approx({b: v / whole for b, v in sums.items()})
    assert set(classify(quiet(case)).shares.values()) == {0.0}
    assert LEAST_NATS > np.log(len(EFFECTS))


def test_unknown_is_never_the_answer_while_no_test_fails(case):
    even = quiet(case, **dict.fromkeys(list(EFFECTS)[:8], 12.0))
    near = replace(even, tests={**even.tests, "memory": 0.9 * RESIDUAL_LIMITS["memory"][0]})
    p = classify(near).probability
    assert max(p, key=lambda e: p[e]) != UNKNOWN
    assert sum(p.values()) == pytest.approx(1.0)
