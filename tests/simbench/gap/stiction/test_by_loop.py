"""The table of conclusions on loops, against arithmetic by hand."""

import shutil
from dataclasses import dataclass

import numpy as np

from simbench.cli import main
from simbench.gap.stiction.conclusion import as_lines
from tests.simbench.boundary.test_hostile import write


@dataclass
class Concluded:
    probability: float | None


LABELS = {
    "a1": {"loop": "A", "unit_group": "U", "label": "stiction"},
    "a2": {"loop": "A", "unit_group": "U", "label": "stiction"},
    "b1": {"loop": "B", "unit_group": "U", "label": "stiction"},
    "c1": {"loop": "C", "unit_group": "C", "label": "no_stiction"},
    "d1": {"loop": "D", "unit_group": "D", "label": "tuning"},
    "e1": {"loop": "E", "unit_group": "E", "label": "unknown"},
}


def test_a_loop_has_the_mean_log_odds_of_its_records_and_loops_and_units_are_counted_apart():
    p = {"a1": 0.99, "a2": 0.02, "b1": 0.98, "c1": 0.02, "d1": None, "e1": 0.9, "other": 0.9}
    lines = as_lines({name: Concluded(x) for name, x in p.items()}, LABELS)
    cells = {line.split()[0]: line.split()[1:] for line in lines[1:-2]}
    assert cells["A"] == ["stiction", "2", "0.59", "cannot", "tell"]
    assert cells["B"] == ["stiction", "1", "0.98", "stiction"]
    assert cells["D"] == ["tuning", "1", "cannot", "tell"]
    assert set(cells) == set("ABCDE")
    assert (
        lines[-2]
        == "Conclusion by loop: stiction in 1 of 2 with stiction and in 0 of 2 without; 2 of 4"
        " cannot tell."
    )
    # log-odds of .99, .02 and .98: 4.60, -3.89 and 3.89, whose mean 1.53 is that of .82
    assert (
        lines[-1]
        == "Conclusion by unit: stiction in 1 of 1 with stiction and in 0 of 2 without; 1 of 3"
        " cannot tell."
    )


def test_detect_prints_it_where_labels_and_all_evidence_are_asked_for(tmp_path, capsys):
    write(tmp_path / "r1.csv", np.arange(250))
    shutil.copy(tmp_path / "r1.csv", tmp_path / "r2.csv")
    labels = tmp_path.with_name(f"{tmp_path.name}-labels.csv")
    labels.write_text("id,loop,label\nr1,A,stiction\nr2,C,no_stiction\n")
    words = ["detect", str(tmp_path), "--labels", str(labels), "--method"]
    assert main([*words, "likelihood"]) == 0
    printed = capsys.readouterr().out
    assert "Conclusion by loop:" in printed
    # the conclusion stands in the table of methods, in the columns of `score`
    head, *rows = [line.split() for line in printed.splitlines() if "  " in line][-3:]
    assert head[:5] == ["method", "n", "applicable", "positives", "cost"]
    assert sorted(row[0] for row in rows) == ["conclusion", "likelihood"]
    assert main([*words, "horch_histogram"]) == 0
    assert "Conclusion by loop:" not in capsys.readouterr().out
