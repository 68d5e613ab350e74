"""Residuals drawn again: compiled as plain, and only from a file beside the loop file."""

import os
import re
import tomllib

import numpy as np
import pytest

import simbench as sb
from simbench.detectors.errors import UserError
from simbench.loop.resampled import drawn
from simbench.loop.resolve import resolve_loop
from simbench.loop.run import run_setup
from simbench.loop.simulate import simulate
from simbench.scenarios.columns import in_a_file
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid
from simbench.scenarios.parts import Part
from simbench.scenarios.spec import Loop, load_loop
from simbench.scenarios.toml import toml_of

OP = [0.1, -0.3, 0.2, 0.4, -0.5, 0.1, 0.0]
PV = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
BASE = {
    "plant": {"type": "foptd", "K": 1.5, "T": 10, "Td": 2},
    "controller": {"type": "PI", "Kc": 0.8, "Ti": 10},
    "sampling": {"Ts": 2.0, "n": 200},
}
LOAD = {"type": "resampled", "piece": 6.0, "op": OP, "output": PV}


def loop(*loads, **sections) -> Loop:
    return Loop.from_table({**BASE, "disturbance": list(loads), **sections})


def signals(total=100, Ts=2.0, seed=1, **parameters):
    given = {"piece": 6.0, "op": OP, "output": PV} | parameters
    kept = {k: v for k, v in given.items() if v is not None}
    return dict(drawn(Part(name="resampled", parameters=kept), total, Ts, (seed, 100)))


def test_compiled_and_plain_give_the_same_bits():
    fast, slow = (run_setup(resolve_loop(loop(LOAD), 3), plain=p) for p in (False, True))
    assert np.array_equal(fast.record.op, slow.record.op)
    assert np.array_equal(fast.record.pv, slow.record.pv)
    assert np.array_equal(simulate(loop(LOAD), 3).record.pv, fast.record.pv)


def test_the_columns_may_stand_in_a_file_beside_the_loop_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = "".join(f"{a!r},{b!r},{k % 2}\n" for k, (a, b) in enumerate(zip(OP, PV, strict=True)))
    (tmp_path / "left.csv").write_text(f"op,output,pv_held\n{rows}")
    load = {"type": "resampled", "piece": 6.0, "file": "left.csv"}
    text = loop().to_toml() + (
        '[archive]\nfile = "left.csv"\n[[disturbance]]\ntype = "resampled"\npiece = 6.0\n'
        'file = "left.csv"\n'
    )
    (tmp_path / "loop.toml").write_text(text)
    read = load_loop(tmp_path / "loop.toml")
    assert read == loop(LOAD, archive={"pv_held": [0, 1, 0, 1, 0, 1, 0]})
    assert Loop.from_table(tomllib.loads(read.to_toml())) == read
    assert sb.load_loop(tmp_path / "loop.toml").to_table() == read.to_table()
    grid = re.sub(r"(?m)^(\[+)", r"\1loop.", text) + '[axes]\n"plant.K" = [1.0, 2.0]\n'
    (tmp_path / "grid.toml").write_text(f'title = "own"\n{grid}')
    assert len(load_grid(tmp_path / "grid.toml")) == 2
    for content, words in {
        "a,b\n1,2\n": "has the columns a, b; at least one of op, input, output is needed",
        "op\n1\nx\n": "line 3: column 1 is 'x'; a number is needed",
        "op\n": "holds no numbers",
    }.items():
        (tmp_path / "left.csv").write_text(content)
        with pytest.raises(SpecError, match=words):
            Loop.from_table(BASE | {"disturbance": [load]})
    with pytest.raises(SpecError, match="file and op are given; one of both is needed"):
        Loop.from_table(BASE | {"disturbance": [LOAD | {"file": "left.csv"}]})
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(SpecError, match=r"pipe.csv is no file; a CSV file of numbers is needed"):
        Loop.from_table(BASE | {"disturbance": [load | {"file": "pipe.csv"}]})
    (tmp_path / "left.csv").unlink()
    with pytest.raises(SpecError, match=r"left.csv: no such file"):
        load_loop(tmp_path / "loop.toml")


@pytest.mark.parametrize(
    "file", ["../secret.csv", "{}/secret.csv", "link.csv", "a/../../secret.csv"]
)
def test_a_file_that_is_not_beside_the_loop_file_is_refused_unread(tmp_path, monkeypatch, file):
    (tmp_path / "secret.csv").write_text("op\nhunter2\nx\n")
    home = tmp_path / "home"
    (home / "a").mkdir(parents=True)
    monkeypatch.chdir(home)
    (home / "link.csv").symlink_to(tmp_path / "secret.csv")
    load = {"type": "resampled", "piece": 6.0, "file": file.format(tmp_path)}
    with pytest.raises(SpecError, match=r"is not in the folder of the loop file") as why:
        Loop.from_table(BASE | {"disturbance": [load]})
    assert "hunter2" not in str(why.value)
    (home / "a" / "left.csv").write_text("op\n1\n2\n3\n4\n5\n6\n7\n8\n")
    Loop.from_table(BASE | {"disturbance": [load | {"file": "a/left.csv"}]})


@pytest.mark.parametrize("moves", [0, 40, 41])
def test_a_set_point_that_moves_often_stands_in_a_file_beside_the_loop_file(tmp_path, moves):
    steps = [(2.0 * k, 50.0 + k % 3) for k in range(1, moves + 1)]
    whole = loop(setpoint={"value": 50.0, "steps": steps})
    table, columns = in_a_file(whole.to_table(), "left.csv")
    assert bool(columns) == (moves > 40)
    (tmp_path / "left.csv").write_text(columns)
    (tmp_path / "loop.toml").write_text(toml_of(table))
    assert load_loop(tmp_path / "loop.toml") == whole
    if columns:
        (tmp_path / "left.csv").write_text("sp_time,sp\n1,50\n2,\n")
        with pytest.raises(SpecError, match="2 numbers of sp_time and 1 of sp"):
            load_loop(tmp_path / "loop.toml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"piece": 0.5}, "0 samples; 1 to 7 are needed"),
        ({"piece": 16.0}, "8 samples; 1 to 7 are needed"),
        ({"op": [1.0, 2.0]}, "columns of one length"),
        ({"op": None, "output": None}, "no residuals"),
        ({"op": [1.0, "x"]}, "op is no list of at least 2 numbers"),
        ({"filter": [1.0, -1.2]}, "filter: unstable: pole at z = 1.2"),
        ({"filter": 3}, "filter"),
        ({"pieces": 3}, "did you mean 'piece'"),
    ],
)
def test_what_cannot_be_drawn_is_one_sentence(change, words):
    with pytest.raises(UserError, match=words) as error:
        signals(**change)
    assert "\n" not in str(error.value)
