"""From rows of evidence to probabilities: they sum to one, have no unit, and every constant moves
only what it should.
"""

import numpy as np
import pytest

from simbench.gap.decide.evidence import ALONE, LAW, MV, PV, SAMPLES, Evidence, known_by, nats_of
from simbench.gap.decide.posterior import Posterior, posterior
from simbench.gap.effects import is_friction
from simbench.gap.thresholds import (
    AFAR,
    DENIED_BELOW,
    EDGE,
    LEAST_NATS,
    OF_TWO,
    SECOND_NATS,
    TEMPERATURE,
    TERM_NATS,
)
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN, block_of

SOUND = (0.005, "disturbance")


def rows(**nats):
    return [Evidence(effect, PV, gain) for effect, gain in nats.items()]


def weighed(on_top=None, worst=SOUND, friction=None, known=(), **nats):
    """Return the posterior of effects that PV speaks for; the first is the strongest."""
    shown = [Evidence(e, SAMPLES, TERM_NATS) for e in known]
    first = known[0] if known else max(nats, key=lambda e: nats[e], default=NONE)
    return posterior([*shown, *rows(**nats)], first, {first: on_top or {}}, worst, friction)


def test_rows_of_one_effect_add_up_and_law_and_samples_are_known():
    every = [
        Evidence("drift", PV, 9.0),
        Evidence("drift", PV, -4.0),
        Evidence("detuning", LAW, TERM_NATS),
        Evidence("outliers", SAMPLES, TERM_NATS),
        Evidence("deadband", MV, 30.0),
        Evidence("outliers", SAMPLES, TERM_NATS),
    ]
    assert nats_of(every)["drift"] == 5.0
    assert known_by(every) == ["detuning", "outliers"]


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


def test_an_effect_is_as_likely_as_none_at_the_price_of_asking():
    p = weighed(noise=LEAST_NATS, drift=2.0).probability
    assert p["noise"] == pytest.approx(p[NONE])
    assert p["noise"] > 3 * p["drift"]


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


def test_friction_beside_what_is_known_keeps_its_own_probability():
    w = weighed(known=("quantisation",), stiction=80.0, deadband=60.0)
    assert w.first == "stiction"
    assert w.friction > 0.97
    assert w.probability["stiction"] / w.probability["deadband"] > 100
    weak = weighed(known=("quantisation",), stiction=float(SECOND_NATS))
    assert weak.friction == pytest.approx(0.5, abs=0.02)
    # what another effect explains better is no friction
    other = weighed(known=("quantisation",), stiction=40.0, load_steps=73.0)
    assert other.friction < 0.02


def test_a_second_effect_follows_the_first_by_what_it_brings_on_top():
    shares = []
    for nats in (-3.0, 3.0, 12.0, 16.0, 200.0):
        w = weighed({"outliers": nats}, drift=40.0)
        assert w.first == "drift"
        shares.append(w.probability["outliers"] / w.probability["drift"])
    assert np.diff(shares).min() > 0.0
    assert shares[0] < 0.01
    assert shares[-1] == pytest.approx(OF_TWO / (1.0 - OF_TWO), rel=0.01)


def test_friction_on_top_of_the_first_effect_is_probable_by_what_it_brings():
    little, even, much = (
        weighed({"stiction": nats}, drift=90.0).friction for nats in (3.0, float(SECOND_NATS), 40.0)
    )
    assert little < 0.06
    assert even == pytest.approx(0.5, abs=0.01)
    assert much == pytest.approx(0.99, abs=0.01)


def test_friction_has_the_probability_that_it_is_given_and_nats_divide_it():
    w = weighed(friction=0.97, stiction=8.0, deadband=12.0, drift=90.0)
    assert w.friction == pytest.approx(0.97)
    assert w.first == "deadband"
    odds = w.probability["deadband"] / w.probability["stiction"]
    assert np.log(odds) == pytest.approx(4.0 * TEMPERATURE)


def test_friction_that_is_weighed_apart_takes_nothing_from_the_odds_of_the_others():
    """However well it fits PV, what it does not explain is not left to unknown."""
    w = posterior(rows(stiction=300.0, drift=2.0), "drift", {}, SOUND, 0.2)
    assert w.friction == pytest.approx(0.2)
    assert w.first == NONE
    assert w.probability[UNKNOWN] < 0.02
    odds = w.probability[NONE] / w.probability["drift"]
    assert np.log(odds) == pytest.approx(TEMPERATURE * (LEAST_NATS - 2.0))
    # of a likely one the second effect follows by what it brings on top
    on_top = {"drift": 90.0, "noise": 3.0}
    seen = rows(stiction=300.0, drift=2.0, noise=2.0)
    sure = posterior(seen, "stiction", {"stiction": on_top}, SOUND, 0.97)
    ranking = sorted(EFFECTS, key=lambda e: -sure.probability[e])
    assert ranking[:2] == ["stiction", "drift"]


def test_where_something_is_unknown_friction_is_what_op_and_pv_show_by_themselves():
    seen = [*rows(stiction=60.0), Evidence("stiction", ALONE, 9.0)]
    by_model = posterior(rows(stiction=60.0), "stiction", {}, (0.8, "process"))
    both = posterior(seen, "stiction", {}, (0.8, "process"))
    alone = 1.0 / (1.0 + np.exp(-TEMPERATURE * 9.0))
    assert by_model.friction == pytest.approx(0.2 * EDGE)
    assert both.friction == pytest.approx(0.2 * EDGE + 0.8 * alone)


def test_an_effect_that_is_not_likelier_than_not_is_unknown_far_from_the_record_unless_known():
    w = weighed(drift=12.0, noise=11.5)
    assert w.first == "drift"
    assert w.probability["drift"] < 0.5
    assert w.afar(9.0, "sensor", known=False).first == UNKNOWN
    assert w.afar(9.0, "sensor", known=True).first == "drift"


def test_a_rival_that_needs_friction_beside_it_does_not_deny_friction():
    seen = rows(stiction=60.0, load_steps=60.0)
    alone = posterior(seen, "stiction", {"stiction": {}}, SOUND)
    assert alone.friction < 0.6
    brought = {"stiction": 40.0, "gain_mismatch": 5.0}
    both = posterior(seen, "stiction", {"stiction": {}, "load_steps": brought}, SOUND)
    assert both.friction > 0.9
    assert sum(both.probability.values()) == pytest.approx(1.0)


# a softmax of some of these is 0, of others less than the smallest normal number
@pytest.mark.parametrize("nats", [-1e6, -2100.0, -2060.0, -2054.0, -2050.0, -1950.0])
def test_friction_keeps_its_probability_where_its_gains_are_too_low_for_numbers(nats):
    w = weighed(friction=0.01, stiction=nats, deadband=nats + 3.0, noise=9.0)
    assert w.friction == pytest.approx(0.01)
    seen = weighed(stiction=nats, deadband=nats + 3.0, noise=9.0).with_friction(0.2)
    assert seen.friction == pytest.approx(0.2)
    assert sum(seen.probability.values()) == pytest.approx(1.0)


def test_friction_that_cannot_be_denied_is_never_denied_by_rounding():
    rng = np.random.default_rng(7)
    for nats in rng.uniform(-8.0, 3.0, (300, 3)):
        w = weighed(stiction=nats[0], deadband=nats[1], deadzone=nats[2], noise=9.0)
        assert w.with_friction(DENIED_BELOW).friction >= DENIED_BELOW


def test_a_share_of_friction_leaves_the_others_their_odds():
    w = weighed(stiction=3.0, drift=12.0, noise=9.0)
    more = w.with_friction(0.5)
    assert more.friction == pytest.approx(0.5)
    assert sum(more.probability.values()) == pytest.approx(1.0)
    ratio = w.probability["drift"] / w.probability["noise"]
    assert more.probability["drift"] / more.probability["noise"] == pytest.approx(ratio)


@pytest.mark.parametrize("times", [1.01, 2.0, 50.0])
@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_far_from_the_record_none_is_unknown_and_friction_keeps_its_share(times, friction):
    w = weighed(worst=(0.0, "process"), friction=friction, stiction=2.0, drift=3.0, noise=2.0)
    assert w.first == NONE
    far = w.afar(times, "sensor", known=False)
    assert (far.probability[UNKNOWN] > far.probability[NONE]) == (times > 1.8)
    assert far.block(UNKNOWN) == "sensor"
    assert far.friction == pytest.approx(friction)
    assert sum(far.probability.values()) == pytest.approx(1.0)
    assert far.probability["drift"] > 0.0


@pytest.mark.parametrize("times", [1.0, 1.5, 9.0])
def test_an_effect_that_is_named_afar_is_less_probable_and_still_the_first(times):
    w = weighed(worst=(0.1, "process"), stiction=4.0, drift=30.0, noise=20.0)
    away = w.afar(times, "process", known=False)
    assert away.first == "drift"
    assert sum(away.probability.values()) == pytest.approx(1.0)
    assert away.friction == pytest.approx(w.friction)
    odds = [x.probability[UNKNOWN] / (1.0 - x.friction - x.probability[UNKNOWN]) for x in (w, away)]
    assert odds[1] == pytest.approx(min(odds[0] * times**AFAR, odds[1]))
    if times < 2.0:
        assert odds[1] / odds[0] == pytest.approx(times**AFAR)


def test_shares_are_the_sums_of_what_lies_in_each_block_and_unknown_has_its_own():
    w = weighed(noise=12.0, drift=10.0, stiction=9.0)
    p = w.probability
    sums = {b: sum(p[e] for e in EFFECTS if block_of(e) == b) for b in BLOCKS}
    sums[UNKNOWN] = p[UNKNOWN]
    whole = sum(sums.values())
    assert w.shares == pytest.approx({b: v / whole for b, v in sums.items()})
    assert set(weighed(noise=-3.0).shares.values()) == {0.0}


def test_only_what_rests_within_a_band_is_friction():
    assert [e for e in (*EFFECTS, NONE, UNKNOWN) if is_friction(e)] == ["stiction", "deadband"]
    assert Posterior({"stiction": 0.5, "deadband": 0.2, NONE: 0.3}, "valve").friction == 0.7
