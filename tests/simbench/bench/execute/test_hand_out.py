"""Records without labels are those of a run of the same grid, and tell nothing more."""

import json

import pandas as pd
import pytest

from simbench.bench.execute.hand_out import write_records
from simbench.bench.execute.run import run_grid
from simbench.bench.store.reading import read_scenario
from simbench.cli import main
from simbench.detectors.errors import UserError
from simbench.loop.simulate import simulate


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Records of a sample of a grid with another seed, and a run of it; never to be changed."""
    place = tmp_path_factory.mktemp("hand_out")
    settings = {"n": 12, "sets": {"seed": 5}}
    write_records("smoke", place / "records", **settings)
    run_grid("smoke", place / "run", ["he"], **settings)
    return place


def read(folder):
    loops = pd.read_csv(folder / "loops.csv", dtype={"record": str})
    return loops, pd.read_parquet(folder / "records.parquet")


def test_they_are_the_records_of_a_run_under_its_ids(place):
    loops, records = read(place / "records")
    table = pd.read_parquet(place / "run" / "scenarios.parquet")
    assert loops.record.tolist() == sorted(table.scenario_id)
    assert records.record.unique().tolist() == loops.record.tolist()
    ident = loops.record[3]
    scenario = read_scenario(place / "run", ident)
    record = simulate(scenario.loop, scenario.seed).record
    mine = records[records.record == ident]
    for name in ("t", "sp", "op", "pv"):
        assert (mine[name].to_numpy() == getattr(record, name)).all(), name
    about = loops.set_index("record").loc[ident]
    assert (about.Ts, about.process) == (record.Ts, record.process)
    assert (about.op_lo, about.op_hi) == record.op_span


def test_they_hold_neither_labels_nor_the_valve_position(place):
    loops, records = read(place / "records")
    assert list(records) == ["record", "t", "sp", "op", "pv"]
    assert list(loops) == ["record", "Ts", "process", "op_lo", "op_hi"]
    assert sorted(p.name for p in (place / "records").iterdir()) == [
        "loops.csv",
        "records.parquet",
    ]


def test_those_of_a_run_are_the_same(place, tmp_path):
    write_records(place / "run", tmp_path / "again")
    for one, other in zip(read(place / "records"), read(tmp_path / "again"), strict=True):
        pd.testing.assert_frame_equal(one, other)


def test_a_full_folder_is_refused(place):
    with pytest.raises(UserError, match="new or an empty folder"):
        write_records("smoke", place / "records")


def test_the_command_line_tells_a_grid_from_a_loop(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", "smoke", "-o", "records", "--n", "4", "--set", "seed=5"]) == 0
    told = capsys.readouterr().out
    assert "records: 4 records without labels" in told
    assert "simbench run smoke --n 4 --set seed=5 -o RUN" in told
    assert main(["simulate", "smoke", "-o", "two", "--n", "2", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"records": "two", "n": 2}
    for wrong, word in (
        (["smok", "-o", "x"], "smoke"),
        (["smoke", "-o", "x", "--seed", "3"], "--set seed=N"),
        (["smoke", "-o", "x", "--n", "9999"], "9999 points"),
        (["loop.toml", "-o", "x", "--n", "3"], "loop.toml"),
        (["smoke"], "-o"),
    ):
        assert main(["simulate", *wrong]) == 2, wrong
        assert word in capsys.readouterr().err
