"""An answer whose simulations stay far from the record gives way to `unknown`."""

from types import SimpleNamespace

import pytest

from simbench.gap.closed_loop.gap import Shrinkage
from simbench.gap.decide.classify import Classified
from simbench.gap.decide.closure import (
    misfit,
    nothing_to_explain,
    with_closure,
    with_nothing,
)
from simbench.loop.effects import EFFECTS


def assessed(trusted=True, shown=()):
    return SimpleNamespace(
        situation=SimpleNamespace(trusted=trusted), shown=lambda effect: effect in shown
    )


def shrinkage(after, lo=-0.2):
    return Shrinkage(4.0, 3.0, after, 0.8, True, 0.5, lo, 0.9, {}, 1.0)


@pytest.mark.parametrize("trusted", [True, False])
@pytest.mark.parametrize(("effects", "after", "lo", "ratio"), [
    (["stiction"], 1.5, -0.2, 0.0),  # near the record
    (["stiction"], 3.0, -0.2, 2.0),
    (["stiction"], 3.0, 0.1, 0.0),  # it answers for the part that it closes
    ([], 1.4, -0.2, 0.0),
    ([], 3.0, 0.1, 2.0),  # refitting closes some of it, but something is missing
])  # fmt: skip
def test_a_gap_beyond_one_and_a_half_plant_floors_speaks_against_an_answer(
    trusted, effects, after, lo, ratio
):
    assert misfit(assessed(trusted), effects, shrinkage(after, lo)) == ratio


def test_what_single_samples_show_beside_a_given_plant_needs_no_simulation():
    far = shrinkage(3.0)
    assert misfit(assessed(shown=["saturation"]), ["saturation"], far) == 0.0
    assert misfit(assessed(False, shown=["saturation"]), ["saturation"], far) == 2.0


def test_unknown_takes_more_than_half_and_the_others_keep_their_odds():
    p = dict.fromkeys(EFFECTS, 0.0) | {"stiction": 0.9, "none": 0.06, "unknown": 0.04}
    weights = with_closure(Classified(p, "process"), 2.0, "sensor")
    assert sum(weights.probability.values()) == pytest.approx(1.0)
    assert max(weights.probability, key=weights.probability.get) == "unknown"
    assert weights.probability["stiction"] / weights.probability["none"] == pytest.approx(15.0)
    assert weights.block("unknown") == "sensor"
    # the farther, the surer
    assert with_closure(Classified(p, "process"), 8.0, "").probability["unknown"] > 0.8


def test_an_effect_needs_a_gap_to_explain_unless_single_samples_show_it_or_it_is_friction():
    near = Shrinkage(0.48, 0.5, 0.45, 0.62, False, None, 0.0, 0.0, {}, 0.7)
    assert nothing_to_explain(assessed(), ["oscillation"], near)
    assert not nothing_to_explain(assessed(), [], near)
    assert not nothing_to_explain(assessed(), ["oscillation"], shrinkage(1.0))
    assert not nothing_to_explain(assessed(shown=["saturation"]), ["saturation"], near)
    assert not nothing_to_explain(assessed(), ["stiction"], near)


def test_where_nothing_is_to_explain_the_effects_give_way_to_none_and_friction_stays():
    p = dict.fromkeys(EFFECTS, 0.0) | {
        "oscillation": 0.7, "stiction": 0.1, "none": 0.15, "unknown": 0.05,
    }  # fmt: skip
    weights = with_nothing(Classified(p, "sensor")).probability
    assert sum(weights.values()) == pytest.approx(1.0)
    assert weights["none"] == pytest.approx(0.85)
    assert (weights["stiction"], weights["oscillation"]) == (0.1, 0.0)
