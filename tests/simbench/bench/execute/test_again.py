"""A second answer of the same detector about the same record is the same answer."""

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from bench_fixtures import SMALL
from plain_loops import chaotic_loop

from simbench.bench.execute import again
from simbench.bench.execute.again import check_and_ask_again
from simbench.bench.execute.run import run_grid
from simbench.bench.score.baseline import write_baseline
from simbench.bench.store.manifest import read_manifest
from simbench.detectors.methods import he
from simbench.loop.simulate import simulate
from simbench.scenarios.grid import make_grid
from simbench.scenarios.spec import Loop


def test_a_detector_that_answers_otherwise_the_second_time_is_reported(tmp_path, monkeypatch):
    rng, honest = np.random.default_rng(0), he.detect

    def moody(prepared, **thresholds):
        verdict = honest(prepared, **thresholds)
        return replace(verdict, score=verdict.score + (rng.random() < 0.1))

    monkeypatch.setattr(he, "detect", moody)
    run = run_grid(make_grid(SMALL, "small"), tmp_path / "run", ["he", "horch"])
    problems = check_and_ask_again(run, run).problems
    assert len(problems) == 1
    assert problems[0].startswith("method he differs from itself on ")


def test_an_honest_detector_is_the_same_twice(finished):
    assert check_and_ask_again(finished, finished).result == "same"


def elsewhere(run, place, share=1.0):
    """The run as a baseline whose records have other bits, as of another processor."""
    write_baseline(run, place)
    table = pq.read_table(place / "scenarios.parquet")
    hashes = np.array(table.column("record_hash").to_pylist(), dtype=object)
    hashes[: round(share * len(hashes))] = "0" * 16
    at = table.schema.get_field_index("record_hash")
    table = table.set_column(at, table.schema.field(at), pa.array(hashes.tolist()))
    pq.write_table(table, place / "scenarios.parquet")
    return place


def test_where_bits_differ_an_ensemble_tells_what_they_lose(finished, tmp_path):
    baseline = elsewhere(finished, tmp_path / "base")
    check = check_and_ask_again(finished, baseline)
    n = read_manifest(finished)["counts"]["scenarios"]
    assert check.result == "same"
    assert check.bits == {"equal": 0, "other_bits": n, "other_verdict": 0}
    assert f"{min(n, 100)} of them simulated 2 times with PV times 1 plus or minus" in check.basis
    assert "not asked" not in check.basis
    # answers may be lost where nothing but the last bits changes, and few are
    explained = check.tests.query("what == 'right'")
    assert (explained["explained"] < 0.5 * explained["n"]).all()


def with_gain(loop, factor):
    return loop.model_copy(update={"plant": loop.plant.with_gain(factor)})


def test_the_ensemble_differs_in_its_last_bits_and_soon_altogether():
    loop = chaotic_loop(sampling={"Ts": 1.0, "n": 3000}, noise={"std": 0.02})
    one = simulate(with_gain(loop, 1.0), 1).record.pv
    other = simulate(with_gain(loop, 1.0 + 1e-12), 1).record.pv
    apart = np.abs(other - one)
    assert 0.0 < apart[:40].max() < 1e-9
    assert apart[-500:].max() > 0.1


def test_every_kind_of_plant_is_shaken():
    tf = {"type": "tf", "num": [2.0], "den": [6.0, 5.0, 1.0], "Td": 1.0}
    own = {"type": "tank", "K": 1.0, "T": 10.0, "Td": 1.0}
    for plant in (tf, own, {"type": "integrating", "K": 0.1}):
        loop = Loop.from_table(
            {
                "plant": plant,
                "controller": {"type": "PI", "Kc": 0.5, "Ti": 20.0},
                "sampling": {"Ts": 1.0, "n": 200},
                "setpoint": {"value": 50.0, "steps": [[0.0, 51.0]]},
            }
        )
        plain = simulate(with_gain(loop, 1.0)).record.pv
        shaken = simulate(with_gain(loop, 1.0 + 1e-12)).record.pv
        assert 0.0 < np.abs(shaken - plain).max() < 1e-9


def test_on_another_processor_the_same_question_is_asked_twice(finished, monkeypatch):
    """Scores that were stored elsewhere differ in their last bits, which is nobody's fault."""
    honest = he.detect

    def otherwise(prepared, **thresholds):
        verdict = honest(prepared, **thresholds)
        return replace(verdict, score=verdict.score * (1.0 + 1e-4))

    monkeypatch.setattr(he, "detect", otherwise)
    (problem,) = check_and_ask_again(finished, finished).problems
    assert problem.startswith("method he differs from itself on ")
    monkeypatch.setattr(again, "processor", lambda: {"numpy": "another"})
    assert check_and_ask_again(finished, finished).result == "same"
