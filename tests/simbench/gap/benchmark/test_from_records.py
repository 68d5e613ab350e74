"""A grid from records: the loops that copy them, labelled by simulation, the same every time."""

import numpy as np
import pytest

import simbench
from simbench.bench.execute.compute_piece import compute_piece
from simbench.bench.execute.run import run_grid
from simbench.bench.scenario.resolve import resolve
from simbench.bench.scenario.truth import YES, simulate_with_truth
from simbench.bench.score.scoring import score_run
from simbench.bench.store.reading import read_table
from simbench.detectors.errors import ParameterError, RecordError, Refusal, UserError
from simbench.detectors.record import LoopRecord
from simbench.files import write_record
from simbench.gap.benchmark.from_records import (
    JUMPS,
    SIZES,
    grid_from_records,
    near_loop,
    plan_of_records,
)
from simbench.loop.effects import EFFECTS
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop


def _record(seed: int, **changed) -> LoopRecord:
    table = {
        "plant": {"type": "foptd", "K": 1.0, "T": 10.0, "Td": 3.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 10.0},
        "sampling": {"Ts": 1.0, "n": 900},
        "noise": {"std": 0.1},
        "disturbance": [{"type": "coloured", "at": "input", "amplitude": 2.0, "period": 20.0}],
    }
    record = simulate(Loop.from_table(table | changed), seed).record.without_mv()
    return LoopRecord(np.round(record.op, 2), np.round(record.pv, 2), record.Ts, sp=record.sp)


@pytest.fixture(scope="module")
def records():
    stuck = {"valve": {"model": "choudhury", "S": 6.0, "J": 3.0}}
    return {"quiet": _record(1), "stuck": _record(2, **stuck)}


@pytest.fixture(scope="module")
def made(records):
    return grid_from_records(records, "ours")


def _scenarios(grid):
    return [one for index in range(grid.group_count) for one in resolve(grid.group(index))]


def test_every_record_gives_sticky_and_healthy_loops(made):
    scenarios = _scenarios(made.grid)
    assert not made.left_out
    for name in ("quiet", "stuck"):
        own = [s for s in scenarios if s.tags["block"] == name]
        sticky = [s for s in own if s.tags["member"] == "sticky"]
        # of few records every cell is drawn twice
        assert len(sticky) == 2 * len(SIZES) * len(JUMPS)
        assert len(own) - len(sticky) >= len(sticky) // 3
    assert len({s.id for s in scenarios}) == len(scenarios)


def test_the_record_is_written_as_the_real_one(made, records):
    for one in _scenarios(made.grid)[:6]:
        run = simulate(one.loop, one.seed).record
        assert run.n == records["quiet"].n
        assert np.allclose(run.op, np.round(run.op, 2), atol=1e-9)


def test_the_friction_of_the_record_is_taken_out(made):
    near = made.loops["stuck"]
    assert near.loop.valve.name == "ideal"
    assert all(EFFECTS[e.name].block != "valve" for e in near.loop.effect)
    assert simulate_with_truth(near.loop, 3)[1].answer != YES


def test_labels_are_those_of_the_simulation(made):
    for one in _scenarios(made.grid):
        answer = simulate_with_truth(one.loop, one.seed)[1].answer
        assert answer != YES or one.tags["member"] == "sticky"


def test_an_echo_stands_beside_what_cycles(made):
    scenarios = _scenarios(made.grid)
    cycling = {
        (s.tags["block"], s.tags["cell"])
        for s in scenarios
        if simulate_with_truth(s.loop, s.seed)[1].answer == YES
    }
    echoes = {(s.tags["block"], s.tags["cell"]) for s in scenarios if s.tags["echo"] != "none"}
    assert cycling
    assert echoes <= cycling


def test_a_loop_that_was_kept_is_not_identified_again(records, made, tmp_path, monkeypatch):
    first = grid_from_records(records, "ours", kept=tmp_path)
    monkeypatch.setattr("simbench.gap.benchmark.from_records.near_loop", None)
    again = grid_from_records(records, "ours", kept=tmp_path)
    assert again.grid.table == first.grid.table == made.grid.table


def test_the_same_grid_for_any_number_of_workers(records, made):
    assert grid_from_records(records, "ours", jobs=2).grid.table == made.grid.table


def test_it_runs_and_scores_like_any_grid(made, tmp_path):
    folder = run_grid(made.grid, tmp_path / "run", ["srinivasan", "oracle"])
    scores = score_run(folder)
    assert scores.as_json()["grid"] == "ours"
    # what the copies are made for stands first
    assert scores.as_text().startswith("Rely on srinivasan for such loops: on ")
    again = run_grid(folder, tmp_path / "again", ["srinivasan"])
    assert (again / "manifest.json").exists()


def test_a_run_on_records_resumes_and_is_checked(records, tmp_path, monkeypatch):
    # a whole run on a folder of records
    (tmp_path / "ours").mkdir()
    for name, record in records.items():
        write_record(record, tmp_path / "ours" / f"{name}.csv")
    asked = {"sets": {"seed": 4}, "n": 16}
    whole = simbench.run(tmp_path / "ours", "srinivasan", out=tmp_path / "whole", **asked)

    # the same one, stopped at its third piece
    stop = 3

    def interrupted(*given):
        nonlocal stop
        stop -= 1
        if not stop:
            raise KeyboardInterrupt
        return compute_piece(*given)

    begun = {"out": tmp_path / "begun", **asked}
    with monkeypatch.context() as m:
        m.setattr("simbench.bench.execute.run.compute_piece", interrupted)
        with pytest.raises(KeyboardInterrupt):
            simbench.run(tmp_path / "ours", "srinivasan", **begun)

    # going on gives the same answers, and the whole run is no place for another
    resumed = simbench.run(tmp_path / "ours", "srinivasan", resume=True, jobs=2, **begun)
    one, other = (read_table(f, "verdicts", ["scenario_id", "verdict"]) for f in (whole, resumed))
    assert one.equals(other)
    assert one.num_rows == 16
    found = simbench.check(resumed, whole)
    assert not found.problems
    assert found.flips.empty
    with pytest.raises(ParameterError, match="is not empty; continue its run"):
        simbench.run(tmp_path / "ours", "srinivasan", out=whole)


def test_a_record_without_a_loop_is_named(records):
    op = 50.0 + np.random.default_rng(0).standard_normal(300)
    dead = LoopRecord(op, np.full(300, 7.0), 1.0)
    assert isinstance(near_loop(dead), Refusal)
    found = grid_from_records({"quiet": records["quiet"], "dead": dead}, "two")
    assert list(found.left_out) == ["dead"]
    assert "dead is left out" in found.as_text()
    with pytest.raises(RecordError, match="no record has a loop that is near it"):
        grid_from_records({"dead": dead}, "none")


def test_a_folder_without_records_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("id,label\none,stiction\n")
    with pytest.raises(UserError, match="no loop record found"):
        plan_of_records(tmp_path, tmp_path / "run", {})
    write_record(_record(1), tmp_path / "quiet.csv")
    assert list(plan_of_records(tmp_path, tmp_path / "run", {}).loops) == ["quiet"]
