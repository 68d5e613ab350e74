"""From rows of evidence to probabilities: they sum to one, have no unit, and every constant moves
only what it should.
"""

import numpy as np
import pytest

from simbench.gap.decide.posterior import PV, SAMPLES, Evidence, posterior
from simbench.gap.thresholds import (
    DENIED_BELOW,
    OF_TWO,
    SECOND_NATS,
    TEMPERATURE,
    TERM_NATS,
)
from simbench.loop.effects import EFFECTS, NONE, UNKNOWN

SOUND = (0.005, "disturbance")


def rows(**nats):
    return [Evidence(effect, PV, gain) for effect, gain in nats.items()]


def weighed(on_top=None, worst=SOUND, friction=None, known=(), **nats):
    """Return the posterior of effects that PV speaks for; the first is the strongest."""
    shown = [Evidence(e, SAMPLES, TERM_NATS) for e in known]
    first = known[0] if known else max(nats, key=lambda e: nats[e], default=NONE)
    return posterior([*shown, *rows(**nats)], first, {first: on_top or {}}, worst, friction)


@pytest.mark.parametrize("known", [(), ("quantisation",), ("detuning", "outliers")])
@pytest.mark.parametrize("friction", [None, 0.0, 0.3, 0.97])
@pytest.mark.parametrize("unknown", [0.0, 0.4, 0.8])
def test_probabilities_are_in_the_contracts_order_and_sum_to_one(known, friction, unknown):
    w = weighed({"drift": 20.0}, (unknown, "process"), friction, known, stiction=60.0, drift=9.0)
    assert list(w.probability) == [*EFFECTS, NONE, UNKNOWN]
    assert sum(w.probability.values()) == pytest.approx(1.0)
    assert min(w.probability.values()) >= 0.0
    if friction is not None:
        assert w.friction == pytest.approx(friction)


def test_no_evidence_is_none():
    w = posterior([], NONE, {}, SOUND)
    assert w.first == NONE
    assert w.probability[NONE] > 0.99
    assert weighed(noise=3.0, drift=-2.0).probability["stiction"] == 0.0


@pytest.mark.parametrize("level", [10.0, 800.0])
def test_a_nat_of_lead_counts_by_the_temperature_whatever_both_gained(level):
    p = weighed(noise=level, drift=level - 2.0).probability
    assert np.log(p["noise"] / p["drift"]) == pytest.approx(2 * TEMPERATURE)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_unknown_has_what_a_test_gives_it_and_takes_from_all_alike(share):
    one, other = (weighed(worst=(q, "sensor"), noise=20.0, drift=15.0) for q in (0.0, share))
    p, q = one.probability, other.probability
    assert q[UNKNOWN] == pytest.approx(share)
    assert q["noise"] / q["drift"] == pytest.approx(p["noise"] / p["drift"])
    assert p[UNKNOWN] == 0.0
    assert other.block(UNKNOWN) == "sensor"


def test_unknown_is_never_the_answer_while_no_test_fails_or_where_an_effect_is_known():
    even = dict.fromkeys(list(EFFECTS)[2:10], 12.0)
    assert weighed(worst=(0.49, "process"), **even).first != UNKNOWN
    assert weighed(worst=(0.51, "process"), **even).first == UNKNOWN
    assert weighed(worst=(0.9, "process"), known=("quantisation",)).first == "quantisation"


def test_what_is_known_takes_the_place_of_none():
    p = weighed(known=("quantisation",), drift=3.0).probability
    assert p[NONE] == 0.0
    assert p["quantisation"] > 0.9
    # an effect beside it counts for its share of the two
    even = weighed(known=("quantisation",), drift=float(SECOND_NATS)).probability
    assert even["drift"] == pytest.approx(0.5 * OF_TWO, rel=0.02)
    much = weighed(known=("quantisation",), drift=200.0).probability
    assert much["drift"] == pytest.approx(OF_TWO, rel=0.02)


def test_friction_has_the_probability_that_it_is_given_and_nats_divide_it():
    w = weighed(friction=0.97, stiction=8.0, deadband=12.0, drift=90.0)
    assert w.friction == pytest.approx(0.97)
    assert w.first == "deadband"
    odds = w.probability["deadband"] / w.probability["stiction"]
    assert np.log(odds) == pytest.approx(4.0 * TEMPERATURE)


def test_an_effect_that_is_not_likelier_than_not_is_unknown_far_from_the_record_unless_known():
    w = weighed(drift=12.0, noise=11.5)
    assert w.first == "drift"
    assert w.probability["drift"] < 0.5
    assert w.afar(9.0, "sensor", known=False).first == UNKNOWN
    assert w.afar(9.0, "sensor", known=True).first == "drift"


def test_friction_that_cannot_be_denied_is_never_denied_by_rounding():
    rng = np.random.default_rng(7)
    for nats in rng.uniform(-8.0, 3.0, (300, 3)):
        w = weighed(stiction=nats[0], deadband=nats[1], deadzone=nats[2], noise=9.0)
        assert w.with_friction(DENIED_BELOW).friction >= DENIED_BELOW
