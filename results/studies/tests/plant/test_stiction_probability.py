"""A rule is scored on a simulator that it was not learned on."""

import numpy as np

from results.studies.plant import stiction_probability as study


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
