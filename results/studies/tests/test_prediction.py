"""The study of predictions: what it tries, what the true loop then does, and what it counts."""

import numpy as np
import pytest

from results.studies.prediction import changes, judged, truth
from results.studies.worlds import load_world


@pytest.mark.parametrize("world", ["own", pytest.param("refinery", marks=pytest.mark.slow)])
def test_the_true_loop_runs_under_the_settings_that_are_predicted(world):
    item = load_world(world).draw(5, 0, {"kind": "none", "mv": False})
    assert changes(item)["Kc / 2"] == (0.5, 0.0)
    as_it_was, softer = (truth(item, world, ratio, 0.0) for ratio in (1.0, 0.5))
    # the same loop again, but for its load; a softer controller moves OP less
    assert 0.3 < np.median([m["pv_std"] for m in as_it_was]) / np.std(item.columns["pv"]) < 3.0
    assert np.mean([m["op_travel_per_hour"] for m in softer]) < np.mean(
        [m["op_travel_per_hour"] for m in as_it_was]
    )


def row(value, period, fresh_period):
    interval = {"value": value, "lo": 0.9 * value, "hi": 1.1 * value}
    cycle = None if period is None else {"value": period, "lo": 0.9 * period, "hi": 1.1 * period}
    fresh = [
        {"pv_std": 1.0, "op_std": 1.0, "op_travel_per_hour": 1.0, "period_s": fresh_period}
    ] * 4
    predicted = {
        "pv_std": interval,
        "op_std": interval,
        "op_travel_per_hour": interval,
        "period_s": cycle,
    }
    return {
        "world": "own",
        "kind": "none",
        "change": "Kc / 2",
        "refused": False,
        **predicted,
        "truth": fresh,
    }


def test_an_answer_is_right_where_both_numbers_are_near_or_nothing_oscillates():
    assert judged(row(1.05, 50.0, 52.0))["right"]
    assert judged(row(1.05, None, np.nan))["right"]
    assert not judged(row(1.15, None, np.nan))["right"]
    assert not judged(row(1.05, 50.0, np.nan))["right"]
    assert not judged(row(1.05, None, 50.0))["right"]
    assert not judged(row(1.05, 50.0, 60.0))["right"]


def test_further_records_are_judged_as_the_prediction_is():
    one = row(1.05, None, np.nan)
    # the second half: their mean is as far off as the first of them is not
    one["truth"][2:] = [{**one["truth"][0], "pv_std": x} for x in (1.0, 2.0)]
    judgement = judged(one)
    assert judgement["right"]
    assert judgement["measured"]
    assert not judgement["known"]
