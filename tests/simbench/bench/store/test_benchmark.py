"""Benchmark versions: what changes a score changes the hash, and runs of different versions are not
compared.
"""

import json

import pytest
from bench_fixtures import SMALL
from typer.testing import CliRunner

from simbench.bench.check.baseline import write_baseline
from simbench.bench.execute.run import run_grid
from simbench.bench.store.benchmark import grid_of
from simbench.bench.store.manifest import read_manifest, write_manifest
from simbench.cli import app
from simbench.detectors.errors import UserError
from simbench.scenarios.grid import make_grid

AXES = {"disturbance": ["none"], "S_over_2J": [0.5]}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs of the same loops by different detectors, and one with another seed."""
    folder = tmp_path_factory.mktemp("runs")
    for name, methods, seed in (
        ("one", ["he"], 3),
        ("same", ["he", "horch"], 3),
        ("other", ["he"], 4),
    ):
        run_grid(
            make_grid({**SMALL, "version": 2}, "small", {"seed": seed}, AXES),
            folder / name,
            methods,
        )
    return folder


def differ(one, other):
    assert one["hash"] != other["hash"]
    return {part for part in one["parts"] if one["parts"][part] != other["parts"][part]}


def test_a_manifest_gives_back_the_grid_and_states_its_version(runs):
    manifest = read_manifest(runs / "one")
    again = make_grid({**SMALL, "version": 2}, "small", {"seed": 3}, AXES)
    assert grid_of(manifest).hash == again.hash == manifest["grid_hash"]
    assert manifest["benchmark"]["name"] == "small-2"
    shown = CliRunner().invoke(
        app, ["score", str(runs / "one"), "--json", "--report", str(runs / "page.html")]
    )
    assert json.loads(shown.stdout)["benchmark"] == manifest["benchmark"]
    assert (
        f"benchmark small-2 ({manifest['benchmark']['hash']})" in (runs / "page.html").read_text()
    )


def test_runs_of_different_versions_are_not_compared(runs, tmp_path):
    def compared(other):
        return CliRunner().invoke(app, ["check", str(runs / "one"), "--against", str(other)])

    # other detectors are what is compared
    assert not isinstance(compared(runs / "same").exception, UserError)
    with pytest.raises(UserError, match=r"differ in the scenarios$"):
        raise compared(runs / "other").exception
    write_baseline(runs / "same", tmp_path / "b")
    manifest = read_manifest(tmp_path / "b")
    del manifest["benchmark"]
    write_manifest(tmp_path / "b", manifest)
    with pytest.raises(UserError, match="states no benchmark version"):
        raise compared(tmp_path / "b").exception
