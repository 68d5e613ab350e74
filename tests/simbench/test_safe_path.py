"""A folder of data is never executed, whatever its files are called."""

import os
import subprocess
import sys

import pytest

from simbench.safe_path import VARIABLE, safe_path

TRAP = "open('executed', 'a').write('x')\nraise SystemExit(3)\n"
COMMANDS = {
    "run": ["run", "smoke", "-o", "run", "-j", "2", "--method", "horch_histogram", "--n", "4"],
    "simulate": ["simulate", "smoke", "-o", "records", "--n", "2"],
}


@pytest.mark.parametrize("verb", ["run", pytest.param("simulate", marks=pytest.mark.slow)])
def test_workers_import_nothing_from_the_folder_in_which_the_command_runs(tmp_path, verb):
    for name in ("joblib", "numpy", "detectors", "multiprocessing"):
        (tmp_path / f"{name}.py").write_text(TRAP)
    # as the installed command does: its own folder is on the path, not the working directory
    start = "from simbench.cli import entry; entry()"
    env = {k: v for k, v in os.environ.items() if k != VARIABLE}
    done = subprocess.run(
        [sys.executable, "-P", "-c", start, *COMMANDS[verb]],
        cwd=tmp_path, env=env, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "executed").exists()


def test_the_environment_is_as_before(monkeypatch):
    for before in (None, "", "1"):
        monkeypatch.setenv(VARIABLE, before) if before is not None else monkeypatch.delenv(
            VARIABLE, raising=False
        )
        with safe_path():
            assert os.environ[VARIABLE] == "1"
        assert os.environ.get(VARIABLE) == before
