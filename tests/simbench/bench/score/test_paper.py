"""Tables for a paper hold the numbers of the ranking."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import simbench as sb
from simbench.bench.score import paper
from simbench.bench.score.scoring import score_book
from simbench.cli import main


@pytest.fixture
def scores(book, noisy):
    rng, truth = np.random.default_rng(0), np.arange(400) % 2
    parts = [noisy(rng, truth, accuracy, methods=1)[0][0] for accuracy in (0.95, 0.7, 0.7)]
    return score_book(book(parts, truth, methods=("good", "fair_one", "fair_two")))


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
    assert all(name in text for name in numbers.group.unique())


def test_rates_over_an_axis_say_of_which_loops_they_are(finished, tmp_path):
    path = tmp_path / "by.md"
    assert main(["score", str(finished), "--by", "disturbance", "--to", str(path)]) == 0
    about, _, head, *_ = path.read_text(encoding="utf-8").splitlines()
    loops = sb.score(finished).rows(population="all").n.max()
    assert f"{loops} loops with a label, oscillating or not" in about
    assert "by disturbance" in about
    assert "rank" not in about
    assert [cell.strip() for cell in head.split("|")[1:4]] == ["Method", "disturbance", "n"]


def test_a_method_is_compared_with_every_other_in_one_family(book, noisy):
    rng, truth = np.random.default_rng(3), np.arange(400) % 2
    parts = [noisy(rng, truth, share, methods=1)[0][0] for share in (0.9, 0.7, 0.72, 0.5)]
    scores = score_book(book(parts, truth, methods=("mine", "one", "two", "three")))
    pairs, every = scores.of(["mine"]).compare().pairs, scores.compare().pairs
    assert pairs["first"].tolist() == ["mine"] * 3
    assert pairs.second.tolist() == ["one", "two", "three"]
    # three tests are corrected for, and not six
    alone = every[every["first"] == "mine"]
    assert (pairs.p.to_numpy() <= alone.p.to_numpy()).all()
    assert pairs.win.tolist() == alone.win.tolist()
    assert scores.of(["mine"]).rows().method.tolist() == ["mine"]
    assert scores.of(["mine"]).rows()["rank"].tolist() == [1.0]
    last = scores.of(["three"]).rows()["rank"].item()
    assert last == scores.rows().set_index("method")["rank"]["three"]
    with pytest.raises(sb.detectors.errors.UserError, match="did you mean 'three'"):
        scores.of(["thre"])


def test_a_method_alone_is_shown_by_all_three_shares_over_two_axes(finished, tmp_path, capsys):
    command = ["score", str(finished), "--by", "disturbance", "--by", "tuning", "--method", "he"]
    assert main([*command, "--to", str(tmp_path / "he.png")]) == 2
    assert "a picture is of the ranking" in capsys.readouterr().err
    assert main(command) == 0
    said = capsys.readouterr().out
    for share in ("he: accuracy", "he: sensitivity", "he: false positives"):
        assert share in said
    assert "yamashita" not in said
    assert main(["score", str(finished), "--method", "he, he", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert {row["method"] for row in rows} == {"he"}


def test_tables_of_python(finished):
    assert list(sb.table(finished).columns[:5]) == ["Group", "Rank", "Method", "n", "Cost"]
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
