"""A small file system that is full: one sentence, nothing half-written, the same bits after room is
made.
"""

import json
import os
import shutil
import subprocess
import sys

import pytest

from tests.simbench.boundary.conftest import answer_to, sampled
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
