"""A dask cluster that loses a worker gives the same bits; one that loses its scheduler ends the run
soon.
"""

import json
import subprocess
import sys
import textwrap
import time

import pytest
from killing import kill_when_it_stops, stops

from results.studies.benchmark_cost import same_tables
from simbench.bench.execute.run import run_grid
from simbench.bench.store.folder import RunError
from simbench.scenarios.grid import make_grid

pytestmark = pytest.mark.slow  # processes of dask are started and killed
distributed = pytest.importorskip("distributed")
QUIET = {
    "n_workers": 2,
    "threads_per_worker": 1,
    "processes": True,
    "dashboard_address": "127.0.0.1:0",
}


def slow(folder, at: int):
    """A detector that stops at a record, once."""
    file = folder / "mine.py"
    file.write_text(
        "from simbench.detectors.method import Method\n"
        "from simbench.detectors.verdict import Verdict\n"
        'METHOD = Method(title="mine", source="a test", front_end=False)\n'
        f"def detect(prepared):\n{textwrap.indent(stops(folder, at), '    ')}    time.sleep(0.02)\n"
        '    return Verdict("mine", "no_decision", reason="nothing to say")\n'
    )
    return file


def test_one_of_two_workers_killed_gives_the_same_bits(small, tmp_path):
    file = slow(tmp_path, 20)
    kill_when_it_stops(tmp_path)
    with distributed.LocalCluster(**QUIET) as cluster:
        run = run_grid(
            small,
            tmp_path / "dask",
            ["he"],
            plugins=[file],
            backend="dask",
            address=cluster.scheduler_address,
        )
    assert (tmp_path / "seen").stat().st_size > 32
    assert same_tables(run, run_grid(small, tmp_path / "one", ["he"], plugins=[file]))


def test_a_killed_worker_of_ray_gives_the_same_bits(small, tmp_path):
    pytest.importorskip("ray")
    file = slow(tmp_path, 20)
    kill_when_it_stops(tmp_path)
    run = run_grid(small, tmp_path / "ray", ["he"], plugins=[file], backend="ray", jobs=2)
    assert (tmp_path / "seen").stat().st_size > 32
    assert same_tables(run, run_grid(small, tmp_path / "one", ["he"], plugins=[file]))


@pytest.fixture
def processes(tmp_path):
    """A scheduler with two workers that nobody replaces."""
    started = []

    def start(*words):
        command = [sys.executable, "-m", f"distributed.cli.dask_{words[0]}", *words[1:]]
        started.append(subprocess.Popen(command, stderr=subprocess.DEVNULL))
        return started[-1]

    home = tmp_path / "scheduler.json"
    scheduler = start("scheduler", "--port", "0", "--scheduler-file", str(home), "--no-dashboard")
    for _ in range(2):
        start("worker", "--scheduler-file", home, "--nthreads", "1", "--no-nanny", "--no-dashboard")
    while not home.exists():
        assert scheduler.poll() is None
        time.sleep(0.1)
    address = json.loads(home.read_text())["address"]
    with distributed.Client(address) as client:
        client.wait_for_workers(2)
    yield address, scheduler
    for process in started:
        process.kill()
        process.wait()


def test_a_run_whose_scheduler_is_gone_ends_by_itself_and_can_be_resumed(
    small, tmp_path, processes
):
    address, scheduler = processes
    file = slow(tmp_path, 50)
    kill_when_it_stops(tmp_path, scheduler.pid)
    many = make_grid(small.content.model_dump(), "small", {"repeats": 8})
    with pytest.raises(RunError, match=r"scheduler is gone.* pieces are whole .*--resume"):
        run_grid(many, tmp_path / "run", ["he"], plugins=[file], backend="dask", address=address)
    assert list((tmp_path / "run" / "receipts").iterdir())
    run_grid(many, tmp_path / "run", ["he"], plugins=[file], resume=True)
    assert same_tables(tmp_path / "run", run_grid(many, tmp_path / "one", ["he"], plugins=[file]))
