"""What the probability of stiction is learned on: records as plants write them, and every simulator
counted the same.
"""

import numpy as np
import pytest
from random_case import random_case

from results.studies.plant import stiction_probability as study


@pytest.mark.parametrize("form", dict.fromkeys(study.FORMS))
def test_a_record_is_written_in_its_form(form):
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


def test_a_rule_is_scored_on_a_simulator_it_was_not_learned_on():
    rng = np.random.default_rng(0)
    rows = []
    for i in range(60):
        sticky = i % 2 == 0
        evidence = [20.0 * sticky + rng.normal(), 0.0, 1.0]
        rows.append(
            {
                "simulator": ("own", "refinery")[i // 30],
                "sticky": sticky,
                "form": "whole",
                "evidence": evidence,
            }
        )
    rule, y = study.RULES["gain"], np.array([r["sticky"] for r in rows])
    loss, area, _ = study.scores(study.left_out(rows, rule), y)
    assert area == 1.0
    assert loss < 0.2
    # a simulator whose labels are turned misleads the other, not itself
    turned = [r | {"sticky": not r["sticky"]} if r["simulator"] == "refinery" else r for r in rows]
    p = study.left_out(turned, rule)
    assert p[:30][y[:30]].max() < p[:30][~y[:30]].min()
    assert p[30:][y[30:]].min() > p[30:][~y[30:]].max()


def test_each_bin_of_the_probability_says_what_share_of_it_sticks():
    p = np.array([0.05] * 10 + [0.95] * 4 + [1.0] * 4)
    y = np.array([True] + [False] * 9 + [True] * 8)
    assert study.reliability(p, y) == [
        "  0.0 to 0.1: 1 of 10 (0.02 to 0.40) sticks",
        "  0.9 to 1.0: 8 of 8 (0.68 to 1.00) sticks",
    ]
