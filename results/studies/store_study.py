"""Measure the store: a cluster whose workers and client are killed, what the client costs, and the
scoring of made-up rows.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pyarrow as pa

from results.studies.benchmark_cost import same_tables
from simbench.bench.execute import pieces
from simbench.bench.execute.run import run_grid
from simbench.bench.execute.work import Chunk
from simbench.bench.store import tables
from simbench.bench.store.manifest import read_manifest
from simbench.bench.store.place import place_of
from simbench.bench.store.reading import read_table
from simbench.detectors.plugins.registry import methods as registry
from simbench.scenarios.grid import chunks, load_grid
from simbench.usage import exit_code

PIECE = 1000  # scenarios of a made-up piece, as of a large grid's


def cluster(count: int, grid: str = "smoke", method: str = "horch") -> dict[str, Any]:
    """Run a grid on a local dask cluster, kill a worker, the client and another worker, resume, and
    compare.

    Keys: scenarios, pieces, killed_after (pieces that were whole at each kill), found (pieces the
    second client read whole), equal (the tables are those of an undisturbed run on two processes,
    bit for bit), dask_us and processes_us: CPU time of the client per scenario, to start (imports,
    a run of the grid's first repeat), to hand out and collect, to score.
    """
    from distributed import Client, LocalCluster

    repeats = -(-count // len(load_grid(grid, {"repeats": 1})))
    total = sum(1 for _ in chunks(load_grid(grid, {"repeats": repeats})))
    with tempfile.TemporaryDirectory() as home:
        target, alone = Path(home) / "cluster", Path(home) / "alone"
        with LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=40
        ) as workers:
            what = (grid, method, str(repeats))
            killed, address = [], workers.scheduler_address
            with Client(workers, set_as_default=False) as control:
                first = _started(target, *what, address)
                killed.append(_wait(target, total // 4, first))
                os.kill(next(iter(control.run(os.getpid).values())), signal.SIGKILL)
                killed.append(_wait(target, total // 2, first))
                first.kill()
                first.communicate()
                whole = len(list(target.glob("receipts/*.json")))
                second = _started(target, *what, address)
                killed.append(_wait(target, total * 3 // 4, second))
                os.kill(next(iter(control.run(os.getpid).values())), signal.SIGKILL)
                on_dask = json.loads(second.communicate()[0])
        on_processes = json.loads(_started(alone, *what, "").communicate()[0])
        equal = same_tables(target, alone)
        count = read_manifest(target)["counts"]["scenarios"]
    costs = {"dask_us": on_dask, "processes_us": on_processes}
    times = {
        "scenarios": count,
        "pieces": total,
        "killed_after": killed,
        "found": whole,
        "equal": equal,
    }
    return {
        **times,
        **{
            k: {name: round(1e6 * s / count, 2) for name, s in cost.items()}
            for k, cost in costs.items()
        },
    }


def _started(target: Path, *what: str) -> subprocess.Popen:
    command = [sys.executable, "-m", "results.studies.store_study", "client", str(target), *what]
    return subprocess.Popen(command, stdout=subprocess.PIPE)


def _wait(target: Path, count: int, client: subprocess.Popen) -> int:
    while (whole := len(list(target.glob("receipts/*.json")))) < count:
        if client.poll() is not None:
            raise RuntimeError(
                f"the client ended after {whole} pieces, before it could be killed; more scenarios"
                " are needed"
            )
        time.sleep(0.05)
    return whole


def _client(target: str, grid: str, method: str, repeats: str, address: str) -> int:
    """Run or resume a grid and print CPU seconds of this process: to start, to hand out and collect
    pieces, to score.
    """
    spent = {"scoring": 0.0}
    more: dict[str, Any] = {"backend": "dask", "address": address} if address else {"jobs": 2}
    with tempfile.TemporaryDirectory() as small:  # whatever is imported, connected or compiled once
        run_grid(grid, Path(small) / "run", [method], sets={"repeats": 1}, **more)
    start = time.process_time()
    with patch.object(pieces, "finish", _charged(pieces.finish, spent)):
        run_grid(grid, target, [method], sets={"repeats": int(repeats)}, resume=True, **more)
    handing = time.process_time() - start - spent["scoring"]
    print(json.dumps({"start": start, "handing_out": handing, **spent}))
    return 0


def _charged(finish: Callable, spent: dict[str, float]) -> Callable:
    def timed(*given: Any) -> None:
        since = time.process_time()
        finish(*given)
        spent["scoring"] = time.process_time() - since

    return timed


def rows(count: int, methods: str = "full") -> dict[str, Any]:
    """Make up a run of many rows, and measure its scoring.

    `count`: rows at least: a scenario has one for every method.

    Keys: rows, scenarios, cpu_s (to read, check and score), peak_MB (resident, the making
    included).

    The rows of a small run of grid `smoke`, again and again, with other ids, groups of two, random
    scores and what a record tells without its waveform scattered by a tenth. The scoring is that of
    a run; its time on the loops is not measured.
    """
    with tempfile.TemporaryDirectory() as home:
        place = place_of(Path(home) / "run")
        with _model(methods) as (model, manifest):
            each = len(manifest["methods"])
            number = -(-count // each // PIECE)
            pieces.open_run(place, manifest, resume=False)
            receipts = [
                pieces.write_piece(place, piece, "") for piece in _made_up(model, each, number)
            ]
        since = time.process_time()
        pieces.finish(place, receipts, manifest)
        used = time.process_time() - since
    total = number * PIECE * each
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {
        "rows": total,
        "scenarios": number * PIECE,
        "cpu_s": round(used, 2),
        "peak_MB": round(peak, 1),
    }


@contextmanager
def _model(methods: str) -> Iterator[tuple[Path, dict[str, Any]]]:
    with tempfile.TemporaryDirectory() as home:
        model = run_grid("smoke", Path(home) / "run", [methods])
        verdicts = read_manifest(model)
        yield (
            model,
            {k: v for k, v in verdicts.items() if k not in ("tables", "counts", "records_hash")}
            | {"complete": False},
        )


def _made_up(model: Path, each: int, number: int) -> Iterator[Chunk]:
    scenarios, verdicts = read_table(model, "scenarios"), read_table(model, "verdicts")
    rng, at = np.random.default_rng(0), np.arange(PIECE) % len(scenarios)
    many = scenarios.take(at), verdicts.take((at[:, None] * each + np.arange(each)).ravel())
    told = np.array(many[0].column("no_waveform").to_pylist())
    for k in range(number):
        scattered = list(told * rng.normal(1.0, 0.1, told.shape))
        loops = _with(many[0], "no_waveform", scattered)
        loops = _with(loops, "group", (k * PIECE + np.arange(PIECE)) // 2)
        ids = np.array([f"{k * PIECE + i:016x}" for i in range(PIECE)])
        verdict = _with(
            _with(many[1], "scenario_id", np.repeat(ids, each)),
            "score",
            rng.normal(size=PIECE * each),
        )
        both = (
            tables.as_parquet(table, k) for table in (_with(loops, "scenario_id", ids), verdict)
        )
        yield Chunk(k, *both, PIECE, 0, 0.0, 0.0, 0.0)


def _with(table: pa.Table, column: str, values: np.ndarray) -> pa.Table:
    at = table.schema.get_field_index(column)
    return table.set_column(
        at, table.schema.field(at), pa.array(values, table.schema.field(at).type)
    )


def main(arguments: list[str] | None = None) -> int:
    """Run one measurement and print it as JSON: `python -m results.studies.store_study cluster` or
    `rows`.

    1 when tables differ.
    """
    chosen = list(sys.argv[1:] if arguments is None else arguments)
    if chosen[:1] == ["client"]:
        return _client(*chosen[1:])
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.store_study", description=__doc__
    )
    parser.add_argument("what", choices=["cluster", "rows"])
    parser.add_argument(
        "--n", type=int, default=None, help="scenarios (100 000), or rows (10 000 000)"
    )
    parser.add_argument("--grid", default="smoke", help="name or file")
    parser.add_argument("--method", default="horch", choices=registry.names())
    asked = parser.parse_args(chosen)
    result = (
        cluster(asked.n or 100_000, asked.grid, asked.method)
        if asked.what == "cluster"
        else rows(asked.n or 10_000_000)
    )
    print(json.dumps(result, indent=1))
    return int(not result.get("equal", True))


if __name__ == "__main__":
    sys.exit(exit_code(main))
