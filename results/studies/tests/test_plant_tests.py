"""What a kind of test is worth, by hand."""

import numpy as np
import pandas as pd
import pytest

from results.studies.plant_tests import table


def test_a_kind_is_worth_what_it_adds_to_the_probability_of_the_truth():
    def row(kind, named, right, p, was="none", before=(False, 0.2), accused=False):
        return {
            "kind": kind, "healthy": True, "named": named, "right": right, "p": p, "set": 2,
            "accused": accused, "named before": was, "right before": before[0],
            "p before": before[1], "set before": 4, "accused before": False,
        }  # fmt: skip

    rows = [
        row("mv", "stiction", True, 0.8),
        row("mv", "none", True, 0.4, before=(True, 0.4)),
        row("bump", "extra_lag", False, 0.0, before=(True, 0.5), accused=True),
    ]
    shown = table(pd.DataFrame(rows))
    assert shown.index.tolist() == ["mv", "bump"]
    mv, bump = shown.loc["mv"], shown.loc["bump"]
    assert (mv.changed, mv["made right"], mv["made wrong"]) == (1, 1, 0)
    assert mv["p(truth)"] == pytest.approx(0.3)
    assert mv["+-"] == pytest.approx(0.6 / np.sqrt(2) / np.sqrt(2))
    assert mv["ln p(truth)"] == pytest.approx(np.log(4.0) / 2)
    assert mv["answers in set"] == -2.0
    assert (bump["made wrong"], bump["named after"]) == (1, 1)
    assert bump["ln p(truth)"] == pytest.approx(np.log(0.001 / 0.5))
