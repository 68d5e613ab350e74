"""An exam shows no truth, its scores are those of a run with the same seeds, and what is not as it
must be is refused.
"""

import contextlib
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.score.scoring import score_run
from simbench.cli import main
from simbench.detectors.errors import ParameterError
from simbench.scenarios.grid import load_grid
from simbench.sealed.exam import answering, opening, simulating
from simbench.sealed.exam.answering import answer_exam
from simbench.sealed.exam.folder import read_exam
from simbench.sealed.exam.making import make_exam
from simbench.sealed.exam.opening import opened_exam

SEED, METHODS = 7, ["he", "horch", "hammerstein"]
PLUGIN = '''"""Slow: answers by the sign of the last sample, after a while."""
import time

from simbench.detectors.method import Method
from simbench.detectors.verdict import NO_STICTION, STICTION, Verdict

METHOD = Method(
    title="slow", source="test", process=("self-regulating", "integrating"), front_end=False
)


def detect(prepared):
    """Wait, then answer."""
    time.sleep(0.05)
    last = float(prepared.record.op[-1] - prepared.record.op.mean())
    return Verdict("slow", STICTION if last > 0 else NO_STICTION, last, reason="last sample of OP")
'''


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """One exam of a whole grid with its key and answers, never to be changed."""
    place = tmp_path_factory.mktemp("exam")
    make_exam("smoke", place / "exam", place / "key", seed=SEED)
    answer_exam(place / "exam", place / "answers.csv", METHODS)
    return place


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    """Four records drawn from a grid, with answers."""
    place = tmp_path_factory.mktemp("tiny")
    make_exam("smoke", place / "exam", place / "key", n=4)
    answer_exam(place / "exam", place / "answers.csv", ["he", "horch"])
    return place


def open_exam(place, *more, exam=None, key=None, answers=None):
    """Return the exit code of `exam open` with the files of a place, or others."""
    files = answers or [place / "answers.csv"]
    words = [exam or place / "exam", "--key", key or place / "key", *files, *more]
    return main(["exam", "open", *map(str, words)])


def assert_refused(capsys, *parts):
    """Check that one sentence was printed, which names these parts."""
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert all(part in printed.err for part in parts), printed.err


def front(table):
    """Return the rows that an exam has too, without times."""
    rows = table[table.method.isin([*METHODS, "oracle", "blind classifier", "always no"])]
    keys = [c for c in ("method", "truth", "process", "axis", "value") if c in rows]
    return rows.drop(columns="median_ms").set_index(keys).sort_index()


def test_scores_and_answers_are_those_of_a_run_with_the_same_seeds_to_the_last_bit(place, tmp_path):
    run = run_grid("smoke", tmp_path / "run", [*METHODS, "oracle"], sets={"seed": SEED})
    theirs = score_run(run)
    with opened_exam(place / "exam", place / "key", [place / "answers.csv"]) as opened:
        ours = score_run(opened.run)
    assert ours.as_json()["benchmark"] == theirs.as_json()["benchmark"]
    pd.testing.assert_frame_equal(front(ours.table), front(theirs.table), check_exact=True)
    pd.testing.assert_frame_equal(front(ours.by_axis), front(theirs.by_axis), check_exact=True)
    pd.testing.assert_frame_equal(ours.quantification, theirs.quantification, check_exact=True)
    names = {
        i: of["scenario"] for i, of in json.loads((place / "key").read_text())["records"].items()
    }
    given = {(r["method"], names[r["record"]]): r for r in csv.DictReader(lines_of(place))}
    verdicts = pd.read_parquet(run / "verdicts.parquet")
    for row in verdicts[verdicts.method != "oracle"].itertuples():
        answer = given.pop((row.method, row.scenario_id))
        assert answer["verdict"] == row.verdict
        assert np.array_equal(float(answer["score"] or "nan"), row.score, equal_nan=True)
        ends = [float(x) for x in answer["S"].split("..")] if answer["S"] else [np.nan]
        assert np.array_equal([ends[0], ends[-1]], [row.S_lo, row.S_hi], equal_nan=True)
    assert not given


@pytest.mark.slow  # without processes: the next test
def test_two_workers_write_the_same_files_as_one(place, tmp_path):
    make_exam("smoke", tmp_path / "exam", tmp_path / "key", jobs=2, seed=SEED)
    answer_exam(tmp_path / "exam", tmp_path / "answers.csv", METHODS, jobs=2)
    for name in (
        "key",
        "answers.csv",
        *(f"exam/{file.name}" for file in (place / "exam").iterdir()),
    ):
        assert (tmp_path / name).read_bytes() == (place / name).read_bytes(), name


def test_the_order_in_which_workers_end_changes_no_file(tmp_path, monkeypatch):
    @contextlib.contextmanager
    def last_first(jobs):
        yield lambda task, pieces: (task(*piece) for piece in reversed(pieces))

    def write(folder):
        make_exam("smoke", folder / "exam", folder / "key", n=6, seed=SEED)
        answer_exam(folder / "exam", folder / "answers.csv", ["he"])
        return {f.name: f.read_bytes() for f in folder.rglob("*") if f.is_file()}

    monkeypatch.setattr(simulating, "_PIECE", 1)
    monkeypatch.setattr(answering, "_PIECE", 1)
    expected = write(tmp_path / "one")
    monkeypatch.setattr(simulating, "on_processes", last_first)
    monkeypatch.setattr(answering, "on_processes", last_first)
    assert write(tmp_path / "other") == expected
    assert len(expected) == 6


def test_an_exam_holds_what_an_engineer_knows_and_nothing_else(place):
    exam, secret = place / "exam", json.loads((place / "key").read_text())
    assert sorted(file.name for file in exam.iterdir()) == [
        "exam.json",
        "loops.csv",
        "records.parquet",
    ]
    table, about = (
        pq.read_table(exam / "records.parquet"),
        json.loads((exam / "exam.json").read_text()),
    )
    assert table.column_names == ["record", "t", "sp", "op", "pv"]
    assert table.schema.metadata is None
    assert set(about) == {"format", "benchmark", "version", "n", "commitment"}
    header, *rows = csv.reader((exam / "loops.csv").read_text().splitlines())
    assert header == ["record", "Ts", "process", "op_lo", "op_hi"]
    assert {row[2] for row in rows} == {"self-regulating", "integrating"}
    records = read_exam(exam).records
    assert [row[0] for row in rows] == list(records) == list(secret["records"])
    assert all(record.mv is None and record.op_span == (0.0, 100.0) for record in records.values())
    order = [(of["group"], of["place"]) for of in secret["records"].values()]
    assert np.abs(np.corrcoef([i for i, _ in order], range(len(order)))[0, 1]) < 0.5
    assert list(secret["records"]) != sorted(secret["records"])
    written = b"".join(file.read_bytes() for file in exam.iterdir())
    words = {
        "choudhury",
        "healthy",
        "sticky",
        "ideal",
        *(of["scenario"] for of in secret["records"].values()),
    }
    assert not [word for word in words if word.encode() in written]


def test_seeds_ids_and_order_are_drawn_afresh(tiny, tmp_path):
    make_exam("smoke", tmp_path / "exam", tmp_path / "key", n=4)
    one, other = (json.loads((place / "key").read_text()) for place in (tiny, tmp_path))
    assert one["seed"] != other["seed"]
    assert not set(one["records"]) & set(other["records"])
    assert (tiny / "key").stat().st_mode & 0o077 == 0


def test_a_subset_takes_siblings_only_when_every_group_has_given_one(tmp_path):
    make_exam(
        "smoke", tmp_path / "exam", tmp_path / "key", n=load_grid("smoke").group_count, seed=3
    )
    groups = [of["group"] for of in json.loads((tmp_path / "key").read_text())["records"].values()]
    assert len(set(groups)) == len(groups)


@pytest.mark.slow  # a whole exam is answered twice, and half of it once more
def test_a_killed_call_goes_on_where_it_stopped(place, tmp_path):
    (tmp_path / "slow.py").write_text(PLUGIN)
    words = [
        "exam",
        "answer",
        place / "exam",
        "--plugin",
        tmp_path / "slow.py",
        "--method",
        "slow,he",
        "-j",
        "2",
    ]
    words = [str(word) for word in words]
    assert main([*words, "-o", str(tmp_path / "whole.csv")]) == 0
    out, parts = tmp_path / "answers.csv", tmp_path / "answers.csv.partial"
    killed = subprocess.Popen(
        [sys.executable, "-m", "simbench.cli", *words, "-o", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    until = time.monotonic() + 240.0
    while not list(parts.glob("[0-9]*.csv")) and killed.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    killed.send_signal(signal.SIGKILL)
    killed.communicate(timeout=60)  # its workers end with it, or this would wait for them
    assert killed.returncode == -signal.SIGKILL
    assert not out.exists()
    there = len(list(parts.glob("[0-9]*.csv")))
    assert 0 < there < 6
    assert main([*words, "-o", str(out)]) == 2  # nothing is overwritten unasked
    assert (
        main([*[w if w != "slow,he" else "slow" for w in words], "-o", str(out), "--resume"]) == 2
    )
    assert len(list(parts.glob("[0-9]*.csv"))) == there
    assert main([*words, "-o", str(out), "--resume"]) == 0
    assert out.read_bytes() == (tmp_path / "whole.csv").read_bytes()
    assert not parts.exists()


def test_answers_of_a_stranger_are_scored_as_given_and_missing_ones_are_counted(
    tiny, tmp_path, capsys
):
    ids = list(read_exam(tiny / "exam").records)
    rows = [
        f"my-method,{ids[0]},stiction,1,2..3",
        f"my-method,{ids[1]},no_stiction,,",
        f"my-method,{ids[2]},stiction,NaN,4",
    ]
    (tmp_path / "mine.csv").write_text("\n".join(["method,record,verdict,score,S", *rows]) + "\n")
    files, labels = [tmp_path / "mine.csv", tiny / "answers.csv"], tmp_path / "labels.csv"
    more = ["--labels", labels, "--report", tmp_path / "r.html", "--json"]
    assert open_exam(tiny, *more, answers=files) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["missing"] == {"my-method": 1}
    labels = pd.read_csv(labels, dtype={"record": str})
    assert list(labels.columns[:5]) == ["record", "cycled", "sticky", "predicted", "oscillates"]
    assert list(labels.record) == ids
    clear = labels.cycled.isin(["yes", "no"])
    given = np.array(["yes", "no", "yes", None])
    whole = ("my-method", "cycled", "all", "all")
    (mine,) = [
        r
        for r in printed["rows"]
        if (r["method"], r["truth"], r["process"], r["population"]) == whole
    ]
    assert mine["n"] == clear.sum()
    assert mine["accuracy"] == pytest.approx((given == labels.cycled)[clear].mean(), abs=1e-6)
    page = (tmp_path / "r.html").read_text()
    assert "my-method" in page
    # the tables lay in a folder that is gone; what is proposed works on what the reader has
    assert tempfile.gettempdir() not in page
    assert "simulate --from" not in page
    assert open_exam(tiny, answers=files) == 0
    assert capsys.readouterr().out.startswith(
        "my-method left out 1 records, which count as no decision\n"
    )


def lines_of(place):
    return (place / "answers.csv").read_text().splitlines(keepends=True)


def spoilt(how, lines):
    """Return the text of answers that are wrong in one way."""
    first = lines[1].split(",")
    changed = {
        "unknown record": [lines[0], lines[1].replace(first[1], "000"), *lines[2:]],
        "repeated record": [*lines, lines[3]],
        "bad verdict": [
            *lines[:2],
            ",".join([*lines[2].split(",")[:2], "perhaps", "", "", ""]) + "\n",
        ],
        "bad score": [*lines[:2], ",".join([*lines[2].split(",")[:3], "high", "", ""]) + "\n"],
        "bad interval": [*lines[:2], ",".join([*lines[2].split(",")[:3], "", "3..2", ""]) + "\n"],
        "bad size": [*lines[:2], ",".join([*lines[2].split(",")[:3], "", "1e308", ""]) + "\n"],
        "reference row": [lines[0], lines[1].replace(first[0], "oracle")],
        "cut in a line": ["".join(lines)[:-4]],
        "cut cells": [*lines[:3], lines[3][:20] + "\n"],
        "other column": [lines[0].replace("score", "Score"), *lines[1:]],
        "no answers": [lines[0]],
        "no text": ["method,record,verdict,score\n\udcff,1,stiction,\n"],
        "empty": [],
    }
    return "".join(changed[how]).encode(errors="surrogateescape")


@pytest.mark.parametrize(
    ("how", "line", "part"),
    [
        ("unknown record", 2, "no record '000'"),
        ("repeated record", 10, "once is allowed"),
        ("bad verdict", 3, "'perhaps' is no verdict"),
        ("bad score", 3, "score = 'high'"),
        ("bad interval", 3, "S = '3..2'"),
        ("bad size", 3, "S = '1e308'; a size from 0 to 1e+06"),
        ("reference row", 2, "'oracle'"),
        ("cut in a line", 9, "ends within a line"),
        ("cut cells", 4, "cells"),
        ("other column", 1, "Score"),
        ("no answers", None, "no answers"),
        ("no text", 2, "UTF-8"),
        ("empty", 1, "ends within a line"),
    ],
)
def test_wrong_answers_are_refused_with_file_and_line(tiny, tmp_path, capsys, how, line, part):
    file = tmp_path / "wrong.csv"
    file.write_bytes(spoilt(how, lines_of(tiny)))
    assert open_exam(tiny, "--labels", tmp_path / "l", answers=[file]) == 2
    assert_refused(capsys, part, f"{file}, line {line}:" if line else str(file))
    assert not (tmp_path / "l").exists()


def test_the_same_file_twice_is_every_record_twice(tiny, capsys):
    assert open_exam(tiny, answers=[tiny / "answers.csv"] * 2) == 2
    assert_refused(capsys, "once is allowed")


def other_sample(exam):
    table = pq.read_table(exam / "records.parquet")
    pv = table.column("pv").to_numpy().copy()
    pv[100] = np.nextafter(pv[100], np.inf)
    pq.write_table(table.set_column(4, "pv", pa.array(pv)), exam / "records.parquet")


def other_text(name, before, after):
    def change(exam):
        text = (exam / name).read_text()
        assert before in text
        (exam / name).write_text(text.replace(before, after, 1))

    return change


def cut(name, size):
    return lambda exam: (exam / name).write_bytes((exam / name).read_bytes()[:-size])


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (other_sample, "is not what its seed gives"),
        (other_text("loops.csv", "100.0", "99.0"), "its line in loops.csv"),
        (cut("records.parquet", 50), "damaged"),
        (cut("loops.csv", 2), "line 5"),
        (cut("exam.json", 20), "damaged"),
        (other_text("exam.json", '"n": 4', '"n": 3'), "3 are needed"),
        (other_text("exam.json", "smoke", "other"), "benchmark"),
        (lambda exam: (exam / "records.parquet").unlink(), "cannot be read"),
    ],
)
def test_a_changed_exam_is_refused(tiny, tmp_path, capsys, change, part):
    shutil.copytree(tiny / "exam", tmp_path / "exam")
    change(tmp_path / "exam")
    assert open_exam(tiny, exam=tmp_path / "exam") == 2
    assert_refused(capsys, part)


def test_another_version_of_the_evaluator_is_named_before_anything_is_simulated(
    tiny, monkeypatch, capsys
):
    monkeypatch.setattr(opening, "evaluator_hash", lambda: "0" * 16)
    monkeypatch.setattr(opening, "simulate_picks", lambda *_: pytest.fail("it was simulated"))
    assert open_exam(tiny) == 2
    assert_refused(
        capsys,
        "was made by another version of simbench",
        "open it with the version that made it",
    )


@pytest.mark.parametrize(
    ("content", "part"),
    [("{} ", "commitment"), ("hello", "no key file"), (None, "cannot be read")],
)
def test_another_key_is_refused(tiny, tmp_path, capsys, content, part):
    if content is not None:
        (tmp_path / "key").write_text(content.format((tiny / "key").read_text()))
    assert open_exam(tiny, key=tmp_path / "key") == 2
    assert_refused(capsys, part)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["make", "smoke", "-o", "new", "--key", "new/key"], "would lie inside"),
        (["make", "smoke", "-o", "new", "--key", "new"], "would lie inside"),
        (["make", "smoke", "-o", "EXAM", "--key", "other"], "exists already"),
        (["make", "smoke", "-o", "new", "--key", "KEY"], "exists already"),
        (["make", "smoke", "-o", "new", "--key", "other", "--n", "49"], "1 to 48"),
        (["answer", "EXAM", "-o", "new", "--method", "oracle"], "needs the truth"),
        (["answer", "EXAM", "-o", "EXAM/loops.csv", "--resume"], "not written over"),
        (["answer", "EXAM", "-o", "ANSWERS", "--method", "he", "--resume"], "other methods"),
    ],
)
def test_wrong_use_ends_in_one_sentence_and_writes_nothing(
    tiny, tmp_path, monkeypatch, capsys, words, part
):
    monkeypatch.chdir(tmp_path)
    known = {"EXAM": tiny / "exam", "KEY": tiny / "key", "ANSWERS": tiny / "answers.csv"}
    words = [
        str(Path(known.get(w.split("/")[0], w.split("/")[0]), *w.split("/")[1:])) for w in words
    ]
    assert main(["exam", *words]) == 2
    assert_refused(capsys, part)
    assert not list(tmp_path.iterdir())


def renamed(tiny, tmp_path, name, verdict=None):
    """Return the answers of `he` alone, under a name, all with one verdict where it is given."""
    rows = [row for row in csv.DictReader(lines_of(tiny)) if row["method"] == "he"]
    lines = ["method,record,verdict,score"]
    lines += [f"{name},{r['record']},{verdict or r['verdict']},{r['score']}" for r in rows]
    file = tmp_path / "mine.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("name", ["h\u0435", "HE", "h\u00e9", "he@tuned", "He-", "\uff48e"])
def test_a_name_that_looks_like_one_of_the_package_is_refused(tiny, tmp_path, capsys, name):
    assert open_exam(tiny, answers=[renamed(tiny, tmp_path, name)]) == 2
    assert_refused(capsys, "mine.csv, line 2")


def test_answers_under_a_name_of_the_package_are_those_of_the_package(tiny, tmp_path, capsys):
    assert open_exam(tiny, answers=[renamed(tiny, tmp_path, "he")]) == 0
    capsys.readouterr()
    rows = [row for row in csv.DictReader(lines_of(tiny)) if row["method"] == "he"]
    other = "no_decision" if rows[0]["verdict"] == "stiction" else "stiction"
    assert open_exam(tiny, answers=[renamed(tiny, tmp_path, "he", other)]) == 2
    assert_refused(capsys, "'he' is a method of the package", "another name")
    assert open_exam(tiny, answers=[renamed(tiny, tmp_path, "mine", other)]) == 0


def test_a_method_that_needs_mv_is_not_ranked_where_there_is_none(tmp_path):
    make_exam("smoke", tmp_path / "exam", tmp_path / "key", seed=SEED)
    answer_exam(tmp_path / "exam", tmp_path / "answers.csv", ["he", "kano_a", "yamashita"])
    with opened_exam(tmp_path / "exam", tmp_path / "key", [tmp_path / "answers.csv"]) as opened:
        rows = {row["method"]: row for row in score_run(opened.run).as_json()["rows"]
                if row["process"] == "all" and row["truth"] == "cycled"
                and row["population"] == "oscillating"}  # fmt: skip
    assert rows["he"]["applicable"] > 0
    for method in ("kano_a", "yamashita"):
        assert (rows[method]["applicable"], rows[method]["rank"]) == (0, None)


def test_answers_of_a_plugin_that_was_changed_are_not_passed_for_its_own(tmp_path, tiny, capsys):
    plugin, out = tmp_path / "slow.py", tmp_path / "answers.csv"
    plugin.write_text(PLUGIN)
    words = ["exam", "answer", str(tiny / "exam"), "-o", str(out), "--plugin", str(plugin)]
    words += ["--method", "slow"]
    assert main(words) == 0
    assert main([*words, "--resume"]) == 0
    plugin.write_text(PLUGIN.replace("last > 0", "last < 0"))
    capsys.readouterr()
    assert main([*words, "--resume"]) == 2
    assert "other plugins" in capsys.readouterr().err


def test_who_waited_for_another_call_does_not_take_its_pieces(tiny, tmp_path, monkeypatch):
    out, held = tmp_path / "answers.csv", answering.lease

    @contextlib.contextmanager
    def late(folder):
        with held(folder):  # while this call waited, another one began with other methods
            (tmp_path / "answers.csv.json").write_text(json.dumps({"methods": ["horch"]}))
            (folder / "000000.csv").write_text("horch,000,stiction,1,,\n")
            yield

    monkeypatch.setattr(answering, "lease", late)
    with pytest.raises(ParameterError, match="was begun already"):
        answer_exam(tiny / "exam", out, ["he"])
    assert not out.exists()


@pytest.mark.parametrize("what", ["exam.json", "loops.csv", "records.parquet", "key", "answers"])
@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_what_may_have_no_end_is_refused_before_it_is_read(tiny, tmp_path, capsys, what, kind):
    shutil.copytree(tiny / "exam", tmp_path / "exam")
    trap = tmp_path / ("exam" if "." in what else "") / what
    trap.unlink(missing_ok=True)
    os.mkfifo(trap) if kind == "pipe" else trap.symlink_to("/dev/zero")
    places = {"key": tmp_path / "key"} if what == "key" else {}
    places |= {"answers": [trap]} if what == "answers" else {}
    assert open_exam(tiny, exam=tmp_path / "exam", **places) == 2
    assert_refused(capsys, "is a pipe or a device")


def test_a_small_file_of_many_samples_is_refused_by_its_footer(tiny, tmp_path, capsys):
    shutil.copytree(tiny / "exam", tmp_path / "exam")
    column = pa.array(np.zeros(3_000_000))
    part = pa.table({"record": pa.array(["a"] * 3_000_000).dictionary_encode(),
                     **dict.fromkeys(("t", "sp", "op", "pv"), column)})  # fmt: skip
    file = tmp_path / "exam" / "records.parquet"
    with pq.ParquetWriter(file, part.schema, compression="zstd") as writer:
        for _ in range(9):
            writer.write_table(part)
    assert file.stat().st_size < 2e6
    assert open_exam(tiny, exam=tmp_path / "exam") == 2
    assert_refused(capsys, "records.parquet unpacks to 1080 MB")


def test_the_loops_of_a_run_can_be_asked(tmp_path):
    run = run_grid("smoke", tmp_path / "run", ["he"], n=12)
    loops = pd.read_parquet(run / "scenarios.parquet").set_index("scenario_id")
    make_exam(run, tmp_path / "exam", tmp_path / "key", n=6, seed=3)
    secret = json.loads((tmp_path / "key").read_text())
    asked = {record["scenario"]: record["seed"] for record in secret["records"].values()}
    assert asked == loops.seed[list(asked)].to_dict()
    assert len(asked) == 6
    exam = read_exam(tmp_path / "exam")
    rows = "".join(f"mine,{name},stiction,1\n" for name in exam.records)
    (tmp_path / "mine.csv").write_text(f"method,record,verdict,score\n{rows}")
    with opened_exam(tmp_path / "exam", tmp_path / "key", [tmp_path / "mine.csv"]) as opened:
        assert opened.missing == {}
        assert set(opened.labels.cycled) <= set(loops.cycled)
