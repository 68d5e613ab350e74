"""Verification: whoever changes a run and makes every checksum consistent again is detected; run
times may differ.
"""

import contextlib
import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from bench_fixtures import SMALL
from typer.testing import CliRunner

from simbench.bench.execute import verify as verify_module
from simbench.bench.execute.pieces import partition_file, records_hash
from simbench.bench.execute.run import run_grid
from simbench.bench.execute.verify import verify_run
from simbench.bench.execute.verify_result import Notes
from simbench.bench.score.baseline import write_baseline
from simbench.bench.score.scoring import score_book
from simbench.bench.store.benchmark import benchmark_of, grid_of
from simbench.bench.store.checksums import RunError, digest, partition
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.bench.store.place import place_of
from simbench.bench.store.reading import RunArrays
from simbench.bench.store.tables import SCENARIOS, VERDICT_SCHEMA, encode
from simbench.cli import app, main
from simbench.scenarios.grid import make_grid
from simbench.scenarios.spec import Loop, Scenario, content_hash

METHODS = ["he", "horch", "yamashita"]
MINE = """
from simbench.detectors.method import Method
from simbench.detectors.verdict import Verdict
METHOD = Method(title="mine", source="a test", front_end=False)
def detect(prepared):
    return Verdict("mine", "stiction", score=1.0, reason="always")
"""
SCHEMAS = {"scenarios": SCENARIOS, "verdicts": VERDICT_SCHEMA}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """An honest run of 8 scenarios, with one record of each piece kept."""
    return run_grid(
        make_grid(SMALL, "small", axes={"disturbance": ["sine"]}),
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

    def write(self, scores=True):
        for kind, parts in self.rows.items():
            shutil.rmtree(self.folder / f"{kind}.parquet")
            (self.folder / f"{kind}.parquet").mkdir()
            self.manifest["tables"][kind] = []
            for i, rows in enumerate(parts):
                content = encode(rows, SCHEMAS[kind], i)
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
        }
        self.manifest["benchmark"] = benchmark_of(grid, book.table)
        if scores:
            score_book(book).write(place_of(self.folder))
        self.close()

    def close(self):
        write_manifest(self.folder, self.manifest)


OPPOSITE = {"stiction": "no_stiction", "yes": "no", "no": "yes"}


def answers(forgery):
    """Of each method another column is changed, of one method two."""
    wrong = [row for row, cycles in forgery.of("he") if (row["verdict"] == "stiction") != cycles]
    assert wrong
    for row in wrong[:3]:
        row["verdict"] = OPPOSITE.get(row["verdict"], "stiction")
    for row, _ in forgery.of("horch")[::4]:
        row["verdict"] = OPPOSITE.get(row["verdict"], "stiction")
    row, cycles = forgery.of("yamashita")[0]
    row |= {"verdict": "stiction" if cycles else "no_stiction", "S_unit": "mA"}
    for row, cycles in forgery.of("he"):
        row["score"] = float(cycles)


def of_verdicts(**values):
    def change(forgery):
        forgery.of("he")[5][0].update(values)

    return change


LABELS = {
    "sticky": True,
    "predicted": None,
    "oscillating": False,
    "record_hash": "0" * 16,
    "Ts": 1.0,
}


def labels(forgery):
    for row in forgery.all("scenarios")[3:6]:
        row.update(LABELS, cycled=OPPOSITE.get(row["cycled"], "no"))


def swapped_methods(forgery):
    for (one, _), (other, _) in zip(forgery.of("he"), forgery.of("horch"), strict=True):
        one["method"], other["method"] = other["method"], one["method"]
    for part in forgery.rows["verdicts"]:
        order = {row["scenario_id"]: i for i, row in reversed(list(enumerate(part)))}
        part.sort(key=lambda row: (order[row["scenario_id"]], METHODS.index(row["method"])))


def other_axis(forgery):
    """Axis and tags are made to agree."""
    row = forgery.all("scenarios")[2]
    row["tags"] = json.dumps({**json.loads(row["tags"]), "noise_ratio": 0.5})
    row["noise_ratio"] = 0.5


def other_loop(forgery):
    row = forgery.all("scenarios")[0]
    row["loop"] = row["loop"].replace('"sampling": {"Ts": ', '"sampling": {"Ts": 1')
    row["Ts"] = json.loads(row["loop"])["sampling"]["Ts"]
    digested(forgery, row)


def other_seeds(forgery):
    for row in forgery.all("scenarios")[:2]:
        row["seed"] += 1
        digested(forgery, row)


def digested(forgery, row):
    """The digest is that of the changed loop."""
    loop = Loop.from_table(json.loads(row["loop"]))
    row["loop_digest"] = Scenario(loop=loop, seed=row["seed"]).loop_digest


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
    """A scenario that a method judges well takes the place of another."""
    for parts in forgery.rows.values():
        parts[0] = [dict(row) for row in parts[0][: len(parts[0]) // 2]] * 2


def of_manifest(*path, value):
    def change(forgery):
        table = forgery.manifest
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = value

    return change


def of_this_installation(forgery):
    of_manifest("versions", "numpy", value="1.26.0")(forgery)
    of_manifest("code", value="0" * 16)(forgery)
    of_manifest("methods", "he", "fitted_on", value=["small"])(forgery)


STATED = {
    "S_lo": 3.0,
    "S_hi": 3.0,
    "reason": "clear stiction",
    "indices": "{}",
    "applicable": False,
    "error": "ValueError: no",
}
# what is changed, and what the contradictions must name: where nothing is given, any one will do
TAMPERINGS = {
    "answers": (answers, ["he: verdict", "he: score", "horch: verdict", "yamashita: S_unit"]),
    "an answer's other columns": (of_verdicts(**STATED), [f"he: {key}" for key in STATED]),
    "labels": (labels, [f"scenario: {key}" for key in (*LABELS, "cycled")]),
    "installation": (of_this_installation, ["versions: numpy", "code", "method he: fitted_on"]),
    "methods swapped": (swapped_methods, []),
    "an axis with its tag": (other_axis, []),
    "a loop with its digest": (other_loop, []),
    "seeds with their digests": (other_seeds, []),
    "the grid's seed": (grid_seed, []),
    "a group removed": (without_failures, []),
    "half of the pieces removed": (half_the_pieces, []),
    "scenarios duplicated": (duplicated, []),
    "grid's name": (of_manifest("grid", value="smoke"), []),
    "grid's version": (of_manifest("grid_content", "draw", "S", value=[3.0, 5.0]), []),
}


@pytest.mark.parametrize("how", TAMPERINGS)
def test_a_changed_run_with_consistent_checksums_is_refuted(run, tmp_path, monkeypatch, how):
    """By its tables and its manifest: nobody looks at the scores."""
    monkeypatch.setattr(verify_module, "_compare_scores", lambda *_: None)
    change, wanted = TAMPERINGS[how]
    forgery = Forgery(run, tmp_path / "f")
    change(forgery)
    with contextlib.suppress(RunError):  # tables that no run has stay as they are
        forgery.write(scores=False)
    contradictions = verify_run(tmp_path / "f").contradictions
    assert contradictions, how
    for words in wanted:
        assert any(f"{words} differs" in c for c in contradictions), (words, contradictions)


def test_the_files_next_to_the_tables_are_compared_too(run, tmp_path):
    forgery = Forgery(run, tmp_path / "f")
    stated = forgery.manifest["benchmark"]
    stated["parts"]["evaluator"] = "0" * 16
    stated["hash"] = content_hash(stated["parts"])
    scores = forgery.folder / "scores.csv"
    table = pd.read_csv(scores)
    table["cost"] /= 2
    table.to_csv(scores, index=False)
    record = next((forgery.folder / "records").iterdir())
    record.write_text(record.read_text().replace("1", "2"))
    of_manifest("counts", "errors", value=3)(forgery)
    forgery.close()
    text = " ".join(verify_run(tmp_path / "f").contradictions)
    assert all(
        word in text
        for word in ("parts: evaluator", "scores.csv", "a record that was kept", "counts: errors")
    )


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_an_honest_run_is_verified_and_run_times_may_differ(run, tmp_path, jobs):
    forgery = Forgery(run, tmp_path / "f")
    for row in forgery.all("verdicts"):
        row["runtime_s"] *= 3
    forgery.write()
    (tmp_path / "f" / "page.html").write_text("accuracy 1.000")
    result = verify_run(tmp_path / "f", jobs=jobs)
    assert not result.contradictions
    assert result.asked == dict.fromkeys(METHODS, 8)
    assert "8 simulations, drawn at random" in result.as_text()
    assert "file page.html" in result.as_text()  # which nobody computed again


def test_the_command_prints_json(run):
    shown = CliRunner().invoke(app, ["verify", str(run), "--json"])
    assert (shown.exit_code, json.loads(shown.stdout)["verified"]) == (0, True)


def test_a_share_is_drawn_anew_and_the_text_names_what_can_escape(run, tmp_path, monkeypatch):
    monkeypatch.setattr(verify_module, "_LEAST", 1)
    monkeypatch.setattr(verify_module, "_LEAST_FAST", 1)
    make, seeds = np.random.default_rng, iter(range(9))
    # the draws of a run are those of its seed; the unseeded draw of a share is made repeatable
    monkeypatch.setattr(
        np.random, "default_rng", lambda *seed: make(*seed) if seed else make(next(seeds))
    )
    forgery = Forgery(run, tmp_path / "f")
    of_verdicts(reason="clear stiction")(forgery)
    forgery.write()
    results = []
    while len({bool(result.contradictions) for result in results}) < 2:
        results.append(verify_run(tmp_path / "f", share=0.5))
        assert len(results) < 9
    assert {result.simulated for result in results} == {4}
    honest = next(result for result in results if not result.contradictions)
    assert "fewer than 5 changed verdicts of a method can escape" in honest.as_text()


def test_a_plugin_is_asked_where_its_file_is_given_and_unverified_elsewhere(
    guest, tmp_path, capsys
):
    file, folder = guest
    result = verify_run(folder)
    assert not result.contradictions
    assert result.unverified == ("mine",)
    assert "mine" not in result.asked
    assert main(["verify", str(folder)]) == 1
    printed = capsys.readouterr().out
    assert "is not verified: mine of its methods was not asked again" in " ".join(printed.split())
    assert re.search(r"^mine +0 +unverified$", printed, re.M)
    assert not result.as_json()["verified"]
    whole = verify_run(folder, plugins=[file])
    assert whole.asked["mine"] > 0
    assert whole.as_json()["verified"]
    assert main(["verify", str(folder), "--plugin", str(file)]) == 0
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
    with pytest.raises(RunError, match="is a baseline"):
        verify_run(tmp_path / "b")
    with pytest.raises(RunError, match="states no plug-in"):
        verify_run(run, plugins=["mine.py"])


def test_tables_are_compared_key_by_key_and_a_table_in_place_of_a_number_is_one_contradiction():
    notes = Notes()
    notes.compare("grid", "", {"seed": 1, "title": "a"}, {"seed": 2, "title": "a", "n": 3})
    notes.compare("hash", "", None, {"parts": 1})
    notes.compare("same", "", {"a": 1}, {"a": 1})
    assert set(notes.entries) == {"grid: seed", "grid: n", "hash"}
