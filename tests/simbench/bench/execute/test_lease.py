"""Two on one folder: one works, the other is refused; what a dead one left is taken over, what
lives is left alone.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from simbench.bench.execute import lease as room
from simbench.bench.execute.lease import LEASE, lease
from simbench.bench.store.checksums import RunError


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(room, "BEAT", 0.05)
    monkeypatch.setattr(room, "STALE", 2.0)


def test_the_second_is_refused_with_the_name_of_the_first_and_the_folder_is_free_afterwards(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(sys, "argv", ["simbench", "run", "s3://ann:secret@host/x"])
    with lease(tmp_path):
        words = rf"process {os.getpid()} on .* works there since .*; wait for its end"
        with pytest.raises(RunError, match=words) as refused, lease(tmp_path):
            pass
        assert "secret" not in str(refused.value)
        assert (tmp_path / LEASE).exists()
    assert not list(tmp_path.iterdir())
    with lease(tmp_path):
        pass


def test_a_killed_holder_is_followed_and_what_it_left_half_written_goes(tmp_path, monkeypatch):
    code = f"""
import os, pathlib
from simbench.bench.execute.lease import lease
folder = pathlib.Path({str(tmp_path)!r})
with lease(folder):
    (folder / ".table.123").write_text("half")
    os.kill(os.getpid(), 9)
"""
    subprocess.run([sys.executable, "-c", code], check=False)
    assert (tmp_path / ".table.123").exists()
    monkeypatch.setattr(room, "STALE", 0.3)
    with lease(tmp_path):
        assert json.loads((tmp_path / LEASE).read_bytes())["pid"] == os.getpid()
        assert [f.name for f in tmp_path.iterdir()] == [LEASE]


def test_a_temporary_that_is_still_written_stays_whoever_writes_it(tmp_path):
    """As one of a worker on another machine does, whose run's head is gone."""
    writer = subprocess.Popen([sys.executable, "-c", f"""
import time
with open({str(tmp_path / ".table.4194309")!r}, "w", buffering=1) as f:
    while True:
        print("more", file=f)
        time.sleep(.02)
"""])  # fmt: skip
    try:
        while not (tmp_path / ".table.4194309").exists():
            time.sleep(0.02)
        (tmp_path / LEASE).write_text('{"pid": 1}')
        (tmp_path / ".table.4194308").write_text("half")
        with lease(tmp_path):
            assert {f.name for f in tmp_path.iterdir()} == {LEASE, ".table.4194309"}
    finally:
        writer.kill()
        writer.wait()


def test_without_a_lease_only_what_nobody_touched_for_an_hour_goes(tmp_path):
    for name, age in ((".a.1", 2 * room.OLD), (".b.2", 60.0)):
        (tmp_path / name).write_text("half")
        os.utime(tmp_path / name, (time.time() - age,) * 2)
    with lease(tmp_path):
        assert {f.name for f in tmp_path.iterdir()} == {LEASE, ".b.2"}


@pytest.mark.slow
def test_of_many_who_find_a_stale_lease_one_gets_it(tmp_path):
    (tmp_path / LEASE).write_text('{"pid": 1}')

    def hold():
        try:
            with lease(tmp_path):
                time.sleep(4)
                return "held"
        except RunError as error:
            return str(error)

    with ThreadPoolExecutor(3) as pool:
        answers = [future.result() for future in [pool.submit(hold) for _ in range(3)]]
    assert answers.count("held") == 1
    assert sum("works there" in answer for answer in answers) == 2
