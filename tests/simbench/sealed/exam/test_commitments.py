"""Answers that were listed before the exam was opened are told from those that came later."""

import csv
import hashlib
import json

import pytest

from simbench.cli import main
from simbench.sealed.exam.answering import answer_exam
from simbench.sealed.exam.making import make_exam


@pytest.fixture
def place(tmp_path):
    """An exam of two records with its key elsewhere, and answers under a foreign name."""
    make_exam("smoke", tmp_path / "exam", tmp_path / "secret" / "key", n=2, seed=5)
    answer_exam(tmp_path / "exam", tmp_path / "package.csv", ["he"])
    for name in ("mine", "late"):
        text = (tmp_path / "package.csv").read_text().replace("\nhe,", f"\n{name},")
        (tmp_path / f"{name}.csv").write_text(text)
    return tmp_path


def commit(place, name):
    return main(["exam", "commit", str(place / name), "--exam", str(place / "exam")])


def answered(place, capsys, *names):
    """Open the exam and return what its rows say of each method."""
    capsys.readouterr()
    words = ["exam", "open", str(place / "exam"), "--key", str(place / "secret" / "key")]
    assert main([*words, *(str(place / name) for name in names), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    return {row["method"]: (row["verified"], row["answered"]) for row in rows}


def rows_of(file):
    return list(csv.DictReader(file.read_text().splitlines()))


def test_rows_say_whether_answers_were_listed_before_the_opening(place, capsys):
    assert commit(place, "mine.csv") == 0
    mark = hashlib.sha256((place / "mine.csv").read_bytes()).hexdigest()
    assert mark in capsys.readouterr().out
    found = answered(place, capsys, "mine.csv", "late.csv", "package.csv")
    assert found["mine"] == (False, "before opening")
    assert found["late"] == (False, "after opening")
    assert found["he"] == found["oracle"] == found["always_no"] == (True, "package")
    (listed,) = rows_of(place / "exam" / "commitments.csv")
    assert (listed["sha256"], listed["name"]) == (mark, "mine.csv")
    (opening,) = rows_of(place / "secret" / "opened.csv")
    assert opening["answers"] == "mine.csv late.csv package.csv"
    assert listed["time"] < opening["time"]


def test_what_is_listed_after_an_opening_stays_late(place, capsys):
    answered(place, capsys, "package.csv")
    commit(place, "late.csv")
    assert answered(place, capsys, "late.csv")["late"] == (False, "after opening")


def test_an_opening_of_another_exam_makes_nothing_late(place, capsys):
    other = place / "other"
    make_exam("smoke", other / "exam", place / "secret" / "other", n=2, seed=6)
    answer_exam(other / "exam", other / "package.csv", ["he"])
    words = [str(other / "exam"), "--key", str(place / "secret" / "other")]
    assert main(["exam", "open", *words, str(other / "package.csv")]) == 0
    commit(place, "mine.csv")
    assert answered(place, capsys, "mine.csv")["mine"] == (False, "before opening")


def test_answers_that_changed_after_they_were_listed_are_late(place, capsys):
    commit(place, "mine.csv")
    text = (place / "mine.csv").read_text()
    (place / "mine.csv").write_text(text + "\n")
    assert answered(place, capsys, "mine.csv")["mine"] == (False, "after opening")


def test_answers_are_listed_once_and_only_answers_to_the_exam(place, capsys):
    assert [commit(place, "mine.csv") for _ in range(2)] == [0, 0]
    assert len(rows_of(place / "exam" / "commitments.csv")) == 1
    (place / "odd.csv").write_text("method,record,verdict,score\nmine,nobody,stiction,1\n")
    capsys.readouterr()
    assert commit(place, "odd.csv") == 2
    assert "the exam has no record 'nobody'" in capsys.readouterr().err
    assert commit(place, "absent.csv") == 2
    assert len(rows_of(place / "exam" / "commitments.csv")) == 1
