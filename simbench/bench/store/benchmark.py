"""Compute the version of a benchmark: the grid's name and number, and a hash of all code that a
score depends on, except the detectors.
"""

from __future__ import annotations

import ast
import hashlib
import math
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from simbench.bench.store.folder import RunError, refuse_unfinished
from simbench.bench.store.manifest import MANIFEST, read_manifest
from simbench.bench.store.reading import read_table, without_loops
from simbench.detectors.records.folder import RECORD_FILES
from simbench.scenarios.expansion import Grid
from simbench.scenarios.grid_file import GridFile
from simbench.scenarios.packaged import grid_names
from simbench.scenarios.sample import Sample
from simbench.scenarios.settled import COLUMNS, SettledGrid, table_of
from simbench.scenarios.toml import content_hash

BENCHMARK = "benchmark"
# key of a manifest: of its overrides those of loops' keys, which the grid's content does not hold
LOOP_KEYS = "loop_overrides"
# source of a grid whose loops copy records
FROM_RECORDS = "simbench run on records"
PARTS = {"scenarios": "the scenarios", "evaluator": "the evaluator's rules"}
# how a grid becomes a table is none of it: the table is the other part
_PACKAGES = ("loop", "theory", "bench/scenario", "bench/score")
_FILES = (
    "valve/maps.py",
    "bench/statistics.py",
    "detectors/signal/oscillation.py",
    "scenarios/parts.py",
    "scenarios/plant.py",
    "scenarios/spec.py",
    "scenarios/toml_table.py",
    "scenarios/toml.py",
    "scenarios/polynomials.py",
)
# they print, compare or transport, and decide no truth and no score
_LEFT_OUT = (
    "asked",
    "compare",
    "page",
    "paper",
    "part_files",
    "public_loop",
    "picture",
    "result",
    "several_seeds",
    "shipped",
    "table",
)


def benchmark_of(grid: Grid, table: Iterable[tuple[str, str]]) -> dict[str, Any]:
    """Return the version of the benchmark that a grid and the table of its scenarios make.

    Parameters
    ----------
    grid : Grid
        With its overrides applied.
    table : iterable of (str, str)
        Id and loop digest of every scenario, in any order.

    Returns
    -------
    dict
        name ("ci-2"), version (2), hash (16 hex digits over both parts), and parts, a hash each:
        scenarios (the table) and evaluator (source of what decides truth and score, whatever its
        comments, docstrings and layout). Where `--set` or `--axis` changed a grid of the package it
        has "changed" after its name.

    Examples
    --------
    >>> from simbench.scenarios.settled import settled_grid
    >>> grid = settled_grid("smoke")
    >>> one, other = ("a", "0f"), ("b", "3c")
    >>> benchmark_of(grid, [one, other]) == benchmark_of(grid, [other, one])
    True
    """
    lines = "\n".join(sorted(f"{ident} {digest}" for ident, digest in table))
    scenarios = hashlib.sha256(lines.encode()).hexdigest()[:16]
    parts = {"scenarios": scenarios, "evaluator": evaluator_hash()}
    name = f"{grid.name}-{grid.content.version}"
    if grid.name in grid_names() and not grid.of_package:
        name += " changed"
    return {
        "name": name,
        "version": grid.content.version,
        "hash": content_hash(parts),
        "parts": parts,
    }


def benchmark_version(manifest: Mapping[str, Any]) -> str:
    """Return name and hash of a run's benchmark; empty for one of an older simbench."""
    stated = manifest.get(BENCHMARK)
    if stated:
        return f"{stated['name']} ({stated['hash']})"
    return ""


def benchmark_text(manifest: Mapping[str, Any]) -> str:
    """Return the version of a run's benchmark as its tables and pages show it."""
    version = benchmark_version(manifest)
    if version:
        return f", benchmark {version}"
    return ""


def grid_settings(grid: Grid, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a run's manifest holds of its grid, `asked` being what --set and --axis change of
    it.
    """
    return {
        "grid": grid.name,
        "grid_hash": grid.hash,
        "grid_content": _without_infinity(grid.content.model_dump(mode="json")),
        "overrides": _without_infinity({**grid.overrides, **asked}),
        LOOP_KEYS: _without_infinity(dict(grid.overrides)),
        "seed": grid.content.seed,
    }


def grid_of(manifest: Mapping[str, Any]) -> Grid:
    """Return the grid that a run's manifest holds, overrides applied; of a map's run, the sample
    that was simulated.
    """
    content = GridFile.model_validate(_with_infinity(manifest["grid_content"]))
    of_loops = manifest.get(LOOP_KEYS, manifest["overrides"])  # all there were, once
    grid = Grid(manifest["grid"], content, _with_infinity(dict(of_loops)))
    if "points" in manifest:
        return Sample.of(grid, manifest["points"])
    return grid


def _without_infinity(value: Any) -> Any:
    """Return settings with infinite numbers as the words that TOML has for them: JSON has none."""
    if isinstance(value, float) and math.isinf(value):
        return "inf" if value > 0.0 else "-inf"
    return _change_parts(value, _without_infinity)


def _with_infinity(value: Any) -> Any:
    """Return settings as they were before `_without_infinity`."""
    if value in ("inf", "-inf"):
        return float(value)
    return _change_parts(value, _with_infinity)


def _change_parts(value: Any, change: Callable[[Any], Any]) -> Any:
    if isinstance(value, dict):
        return {key: change(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [change(part) for part in value]
    return value


def is_stored(grid: str | Path | Grid) -> bool:
    """Return whether a grid is asked for by the folder of a run or baseline."""
    return not isinstance(grid, Grid) and str(grid) not in grid_names() and Path(grid).is_dir()


def is_records(grid: str | Path | Grid) -> bool:
    """Return whether a grid is asked for by a record, or by a folder of records."""
    if isinstance(grid, Grid) or str(grid) in grid_names():
        return False
    path = Path(grid)
    if path.is_dir():
        files = list(path.iterdir())
        return not (path / MANIFEST).exists() and any(map(_may_be_record, files))
    return path.is_file() and _may_be_record(path)


def _may_be_record(file: Path) -> bool:
    return file.suffix.lower() in RECORD_FILES


def stored_grid(folder: str | Path) -> SettledGrid:
    """Return the loops that a run or a baseline stored as a grid: the same ids, loops and seeds.

    Parameters
    ----------
    folder : str or Path
        Folder of a finished run, or of a baseline.

    Returns
    -------
    SettledGrid
        Named as the grid of that run.

    Raises
    ------
    RunError
        When the folder holds no finished run, is damaged, or was written by an older simbench.
    """
    manifest = read_manifest(folder)
    refuse_unfinished(Path(folder), manifest)
    grid = grid_of({k: v for k, v in manifest.items() if k != "points"})
    stored = read_table(folder, "scenarios", COLUMNS)
    if stored.column("loop").null_count:
        raise without_loops(str(folder))
    table = table_of(stored.to_pylist())
    return SettledGrid(grid.name, grid.content, grid.overrides, table, int(manifest["scenarios"]))


def refuse_other_benchmark(one: Mapping[str, Any], other: Mapping[str, Any], common: int) -> None:
    """Raise RunError, naming what differs, unless two manifests state the same evaluator and the
    runs have scenarios in common.
    """
    # Both runs state their version
    versions = [manifest.get(BENCHMARK) for manifest in (one, other)]
    for manifest, stated in zip((one, other), versions, strict=True):
        if stated is None:
            older = (
                f"a run of grid {manifest.get('grid')!r} states no benchmark version, as an older"
                " simbench wrote it"
            )
            raise RunError(f"{older}; run it again")

    # The same rules, and scenarios in common
    first, second = versions
    if first["parts"]["evaluator"] != second["parts"]["evaluator"] or not common:
        differ = []
        for part, name in PARTS.items():
            if first["parts"][part] != second["parts"][part]:
                differ.append(name)
        names = " and ".join(map(benchmark_version, (one, other)))
        raise RunError(
            f"runs of different benchmark versions are not compared: {names} differ in"
            f" {', '.join(differ)}"
        )


@cache
def evaluator_hash() -> str:
    """Return 16 hex digits of the source of everything that decides truth and score, as Python
    reads it.
    """
    root = Path(__file__).resolve().parents[2]
    files = []
    for package in _PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            if file.stem not in _LEFT_OUT:
                files.append(file)
    digest = hashlib.sha256()
    for file in (*files, *(root / name for name in _FILES)):
        digest.update(
            f"{file.relative_to(root).as_posix()}\n{_as_read(file.read_text(encoding='utf-8'))}\n".encode()
        )
    return digest.hexdigest()[:16]


def _as_read(source: str) -> str:
    """Return Python source without comments, docstrings and layout.

    >>> _as_read('def f(x):  # doubled\\n    "Return 2 x."\\n    return (2 *\\n        x)')
    'def f(x):\\n    return 2 * x'
    """
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(
            node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
        ) and ast.get_docstring(node):
            node.body = node.body[1:]
    return ast.unparse(tree)
