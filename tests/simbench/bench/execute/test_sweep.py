"""A sweep's table counted again from its verdicts."""

import math

import numpy as np
import pandas as pd
import pytest

from simbench.bench.execute import work
from simbench.bench.execute.sweep import Sweep, sweep
from simbench.bench.statistics import wilson
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "valve": {"model": "choudhury", "S": 5, "J": 2},
        "sampling": {"Ts": 1},
    }
)


@pytest.fixture
def made(monkeypatch):
    rng = np.random.default_rng(0)
    rows = []
    for cell, J in enumerate((1.0, 2.0)):
        for method in ("a", "b"):
            for _ in range(40):
                verdict = rng.choice(["stiction", "no_stiction", "no_decision"])
                cycled = rng.choice(["yes", "no", "unclear", "entrained"]) if J > 1 else "unclear"
                rows.append([cell, method, J, cycled, verdict, rng.normal()])
    names = ["cell", "method", "valve.J", "cycled", "verdict", "score"]
    frame = pd.DataFrame(rows, columns=names)
    monkeypatch.setattr(Sweep, "_run", lambda self, *a: frame)
    return frame


def test_every_number_of_a_sweep(made):
    scores = sweep(LOOP, {"valve.J": [1.0, 2.0]}, seeds=40).score(["a", "b"])
    verdict, score = "verdict", "score"
    assert len(scores) == 4
    for row in scores.to_dict("records"):
        part = [
            r
            for r in made.to_dict("records")
            if (r["valve.J"], r["method"]) == (row["valve.J"], row["method"])
        ]
        assert row["n"] == len(part) == 40
        for name, wanted in (("stiction", "stiction"), ("no_decision", "no_decision")):
            assert row[name] == pytest.approx(np.mean([r[verdict] == wanted for r in part]))
        assert row["cycling"] == pytest.approx(np.mean([r["cycled"] == "yes" for r in part]))
        assert row["score"] == pytest.approx(np.median([r[score] for r in part]))
        right = {("yes", "stiction"), ("no", "no_stiction")}
        judged = [(r["cycled"], r[verdict]) in right for r in part if r["cycled"] in ("yes", "no")]
        lo, hi = wilson(sum(judged), len(judged))
        assert (row["accuracy_lo"], row["accuracy_hi"]) == pytest.approx((float(lo), float(hi)))
        if judged:
            assert row["accuracy"] == pytest.approx(np.mean(judged))
        else:
            assert math.isnan(row["accuracy"])


def test_one_seed_and_the_root_nought_unless_asked():
    assert len(sweep(LOOP, {"valve.J": [1.0, 2.0]})) == 2
    assert sweep(LOOP, {"valve.J": [1.0]}).grid.content.seed == 0


def test_a_sweep_that_was_interrupted_goes_on_in_its_folder(tmp_path, monkeypatch):
    swept = sweep(LOOP.with_("sampling.n", 400), {"valve.J": [1.0, 2.0]}, seeds=3)
    out, asked = tmp_path / "swept", []
    whole = swept.score(["horch"])

    def stop(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as m:
        m.setattr("simbench.bench.execute.pieces.finish", stop)
        with pytest.raises(KeyboardInterrupt):
            swept.score(["horch"], out=out)
    resolved = work.judge_record
    monkeypatch.setattr(work, "judge_record", lambda *a: asked.append(1) or resolved(*a))
    pd.testing.assert_frame_equal(swept.score(["horch"], out=out), whole)
    assert (asked, len(swept.verdicts(["horch"], out=out))) == ([], 6)


def test_a_score_reads_only_the_columns_that_it_needs(monkeypatch):
    read, before = [], pd.read_parquet
    monkeypatch.setattr(
        pd, "read_parquet", lambda f, columns: read.append(columns) or before(f, columns=columns)
    )
    swept = sweep(LOOP.with_("sampling.n", 400), {"valve.J": [1.0, 2.0]})
    assert list(swept.score("horch")["valve.J"]) == [1.0, 2.0]
    assert read == [
        ["scenario_id", "cell", "cycled", "tags"],
        ["scenario_id", "method", "verdict", "score"],
    ]
