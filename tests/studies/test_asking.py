"""The study of a diagnosis that asks: what it draws, and what it counts."""

import pandas as pd

from results.studies.asking import table


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
