"""The study of a diagnosis that asks: what it draws, and what it counts."""

from types import SimpleNamespace

import pandas as pd

from results.studies.asking import table
from results.studies.asking_tests import _shifted


def test_the_table_counts_each_kind_by_itself(tmp_path):
    row = {
        "first": True,
        "in_group": True,
        "block_right": False,
        "called_unknown": False,
        "called_none": False,
        "both_named": False,
        "probability": 0.95,
    }
    rows = [
        {**row, "kind": "single"},
        {**row, "kind": "none", "first": False},
        {**row, "kind": "foreign", "block_right": True},
    ]
    (tmp_path / "own-score").mkdir()
    pd.DataFrame(rows).to_csv(tmp_path / "own-score" / "records.csv", index=False)
    counts = table(tmp_path, ["own"]).loc["own"]["alone"]
    assert (counts["first"], counts["block"]) == ("1/1 [0.21, 1.00]", "0/1 [0.00, 0.79]")
    assert (counts["named where none is"], counts["both of two"]) == ("1/1 [0.21, 1.00]", "-")
    assert counts["foreign unknown or block"].startswith("1/1")
    assert counts["right where p > .9"].startswith("1/2")


def test_a_shifted_mode_is_the_operators_a_minute_early_or_late():
    item = SimpleNamespace(baseline={"sampling": {"Ts": 20.0}})
    rows = ["t,op,mode", *(f"{k},50,{'MAN' if k >= 5 else 'AUTO'}" for k in range(10))]
    for way, first in ((1, 8), (-1, 2)):
        modes = [row.split(",")[2] for row in _shifted("\n".join(rows), item, way).splitlines()[1:]]
        assert modes.index("MAN") == first
        assert len(modes) == 10
