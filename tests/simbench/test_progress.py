"""Long work shows its progress, on a log file too, and a stopped command leaves a word."""

import re
import signal
import subprocess
import sys
import time

import pytest

from simbench import cli, progress
from simbench.cli.catalogue import LISTED_KINDS


def test_a_log_gets_whole_lines_no_more_often_than_allowed(monkeypatch, capsys):
    monkeypatch.setattr(progress, "BETWEEN_LINES", 0.2)
    for _ in progress.Progress(range(10), desc="loops"):
        time.sleep(0.05)
    lines = capsys.readouterr().err.splitlines()
    assert 1 <= len(lines) <= 3
    assert all(re.fullmatch(r"loops: \d+ of 10 after [\d:]+, [\d:]+ left", line) for line in lines)


@pytest.mark.parametrize(("shown", "said"), [(False, ""), (None, "work: 30 of 40 after")])
def test_what_was_done_before_counts_and_flatters_no_rate(monkeypatch, capsys, shown, said):
    monkeypatch.setattr(progress, "BETWEEN_LINES", 0.0)
    with progress.Progress(total=40, desc="work", shown=shown) as bar:
        bar.skip(20)
        time.sleep(0.5)
        bar.update(10)
    last = capsys.readouterr().err.splitlines()[-1:]
    assert "".join(last).startswith(said)
    # ten in half a second: as many again are left
    assert all(line.endswith(("00:00 left", "00:01 left")) for line in last)


def test_a_command_stopped_by_sigterm_prints_that():
    # in many naps: a signal between the print and one long sleep would wait for its end
    code = "import time\ndef nap():\n for _ in range(600): time.sleep(0.1)\n"
    code += "from simbench.usage import exit_code\n"
    code += "exit(exit_code(lambda: print('on', flush=True) or nap()))"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as work:
        assert work.stdout.readline() == "on\n"
        work.send_signal(signal.SIGTERM)
        _, printed = work.communicate(timeout=60)
    assert work.returncode == 143
    assert printed == "stopped by SIGTERM; no output is half-written\n"


def test_list_alone_prints_what_can_be_listed(capsys):
    assert cli.main(["list"]) == 0
    assert capsys.readouterr().out.split("\n")[:-1] == [
        f"simbench list {kind}" for kind in (*LISTED_KINDS, "thresholds")
    ]


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_no_file_takes_the_number_of_a_closed_stream(tmp_path, closed):
    work = f"lambda: (f := open({str(tmp_path / 'rec.csv')!r}, 'w')).write(str(f.fileno())) and 0"
    code = f"from simbench.usage import exit_code; exit(exit_code({work}))"
    shell = ["sh", "-c", f'exec "$0" -c "$1" {closed}', sys.executable, code]
    assert subprocess.run(shell).returncode == 0
    assert int((tmp_path / "rec.csv").read_text()) > 2


def test_a_full_stderr_keeps_the_exit_code():
    code = "from simbench.usage import complain, exit_code; "
    code += "exit(exit_code(lambda: complain('x')))"
    shell = ["sh", "-c", 'exec "$0" -c "$1" 2>/dev/full', sys.executable, code]
    assert subprocess.run(shell).returncode == 2


@pytest.mark.parametrize(("printed", "code"), [("to nobody", 2), ("", 0)])
def test_what_is_printed_to_a_closed_stdout_is_no_success(printed, code):
    text = f"from simbench.usage import exit_code as e; exit(e(lambda: print('{printed}')))"
    shell = ["sh", "-c", f'exec "{sys.executable}" -c "{text}" >&-']
    done = subprocess.run(shell, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (code, code // 2)
    assert ("stdout is closed" in done.stderr) == bool(printed)


def test_the_answer_on_a_closed_stdout_is_named_as_lost():
    command = f'exec "{sys.executable}" -m simbench.cli list valves'
    done = subprocess.run(["sh", "-c", f"{command} >&-"], stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
