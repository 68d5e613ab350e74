"""One sample of a size that no transmitter sends, and a user without a home folder: no verb prints
a raw warning.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from simbench.cli import main
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


# a warning is an error in every test, and `main` raises what is a fault of the program
@pytest.mark.parametrize("signal", ["op", "pv"])
@pytest.mark.parametrize(
    "words",
    ["detect REC --method full --html v.html", "diagnose REC --picture p.svg",
     pytest.param("trust REC --html t.html", marks=pytest.mark.slow),
     pytest.param("gap diagnose REC --identify --html g.html", marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_single_sample_of_1e59_warns_of_nothing(large, tmp_path, monkeypatch, signal, words):
    monkeypatch.chdir(tmp_path)
    assert main(
        [str(large / f"{signal}.csv") if word == "REC" else word for word in words.split()]
    ) in (0, 2)


@pytest.mark.slow
def test_report_of_samples_of_1e59_warns_of_nothing(large, tmp_path, capfd):
    assert main(["report", str(large), "-o", str(tmp_path / "page.html"), "-j", "1"]) == 0
    assert "Warning" not in capfd.readouterr().err


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
    command = [
        setpriv,
        "--reuid=54321",
        "--regid=54321",
        "--clear-groups",
        str(python),
        "-m",
        "simbench.cli",
        *words,
    ]
    return subprocess.run(command, cwd=folder, env=given, capture_output=True, text=True)


@pytest.fixture
def open_folder():
    """A folder that every user reaches; pytest's own are closed to others."""
    folder = Path("/tmp") / f"simbench-stranger-{os.getpid()}"
    folder.mkdir()
    yield folder
    shutil.rmtree(folder)


# each compiles what it needs anew, as nothing is kept for such a user
SLOW = [
    "detect rec.csv --method horch --html v.html",
    "report . -o page.html -j 2",
    "run smoke -o run --method horch_histogram -j 2 --set disturbance=none",
    "gap diagnose rec.csv --identify --html g.html",
    "trust rec.csv --method horch --html t.html",
]


@pytest.mark.parametrize(
    "words",
    ["figure table-11-4 -o .", *(pytest.param(w, marks=pytest.mark.slow) for w in SLOW)],
)
def test_a_user_without_a_home_runs_a_verb(open_folder, words):
    write(open_folder / "rec.csv", np.arange(600))
    done = stranger(open_folder, *words.split())
    assert done.returncode == 0, done.stderr
    raw = ("atplotlib", "Warning", "cache")
    assert not [line for line in done.stderr.splitlines() if any(word in line for word in raw)], (
        done.stderr
    )
