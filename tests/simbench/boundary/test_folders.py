"""A run folder or baseline with one thing changed: `score`, `check`, `report`, `simulate --from`
and `--resume` notice.
"""

from __future__ import annotations

import json
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from simbench.bench.check.check import check_run, update_baseline
from simbench.bench.execute import pieces
from simbench.bench.execute.run import Interrupted, run_grid
from simbench.bench.score.scoring import score_run
from simbench.bench.store.folder import RunError
from simbench.bench.store.reading import read_table
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


WAYS = ("gone", "empty", "cut", "folder", "first rows", "another order")


def spoil(file, way: str) -> None:
    """Damage a table: its file, or its rows."""
    content = file.read_bytes()
    if way == "first rows":
        pq.write_table(pq.read_table(file)[:-1], file)
    elif way == "another order":
        table = pq.read_table(file)
        pq.write_table(table.take(pa.array([1, 0, *range(2, table.num_rows)])), file)
    else:
        file.unlink()
        if way == "folder":
            file.mkdir()
        elif way != "gone":
            file.write_bytes(content[: len(content) // 2] if way == "cut" else b"")


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


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", TABLES)
def test_one_fault_in_a_table_of_a_run_or_a_baseline(finished, baseline, here, kind, way):
    run = copied(finished, here)
    spoil(file_of(run, kind), way)
    noticed("score copy")
    noticed(f"check copy --against {baseline}")
    shutil.rmtree(run)
    base = copied(baseline, here)
    spoil(file_of(base, kind), way)
    refuses(lambda: check_run(finished, base))


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
    "score copy --paired",
]


@pytest.mark.parametrize(
    ("words", "text"), sampled([(words, text) for text in NO_MANIFEST for words in READERS], 6)
)
def test_a_manifest_that_is_none(finished, here, words, text):
    (copied(finished, here) / "manifest.json").write_text(text)
    refused(words.replace("FINISHED", str(finished)), "copy")


@pytest.mark.parametrize("kind", TABLES)
def test_one_bit_of_a_table_is_noticed_or_changes_nothing(finished, here, kind):
    run = copied(finished, here)
    file, rng, found = file_of(run, kind), np.random.default_rng(0), 0
    before, content = read_table(run, kind), file.read_bytes()
    for _ in range(40):
        spoilt = bytearray(content)
        spoilt[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
        file.write_bytes(spoilt)
        try:
            assert read_table(run, kind).equals(before)
        except RunError as error:
            check_sentence(str(error))
            found += 1
    assert found > 20


def test_an_empty_baseline_never_passes(finished, baseline, here):
    base = copied(baseline, here)
    for kind in TABLES:
        file = base / f"{kind}.parquet"
        pq.write_table(pq.read_table(file)[:0], file)
    refused(f"check {finished} --against copy", "copy")


def contents(folder) -> str:
    """All of both tables but the times."""
    tables = [pq.read_table(folder / f"{kind}.parquet").to_pydict() for kind in TABLES]
    return json.dumps([t | {"runtime_s": None} for t in tables])


@pytest.mark.parametrize(
    "way", ["receipt gone", "receipt cut", "receipt of another run", "table gone"]
)
def test_a_piece_that_is_not_whole_is_worked_again(finished, unfinished, here, way):
    run = copied(unfinished, here)
    receipt = sorted((run / "receipts").glob("*.json"))[0]
    if way == "receipt of another run":
        content = json.loads(receipt.read_text())
        receipt.write_text(json.dumps({**content, "run": "other"}))
    elif way == "table gone":
        (run / "verdicts.parquet" / f"{receipt.stem}.parquet").unlink()
    else:
        spoil(receipt, way.split()[1])
    assert contents(worked(run, resume=True)) == contents(finished)
