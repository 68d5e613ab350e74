"""Input that once ended in a fault of the program, in silence or in minutes of nothing: one
sentence each.
"""

import os
from importlib import import_module
from importlib.resources import files

import numpy as np
import pytest

from tests.simbench.boundary.conftest import answer_to, asked, names_in, refused
from tests.simbench.boundary.test_loops import text as loop_text


@pytest.fixture
def here(here):
    """A folder with a loop and a record in it, where the command runs."""
    (here / "loop.toml").write_text(loop_text())
    write(here / "rec.csv", np.arange(900))
    for name in ("self.csv", "self"):
        (here / name).symlink_to(name)
    for name in ("pipe.mat", "pipe.csv", "pipe.toml", "pipe.json"):
        os.mkfifo(name)
    return here


def write(path, times, head: str = "t,op,pv") -> None:
    """Write a record of a loop that oscillates."""
    k = np.arange(len(times))
    op = 50 + 6 * np.sin(k / 8)
    pv = 30 + 5 * np.copysign(1, np.sin(k / 8 - 1)) + 0.1 * np.sin(7.1 * k)
    rows = (f"{float(t)!r},{u:.4f},{y:.4f}\n" for t, u, y in zip(times, op, pv))
    path.write_text(f"{head}\n{''.join(rows)}")


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        ("simulate loop.toml -o self.csv", "leads back to itself; name another file"),
        ("detect rec.csv --csv self.csv", "leads back to itself; name another file"),
        ("run smoke -o self", "cannot be made"),
        ("detect self.csv", "does not exist"),
        ("detect rec.csv --plugin self/x.py", ""),
        ("detect pipe.mat", "is needed"),
        ("detect pipe.csv", "are needed"),
        ("simulate pipe.toml -o out.csv", "is needed"),
        ("run pipe.toml -o run", "is needed"),
        ("run smoke -o run --set seed=5_0", "seed"),
        ("simulate loop.toml -o ftp://me:secret@host/r.csv", "***@host/r.csv"),
        ("run smoke -o nothing://me:secret@host/run", "***@host/run"),
        ("run smoke -o run --backend dask --address tcp://me:secret@127.0.0.1:1", "***@"),
    ],
)
def test_hostile_words_end_in_a_sentence(here, words, needed):
    if "dask" in words:
        pytest.importorskip("distributed")
    before = names_in(here)
    code, _, message = asked(words)
    assert code == 2
    assert needed in message
    assert "secret" not in message
    assert names_in(here) == before


@pytest.mark.parametrize("last", [1e300, 1e17, 1e308])
def test_times_that_no_whole_number_counts_are_refused(here, last):
    write(here / "rec.csv", [*range(899), last])
    refused("detect rec.csv --method horch", "time step", "is needed")


def test_an_axis_without_end_is_refused_before_it_is_read_value_by_value(here):
    values = ", ".join(str(0.3 + k * 1e-7) for k in range(20_000))
    (here / "grid.toml").write_text(GRID.replace("1.0", values))
    refused(
        "run grid.toml -o run",
        "'controller.Kc' has 20000 values; at most 10000 are allowed",
    )


GRID = """
title = "t"
[axes]
"controller.Kc" = [1.0]
[loop.plant]
type = "foptd"
K = 1
T = 10
[loop.controller]
type = "P"
Kc = 1
"""


@pytest.mark.parametrize("first", [45_000.0, 739_000.0])  # of a spreadsheet, and of MATLAB
def test_days_are_never_taken_for_seconds(here, first):
    write(here / "days.csv", first + np.arange(900) / 86400, "timestamp,op,pv")
    refused("detect days.csv", "or 1 s if it counts days", "--ts 1")
    assert "Ts = 1 s" in answer_to("detect days.csv --method horch --ts 1")


def test_an_underscore_makes_no_number(here):
    text = (here / "rec.csv").read_text().splitlines()
    (here / "rec.csv").write_text("\n".join([text[0], "0,5_0.3,30", *text[2:]]))
    refused("detect rec.csv", "op is '5_0.3'", "line 2")


def test_a_load_of_period_0_is_refused_before_anything_is_simulated(here, stopped):
    text = (files("simbench.scenarios") / "grids" / "smoke.toml").read_text()
    assert "period = [0.4, 2.5]" in text
    (here / "grid.toml").write_text(text.replace("period = [0.4, 2.5]", "period = 0", 1))
    refused("run grid.toml -o run", "disturbance 'sine': period = 0; it must be above 0")


CLOSED = [
    "simulate loop.toml -o closed/r.csv",
    "run smoke -o closed/run",
    "detect rec.csv --method horch --csv closed/v.csv",
    "figure table-11-4 -o closed",
]


@pytest.mark.skipif(
    os.getuid() == 0 and not hasattr(os, "seteuid"),
    reason="needs a user whom a folder can be closed to",
)
def test_a_folder_closed_to_its_reader_is_named(here):
    closed = here / "closed"
    closed.mkdir(mode=0o555)
    root = os.geteuid() == 0
    here.chmod(0o777)
    # the other user could not read what is imported later
    for module in ("email.parser", "matplotlib.font_manager"):
        import_module(module)
    if root:
        for above in (here, *list(here.parents)[:3]):
            above.chmod(above.stat().st_mode | 0o011)
        os.seteuid(12345)
    try:
        for words in CLOSED:
            code, _, message = asked(words)
            assert code == 2
            assert "permission denied" in message
    finally:
        if root:
            os.seteuid(0)
    assert not list(closed.iterdir())


VERBS = [
    "detect rec.csv",
    "diagnose rec.csv",
    "run smoke -o run",
    "simulate loop.toml -o out.csv",
    "list grids",
    "score run",
    "check run --against b",
    "figure table-11-4 -o f",
    "valve --model kano op.csv -o v.csv",
]
