"""A small file system that is full: one sentence, nothing half-written, the same bits after room is
made.
"""

import json
import os
import resource
import shutil
import subprocess
import sys

import pytest

from tests.simbench.boundary.conftest import answer_to, names_in, sampled
from tests.simbench.boundary.test_verbs_faults import (
    HEAVY,
    QUICK,
    begun,
    contents,
    home,
    made_already,
)

__all__ = ["home"]  # a fixture
ROOM = (0, 8, 40, 200, 1000)  # KiB left on a file system of 8 MB
# run by verbs in a space of mounts of their own, which ends with the process
CHILD = """
import json, os, shutil, sys
from tests.simbench.boundary.conftest import run_verb
words, tried = sys.argv[2:], []
rooms, sys.argv = json.loads(sys.argv[1])
for room in rooms:
    with open(".filler", "wb") as f:
        f.write(bytes(max(os.statvfs(".").f_bavail * os.statvfs(".").f_bsize - 1024 * room, 0)))
    code, _, message = run_verb(words)
    hidden = [n for _, _, names in os.walk(".") for n in names if n[0] == "." and n != ".filler"]
    tried.append([code, message, hidden])
    os.unlink(".filler")
    if code == 0:
        break
again = run_verb(words)
shutil.copytree(".", "../on small")
print(json.dumps([tried, again]))
"""
VERBS = {**QUICK, "run": HEAVY["run"]}


def mounts() -> bool:
    """Whether a space of mounts can be made here."""
    words = ["unshare", "-rm", "sh", "-c", "mount -t tmpfs -o size=1m tmpfs /mnt"]
    return (
        bool(shutil.which("unshare")) and not subprocess.run(words, capture_output=True).returncode
    )


@pytest.mark.skipif(not mounts(), reason="no file system can be mounted here")
@pytest.mark.parametrize("verb", sampled(VERBS, 0, ["simulate"]))
def test_a_verb_on_a_full_file_system(home, verb, monkeypatch):
    words = VERBS[verb].split()
    monkeypatch.chdir(begun(home, "whole", words))
    answer_to(words)
    expected = contents(home / "whole")
    shutil.rmtree(home / "on small", ignore_errors=True)
    small = begun(home, "small", words)
    mount = 'mount -t tmpfs -o size=8m tmpfs "$0" && cd "$0" && exec "$@"'
    child = [sys.executable, "-c", CHILD, json.dumps([ROOM, sys.argv]), *words]
    done = subprocess.run(
        ["unshare", "-rm", "sh", "-c", mount, small, *child],
        capture_output=True,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )
    assert done.returncode == 0, done.stderr
    tried, (code, _, message) = json.loads(done.stdout)
    refusals = [told for told in tried if told[0]]
    assert refusals
    for one, told, hidden in refusals:
        last = told.splitlines()[-1]
        assert one == 2
        assert last.startswith("error: "), told
        assert "no space left on device" in last, told
        assert not hidden or set(hidden) <= {".partial"}, hidden
    assert code == 0 or made_already(verb, home / "on small", expected), message
    assert contents(home / "on small") == expected


def test_a_file_that_grows_too_large_leaves_the_old_one_as_it_was(home, here):
    command = [sys.executable, "-m", "simbench.cli", "simulate", home / "loop.toml", "-o"]
    environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    # compiled first: the limit would hit numba's cache too
    assert subprocess.run([*command, "warm.csv"], env=environment).returncode == 0
    (here / "out.csv").write_text("old")
    limits = (resource.RLIMIT_FSIZE, (4096, 4096))
    done = subprocess.run(
        [*command, "out.csv"], env=environment, capture_output=True, text=True,
        preexec_fn=lambda: resource.setrlimit(*limits),
    )  # fmt: skip
    assert done.returncode == 2
    assert "too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert (here / "out.csv").read_text() == "old"
    assert names_in(here) == ["out.csv", "warm.csv"]
