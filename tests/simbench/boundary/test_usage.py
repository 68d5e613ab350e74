"""What happens around a command: an empty argument, no display, a fault, a reader that is gone."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from simbench.detectors import faults
from simbench.usage import exit_code
from tests.simbench.boundary.conftest import answer_to, refused


@pytest.mark.parametrize("words", [["detect", ""], ["list", ""]])
def test_an_empty_argument_is_not_the_folder_in_which_the_command_runs(words):
    refused(words, f"argument {len(words)} is empty", "is needed")


def test_a_backend_that_matplotlib_no_longer_has_hinders_no_picture(here):
    command = [sys.executable, "-m", "simbench.cli", "figure", "table-11-4", "-o", "."]
    environment = {**os.environ, "MPLBACKEND": "Qt4Agg"}
    assert subprocess.run(command, env=environment, capture_output=True).returncode == 0


def test_faults_of_the_program_are_one_sentence_that_names_its_log_and_logs_do_not_pile_up(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.delenv(faults.RAISED)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "simbench-report.log").write_text("not ours")
    for number in range(faults.LOGS + 5):

        def fault(number=number):
            raise ZeroDivisionError(f"nobody\nthought of {number}")

        assert exit_code(fault) == 2
    message = capsys.readouterr().err.splitlines()[-1]
    assert f"nobody thought of {faults.LOGS + 4}" in message
    assert len(list(tmp_path.glob(f"{faults.LOG}*"))) == faults.LOGS
    log = Path(message.rpartition(" ")[2]).read_text()
    assert "Traceback" in log
    assert f"thought of {faults.LOGS + 4}" in log
    assert (tmp_path / "simbench-report.log").exists()


def test_json_with_exit_0_is_json():
    for kind in ("detectors", "grids", "effects", "valves", "figures"):
        assert json.loads(answer_to(f"list {kind} --json"))


@pytest.mark.parametrize("command", ["list thresholds", "list grids --json", "--help"])
def test_a_reader_that_is_gone_is_no_verdict(command):
    read, write = os.pipe()
    os.close(read)
    ended = subprocess.run(
        [sys.executable, "-m", "simbench.cli", *command.split()], stdout=write, stderr=-1, text=True
    )
    os.close(write)
    # as a shell says of any command that SIGPIPE ends; 1 means that a detector became worse
    assert (ended.returncode, ended.stderr) == (141, "")
