"""Verification: whoever changes a run and makes every checksum consistent again is found; run times
may differ.
"""

import contextlib
import json
import shutil

import numpy as np
import pandas as pd
import pytest
from bench_fixtures import SMALL
from typer.testing import CliRunner

from scenarios.grid import make_grid
from scenarios.spec import Loop, Scenario, content_hash
from simbench.bench.execute import verify as verify_module
from simbench.bench.execute.pieces import partition_file, records_hash
from simbench.bench.execute.run import run_grid
from simbench.bench.execute.verify import verify_run
from simbench.bench.score.baseline import write_baseline
from simbench.bench.score.scoring import score_book
from simbench.bench.store.benchmark import benchmark_of, grid_of
from simbench.bench.store.checksums import RunError, digest, partition
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.bench.store.place import place_of
from simbench.bench.store.reading import RunArrays
from simbench.bench.store.tables import SCENARIOS, VERDICT_SCHEMA, encode
from simbench.cli import app

METHODS = ["he", "horch", "yamashita"]
MINE = """
from detectors.method import Method
from detectors.verdict import Verdict
METHOD = Method(title="mine", source="own", front_end=False)
def detect(prepared):
    return Verdict("mine", "stiction", score=1.0, reason="always")
"""
SCHEMAS = {"scenarios": SCENARIOS, "verdicts": VERDICT_SCHEMA}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """An honest run of 32 scenarios, with one record kept."""
    return run_grid(
        make_grid(SMALL, "small", {"repeats": 2}),
        tmp_path_factory.mktemp("run") / "r",
        METHODS,
        keep=1,
    )


@pytest.fixture(scope="module")
def guest(tmp_path_factory):
    """A plug-in, and an honest run of a few scenarios that it took part in."""
    file = tmp_path_factory.mktemp("guest") / "mine.py"
    file.write_text(MINE)
    grid = make_grid(SMALL, "small", axes={"disturbance": ["none"], "Td_over_T": [0.3]})
    return file, run_grid(grid, file.parent / "r", ["he"], plugins=[file])


class Forgery:
    """A copy of a run whose tables and manifest can be changed, and which then states no wrong
    checksum.
    """

    def __init__(self, run, folder):
        self.folder = shutil.copytree(run, folder)
        self.manifest = read_manifest(folder)
        self.pieces = len(self.manifest["tables"]["scenarios"])
        self.rows = {
            kind: [
                pd.read_parquet(folder / partition_file(kind, i)).to_dict("records")
                for i in range(self.pieces)
            ]
            for kind in SCHEMAS
        }
        for rows in (row for kind in self.rows.values() for part in kind for row in part):
            rows.update({k: None for k, v in rows.items() if isinstance(v, float) and np.isnan(v)})

    def all(self, kind):
        return [row for part in self.rows[kind] for row in part]

    def of(self, method):
        truth = {row["scenario_id"]: row["cycled"] == "yes" for row in self.all("scenarios")}
        return [
            (row, truth[row["scenario_id"]])
            for row in self.all("verdicts")
            if row["method"] == method
        ]

    def write(self):
        for kind, parts in self.rows.items():
            shutil.rmtree(self.folder / f"{kind}.parquet")
            (self.folder / f"{kind}.parquet").mkdir()
            self.manifest["tables"][kind] = []
            for i, rows in enumerate(parts):
                content = encode(
                    {f.name: [row[f.name] for row in rows] for f in SCHEMAS[kind]}, SCHEMAS[kind], i
                )
                (self.folder / f"{kind}.parquet" / partition(i)).write_bytes(content)
                self.manifest["tables"][kind].append(digest(content))
        count = len(self.all("scenarios"))
        self.manifest["counts"] = {
            "scenarios": count,
            "verdicts": len(self.all("verdicts")),
            "errors": 0,
        }
        self.manifest["seed"] = self.manifest["grid_content"]["seed"]
        self.close()
        book = RunArrays.read(self.folder, self.manifest)
        grid = grid_of(self.manifest)
        self.manifest |= {
            "records_hash": records_hash(book),
            "grid_hash": grid.hash,
            "cells_hash": grid.cells_hash,
        }
        self.manifest["benchmark"] = benchmark_of(grid, book.ids.astype(str).tolist())
        score_book(book).write(place_of(self.folder))
        self.close()

    def close(self):
        write_manifest(self.folder, self.manifest)


def in_favour(forgery):
    """Three wrong answers of a method become right ones."""
    wrong = [row for row, cycles in forgery.of("he") if (row["verdict"] == "stiction") != cycles][
        :3
    ]
    assert wrong
    for row in wrong:
        row["verdict"] = row["verdict_raw"] = (
            "no_stiction" if row["verdict"] == "stiction" else "stiction"
        )


def against_another(forgery):
    for row, cycles in forgery.of("horch")[::10]:
        row["verdict"] = "no_stiction" if cycles else "stiction"


def abstentions_decided(forgery):
    row, cycles = forgery.of("yamashita")[0]
    row |= {"verdict": "stiction" if cycles else "no_stiction", "verdict_raw": "no_decision"}


def better_scores(forgery):
    for row, cycles in forgery.of("he"):
        row["score"] = float(cycles)


def of_verdicts(**values):
    def change(forgery):
        forgery.of("he")[5][0].update(values)

    return change


def of_scenarios(**values):
    def change(forgery):
        for row in forgery.all("scenarios")[3:6]:
            row.update(values)

    return change


def swapped_labels(forgery):
    for row in forgery.all("scenarios")[:4]:
        row["cycled"] = {"yes": "no", "no": "yes"}.get(row["cycled"], "no")


def swapped_methods(forgery):
    for (one, _), (other, _) in zip(forgery.of("he"), forgery.of("horch"), strict=True):
        one["method"], other["method"] = other["method"], one["method"]
    for part in forgery.rows["verdicts"]:
        order = {row["scenario_id"]: i for i, row in reversed(list(enumerate(part)))}
        part.sort(key=lambda row: (order[row["scenario_id"]], METHODS.index(row["method"])))


def other_axis(forgery):
    """Axis, tags and id are made to agree."""
    row = forgery.all("scenarios")[2]
    row["tags"] = json.dumps({**json.loads(row["tags"]), "noise_ratio": 0.5})
    row["noise_ratio"] = 0.5
    renamed(forgery, row)


def other_loop(forgery):
    row = forgery.all("scenarios")[0]
    row["loop"] = row["loop"].replace('"sampling": {"Ts": ', '"sampling": {"Ts": 1')
    row["Ts"] = json.loads(row["loop"])["sampling"]["Ts"]
    renamed(forgery, row)


def other_seeds(forgery):
    for row in forgery.all("scenarios")[:2]:
        row["seed"] += 1
        renamed(forgery, row)


def renamed(forgery, row):
    was, loop = row["scenario_id"], Loop.from_table(json.loads(row["loop"]))
    row["scenario_id"] = Scenario(loop=loop, seed=row["seed"], tags=json.loads(row["tags"])).id
    for verdict in forgery.all("verdicts"):
        if verdict["scenario_id"] == was:
            verdict["scenario_id"] = row["scenario_id"]


def grid_seed(forgery):
    forgery.manifest["grid_content"]["seed"] = 4


def without_failures(forgery):
    """The scenarios of a group on which a method errs are gone."""
    lost = forgery.all("scenarios")[6]["group"]
    ids = {row["scenario_id"] for row in forgery.all("scenarios") if row["group"] == lost}
    for parts in forgery.rows.values():
        parts[:] = [[row for row in rows if row["scenario_id"] not in ids] for rows in parts]
    forgery.manifest["scenarios"] -= len(ids)


def half_the_pieces(forgery):
    for parts in forgery.rows.values():
        del parts[len(parts) // 2 :]


def duplicated(forgery):
    """A scenario that a method judges well stands in the place of another."""
    for parts in forgery.rows.values():
        parts[0] = [dict(row) for row in parts[0][: len(parts[0]) // 2]] * 2


def of_manifest(*path, value):
    def change(forgery):
        table = forgery.manifest
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = value

    return change


TAMPERINGS = {
    "wrong answers become right": in_favour,
    "right answers of another method become wrong": against_another,
    "no decision becomes an answer": abstentions_decided,
    "scores follow the truth": better_scores,
    "an estimate of S": of_verdicts(S_lo=3.0, S_hi=3.0, S_unit="%"),
    "a reason": of_verdicts(reason="clear stiction"),
    "an index": of_verdicts(indices="{}"),
    "a loop counts as covered": of_verdicts(applicable=False),
    "an error that was not": of_verdicts(error="ValueError: no"),
    "labels swapped": swapped_labels,
    "the label sticky": of_scenarios(sticky=True),
    "the label predicted": of_scenarios(predicted=None),
    "loops do not oscillate": of_scenarios(oscillating=False),
    "a record's hash": of_scenarios(record_hash="0" * 16),
    "sampling period alone": of_scenarios(Ts=1.0),
    "methods swapped": swapped_methods,
    "an axis with its id": other_axis,
    "a loop with its id": other_loop,
    "seeds with their ids": other_seeds,
    "the grid's seed": grid_seed,
    "a group removed": without_failures,
    "half of the pieces removed": half_the_pieces,
    "scenarios duplicated": duplicated,
    "thresholds": of_manifest("thresholds", value={"he": {"stiction_above": 0.9}}),
    "thresholds that the method has not": of_manifest(
        "thresholds", value={"he": {"stiction": 0.9}}
    ),
    "library version": of_manifest("versions", "numpy", value="1.26.0"),
    "code": of_manifest("code", value="0" * 16),
    "grid's name": of_manifest("grid", value="smoke"),
    "grid's version": of_manifest("grid_content", "draw", "S", value=[3.0, 5.0]),
    "oscillation detection": of_manifest("front_end", value="hagglund"),
    "where a method was fitted": of_manifest("methods", "he", "fitted_on", value=["small"]),
}


@pytest.mark.parametrize("how", TAMPERINGS)
def test_a_changed_run_with_consistent_checksums_is_refuted(run, tmp_path, how):
    forgery = Forgery(run, tmp_path / "f")
    TAMPERINGS[how](forgery)
    with contextlib.suppress(RunError):  # tables that no run has stay as they are
        forgery.write()
    found = verify_run(tmp_path / "f")
    assert found.contradictions, how


def test_what_stands_beside_the_tables_is_compared_too(run, tmp_path):
    def refuted(change):
        forgery = Forgery(run, tmp_path / "f")
        change(forgery)
        forgery.close()
        found = verify_run(tmp_path / "f")
        shutil.rmtree(tmp_path / "f")
        return " ".join(found.contradictions)

    def other_evaluator(forgery):
        stated = forgery.manifest["benchmark"]
        stated["parts"]["evaluator"] = "0" * 16
        stated["hash"] = content_hash(stated["parts"])

    def other_scores(forgery):
        file = forgery.folder / "scores.csv"
        table = pd.read_csv(file)
        table["cost"] /= 2
        table.to_csv(file, index=False)

    def other_record(forgery):
        file = next((forgery.folder / "records").iterdir())
        file.write_text(file.read_text().replace("1", "2"))

    assert "evaluator" in refuted(other_evaluator)
    assert "scores.csv" in refuted(other_scores)
    assert "record" in refuted(other_record)
    assert "counts" in refuted(of_manifest("counts", "errors", value=3))


def test_an_honest_run_is_verified_and_run_times_may_differ(run, tmp_path):
    forgery = Forgery(run, tmp_path / "f")
    for row in forgery.all("verdicts"):
        row["runtime_s"] *= 3
    forgery.write()
    (tmp_path / "f" / "page.html").write_text("accuracy 1.000")
    found = verify_run(tmp_path / "f", jobs=2)
    assert not found.contradictions
    assert found.asked == dict.fromkeys(METHODS, 32)
    assert "32 scenarios, drawn at random, were simulated again" in found.as_text()
    assert "file page.html" in found.as_text()  # which nobody computed again
    shown = CliRunner().invoke(app, ["verify", str(run), "--json"])
    assert (shown.exit_code, json.loads(shown.stdout)["verified"]) == (0, True)


def test_a_share_is_drawn_anew_and_says_what_can_escape(run, tmp_path, monkeypatch):
    monkeypatch.setattr(verify_module, "_LEAST", 1)
    monkeypatch.setattr(verify_module, "_LEAST_FAST", 1)
    forgery = Forgery(run, tmp_path / "f")
    of_verdicts(reason="clear stiction")(forgery)
    forgery.write()
    found = [verify_run(tmp_path / "f", share=0.5) for _ in range(12)]
    assert {f.simulated for f in found} == {16}
    # found and missed with a probability of a half each time: all alike once in two thousand
    assert {bool(f.contradictions) for f in found} == {True, False}
    honest = next(f for f in found if not f.contradictions)
    assert "fewer than 5 changed verdicts of a method can escape" in honest.as_text()


def test_a_plugin_is_asked_where_its_file_is_given(guest, tmp_path):
    file, folder = guest
    found = verify_run(folder)
    assert not found.contradictions
    assert "method mine (a plug-in whose file is not given)" in found.as_text()
    assert "mine" not in found.asked
    assert verify_run(folder, plugins=[file]).asked["mine"] > 0
    other = tmp_path / "mine.py"
    other.write_text(MINE.replace("always", "ever"))
    assert "digest" in verify_run(folder, plugins=[other]).contradictions[0]
    forgery = Forgery(folder, tmp_path / "f")
    forgery.manifest["plugins"]["mine"] = digest(other.read_bytes())
    forgery.write()
    assert "mine: reason differs" in " ".join(
        verify_run(tmp_path / "f", plugins=[other]).contradictions
    )
    # a built-in method is asked whatever the run calls it
    in_favour_of_he = Forgery(folder, tmp_path / "g")
    in_favour_of_he.manifest["plugins"]["he"] = "0" * 16
    of_verdicts(reason="clear stiction")(in_favour_of_he)
    in_favour_of_he.write()
    assert verify_run(tmp_path / "g").contradictions


def test_what_cannot_be_verified_is_refused(run, tmp_path):
    write_baseline(run, tmp_path / "b")
    with pytest.raises(RunError, match="keeps no grid"):
        verify_run(tmp_path / "b")
    with pytest.raises(RunError, match="states no plug-in"):
        verify_run(run, plugins=["mine.py"])


def test_further_rounds_of_an_adaptive_run_follow_from_the_grid(tmp_path):
    grid = make_grid(SMALL, "small", axes={"disturbance": ["none"], "Td_over_T": [0.3]})
    folder = run_grid(grid, tmp_path / "r", ["he"], until_width=0.55)
    assert not verify_run(folder).contradictions
    forgery = Forgery(folder, tmp_path / "f")
    assert max(row["repeat"] for row in forgery.all("scenarios")) > 0
    for parts in forgery.rows.values():
        parts.pop()
    forgery.write()
    assert verify_run(tmp_path / "f").contradictions
