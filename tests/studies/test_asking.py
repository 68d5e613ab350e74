"""The study of a diagnosis that asks: what it draws, and what it counts."""

from types import SimpleNamespace

import pandas as pd

from results.studies.asking import Mixture, table
from results.studies.asking_tests import _shifted


def test_a_mixture_follows_from_its_seed_and_holds_what_it_says():
    entries = Mixture(5).entries(["slew_limit", "derivative"])
    assert entries == Mixture(5).entries(["slew_limit", "derivative"])
    kinds = [e["kind"] for e in entries]
    assert {k: kinds.count(k) for k in set(kinds)} == {"single": 6, "none": 3, "foreign": 1}
    assert {e["strength"] for e in entries if e["kind"] == "single"} == {"medium", "strong"}
    assert len({e["effect"] for e in entries if e["kind"] == "single"}) == 6


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
    found = table(tmp_path, ["own"]).loc["own"]["alone"]
    assert (found["first"], found["block"]) == ("1/1 [0.21, 1.00]", "0/1 [0.00, 0.79]")
    assert (found["named where none is"], found["both of two"]) == ("1/1 [0.21, 1.00]", "-")
    assert found["foreign unknown or block"].startswith("1/1")
    assert found["right where p > .9"].startswith("1/2")


def test_a_shifted_mode_is_the_operators_a_minute_early_or_late():
    item = SimpleNamespace(baseline={"sampling": {"Ts": 20.0}})
    rows = ["t,op,mode", *(f"{k},50,{'MAN' if k >= 5 else 'AUTO'}" for k in range(10))]
    for way, first in ((1, 8), (-1, 2)):
        modes = [row.split(",")[2] for row in _shifted("\n".join(rows), item, way).splitlines()[1:]]
        assert modes.index("MAN") == first
        assert len(modes) == 10
