"""What is written is whole under its name, on this machine, or not at all."""

import csv
import os
import subprocess
import sys

import pandas as pd
import pytest

from simbench.cli import main
from simbench.files import (
    HOST,
    FileError,
    folder,
    plain_cell,
    refuse_own_input,
    remove_stale_temporaries,
    whole_file,
    write_table,
)


@pytest.mark.parametrize(
    "url", ["s3://bucket/run", "gs:/bucket/run", "memory://run", "file:///tmp/run"]
)
def test_a_url_is_refused_and_no_folder_is_made(url, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match="is a URL; a path on this machine is needed"):
        folder(url)
    with pytest.raises(FileError, match="is a URL"), whole_file(url):
        pass
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "cell", ["=1+1", "@SUM(A1)", "+cmd|'/c calc'!A0", "-2+cmd()", "\t=1", "\r=1", "=", "-a"]
)
def test_text_that_a_spreadsheet_would_compute_is_quoted(cell, tmp_path):
    frame = pd.DataFrame({cell: [cell, "plain", None], "x": [-1.5, 2.0, 3.0]})
    write_table(frame, tmp_path / "t.csv")
    with open(tmp_path / "t.csv", newline="") as f:
        rows = list(csv.reader(f))
    quoted = "'" + cell.replace("\r", " ")  # a bare carriage return would end the line
    assert rows == [[quoted, "x"], [quoted, "-1.5"], ["plain", "2.0"], ["", "3.0"]]


def test_text_after_a_list_separator_is_another_cell_in_many_countries():
    cells = ("x;=1+1", "x; @SUM(A1)", "x\t+cmd|'/c'!A0", "x\n=1", 'x;"=1', "x;\uff1d1")
    quoted = ["x;'=1+1", "x;' @SUM(A1)", "x\t'+cmd|'/c'!A0", "x\n'=1", "x;'\"=1", "x;'\uff1d1"]
    assert [plain_cell(c) for c in cells] == quoted


def test_the_verbs_that_echo_a_table_quote_it_too(tmp_path, capsys):
    (tmp_path / "in.csv").write_text("t,op,=cmd\n0,50,=1+1\n1,-5,-3\n2,52,@x\n")
    assert (
        main(
            [
                "valve",
                "--model",
                "choudhury",
                "--param",
                "S=5",
                "--param",
                "J=2",
                str(tmp_path / "in.csv"),
                "-o",
                str(tmp_path / "out.csv"),
            ]
        )
        == 0
    )
    lines = (tmp_path / "out.csv").read_text().splitlines()
    assert [line.rsplit(",", 1)[0] for line in lines] == [
        "t,op,'=cmd",
        "0,50,'=1+1",
        "1,-5,-3",
        "2,52,'@x",
    ]


def test_a_name_that_is_no_text_is_written_and_printed(tmp_path, capsys):
    with whole_file(tmp_path / "a.txt") as f:
        f.write("a\udcffb")
    assert (tmp_path / "a.txt").read_text() == "a\\udcffb"


@pytest.mark.parametrize("name", ["x" * 255, "\u4f4d" * 85])
def test_a_name_as_long_as_the_file_system_takes_is_written(tmp_path, name):
    with whole_file(tmp_path / name) as f:
        f.write("whole")
        (temporary,) = tmp_path.iterdir()
        assert temporary.name.endswith(f".{HOST}.{os.getpid()}")
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_what_a_killed_process_left_half_written_goes_and_what_others_write_stays(tmp_path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    names = [
        f".fig.svg.{HOST}.{dead.pid}",
        f".fig.svg.{HOST}.{os.getpid()}",
        f".fig.svg.00000000.{dead.pid}",
        ".hidden",
        "a.1",
    ]
    for name in names:
        (tmp_path / name).touch()
    remove_stale_temporaries(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(names[1:])


def test_a_link_to_itself_is_refused_where_it_is_written_and_harmless_where_others_are_read(
    tmp_path,
):
    (tmp_path / "self.csv").symlink_to("self.csv")
    with pytest.raises(FileError, match="leads back to itself; name another file"):
        refuse_own_input([tmp_path / "self.csv"], [])
    refuse_own_input([tmp_path.parent / "out.csv"], [tmp_path])
