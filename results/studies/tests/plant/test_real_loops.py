"""The list of real loops: what is one loop, what is counted, and who matters most."""

import numpy as np
import pandas as pd
import pytest

from results.studies.plant.real_loops import (
    TIERS,
    by_loop,
    counted,
    read,
    share,
)
from simbench.gap.stiction.conclusion import Conclusion


def records(*rows):
    """Return answered records: loop, unit, label, tier, contributor, verdict, probability."""
    names = ("loop", "unit_group", "label", "tier", "contributor", "verdict", "p")
    return pd.DataFrame([
        {"id": f"r{i}", "conclusion": Conclusion(*row[-2:], "", "", "")}
        | dict(zip(names, row, strict=True))
        for i, row in enumerate(rows)
    ])  # fmt: skip


ANSWERED = records(
    ("A", "U", "stiction", "stated", "Horch", "stiction", 0.99),
    ("A", "U", "stiction", "stated", "Horch", "no_stiction", 0.10),
    ("B", "U", "no_stiction", "likely", "Scali", "no_stiction", 0.05),
    ("C", "V", "no_stiction", "likely", "Scali", "no_decision", 0.70),
    ("D", "W", "stiction", "likely", "Scali", "no_decision", None),
    ("E", "X", "unknown", "unverified", "Po", "stiction", 0.95),
)


def test_a_loop_has_the_mean_log_odds_of_its_records():
    loops = by_loop(ANSWERED).set_index("loop")
    # log-odds of .99 and .1: 4.60 and -2.20, whose mean 1.20 is that of .77
    assert loops.p["A"] == pytest.approx(0.768, abs=1e-3)
    assert list(loops.verdict) == [
        "no_decision", "no_stiction", "no_decision", "no_decision", "stiction",
    ]  # fmt: skip
    assert np.isnan(float(loops.p["D"]))
    assert list(by_loop(ANSWERED, "unit_group").records) == [2, 1, 1, 1, 1]


def test_each_kind_of_label_is_counted_apart_and_an_unknown_one_is_not():
    lines = counted(by_loop(ANSWERED))
    assert len(lines) == 1 + 2 * len(set(TIERS.values()))
    assert "0 of 1 (0.00 to 0.79)" in next(x for x in lines if x.startswith("stiction, stated"))
    assert "1 of 2 (0.09 to 0.91)" in next(x for x in lines if x.startswith("no stiction, likely"))
    assert share(0, 0) == "0 of 0"


def test_a_record_of_two_folders_counts_once_and_has_its_contributor(tmp_path):
    for name, source in (("one", "A. Horch: Flow control"), ("two", "comment of the book")):
        (tmp_path / name).mkdir()
        pd.DataFrame({
            "id": ["r1", "missing"], "loop": ["L", "M"], "unit_group": ["U", "U"],
            "label": ["stiction", "stiction"], "label_tier": ["stated", "author_folder"],
            "label_source": [source, "folder: of the authors"], "source": ["ISDB via x", "SGPT y"],
        }).to_csv(tmp_path / name / "records.csv", index=False)  # fmt: skip
        (tmp_path / name / "r1.csv").write_text("op,pv\n1,2\n")
    rows = read([tmp_path / "one", tmp_path / "two"])
    assert list(rows.id) == ["r1"]
    assert list(rows.contributor) == ["A. Horch"]
    assert list(rows.tier) == ["stated"]
