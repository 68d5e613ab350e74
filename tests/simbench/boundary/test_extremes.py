"""One sample of a size that no transmitter sends, and a user without a home folder: no verb prints
a raw warning.
"""

import os
import re
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.simbench.boundary.conftest import run_verb, sampled
from tests.simbench.boundary.test_hostile import write

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """Records of which one sample of PV, or of OP, is 1e59."""
    folder = tmp_path_factory.mktemp("large")
    for column in (1, 2):
        write(folder / "plain.csv", np.arange(600))
        rows = [line.split(",") for line in (folder / "plain.csv").read_text().splitlines()]
        rows[300][column] = "1e59"
        (folder / f"{rows[0][column]}.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    (folder / "plain.csv").unlink()
    return folder


VERBS = [
    "detect REC --method full --html v.html",
    "diagnose REC --picture p.svg",
    "gap diagnose REC --identify --html g.html",
]


# a warning is an error in every test, and `main` raises what is a fault of the program
@pytest.mark.parametrize(
    ("words", "signal"), sampled(product(VERBS, ["op", "pv"]), 0, [(VERBS[0], "op")])
)
def test_a_single_sample_of_1e59_warns_of_nothing(large, here, words, signal):
    assert run_verb(words.replace("REC", str(large / f"{signal}.csv")))[0] in (0, 2)


def stranger(folder, *words):
    """Run a verb as a user whom no table of users knows, with nothing to write to but one
    folder.
    """
    python = Path("/usr/bin/python3")
    setpriv = shutil.which("setpriv")
    if os.getuid() or setpriv is None or not python.exists():
        pytest.skip(
            "another user can be played by root only, with setpriv and a Python that all may run"
        )
    version = subprocess.run(
        [python, "-c", "import sys; print(*sys.version_info[:2])"], capture_output=True, text=True
    ).stdout
    if version.split() != [str(part) for part in sys.version_info[:2]]:
        pytest.skip("the Python of the system is another version")
    folder.chmod(0o777)
    packages = [p for p in sys.path if p.endswith("site-packages")]
    given = {
        "PATH": "/usr/bin:/bin",
        "TMPDIR": str(folder),
        "PYTHONPATH": os.pathsep.join([str(ROOT), *packages]),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    user = [setpriv, "--reuid=54321", "--regid=54321", "--clear-groups"]
    command = [*user, str(python), "-m", "simbench.cli", *words]
    return subprocess.run(command, cwd=folder, env=given, capture_output=True, text=True)


@pytest.fixture
def open_folder():
    """A folder that every user reaches; those of pytest are closed to others."""
    folder = Path("/tmp") / f"simbench-stranger-{os.getpid()}"
    folder.mkdir()
    yield folder
    shutil.rmtree(folder)


# each compiles what it needs anew, as nothing is kept for such a user
VERBS_OF_A_STRANGER = [
    "figure table-11-4 -o .",
    "detect rec.csv --method horch --html v.html",
    "run smoke -o run --method horch_histogram -j 2 --set disturbance=none",
    "gap diagnose rec.csv --identify --html g.html",
]


@pytest.mark.parametrize("words", sampled(VERBS_OF_A_STRANGER, 0, VERBS_OF_A_STRANGER[:1]))
def test_a_user_without_a_home_runs_a_verb(open_folder, words):
    write(open_folder / "rec.csv", np.arange(600))
    done = stranger(open_folder, *words.split())
    assert done.returncode == 0, done.stderr
    assert not re.search("atplotlib|Warning|cache", done.stderr), done.stderr
