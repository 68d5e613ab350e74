"""Measure the benchmark itself: kills, memory, time per scenario, speed on two workers, overhead,
adaptive sweeps.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from simbench.bench.execute.run import Interrupted, run_grid
from simbench.bench.store.manifest import read_manifest
from simbench.files import whole_file
from simbench.scenarios.grid import load_grid
from simbench.usage import exit_code

# every repeat has the same cells, so that time per scenario can be compared between sizes
GRID = "table-11-3"


def kills(
    n: int, seed: int = 0, grid: str = GRID, methods: str = "he,horch,yamashita", jobs: int = 2
) -> dict[str, Any]:
    """Kill runs at random moments, resume each, and compare the tables with an undisturbed run's.

    `n`: kills (SIGKILL to the run and its workers), spread over as many runs as it takes.

    Keys: kills, runs, kills_after_first_piece, equal (all final tables equal to the undisturbed
    ones bit for bit).
    """
    rng = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        sets = {"repeats": 1}
        since = time.monotonic()
        _run(where / "undisturbed", grid, methods, jobs, sets).wait()
        length = time.monotonic() - since
        done = late = runs = 0
        equal = True
        while done < n:
            target = where / f"run{runs}"
            while True:
                process = _run(target, grid, methods, jobs, sets, group=True)
                try:
                    # often enough in mid-run, sometimes not before the end
                    process.wait(
                        timeout=float(rng.uniform(0.05, 0.7) * length) if done < n else None
                    )
                    break
                except subprocess.TimeoutExpired:
                    late += any(target.glob("receipts/*.json"))
                    os.killpg(process.pid, signal.SIGKILL)
                    process.wait()
                    done += 1
            runs += 1
            equal &= same_tables(where / "undisturbed", target)
    return {"kills": done, "runs": runs, "kills_after_first_piece": int(late), "equal": bool(equal)}


def same_tables(one: Path, other: Path) -> bool:
    """Whether two runs' tables agree bit for bit, `runtime_s` excepted."""
    for kind in ("verdicts", "scenarios"):
        tables = [pq.read_table(folder / f"{kind}.parquet") for folder in (one, other)]
        if kind == "verdicts":
            tables = [t.drop_columns(["runtime_s"]) for t in tables]
        if not tables[0].equals(tables[1]):
            return False
    return True


def sizes(counts: Sequence[int], methods: str = "fast", grid: str = GRID) -> list[dict[str, Any]]:
    """Run a grid at several sizes, one worker each, and measure memory, time per scenario and
    overhead.

    Keys: scenarios, peak_MB (resident), ms_per_scenario (wall, without start-up), cpu_ms and bytes
    (of the tables) per scenario, overhead (share of the working time outside simulation and
    detectors).
    """
    each = len(load_grid(grid, {"repeats": 1}))
    rows = []
    for count in counts:
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "run"
            process = _run(
                target, grid, methods, 1, {"repeats": max(round(count / each), 1)}, measure=True
            )
            used = json.loads(process.communicate()[0])
            manifest = read_manifest(target)
            size = sum(f.stat().st_size for f in target.glob("*.parquet/*"))
        times, n = manifest["times"], manifest["counts"]["scenarios"]
        rows.append(
            {
                "scenarios": n,
                "peak_MB": round(used["peak_MB"], 1),
                "ms_per_scenario": round(1e3 * times["wall"] / n, 3),
                "cpu_ms": round(1e3 * used["cpu"] / n, 3),
                "bytes": round(size / n, 1),
                "overhead": round(
                    1.0 - (times["simulating"] + times["judging"]) / times["wall"], 4
                ),
            }
        )
        print(json.dumps(rows[-1]), file=sys.stderr)
    return rows


def speed(
    count: int, methods: str = "fast", grid: str = "chapter", jobs: int = 2
) -> dict[str, Any]:
    """Time a run on several workers against as many independent processes.

    Keys: scenarios, seconds, seconds_for_10000, independent_seconds, share (of the independent
    processes' speed), and cpu_share, the same in processor time, which a busy machine blurs less
    but which does not see idling.
    """
    each = len(load_grid(grid, {"repeats": 1}))
    repeats = max(math.ceil(count / each / jobs), 1)
    with tempfile.TemporaryDirectory() as folder:
        where = Path(folder)
        since, used = time.monotonic(), _cpu()
        _run(where / "together", grid, methods, jobs, {"repeats": repeats * jobs}).wait()
        together, cpu_together = time.monotonic() - since, _cpu() - used
        since, used = time.monotonic(), _cpu()
        alone = [
            _run(where / f"alone{i}", grid, methods, 1, {"repeats": repeats, "seed": 900 + i})
            for i in range(jobs)
        ]
        for process in alone:
            process.wait()
        apart, cpu_apart = time.monotonic() - since, _cpu() - used
        n = read_manifest(where / "together")["counts"]["scenarios"]
    return {
        "scenarios": n,
        "seconds": round(together, 2),
        "seconds_for_10000": round(1e4 * together / n, 1),
        "independent_seconds": round(apart, 2),
        "share": round(apart / together, 3),
        "cpu_share": round(cpu_apart / cpu_together, 3),
    }


def adaptive_cost(
    width: float, grid: str = "smoke", methods: str = "he,yamashita", jobs: int = 2
) -> dict[str, Any]:
    """Compare an adaptive sweep with the full product that reaches the same width in every cell.

    Keys: width, widest, scenarios, full_product, saved (share of the full product not needed).
    """
    with tempfile.TemporaryDirectory() as folder:
        target = run_grid(grid, Path(folder) / "run", [methods], jobs, until_width=width)
        sizes = read_manifest(target)["adaptive"]
    return {**sizes, "saved": round(1.0 - sizes["scenarios"] / sizes["full_product"], 3)}


def _cpu() -> float:
    # of processes that have ended, their workers included
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _run(
    target: Path,
    grid: str,
    methods: str,
    jobs: int,
    sets: dict[str, Any],
    measure: bool = False,
    group: bool = False,
) -> subprocess.Popen:
    words = ["child", str(target), grid, methods, str(jobs), json.dumps(sets)]
    command = [sys.executable, "-m", "results.studies.benchmark_cost", *words]
    # a separate process group lets a kill take the workers too; a busy machine shares itself out by
    # group, so timing does without
    return subprocess.Popen(
        command, start_new_session=group, stdout=subprocess.PIPE if measure else subprocess.DEVNULL
    )


def _child(target: str, grid: str, methods: str, jobs: str, sets: str) -> int:
    try:
        run_grid(grid, target, [methods], int(jobs), sets=json.loads(sets), resume=True)
    except Interrupted as stop:
        print(stop, file=sys.stderr)
        return 130
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(json.dumps({"peak_MB": used.ru_maxrss / 1024, "cpu": used.ru_utime + used.ru_stime}))
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Run one measurement, print it as JSON and, where asked, write it.

    1 when the tables of killed runs differ.
    """
    chosen = list(sys.argv[1:] if arguments is None else arguments)
    if chosen[:1] == ["child"]:
        return _child(*chosen[1:])
    parser = argparse.ArgumentParser(
        prog="python -m results.studies.benchmark_cost", description=__doc__
    )
    parser.add_argument("what", choices=["kills", "sizes", "speed", "adaptive"])
    parser.add_argument(
        "--n", type=int, nargs="+", default=None, help="kills, or scenarios (several for sizes)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--methods", default=None)
    parser.add_argument("--grid", default=None)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--width", type=float, default=0.1)
    parser.add_argument("--out", default=None, help="JSON file to write")
    asked = parser.parse_args(chosen)
    more = {k: v for k, v in (("methods", asked.methods), ("grid", asked.grid)) if v is not None}
    if asked.what == "kills":
        result: Any = kills((asked.n or [50])[0], asked.seed, jobs=asked.jobs, **more)
    elif asked.what == "sizes":
        result = sizes(asked.n or [1000, 10_000, 100_000], **more)
    elif asked.what == "speed":
        result = speed((asked.n or [10_000])[0], jobs=asked.jobs, **more)
    else:
        result = adaptive_cost(asked.width, jobs=asked.jobs, **more)
    text = json.dumps(result, indent=1)
    print(text)
    if asked.out is not None:
        with whole_file(asked.out) as f:
            f.write(text + "\n")
    return int(asked.what == "kills" and not result["equal"])


if __name__ == "__main__":
    raise SystemExit(exit_code(main))
