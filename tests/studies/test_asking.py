"""The study of a diagnosis that asks: what it draws, and what it counts."""

import pandas as pd

from results.studies.asking import Mixture, table


def test_a_mixture_follows_from_its_seed_and_holds_what_it_says():
    entries = Mixture(5).entries(["slew_limit", "derivative"])
    assert entries == Mixture(5).entries(["slew_limit", "derivative"])
    kinds = [e["kind"] for e in entries]
    assert {k: kinds.count(k) for k in set(kinds)} == {"single": 6, "none": 3, "foreign": 1}
    assert {e["strength"] for e in entries if e["kind"] == "single"} == {"medium", "strong"}
    assert len({e["effect"] for e in entries if e["kind"] == "single"}) == 6


def test_the_table_counts_each_kind_by_itself(tmp_path):
    row = {
        "first": True, "in_group": True, "block_right": False, "called_unknown": False, "called_none": False,
        "both_named": False, "probability": 0.95,
    }  # fmt: skip
    rows = [{**row, "kind": "single"}, {**row, "kind": "none", "first": False}, {**row, "kind": "foreign", "block_right": True}]
    (tmp_path / "own-score").mkdir()
    pd.DataFrame(rows).to_csv(tmp_path / "own-score" / "records.csv", index=False)
    (found,) = table(tmp_path).to_dict("records")
    assert (found["world"], found["tests"], found["n"]) == ("own", "alone", 3)
    assert (found["first"], found["block"], found["named where none is"]) == ("1/1", "0/1", "1/1")
    assert (found["foreign unknown or block"], found["right where p > .9"]) == ("1/1", "1/2")
