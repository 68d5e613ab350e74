"""The verb detect as people use it: a table first, reasons on request, every note once, files
next to it; and every help.
"""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
from importlib.metadata import version

import chromium
import pytest
import typer
from chromium import needs_browser

from simbench import cli
from simbench.detectors import faults
from simbench.gap.stiction.conclusion import judged
from simbench.scenarios.plant import Controller
from simbench.theory.public_loop import Loop

FAST = ["--method", "horch,he,kano_a,procedure"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("plant")
    for name, S in (("sticky", 5.0), ("sound", 0.0)):
        loop = Loop(
            plant={"type": "foptd", "K": 1, "T": 10, "Td": 2},
            controller={"type": "PI", "Kc": 1, "Ti": 10},
            valve={"model": "choudhury", "S": S, "J": 0.4 * S},
            sampling={"Ts": 1, "n": 1500},
            setpoint={"steps": [[10, 55]]},
            noise={"std": 0.05},
        )
        loop.simulate(1).to_frame().rename(columns={"op": "X1.OUT", "pv": "X1.MEAS"}).to_csv(
            place / f"{name}.csv", index=False
        )
    return place


def printed(capsys, *words):
    assert cli.main([str(w) for w in words]) == 0
    return capsys.readouterr()


def test_what_every_method_warns_of_is_printed_once(folder, capsys):
    out = printed(capsys, "detect", folder / "sticky.csv", *FAST, "--why").out
    assert out.count("process type unknown") == 1
    assert out.count("PV is 'X1.MEAS'") == 1


def test_a_folder_is_a_matrix(folder, capsys):
    out = printed(capsys, "detect", folder, *FAST).out.splitlines()
    rows = {
        line.split()[0]: line.split()[1:] for line in out if line.startswith(("sticky", "sound"))
    }
    assert rows["sound"] == ["-"] * 4
    assert "S" in rows["sticky"]
    # what the columns are stands above them
    names = [f"{i}={name}" for i, name in enumerate(FAST[1].split(","), 1)]
    columns = out.index(f"Columns: {', '.join(names)}.")
    assert out[columns + 1].startswith("S: stiction")
    assert columns < out.index(next(line for line in out if line.startswith("record")))
    concluded = printed(capsys, "detect", folder, "--method", "likelihood").out
    assert "What each method says: --why" in concluded
    assert "Columns: 1=likelihood." not in concluded
    asked = printed(capsys, "detect", folder, "--method", "likelihood", "--why").out
    assert "Columns: 1=likelihood." in asked


def test_table_and_page_are_written(folder, capsys, tmp_path):
    table, page = tmp_path / "v.csv", tmp_path / "v.html"
    shown = printed(capsys, "detect", folder, *FAST, "--csv", table, "--html", page, "--json")
    assert len(json.loads(shown.out)) == 8
    with table.open() as f:
        rows = list(csv.DictReader(f))
    assert [(r["record"], r["conclusion"]) for r in rows] == [
        ("sticky", "stiction"),
        ("sound", "no_stiction"),
    ]
    assert set(FAST[1].split(",")) < set(rows[0])
    html = page.read_text()
    assert "Does the valve stick?" in html
    assert html.index("sticky") < html.index("sound")
    assert "http" not in html.replace("http://www.w3.org", "")


def test_a_page_says_how_many_of_its_loops_are_drawn_and_what_made_it(
    folder, tmp_path, capsys, monkeypatch
):
    monkeypatch.setattr("simbench.page.detect_page._SHOWN", 1)
    monkeypatch.setattr("sys.argv", ["simbench", "detect", "my plant", "--html", "page.html"])
    page = tmp_path / "page.html"
    printed(capsys, "detect", folder, "--method", "horch", "--html", page)
    html = page.read_text(encoding="utf-8")
    assert "The first 1 of 2 loops are drawn below" in html
    assert "<pre>simbench detect &#39;my plant&#39; --html page.html\n</pre>" in html
    assert f"simbench {version('stiction-simbench')}" in html


@needs_browser
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1280, 400])
def test_in_a_browser_a_trend_and_a_loop_of_every_record_are_seen(
    folder, tmp_path, capsys, width, dark
):
    page = tmp_path / "page.html"
    printed(capsys, "detect", folder, "--method", "horch", "--html", page)
    assert chromium.seen_pictures(page, width, dark) == 2 * 2


def test_columns_period_and_loop_are_chosen(folder, capsys, tmp_path):
    frame = (folder / "sticky.csv").read_text().replace("t_s,sp,X1.OUT,X1.MEAS,mv", "clock,a,b,c,d")
    file = tmp_path / "mine.csv"
    file.write_text(frame)
    out = printed(
        capsys, "detect", file, "--columns", "op=b,pv=c", "--columns", "t=clock", "--method", "he"
    ).out
    assert "he reports stiction" in out
    assert (
        "Ts = 2 s"
        in printed(
            capsys, "detect", file, "--columns", "op=b,pv=c", "--ts", "2", "--method", "he"
        ).out
    )
    assert (
        "1500 samples"
        in printed(capsys, "detect", folder / "sticky.csv", "--tag", "X1", "--method", "he").out
    )
    assert cli.main(["detect", str(file), "--columns", "op=bb,pv=c"]) == 2
    assert "no column 'bb' for op" in capsys.readouterr().err


def test_the_version_is_the_packages(capsys):
    assert printed(capsys, "--version").out.strip() == version("stiction-simbench")


def every_verb(command, path=()):
    for name, one in command.commands.items():
        yield from (
            every_verb(one, (*path, name)) if hasattr(one, "commands") else [((*path, name), one)]
        )


VERBS = dict(every_verb(typer.main.get_command(cli.app)))


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_every_help_ends_with_examples_that_parse(verb, capsys):
    help_text = printed(capsys, *verb, "--help").out
    examples = help_text.split("Examples:\n")[1].strip().splitlines()
    assert examples
    for line in examples:
        words = line.split()
        assert words[: 1 + len(verb)] == ["simbench", *verb]
        VERBS[verb].make_context(verb[-1], words[1 + len(verb) :])


@pytest.mark.parametrize(
    ("typed", "at", "expected"),
    [("simbench run cha", 2, "chapter"), ("simbench detect --method hor", 3, "horch")],
)
def test_a_shell_completes_grids_and_methods(typed, at, expected):
    asked = {"_SIMBENCH_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(at)}
    command = [sys.executable, "-c", "from simbench.cli import entry; entry()"]
    out = subprocess.run(
        command, env={**os.environ, **asked}, capture_output=True, text=True
    ).stdout
    assert expected in out.split()


def test_a_folder_of_one_record_is_a_row_a_loop_too(folder, capsys, tmp_path, monkeypatch):
    (tmp_path / "one").mkdir()
    shutil.copy(folder / "sticky.csv", tmp_path / "one")
    table, page = tmp_path / "v.csv", tmp_path / "v.html"
    printed(capsys, "detect", tmp_path / "one", *FAST, "--csv", table, "--html", page)
    (row,) = csv.DictReader(io.StringIO(table.read_text()))
    assert (row["record"], row["conclusion"]) == ("sticky", "stiction")
    assert "The loops" in page.read_text()
    # of which nothing could be answered
    monkeypatch.delenv(faults.RAISED)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("simbench.gap.diagnosis.conclude", lambda record: 1 / 0)
    words = ["--csv", str(table), "--html", str(page)]
    assert cli.main(["detect", str(tmp_path / "one"), *FAST, *words]) == 1
    (row,) = csv.DictReader(io.StringIO(table.read_text()))
    assert (row["record"], row["conclusion"]) == ("sticky", "no record")


def test_a_record_that_fails_is_listed_with_its_file_and_the_others_are_answered(
    folder, capsys, monkeypatch, tmp_path
):
    monkeypatch.delenv(faults.RAISED)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for name in ("healthy", "sticky"):
        shutil.copy(folder / f"{name.replace('healthy', 'sound')}.csv", tmp_path / f"{name}.csv")
    (tmp_path / "torn.csv").write_text("t,op,pv\n0,1,2\n1,x,2\n")

    def conclude(record):
        if record.tag == "healthy":  # as a plant's controller without a gain did
            Controller(type="PI", Kc=0.0, Ti=1.0)
        return judged(record)[0]

    monkeypatch.setattr("simbench.gap.diagnosis.conclude", conclude)
    assert cli.main(["detect", str(tmp_path), "--method", "horch,likelihood", "--json"]) == 1
    out, err = capsys.readouterr()
    assert {row["record"] for row in json.loads(out) if row["method"]} == {"sticky"}
    (fault,) = (line for line in err.splitlines() if line.startswith("left out healthy"))
    assert "this record met a fault of the program itself (ValidationError)" in fault
    assert "pydantic" not in err
    assert "left out torn: " in err
    # of one record alone, the sentence names the command and so the file
    assert cli.main(["detect", str(tmp_path / "healthy.csv")]) == 2
    assert "healthy.csv` met a fault" in capsys.readouterr().err


def test_json_of_every_verb_that_concludes_has_the_conclusion_its_text_prints(folder, capsys):
    file = folder / "sticky.csv"
    for verb in (
        ("detect", file, "--method", "horch,likelihood"),
        ("diagnose", file),
        ("gap", "diagnose", file, "--identify"),
    ):
        first = " ".join(printed(capsys, *verb).out.split())
        answer = json.loads(printed(capsys, *verb, "--json").out)
        rows = answer if isinstance(answer, list) else [answer]
        assert len({json.dumps(row["conclusion"]) for row in rows}) == 1
        concluded = rows[0]["conclusion"]
        assert [*concluded] == ["verdict", "probability", "cause", "reason", "next", "notes"]
        assert concluded["verdict"] == "stiction"
        assert f"(probability of stiction {concluded['probability']:.2f})" in first
    alone = json.loads(printed(capsys, "detect", file, "--method", "horch", "--json").out)
    assert "conclusion" not in alone[0]  # nothing was weighed, as in the text


def test_how_a_record_is_read_is_explained_once(capsys):
    said = printed(capsys, "detect", "--help").out
    assert "State the recorded values of OP that mean 0 and" in " ".join(said.split())
    other = " ".join(printed(capsys, "diagnose", "--help").out.split())
    assert "--op-span" in other
    assert "see simbench detect --help" in other
    assert "State the recorded values of OP" not in other
