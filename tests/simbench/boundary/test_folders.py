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

from scenarios.grid import load_grid
from simbench.bench.execute import pieces
from simbench.bench.execute.run import Interrupted, run_grid
from simbench.bench.score.check import check_run, update_baseline
from simbench.bench.score.compare import compare
from simbench.bench.score.scoring import score_run
from simbench.bench.store.checksums import RunError, digest, with_checksum
from simbench.cli import main
from tests.simbench.boundary.conftest import held

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
        "verdict_raw",
        "applicable",
        "reason",
        "error",
        "S_unit",
    ),
}


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return run_grid(
        load_grid("smoke", SMALL),
        tmp_path_factory.mktemp("runs") / "done",
        ["horch", "horch_histogram"],
    )


@pytest.fixture(scope="module")
def baseline(finished, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "baseline"
    update_baseline(finished, folder)
    return folder


@pytest.fixture(scope="module")
def unfinished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "unfinished"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pieces, "finish", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(Interrupted):
            run_grid(load_grid("smoke", SMALL), folder, ["horch", "horch_histogram"])
    return folder


def ways(kind: str) -> list[tuple[str, str]]:
    """Single faults of one table: a value in a column, a row, a column, a type, bytes of the
    file.
    """
    cells = [("cell", f"{c} {row}") for c in CHANGED[kind] for row in ("first", "last")]
    rows = [
        ("rows", w)
        for w in ("drop first", "drop last", "drop all", "twice", "swapped", "reversed", "half")
    ]
    columns = [("column", f"{w} {c}") for c in CHANGED[kind] for w in ("drop", "null")]
    bytes_ = [("bytes", f"{place}") for place in range(24)]
    return [
        *cells,
        *rows,
        *columns,
        *bytes_,
        ("file", "gone"),
        ("file", "empty"),
        ("file", "cut"),
        ("file", "folder"),
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
        order = {
            "drop first": range(1, n),
            "drop last": range(n - 1),
            "drop all": [],
            "twice": [*range(n), n - 1],
            "swapped": [1, 0, *range(2, n)],
            "reversed": range(n - 1, -1, -1),
            "half": range(n // 2),
        }[how]
        return table.take(pa.array(list(order), type=pa.int64()))
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


def noticed(capsys, *arguments) -> None:
    code = main([str(a) for a in arguments])
    out, err = capsys.readouterr()
    assert code in (1, 2), out[:300]
    assert "Traceback" not in err
    assert "fault of the program" not in err
    if code == 2:
        assert err.count("\n") == 1
        assert "copy" in err
        held(err)


def asked(kind: str, number: int, way: tuple[str, str]):
    """A fault in a table: of cells, columns and bytes every third is asked always."""
    return pytest.param(
        kind, way, marks=pytest.mark.slow if number % 3 and way[0] not in ("file", "rows") else ()
    )


@pytest.mark.parametrize(
    ("kind", "way"), [asked(k, *each) for k in TABLES for each in enumerate(ways(k))], ids=str
)
def test_one_fault_in_a_table_of_a_run_or_a_baseline(
    finished, baseline, tmp_path, capsys, kind, way
):
    run = copied(finished, tmp_path)
    file = file_of(run, kind)
    before = file.read_bytes()
    spoil(file, way)
    if file.is_file() and file.read_bytes() == before:
        pytest.fail("nothing was changed")
    if way[0] in ("file", "rows"):  # the verbs themselves; else the functions they call
        noticed(capsys, "score", run)
        noticed(capsys, "check", run, "--against", baseline)
    for reads in (lambda: score_run(run), lambda: check_run(run, baseline), lambda: compare(run)):
        with pytest.raises(RunError, match="copy") as said:
            reads()
        held(str(said.value), marks(file))
    shutil.rmtree(run)
    base = copied(baseline, tmp_path)
    file = file_of(base, kind)
    spoil(file, way)
    with pytest.raises(RunError, match="copy") as said:
        check_run(finished, base)
    held(str(said.value), marks(file))


def marks(file) -> list[str]:
    """What a sentence about a changed file quotes: its checksum."""
    return [digest(file.read_bytes())] if file.is_file() else []


@pytest.mark.parametrize("kind", TABLES)
@pytest.mark.parametrize("way", ["one more", "swapped", "twice", "renamed"])
def test_partitions_that_do_not_belong_there(finished, baseline, tmp_path, capsys, kind, way):
    run = copied(finished, tmp_path)
    one, two = sorted((run / f"{kind}.parquet").iterdir())[:2]
    if way == "one more":
        shutil.copy(one, one.with_name("00009999.parquet"))
    elif way == "swapped":
        content = one.read_bytes()
        one.write_bytes(two.read_bytes())
        two.write_bytes(content)
    elif way == "twice":
        one.write_bytes(two.read_bytes())
    else:
        one.rename(one.with_name("part.parquet"))
    noticed(capsys, "score", run)
    noticed(capsys, "check", run, "--against", baseline)
    noticed(capsys, "simulate", "--from", run, "--id", "0" * 16, "-o", tmp_path / "r.csv")


def places(content, path=()) -> list[tuple]:
    found = []
    for key, value in content.items():
        found.append((*path, key))
        if isinstance(value, dict):
            found += places(value, (*path, key))
    return found


def test_one_fault_anywhere_in_a_manifest(finished, baseline, tmp_path):
    tried = 0
    for folder in (finished, baseline):
        whole = json.loads((folder / "manifest.json").read_text())
        run = copied(folder, tmp_path)
        for *path, last in places(whole):
            for value in ("gone", None, "other", 0, [], {}):
                content = json.loads((folder / "manifest.json").read_text())
                at = content
                for step in path:
                    at = at[step]
                if value == "gone":
                    del at[last]
                elif at[last] == value and type(at[last]) is type(value):
                    continue
                else:
                    at[last] = value
                (run / "manifest.json").write_text(json.dumps(content))
                with pytest.raises(RunError, match="copy") as said:
                    score_run(run) if folder is finished else check_run(finished, run)
                held(
                    str(said.value),
                    [str(value)[:60]] if last == "format" and value != "gone" else None,
                )
                tried += 1
        shutil.rmtree(run)
    assert tried > 300


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


@pytest.mark.parametrize("text", NO_MANIFEST, ids=lambda t: f"{t[:12]} {len(t)}")
@pytest.mark.parametrize(
    "verb", ["score", "check", "against", "from", "resume", "report", "compare"]
)
def test_a_manifest_that_is_none(finished, tmp_path, refused, verb, text):
    run = copied(finished, tmp_path)
    (run / "manifest.json").write_text(text)
    refused(
        {
            "score": ["score", run],
            "check": ["check", run, "--against", finished],
            "against": ["check", finished, "--against", run],
            "from": ["simulate", "--from", run, "--id", "0" * 16, "-o", tmp_path / "r.csv"],
            "resume": ["run", "smoke", "-o", run, "--resume"],
            "report": ["score", run, "--report", tmp_path / "r.html"],
            "compare": ["score", finished, "--compare", run, "--paired"],
        }[verb],
        "copy",
    )


@pytest.mark.parametrize("kind", TABLES)
def test_simulate_from_a_changed_run(finished, tmp_path, refused, kind):
    ident = pq.read_table(finished / "scenarios.parquet").column("scenario_id")[0].as_py()
    run = copied(finished, tmp_path)
    spoil(file_of(run, kind), ("cell", "scenario_id last"))
    refused(["simulate", "--from", run, "--id", ident, "-o", tmp_path / "r.csv"], "copy")
    refused(
        ["simulate", "--from", finished, "--id", "nothing", "-o", tmp_path / "r.csv"], "nothing"
    )


def test_an_empty_baseline_never_passes(finished, baseline, tmp_path, refused):
    """Emptied with all its checksums right."""
    base = copied(baseline, tmp_path)
    manifest = json.loads((base / "manifest.json").read_text())
    for kind in TABLES:
        spoil(base / f"{kind}.parquet", ("rows", "drop all"))
        manifest["tables"][kind] = digest((base / f"{kind}.parquet").read_bytes())
    (base / "manifest.json").write_text(json.dumps(with_checksum(manifest)))
    refused(["check", finished, "--against", base], "copy")


def resumed(folder) -> dict[str, list]:
    run_grid(load_grid("smoke", SMALL), folder, ["horch", "horch_histogram"], resume=True)
    tables = [pq.read_table(folder / f"{kind}.parquet").to_pydict() for kind in TABLES]
    return {k: v for table in tables for k, v in table.items() if k != "runtime_s"}


FAULTS = ("bytes", "gone", "empty", "cut", "other piece", "other run", "cell", "rows")
PARTS = [
    (k, w) for k in (*TABLES, "receipt") for w in FAULTS if (k, w) != ("verdicts", "other run")
]


@pytest.mark.parametrize(("kind", "way"), PARTS, ids=str)
def test_one_fault_in_a_piece_is_worked_again(finished, unfinished, tmp_path, kind, way):
    run = copied(unfinished, tmp_path)
    numbers = sorted(int(f.stem) for f in (run / "receipts").glob("*.json"))
    file, other = (
        run / (pieces.receipt_file(n) if kind == "receipt" else pieces.partition_file(kind, n))
        for n in numbers[:2]
    )
    if way == "other piece":
        shutil.copy(other, file)
    elif way == "other run":
        # all three files of a piece from a run with another seed
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(pieces, "finish", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
            with pytest.raises(Interrupted):
                run_grid(
                    load_grid("smoke", {**SMALL, "seed": 7}),
                    tmp_path / "alien",
                    ["horch", "horch_histogram"],
                )
        for alien in (tmp_path / "alien").glob(f"*/{numbers[0]:08d}.*"):
            shutil.copy(alien, run / alien.relative_to(tmp_path / "alien"))
    elif kind == "receipt" and way in ("cell", "rows"):
        content = json.loads(file.read_text())
        content["run" if way == "cell" else "piece"] = 3
        file.write_text(json.dumps(content))
    else:
        what = {
            "bytes": ("bytes", "3"),
            "cell": ("cell", "scenario_id first"),
            "rows": ("rows", "drop last"),
        }
        spoil(file, what.get(way, ("file", way)))
    whole = [pq.read_table(finished / f"{k}.parquet").to_pydict() for k in TABLES]
    expected = {k: v for table in whole for k, v in table.items() if k != "runtime_s"}
    assert json.dumps(resumed(run)) == json.dumps(expected)


def test_what_a_killed_process_left_behind_blocks_nothing(tmp_path):
    run = tmp_path / "run"
    run.mkdir()
    left = run / f".manifest.json.{2**22 + 5}"
    left.write_text('{"for')
    os.utime(left, (0, 0))
    assert resumed(run)
    assert not [f for f in run.iterdir() if f.name.startswith(".")]


def test_a_disk_that_loses_what_is_written_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(pieces, "find_receipt", lambda *_: None)
    with pytest.raises(RunError, match="reads back otherwise"):
        run_grid(load_grid("smoke", SMALL), tmp_path / "run", ["horch"])
