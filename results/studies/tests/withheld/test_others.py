"""Diagnoses of other people: their scores side by side, and the example in awk."""

import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from results.studies.withheld.__main__ import run
from results.studies.withheld.others import SHOWN, read_diagnosis, score
from results.studies.withheld.page import write_page

ROOT = Path(__file__).parents[4]


def written(folder, name, text):
    file = folder / f"{name}.csv"
    file.write_text(text)
    return file


RIGHT = "id,effect,probability\na,stiction,0.9\nb,none,0.8\nb,noise,0.1\nc,unknown,0.7\n"
WRONG = "id,effect\na,noise\na,stiction\nb,drift\n"


def test_the_most_probable_row_is_the_answer_and_else_the_first(tmp_path):
    file = written(tmp_path, "x", "ID,Effect,Probability\na,noise,0.1\na,stiction,0.6\nb,drift,\n")
    answers = read_diagnosis(file, ["a", "b", "c"])
    assert (answers["a"]["effect"], answers["a"]["block"]) == ("stiction", "valve")
    assert [r["effect"] for r in answers["a"]["ranking"]] == ["stiction", "noise"]
    assert answers["b"]["ranking"][0]["probability"] is None
    assert "c" not in answers
    plain = read_diagnosis(written(tmp_path, "y", WRONG), ["a", "b"])
    assert plain["a"]["effect"] == "noise"


def test_a_block_that_is_stated_counts_for_what_is_unknown(tmp_path):
    file = written(tmp_path, "x", "id,effect,block\na,unknown,sensor\n")
    assert read_diagnosis(file, ["a"])["a"]["block"] == "sensor"


def test_diagnoses_are_scored_beside_each_other_on_the_same_records(theirs, tmp_path):
    files = [written(tmp_path, "right", RIGHT), written(tmp_path, "wrong", WRONG)]
    scored = score(theirs, files)
    figures = scored.figures().set_index("figure")
    assert list(figures.index) == list(SHOWN)
    assert figures.right["first answer right"].startswith("1.00")
    assert figures.wrong["first answer right"].startswith("0.00")
    assert figures.wrong["among the first three"].startswith("1.00")
    assert figures.wrong["effect named where there is none"].startswith("1.00")
    assert figures.right["not answered"].startswith("0.00")
    assert figures.wrong["not answered"].startswith("0.33")
    (pair,) = scored.pairs().to_dict("records")
    assert (pair["only the first right"], pair["only the second right"]) == (1, 0)
    assert scored.by("effect").set_index("effect").right["stiction"] == "1 of 1"
    page = tmp_path / "page.html"
    write_page(scored, page)
    assert "By effect" in page.read_text(encoding="utf-8")
    assert "By site" not in page.read_text(encoding="utf-8"), "their folder names no sites"


@pytest.fixture(scope="module")
def sites(tmp_path_factory):
    """A small draw of the twenty sites, as the page says, in another folder."""
    place = tmp_path_factory.mktemp("sites")
    words = ["--key", str(place / "key"), "--seed", "5", "-n", "20", "--world", "recipes"]
    assert run(["make", str(place / "sites"), *words]) == 0
    return place


@pytest.mark.skipif(shutil.which("awk") is None, reason="no awk")
def test_the_example_in_awk_answers_every_record_and_is_scored_by_site(sites, capsys):
    records = sorted(map(str, (sites / "sites" / "records").glob("*.csv")))
    script = str(ROOT / "docs" / "example" / "diagnose.awk")
    done = subprocess.run(
        ["awk", "-f", script, *records], capture_output=True, text=True, check=True
    )
    file = written(sites, "three_rules", done.stdout)
    assert pd.read_csv(file).id.nunique() == len(records) == 20
    words = ["score", str(sites / "sites"), str(file), "--key", str(sites / "key")]
    assert run([*words, "--page", str(sites / "page.html")]) == 0
    text = capsys.readouterr().out
    assert re.search(r"not answered +0\.00 \(.*\), n 20", text)
    assert re.search(r"three_rules: first answer right by site .* of \d+ sites", text)
    assert "By site" in (sites / "page.html").read_text(encoding="utf-8")


def test_the_rules_of_the_example_see_what_they_look_for(tmp_path):
    rows = {
        "stuck": [f"{k},{k % 7},{k * 0.37 % 1},5" for k in range(60)],
        "steps": [f"{k},{k % 7},{k // 5 % 3},{k % 7}" for k in range(60)],
        "noisy": [f"{k},50,{(-1) ** k * 0.5 + k * 1e-3},50" for k in range(60)],
        "quiet": [f"{k},50,{k * 1e-3},50" for k in range(60)],
    }
    for name, lines in rows.items():
        (tmp_path / f"{name}.csv").write_text("\n".join(["t,op,pv,mv", *lines]) + "\n")
        (tmp_path / f"{name}.toml").write_text("[plant]\nK = 1\n\n[noise]\nstd = 0.1\n")
    files = [str(tmp_path / f"{name}.csv") for name in rows]
    script = str(ROOT / "docs" / "example" / "diagnose.awk")
    done = subprocess.run(["awk", "-f", script, *files], capture_output=True, text=True, check=True)
    first = {}
    for line in done.stdout.splitlines()[1:]:
        first.setdefault(*line.split(",")[:2])
    assert first == {
        "stuck": "stiction",
        "steps": "quantisation",
        "noisy": "noise",
        "quiet": "none",
    }
