"""What runs where a platform has no fcntl, no resource, no fork, no alarm and no /proc: everything
but a plug-in's limits.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tests.simbench.boundary.test_loops import put
from tests.simbench.boundary.test_loops import text as loop

ROOT = Path(__file__).parents[3]
# what every process of a blocked run does first, whoever starts it
BLOCKADE = """
import os, signal, sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name in ("fcntl", "resource"):
            raise ImportError(f"{name} is blocked")
sys.meta_path.insert(0, Blocked())
for name in ("fcntl", "resource"):
    sys.modules.pop(name, None)
if WHOLE:  # the processes of multiprocessing are started by fork and exec alone on this system
    for module, name in ((os, "fork"), (signal, "SIGALRM"), (signal, "setitimer")):
        delattr(module, name)
def no_proc(event, args):
    if event in ("open", "os.listdir", "os.scandir") and str(args[0]).startswith("/proc"):
        raise FileNotFoundError(2, "no such file or directory", args[0])
sys.addaudithook(no_proc)
"""
EVERYTHING = """
import importlib, pkgutil
for package in ("detectors", "scenarios", "simbench"):
    for module in pkgutil.walk_packages(importlib.import_module(package).__path__, package + "."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
"""


@pytest.fixture(scope="module")
def blocked(tmp_path_factory):
    """Run Python code with the blockade, or without it; return what it prints."""
    folder = tmp_path_factory.mktemp("blockade")
    (folder / "sitecustomize.py").write_text(
        BLOCKADE.replace("WHOLE", "'loky' not in ' '.join(sys.orig_argv)")
    )

    def run(code: str, blockade: bool = True) -> str:
        paths = [str(folder)] * blockade + [str(ROOT)]
        known = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
        done = subprocess.run(
            [sys.executable, "-c", code], env=known, capture_output=True, text=True, timeout=500
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def commands(folder: Path, jobs: int, whole: bool) -> str:
    """Code that runs verbs in a folder, the dear ones too or not."""
    return f"""
import os, sys, pathlib
from simbench.cli import main
def do(*words):
    code = main(list(map(str, words)))
    assert code in (0, 1), code
folder = pathlib.Path({str(folder)!r})
folder.mkdir(exist_ok=True)
os.chdir(folder)
do("simulate", {str(folder.parent / "loop.toml")!r}, "-o", "rec.csv")
do("detect", "rec.csv", "--method", "fast", "--json")
if {whole}:
    loop = {str(folder.parent / "loop.toml")!r}
    do("gap", "diagnose", "rec.csv", "--baseline", loop, "--json")
sets = ["disturbance=none", "Td_over_T=0.3", "S_over_2J=0.5", "Td_over_Ti=0.05"]
small = [word for one in sets for word in ("--set", one)]
do("run", "smoke", *small, "-o", "run", "--method", "horch", "-j", {jobs!r}, "--json")
do("score", "run", "--json")
"""


def test_every_module_imports(blocked):
    blocked(EVERYTHING)


@pytest.mark.parametrize(
    ("jobs", "whole"), [(1, False), pytest.param(2, True, marks=pytest.mark.slow)]
)
def test_commands_answer_with_the_same_bits_as_without_the_blockade(blocked, tmp_path, jobs, whole):
    put(tmp_path, loop())
    answers, tables = [], []
    for blockade in (False, True):
        folder = tmp_path / f"blocked {blockade}"
        answer = blocked(commands(folder, jobs if blockade else 1, whole), blockade)
        answers.append(re.sub(r'"\w+_ms": .*', "", answer))
        files = (folder / "run" / f"{name}.parquet" for name in ("verdicts", "scenarios"))
        tables.append([pd.read_parquet(f).assign(runtime_s=0.0) for f in files])
    assert answers[0] == answers[1]
    for free, other in zip(*tables):
        pd.testing.assert_frame_equal(free, other[free.columns], check_exact=True)
