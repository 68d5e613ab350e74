"""A run lies at its URL: the same bits in memory, on disk or on a cluster, and nothing
where nobody can write.
"""

import sys
import uuid

import fsspec
import fsspec.implementations.memory
import numpy as np
import pytest
from bench_fixtures import raise_after

from simbench.bench.execute import run as run_module
from simbench.bench.execute.failures import read_failures
from simbench.bench.execute.run import RunError, run_grid
from simbench.bench.score.baseline import write_baseline
from simbench.bench.score.check import check_run
from simbench.bench.score.scoring import score_run
from simbench.bench.store.place import Place, place_of
from simbench.bench.store.reading import RunArrays, read_scenario, read_table
from simbench.cli import main
from simbench.files import FileError
from simbench.report import write_report

METHODS = ["he", "yamashita"]


@pytest.fixture
def url():
    url = f"memory://runs/{uuid.uuid4().hex}"
    yield url
    place_of(url).remove("")


def same(one, other) -> bool:
    scenarios = [read_table(run, "scenarios") for run in (one, other)]
    verdicts = [read_table(run, "verdicts").drop_columns(["runtime_s"]) for run in (one, other)]
    return scenarios[0].equals(scenarios[1]) and verdicts[0].equals(verdicts[1])


def test_a_run_in_memory_has_the_bits_of_one_on_disk_and_is_read_by_every_verb(
    small, finished, tmp_path, url
):
    assert run_grid(small, url, METHODS) == url
    assert same(url, finished)
    assert place_of(url).names() == sorted(f.name for f in finished.iterdir())
    shown = ["method", "truth", "process", "sensitivity", "auc", "rank"]
    assert score_run(url).table[shown].equals(score_run(finished).table[shown])
    assert read_failures(url).scenarios == 0
    ident = RunArrays.read(url).ids[0].decode()
    assert read_scenario(url, ident).id == ident
    write_baseline(url, tmp_path / "baseline")
    assert not check_run(url, tmp_path / "baseline").failed
    write_report(url, tmp_path / "report.html")
    assert (tmp_path / "report.html").stat().st_size > 10_000


def test_a_run_in_memory_is_resumed_by_its_receipts(small, finished, url, monkeypatch):
    work = run_module.compute_piece
    with monkeypatch.context() as patch:
        raise_after(patch, run_module, "compute_piece", 3, KeyboardInterrupt)
        with pytest.raises(run_module.Interrupted, match="3 pieces are whole in memory://"):
            run_grid(small, url, METHODS)
    worked = []
    monkeypatch.setattr(
        run_module, "compute_piece", lambda *given: worked.append(given[1]) or work(*given)
    )
    run_grid(small, url, METHODS, resume=True)
    assert worked == [3, 4, 5, 6, 7]
    assert same(url, finished)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("memry://run", "did you mean 'memory'"),
        ("nothing:/run", "scheme 'nothing' is unknown"),
        ("dropbox://run", "cannot be"),
    ],
)
def test_a_scheme_that_nobody_serves_is_one_sentence_and_makes_no_folder(
    small, tmp_path, url, words, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileError, match=words) as error:
        run_grid(small, url, METHODS)
    assert "\n" not in str(error.value)
    assert main(["run", "smoke", "-o", url]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_workers_that_write_elsewhere_are_noticed(small, tmp_path, monkeypatch):
    """As with `memory://` and two processes, or a folder that is not shared."""
    monkeypatch.setattr(Place, "absolute", lambda place: Place(tmp_path / "elsewhere"))
    with pytest.raises(
        RunError, match=r"lacks 00000000.parquet, which a worker wrote; name a place that all reach"
    ):
        run_grid(small, tmp_path / "run", METHODS)


def test_what_the_workers_hand_back_does_not_grow_with_what_they_write(
    small, tmp_path, monkeypatch
):
    import pickle

    sizes, run = [], run_module._Task.__call__

    def weighed(task, number, groups):
        receipt = run(task, number, groups)
        sizes.append(len(pickle.dumps(receipt)))
        return receipt

    monkeypatch.setattr(run_module._Task, "__call__", weighed)
    folder = run_grid(small, tmp_path / "run", METHODS, keep=4)
    assert max(sizes) < 500 < min(f.stat().st_size for f in folder.glob("*.parquet/*"))
    assert len(list((folder / "records").iterdir())) == 32


def test_a_place_writes_reads_lists_and_removes(tmp_path, url):
    for place in (place_of(tmp_path / "a"), place_of(url)):
        content = np.random.default_rng(0).bytes(1000)
        assert place.names() == []
        place.write("sub/one", content)
        place.write("sub/two", b"")
        assert (place.names(), place.names("sub")) == (["sub"], ["one", "two"])
        assert place.read("sub/one") == content
        with pytest.raises(FileNotFoundError):
            place.read("sub/three")
        place.remove("sub")
        place.remove("sub")
        assert place.names("sub") == []


@pytest.mark.parametrize("scheme", ["local", "file"])
def test_a_local_url_is_the_folder_it_names(tmp_path, scheme):
    assert place_of(f"{scheme}://{tmp_path}/run").local == tmp_path / "run"


def test_the_command_line_refuses_a_run_that_is_gone_when_it_ends(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "smoke", "-o", "memory://run"]) == 2
    assert (
        "memory is gone when this command ends; a folder or a URL that lasts is needed"
        in capsys.readouterr().err
    )
    assert not list(tmp_path.iterdir())


def test_a_server_that_keeps_nothing_is_noticed_before_anything_is_simulated(
    url, small, monkeypatch
):
    monkeypatch.setattr(
        fsspec.implementations.memory.MemoryFileSystem, "pipe_file", lambda self, path, value: None
    )
    monkeypatch.setattr(run_module, "compute_piece", None)
    with pytest.raises(
        FileError, match=r"keeps no run .*; a place that can be written, listed and read is needed"
    ):
        run_grid(small, url, METHODS)


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("data:/text/run", "keeps no run .* is needed"),
        ("simplecache::memory://run", "'simplecache::memory' is unknown"),
        ("dir://run", "by itself; a place that can be written is needed"),
        ("arrow_hdfs://me:secret@host/run", r"arrow_hdfs://\*\*\*@host/run"),
    ],
)
def test_what_cannot_be_kept_is_refused_before_anything_is_simulated(
    url, words, small, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_module, "compute_piece", None)
    with pytest.raises(FileError, match=words):
        run_grid(small, url, METHODS)
    assert not list(tmp_path.iterdir())


def test_no_password_is_in_a_run_or_in_what_is_printed(small, url, monkeypatch, capsys):
    secret = f"memory://me:secret@host/{uuid.uuid4().hex}"
    monkeypatch.setattr("sys.argv", ["simbench", "run", "small", "-o", secret])
    assert run_grid(small, secret, METHODS) == secret
    place = place_of(secret)
    assert str(place).startswith("memory://***@host/")
    assert b"***@host" in place.read("manifest.json")
    assert not any(
        b"secret" in place.read(name)
        for name in place.names()
        if "." in name and "parquet" not in name
    )
    assert main(["score", secret, "--json"]) == 0
    assert main(["score", f"{secret}x"]) == 2
    printed = capsys.readouterr()
    assert "secret" not in printed.out + printed.err
    place.remove("")


def test_a_url_without_the_package_that_reaches_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(FileError, match=r"fsspec.*stiction-simbench\[remote\]"):
        place_of("s3://bucket/run")
