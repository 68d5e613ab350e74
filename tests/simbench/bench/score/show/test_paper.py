"""Tables for a paper hold the numbers of the ranking."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import simbench as sb
from simbench.bench.score.scoring import score_book
from simbench.bench.score.show import paper
from simbench.cli import main


@pytest.fixture
def scores(book, noisy):
    rng, truth = np.random.default_rng(0), np.arange(400) % 2
    parts = [noisy(rng, truth, accuracy, methods=1)[0][0] for accuracy in (0.95, 0.7, 0.7)]
    return score_book(book(parts, truth, methods=("good", "fair_one", "fair_two")))


def test_the_numbers_are_the_rankings_and_shared_ranks_are_marked(scores):
    numbers, ranking = paper.ranking_numbers(scores), scores.ranking()
    assert numbers.method.tolist() == ranking.method.tolist()
    assert numbers.cost.tolist() == pytest.approx(ranking.cost.tolist())
    assert numbers.set_index("method").shared[["good", "fair_one", "fair_two"]].tolist() == [
        False,
        True,
        True,
    ]
    text = paper.ranking_text(scores).set_index("Method")
    assert text.Rank[["good", "fair_one", "fair_two"]].tolist() == ["1", "2=", "2="]
    good = numbers.set_index("method").loc["good"]
    assert text.Cost["good"] == f"{good.cost:.2f} [{good.cost_lo:.2f}, {good.cost_hi:.2f}]"


def version_of(run):
    """Name and hash of the benchmark that a run states."""
    stated = json.loads((run / "manifest.json").read_text(encoding="utf-8"))["benchmark"]
    return f"{stated['name']} ({stated['hash']})"


@pytest.mark.parametrize("kind", paper.PAPER_KINDS)
def test_a_run_is_a_table_in_one_call(finished, tmp_path, capsys, kind):
    path = tmp_path / f"table{kind}"
    assert main(["score", str(finished), "--to", str(path)]) == 0
    assert str(path) in capsys.readouterr().out.replace("\n", "")
    text = path.read_text(encoding="utf-8")
    if kind == ".csv":
        table = pd.read_csv(path)
        assert {"method", "cost_lo", "sensitivity_hi", "no_decision", "shared"} <= set(table)
        assert table.benchmark.unique().tolist() == [version_of(finished)]
        return
    numbers = sb.table(finished, "ranking").set_index("method")
    assert f"{numbers.accuracy['he']:.2f} [{numbers.accuracy_lo['he']:.2f}, " in text
    assert "grid small" in text.splitlines()[0]
    rows = re.findall(r"^\|" if kind == ".md" else r"\\\\$", text, re.MULTILINE)
    assert len(rows) == len(numbers) + (2 if kind == ".md" else 1)


def test_tables_of_python(finished):
    assert list(sb.table(finished).columns[:4]) == ["Rank", "Method", "n", "Cost"]
    pairs = sb.table(finished, "pairs")
    assert list(pairs.columns) == ["first", "second", "n", "win", "tie", "loss", "p", "differ"]
    with pytest.raises(sb.detectors.errors.UserError, match="paper"):
        sb.table(finished, "papr")


def test_pairs_are_written_and_drawn(finished, tmp_path, capsys):
    for name in ("pairs.csv", "pairs.md", "pairs.tex"):
        assert main(["score", str(finished), "--paired", "--to", str(tmp_path / name)]) == 0
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert "yamashita" in text
        assert version_of(finished) in text
    assert "rank  method" not in capsys.readouterr().out
