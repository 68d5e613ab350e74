"""Runs: the same bits however they are worked through, nothing finished is lost, nothing different
is mixed.
"""

import shlex
import shutil
import signal
import sys
import textwrap
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from bench_fixtures import SMALL, raise_after
from joblib import Parallel, delayed

import simbench.scenarios as scenarios
from simbench.bench.execute import compute_piece as piece_module
from simbench.bench.execute import pieces
from simbench.bench.execute import run as run_module
from simbench.bench.execute.compute_piece import record_hash
from simbench.bench.execute.run import Interrupted, run_grid
from simbench.bench.score.page import reproduce
from simbench.bench.score.scoring import score_run
from simbench.bench.store import manifest as manifest_module
from simbench.bench.store.manifest import RunError, read_manifest
from simbench.bench.store.reading import RunArrays, read_book, read_scenario
from simbench.cli import main
from simbench.detectors.judge import judge
from simbench.files import HOST
from simbench.loop.simulate import simulate
from simbench.scenarios.grid import make_grid

METHODS = ["he", "yamashita"]


def tables(folder):
    verdicts = pd.read_parquet(folder / "verdicts.parquet").drop(columns="runtime_s")
    return verdicts, pd.read_parquet(folder / "scenarios.parquet")


def assert_same(a, b):
    for x, y in zip(tables(a), tables(b)):
        pd.testing.assert_frame_equal(x, y, check_exact=True)


def plugin(tmp_path, body):
    """A detector file whose `detect` runs `body` first."""
    file = tmp_path / "mine.py"
    file.write_text(
        "import os, pathlib, signal\n"
        "from simbench.detectors.method import Method\n"
        "from simbench.detectors.verdict import Verdict\n"
        'METHOD = Method(title="mine", source="a test", front_end=False)\n'
        "def detect(prepared):\n"
        + textwrap.indent(textwrap.dedent(body), "    ")
        + '\n    return Verdict("mine", "no_decision", reason="nothing to say")\n'
    )
    return file


@pytest.fixture
def unscored(monkeypatch):
    """Runs of this process are not scored, which takes half of their time."""
    nothing = SimpleNamespace(write=lambda place: None)
    monkeypatch.setattr(pieces, "score_book", lambda book: nothing)


@pytest.fixture(scope="module")
def by_two(tmp_path_factory):
    """The run by two workers."""
    grid = make_grid(SMALL, "small", {"repeats": 2})
    return run_grid(grid, tmp_path_factory.mktemp("two") / "run", METHODS, 2)


def test_two_workers_give_the_same_bits_as_one(by_two, finished):
    assert_same(by_two, finished)


@pytest.mark.usefixtures("by_two")
def test_joblib_still_finds_its_processes_after_a_run():
    """As `simbench report` after `simbench run` in one process."""
    assert Parallel(2)(delayed(abs)(-i) for i in range(3)) == [0, 1, 2]


@pytest.mark.usefixtures("unscored")
def test_dask_gives_the_same_bits(small, finished, tmp_path):
    distributed = pytest.importorskip("distributed")
    settings = {
        "n_workers": 1,
        "threads_per_worker": 2,
        "processes": False,
        "dashboard_address": "127.0.0.1:0",
    }
    with distributed.LocalCluster(**settings) as cluster:
        run = run_grid(
            small, tmp_path / "dask", METHODS, backend="dask", address=cluster.scheduler_address
        )
    assert_same(run, finished)


def test_without_ray_the_error_names_what_to_install(small, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(
        RunError, match=r"backend ray needs the package ray; install stiction-simbench\[ray\]"
    ):
        run_grid(small, tmp_path / "ray", ["he"], backend="ray")


def test_verdicts_are_those_of_judge(finished):
    verdicts, scenarios = tables(finished)
    assert not scenarios.oscillating.all()
    for ident in scenarios.scenario_id:
        scenario = read_scenario(finished, ident)
        record = simulate(scenario.loop, scenario.seed).record
        rows = verdicts[verdicts.scenario_id == ident].set_index("method")
        for verdict in judge(record, METHODS):
            row = rows.loc[verdict.method]
            assert (row.verdict, row.reason) == (verdict.verdict, verdict.reason)
            assert np.array_equal(row.score, verdict.score, equal_nan=True)


@pytest.mark.usefixtures("unscored")
def test_a_detector_that_raises_is_a_row_with_its_error(small, tmp_path):
    file = plugin(tmp_path, 'raise ZeroDivisionError("by design")')
    run = run_grid(small, tmp_path / "run", ["he"], plugins=[file])
    verdicts, _ = tables(run)
    mine, others = verdicts[verdicts.method == "mine"], verdicts[verdicts.method == "he"]
    assert set(mine.verdict) == {"no_decision"}
    assert mine.error.str.contains("ZeroDivisionError: by design").all()
    assert others.error.isna().all()
    assert read_manifest(run)["counts"]["errors"] == len(mine)


@pytest.mark.usefixtures("unscored")
@pytest.mark.parametrize("deaths", [1, run_module.LIVES])
def test_dead_workers_are_replaced_and_when_they_keep_dying_the_run_ends_with_advice(
    small, finished, tmp_path, monkeypatch, deaths
):
    class BrokenProcessPool(Exception):
        pass

    worked, work = [], run_module.compute_piece

    def dying(grid, number, *more):
        worked.append(number)
        if number == 3 and worked.count(3) <= deaths:
            raise BrokenProcessPool("a worker was killed")
        return work(grid, number, *more)

    monkeypatch.setattr(run_module, "compute_piece", dying)
    if deaths < run_module.LIVES:
        assert_same(run_grid(small, tmp_path / "run", METHODS), finished)
    else:
        with pytest.raises(RunError, match=r"keep dying .*--resume"):
            run_grid(small, tmp_path / "run", METHODS)
    assert worked == [0, 1, 2, *[3] * deaths, *([3, 4, 5, 6, 7] if deaths == 1 else [])]


@pytest.mark.parametrize(
    ("sent", "on_sigint"),
    [(signal.SIGINT, signal.default_int_handler), (signal.SIGTERM, signal.SIG_IGN)],
)
def test_a_signal_stops_a_run_after_the_pieces_that_are_whole(
    small, tmp_path, monkeypatch, sent, on_sigint
):
    work, before = run_module.compute_piece, signal.getsignal(signal.SIGINT)

    def signalled(grid, number, *more):
        if number == 2:
            assert signal.getsignal(sent) is signal.default_int_handler  # else the test would end
            signal.raise_signal(sent)
        return work(grid, number, *more)

    monkeypatch.setattr(run_module, "compute_piece", signalled)
    signal.signal(signal.SIGINT, on_sigint)
    try:
        with pytest.raises(Interrupted, match=r"2 pieces are whole .* continue with --resume"):
            run_grid(small, tmp_path / "run", ["he"])
    finally:
        signal.signal(signal.SIGINT, before)


def test_resuming_a_finished_run_changes_nothing(small, finished):
    before = {f.name: f.stat().st_mtime_ns for f in finished.iterdir()}
    run_grid(small, finished, METHODS, resume=True)
    assert before == {f.name: f.stat().st_mtime_ns for f in finished.iterdir()}


def test_a_run_is_not_written_over(small, finished):
    with pytest.raises(RunError, match="already holds a run"):
        run_grid(small, finished, METHODS)


def test_a_folder_with_something_else_in_it_is_left_alone(small, tmp_path):
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(RunError, match="not empty"):
        run_grid(small, tmp_path, METHODS, resume=True)


@pytest.mark.usefixtures("unscored")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"grid": {"noise_ratio": 0.2}}, "the grid differs"),
        (
            {"methods": ["he"]},
            "methods differ: the run has yamashita, which this command does not ask for$",
        ),
        ({"code": "0" * 16}, "the code differs"),
        ({"numpy": "1.0"}, "versions differ: numpy was 1.0"),
    ],
)
def test_a_run_that_differs_is_not_mixed_with_the_old_one(
    small, finished, tmp_path, change, words, monkeypatch
):
    run = tmp_path / "run"
    shutil.copytree(finished, run)
    content = read_manifest(run)
    if "numpy" in change:
        content["versions"]["numpy"] = change["numpy"]
    if "code" in change:
        monkeypatch.setattr(manifest_module, "code_hash", lambda: change["code"])
    manifest_module.write_manifest(run, {**content, "complete": False})
    grid = make_grid(small.content.model_dump(), "small", change.get("grid"))
    with pytest.raises(RunError, match=words):
        run_grid(
            grid,
            run,
            change.get("methods", METHODS),
            resume=True,
        )


def spoil(file, how, other):
    """Spoil the file of a piece."""
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= how == "flipped"
    instead = {
        "exchanged": file.with_name("00000005.parquet").read_bytes(),
        "of another run": (other / file.parent.name / file.name).read_bytes(),
        "cut": content[:-50],
        "empty": b"",
        "flipped": content,
    }
    file.write_bytes(instead[how])


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    """A run of the small grid with another seed, never to be changed."""
    grid = make_grid(SMALL, "small", {"repeats": 2, "seed": 4})
    return run_grid(grid, tmp_path_factory.mktemp("other") / "run", METHODS)


@pytest.fixture(scope="module")
def under_way(tmp_path_factory):
    """A run of the small grid that was interrupted, never to be changed."""
    folder = tmp_path_factory.mktemp("half") / "run"
    grid = make_grid(SMALL, "small", {"repeats": 2})
    with pytest.MonkeyPatch.context() as patch:
        raise_after(patch, run_module, "compute_piece", 7, KeyboardInterrupt)
        with pytest.raises(Interrupted):
            run_grid(grid, folder, METHODS)
    return folder


@pytest.mark.parametrize(
    ("kind", "how"),
    [
        ("verdicts", "exchanged"),
        ("scenarios", "exchanged"),
        ("verdicts", "of another run"),
        ("scenarios", "of another run"),
        ("verdicts", "cut"),
        ("scenarios", "empty"),
        ("verdicts", "flipped"),
    ],
)
def test_a_piece_that_is_not_as_it_was_written_is_named_and_computed_again(
    small, finished, other, under_way, tmp_path, kind, how
):
    run = shutil.copytree(finished, tmp_path / "run")
    spoil(run / f"{kind}.parquet" / "00000002.parquet", how, other)
    with pytest.raises(RunError, match=rf"is damaged: {kind}.parquet/00000002.parquet .*--resume"):
        read_book(run)
    run_grid(small, run, METHODS, resume=True)
    assert_same(run, finished)

    # a run that is under way finds its receipt wrong
    half = shutil.copytree(under_way, tmp_path / "half")
    spoil(half / f"{kind}.parquet" / "00000002.parquet", how, other)
    run_grid(small, half, METHODS, resume=True)
    assert_same(half, finished)


def test_a_piece_too_many_or_too_few_is_named(small, finished, tmp_path):
    run = shutil.copytree(finished, tmp_path / "run")
    parts = run / "verdicts.parquet"
    shutil.copy(parts / "00000002.parquet", parts / "00000008.parquet")
    with pytest.raises(RunError, match=r"00000008.parquet is not needed there; remove it"):
        read_book(run)
    (parts / "00000008.parquet").replace(parts / "00000001.parquet")
    (parts / "00000007.parquet").unlink()
    with pytest.raises(RunError, match=r"00000007.parquet is missing"):
        read_book(run)
    run_grid(small, run, METHODS, resume=True)
    assert_same(run, finished)


@pytest.mark.parametrize("how", ["removed", "moved"])
def test_a_run_whose_folder_goes_ends_at_the_next_piece(small, tmp_path, monkeypatch, how):
    run, work = tmp_path / "run", run_module.compute_piece

    def worked(grid, number, *more):
        if number == 2:
            shutil.rmtree(run) if how == "removed" else run.rename(tmp_path / "elsewhere")
        assert number < 3
        return work(grid, number, *more)

    monkeypatch.setattr(run_module, "compute_piece", worked)
    with pytest.raises(RunError, match=r"holds no manifest.json any more.*removed or moved") as why:
        run_grid(small, run, METHODS)
    assert "--resume" not in str(why.value)
    assert not run.exists()


def test_of_two_on_one_folder_one_is_refused(small, finished, tmp_path):
    words = "run is in use: another simbench works there"
    with pieces.held(tmp_path / "run"), pytest.raises(RunError, match=words):
        run_grid(small, tmp_path / "run", METHODS)
    assert not (tmp_path / "run").exists()
    assert_same(run_grid(small, tmp_path / "run", METHODS), finished)


def test_what_a_killed_process_left_half_written_goes(tmp_path):
    half = tmp_path / "verdicts.parquet" / f".00000000.parquet.{HOST}.{2**22 + 5}"
    half.parent.mkdir()
    half.write_text("half")
    with pieces.held(tmp_path):
        assert not half.exists()


def test_workers_that_write_elsewhere_are_noticed(small, tmp_path, monkeypatch):
    monkeypatch.setattr(pieces, "write_file", lambda file, content: None)
    with pytest.raises(RunError, match="which a worker wrote; name a folder that all reach"):
        run_grid(small, tmp_path / "run", METHODS)


def test_a_kill_before_the_scores_is_tidied_up(small, finished, tmp_path, monkeypatch):
    run = tmp_path / "run"
    with monkeypatch.context() as patch:
        raise_after(patch, pieces, "score_book", 0, KeyboardInterrupt)
        with pytest.raises(Interrupted, match="8 pieces are whole"):
            run_grid(small, run, METHODS)
    with pytest.raises(RunError, match="not finished"):
        RunArrays.read(run)
    run_grid(small, run, METHODS, resume=True)
    assert sorted(f.name for f in run.iterdir()) == sorted(f.name for f in finished.iterdir())
    assert_same(run, finished)


@pytest.mark.usefixtures("unscored")
def test_a_theory_that_fails_leaves_its_columns_empty_and_the_record_judged(
    small, finished, tmp_path, monkeypatch
):
    def broken(loop, **_):
        raise ZeroDivisionError("by design")

    monkeypatch.setattr(piece_module, "truth_columns", broken)
    verdicts, scenarios = tables(run_grid(small, tmp_path / "run", METHODS, 1))
    assert (
        scenarios[["predicted", "refined", "theory", "theory_period", "theory_amplitude", "error"]]
        .isna()
        .all(axis=None)
    )
    assert set(scenarios.theory_reason) == {"ZeroDivisionError: by design"}
    sound_verdicts, sound = tables(finished)
    pd.testing.assert_frame_equal(verdicts, sound_verdicts, check_exact=True)
    assert list(scenarios.record_hash) == list(sound.record_hash)
    assert list(scenarios.cycled) == list(sound.cycled)


def test_the_manifest_states_what_set_and_axis_change_and_its_command_repeats_the_run(tmp_path):
    changes = {"sets": {"noise_ratio": 0.1}, "axes": {"S_over_2J": [0.5, 2.0]}}
    folder = run_grid("smoke", tmp_path / "run", ["he"], n=4, **changes)
    manifest = read_manifest(folder)
    assert manifest["overrides"] == {"noise_ratio": 0.1, "S_over_2J": [0.5, 2.0]}
    words = shlex.split(reproduce(manifest)[-2])[1:]
    assert main([str(tmp_path / "again") if word == "again" else word for word in words]) == 0
    assert_same(folder, tmp_path / "again")


@pytest.mark.usefixtures("unscored")
def test_records_are_judged_in_an_order_that_tells_nothing_and_written_in_that_of_the_grid(
    small, tmp_path, monkeypatch
):
    asked, judge_record = [], piece_module.judge_record

    def heard(record, *rest):
        asked.append(record_hash(record))
        return judge_record(record, *rest)

    monkeypatch.setattr(piece_module, "judge_record", heard)
    folder = run_grid(make_grid(SMALL, "small", {"repeats": 8}), tmp_path / "run", ["he"])
    rows = pd.read_parquet(folder / "scenarios.parquet")
    assert sorted(asked) == sorted(rows.record_hash)
    place = {mark: k for k, mark in enumerate(asked)}
    came = np.array([place[mark] for mark in rows.record_hash])
    sticky, healthy = (
        came[(rows.member == "sticky").to_numpy()],
        came[(rows.member == "healthy").to_numpy()],
    )
    # a sticky loop is right before its sibling in the grid; asked about, it comes first as
    # often as last
    assert 0.25 < np.mean(sticky < healthy) < 0.75  # 64 pairs: four standard errors
    assert np.mean(healthy - sticky == 1) < 0.2  # 1/16 expected, as pieces have 16 loops


def test_pieces_whose_loops_were_all_left_out_are_no_damage(small, tmp_path, monkeypatch):
    kept, settled = [], piece_module.settled
    monkeypatch.setattr(
        piece_module, "settled", lambda group: kept.append(1) or settled(group)[: len(kept) > 2]
    )
    book = RunArrays.read(run_grid(small, tmp_path / "some", ["he"]))
    assert 0 < book.ids.size < len(small) - 2
    assert book.verdict.shape == (1, book.ids.size)
    monkeypatch.setattr(piece_module, "settled", lambda group: [])
    book = RunArrays.read(run_grid(small, tmp_path / "none", ["he"]))
    assert book.verdict.shape == (1, 0)


def test_fresh_seeds_are_drawn_and_stated(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(
        (Path(scenarios.__path__[0]) / "grids" / "smoke.toml")
        .read_text()
        .replace("expected = 48\n", "")
    )
    axes = {"disturbance": ["none"], "S_over_2J": [0.5]}
    folder = run_grid(file, tmp_path / "a", ["he"], axes=axes, fresh_seeds=True)
    manifest = read_manifest(folder)
    assert manifest["seed"] != 1
    assert f"seed {manifest['seed']}," in score_run(folder).as_text()
    assert_same(
        folder, run_grid(file, tmp_path / "b", ["he"], axes=axes, sets={"seed": manifest["seed"]})
    )
    with pytest.raises(RunError, match="draws the grid's seed"):
        run_grid(file, tmp_path / "c", ["he"], sets={"seed": 4}, fresh_seeds=True)


@pytest.mark.usefixtures("unscored")
def test_the_bar_shows_rate_remaining_time_and_failures_when_asked(small, tmp_path, capfd):
    run_grid(small, tmp_path / "run", ["yamashita"], progress=True)
    err = capfd.readouterr().err
    assert "32/32" in err
    assert "scenarios/s" in err
    assert "failures=0" in err
