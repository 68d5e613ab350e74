"""A run folder or baseline with one thing changed: `score`, `check`, `report`, `simulate --from`
and `--resume` notice.
"""

from __future__ import annotations

import json
import os
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from simbench.bench.execute import pieces
from simbench.bench.execute.run import Interrupted, run_grid
from simbench.bench.score.check import check_run, update_baseline
from simbench.bench.score.compare import compare
from simbench.bench.score.scoring import score_run
from simbench.bench.store.checksums import RunError, digest, with_checksum
from simbench.scenarios.grid import load_grid
from tests.simbench.boundary.conftest import asked, check_sentence, refused, sampled

SMALL = {
    "disturbance": "none",
    "Td_over_T": 0.3,
    "S_over_2J": 0.5,
    "Td_over_Ti": 0.05,
    "periods": 15.0,
    "repeats": 3,
}
TABLES = ("scenarios", "verdicts")
CHANGED = {
    "scenarios": (
        "scenario_id",
        "cell",
        "repeat",
        "block",
        "member",
        "process",
        "noise_ratio",
        "seed",
        "sticky",
        "predicted",
        "refined",
        "theory",
        "cycled",
        "Ts",
        "n",
        "oscillating",
        "record_hash",
        "loop",
        "tags",
        "error",
    ),
    "verdicts": (
        "scenario_id",
        "method",
        "verdict",
        "score",
        "applicable",
        "reason",
        "error",
        "S_unit",
    ),
}


def worked(folder, resume=False, **sets):
    """Run a small grid."""
    grid = load_grid("smoke", {**SMALL, **sets})
    return run_grid(grid, folder, ["horch", "horch_histogram"], resume=resume)


def interrupted(folder, **sets):
    """A run whose pieces are all there, and that was stopped before its tables were joined."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pieces, "finish", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(Interrupted):
            worked(folder, **sets)
    return folder


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return worked(tmp_path_factory.mktemp("runs") / "done")


@pytest.fixture(scope="module")
def baseline(finished, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "baseline"
    update_baseline(finished, folder)
    return folder


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory):
    return interrupted(tmp_path_factory.mktemp("runs") / "unfinished")


ORDERS = {
    "drop first": lambda n: range(1, n),
    "drop last": lambda n: range(n - 1),
    "drop all": lambda n: [],
    "twice": lambda n: [*range(n), n - 1],
    "swapped": lambda n: [1, 0, *range(2, n)],
    "reversed": lambda n: range(n - 1, -1, -1),
    "half": lambda n: range(n // 2),
}
WHOLE = [("rows", way) for way in ORDERS]
WHOLE += [("file", way) for way in ("gone", "empty", "cut", "folder")]


def ways(kind: str) -> list[tuple[str, str]]:
    """Single faults of one table: a value in a column, a row, a column, a type, bytes of the
    file.
    """
    columns = CHANGED[kind]
    return [
        *(("cell", f"{c} {row}") for c in columns for row in ("first", "last")),
        *WHOLE,
        *(("column", f"{w} {c}") for c in columns for w in ("drop", "null")),
        *(("bytes", f"{place}") for place in range(24)),
    ]


def spoil(file, way: tuple[str, str]) -> None:
    what, how = way
    if what == "bytes":
        content = bytearray(file.read_bytes())
        at = int(np.random.default_rng(int(how)).integers(0, len(content)))
        content[at] ^= 1 << (int(how) % 8)
        file.write_bytes(content)
    elif what == "file":
        content = file.read_bytes()
        file.unlink()
        if how == "folder":
            file.mkdir()
        elif how != "gone":
            file.write_bytes(content[: len(content) // 2] if how == "cut" else b"")
    else:
        pq.write_table(_changed(pq.read_table(file), what, how), file)


def _changed(table: pa.Table, what: str, how: str) -> pa.Table:
    n = table.num_rows
    if what == "rows":
        return table.take(pa.array(list(ORDERS[how](n)), type=pa.int64()))
    name = how.split(" ")[1 if what == "column" else 0]
    at = table.schema.get_field_index(name)
    field = table.schema.field(at)
    if how.startswith("drop "):
        return table.remove_column(at)
    if how.startswith("null "):
        return table.set_column(at, field, pa.nulls(n, field.type))
    values = table.column(at).to_pylist()
    row = 0 if how.endswith("first") else n - 1
    old = values[row]
    values[row] = (
        (not old)
        if isinstance(old, bool)
        else f"{old}x"
        if isinstance(old, str) or old is None
        else old + 1
    )
    if old is None and not pa.types.is_string(field.type):
        values[row] = False if pa.types.is_boolean(field.type) else 1
    return table.set_column(at, field, pa.array(values, type=field.type))


def file_of(folder, kind: str):
    """The file of a baseline's table, or one in the middle of a run's."""
    table = folder / f"{kind}.parquet"
    return sorted(table.iterdir())[1] if table.is_dir() else table


def copied(folder, tmp_path):
    return shutil.copytree(folder, tmp_path / "copy")


def noticed(words: str) -> None:
    """Run a verb that must refuse the copied folder, or pass no judgement on it."""
    code, answer, message = asked(words)
    assert code in (1, 2), answer[:300]
    if code == 2:
        assert "copy" in message
        check_sentence(message)


def refuses(read, values=None) -> None:
    """Check that a function names the copied folder in the sentence of its error."""
    with pytest.raises(RunError, match="copy") as error:
        read()
    check_sentence(str(error.value), values)


def marks(file) -> list[str]:
    """What a sentence about a changed file quotes: its checksum."""
    return [digest(file.read_bytes())] if file.is_file() else []


@pytest.mark.parametrize(("kind", "way"), sampled([(k, way) for k in TABLES for way in ways(k)], 9))
def test_one_fault_in_a_table_of_a_run_or_a_baseline(finished, baseline, here, kind, way):
    run = copied(finished, here)
    file = file_of(run, kind)
    before = file.read_bytes()
    spoil(file, way)
    assert not file.is_file() or file.read_bytes() != before
    if way in WHOLE:  # the verbs themselves; else the functions they call
        noticed("score copy")
        noticed(f"check copy --against {baseline}")
    for read in (lambda: score_run(run), lambda: check_run(run, baseline), lambda: compare(run)):
        refuses(read, marks(file))
    shutil.rmtree(run)
    base = copied(baseline, here)
    file = file_of(base, kind)
    spoil(file, way)
    refuses(lambda: check_run(finished, base), marks(file))


@pytest.mark.parametrize(
    ("kind", "way"),
    sampled([(k, w) for k in TABLES for w in ("one more", "swapped", "twice", "renamed")], 3),
)
def test_partitions_that_do_not_belong_there(finished, baseline, here, kind, way):
    run = copied(finished, here)
    one, two = sorted((run / f"{kind}.parquet").iterdir())[:2]
    if way == "one more":
        shutil.copy(one, one.with_name("00009999.parquet"))
    elif way == "renamed":
        one.rename(one.with_name("part.parquet"))
    else:
        content = one.read_bytes()
        one.write_bytes(two.read_bytes())
        if way == "swapped":
            two.write_bytes(content)
    noticed("score copy")
    noticed(f"check copy --against {baseline}")
    noticed(f"simulate --from copy --id {'0' * 16} -o r.csv")


def places(content, path=()) -> list[tuple]:
    """The path to every key of nested tables."""
    paths = []
    for key, value in content.items():
        paths.append((*path, key))
        if isinstance(value, dict):
            paths += places(value, (*path, key))
    return paths


@pytest.mark.parametrize("every", [pytest.param(1, marks=pytest.mark.slow), 17])
def test_one_fault_anywhere_in_a_manifest(finished, baseline, here, every):
    for folder in (finished, baseline):
        text = (folder / "manifest.json").read_text()
        run = copied(folder, here)
        faults = [
            (path, value)
            for path in places(json.loads(text))
            for value in ("gone", None, "other", 0, [], {})
        ]
        assert len(faults) > 100
        for (*path, last), value in faults[::every]:
            content = table = json.loads(text)
            for step in path:
                table = table[step]
            if value == "gone":
                del table[last]
            elif table[last] == value and type(table[last]) is type(value):
                continue
            else:
                table[last] = value
            (run / "manifest.json").write_text(json.dumps(content))
            values = [str(value)[:60]] if last == "format" and value != "gone" else None
            refuses(
                lambda run=run, is_run=folder is finished: (
                    score_run(run) if is_run else check_run(finished, run)
                ),
                values,
            )
        shutil.rmtree(run)


NO_MANIFEST = [
    "",
    "{",
    "[]",
    "null",
    "1",
    "[" * 100_000,
    '{"format": 1}',
    "\0",
    f'{{"format": {"1" * 5000}}}',
]
READERS = [
    "score copy",
    "check copy --against FINISHED",
    "check FINISHED --against copy",
    "simulate --from copy --id 0000000000000000 -o r.csv",
    "run smoke -o copy --resume",
    "score copy --report r.html",
    "score FINISHED --compare copy --paired",
]


@pytest.mark.parametrize(
    ("words", "text"), sampled([(words, text) for text in NO_MANIFEST for words in READERS], 6)
)
def test_a_manifest_that_is_none(finished, here, words, text):
    (copied(finished, here) / "manifest.json").write_text(text)
    refused(words.replace("FINISHED", str(finished)), "copy")


@pytest.mark.parametrize("kind", TABLES)
def test_simulate_from_a_changed_run(finished, here, kind):
    scenario = pq.read_table(finished / "scenarios.parquet").column("scenario_id")[0].as_py()
    spoil(file_of(copied(finished, here), kind), ("cell", "scenario_id last"))
    refused(f"simulate --from copy --id {scenario} -o r.csv", "copy")
    refused(f"simulate --from {finished} --id nothing -o r.csv", "nothing")


def test_an_empty_baseline_never_passes(finished, baseline, here):
    """Emptied with all its checksums right."""
    base = copied(baseline, here)
    manifest = json.loads((base / "manifest.json").read_text())
    for kind in TABLES:
        spoil(base / f"{kind}.parquet", ("rows", "drop all"))
        manifest["tables"][kind] = digest((base / f"{kind}.parquet").read_bytes())
    (base / "manifest.json").write_text(json.dumps(with_checksum(manifest)))
    refused(f"check {finished} --against copy", "copy")


def contents(folder) -> str:
    """All of both tables but the times."""
    tables = [pq.read_table(folder / f"{kind}.parquet").to_pydict() for kind in TABLES]
    return json.dumps([t | {"runtime_s": None} for t in tables])


FAULTS = ("bytes", "gone", "empty", "cut", "other piece", "other run", "cell", "rows")
PARTS = [
    (k, w) for k in (*TABLES, "receipt") for w in FAULTS if (k, w) != ("verdicts", "other run")
]


@pytest.mark.parametrize(("kind", "way"), sampled(PARTS, 5))
def test_one_fault_in_a_piece_is_worked_again(finished, unfinished, here, kind, way):
    run = copied(unfinished, here)
    numbers = sorted(int(f.stem) for f in (run / "receipts").glob("*.json"))
    file, other = (
        run / (pieces.receipt_file(n) if kind == "receipt" else pieces.partition_file(kind, n))
        for n in numbers[:2]
    )
    if way == "other piece":
        shutil.copy(other, file)
    elif way == "other run":  # all three files of a piece from a run with another seed
        interrupted(here / "alien", seed=7)
        for alien in (here / "alien").glob(f"*/{numbers[0]:08d}.*"):
            shutil.copy(alien, run / alien.relative_to(here / "alien"))
    elif kind == "receipt" and way in ("cell", "rows"):
        content = json.loads(file.read_text())
        content["run" if way == "cell" else "piece"] = 3
        file.write_text(json.dumps(content))
    else:
        changes = {
            "bytes": ("bytes", "3"),
            "cell": ("cell", "scenario_id first"),
            "rows": ("rows", "drop last"),
        }
        spoil(file, changes.get(way, ("file", way)))
    assert contents(worked(run, resume=True)) == contents(finished)


def test_what_a_killed_process_left_blocks_nothing(here):
    (here / "run").mkdir()
    left = here / "run" / f".manifest.json.{2**22 + 5}"
    left.write_text('{"for')
    os.utime(left, (0, 0))
    run = worked(here / "run", resume=True)
    assert not [f for f in run.iterdir() if f.name.startswith(".")]


def test_a_disk_that_loses_what_is_written_is_named(here, monkeypatch):
    monkeypatch.setattr(pieces, "find_receipt", lambda *_: None)
    with pytest.raises(RunError, match="reads back otherwise"):
        worked(here / "run")
