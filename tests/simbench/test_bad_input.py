"""Bad input ends in one clear sentence, exit 2, no traceback, and nothing half-written."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from simbench.cli import main

LOOP = """
[plant]
type = "foptd"
K = 1.0
T = 10.0
Td = 2.0
[controller]
type = "PI"
Kc = 1.0
Ti = 10.0
[valve]
model = "choudhury"
S = 5.0
J = 2.0
[sampling]
Ts = 1.0
n = 500
"""
RECORD = "t,sp,op,pv\n" + "".join(f"{k},50,{50 + k % 7},{50 + k % 5}\n" for k in range(300))


def refused(capsys, arguments: list, *words: str) -> str:
    """Run the command line and check exit 2 and its one sentence."""
    code = main([str(a) for a in arguments])
    captured = capsys.readouterr()
    assert code == 2, captured.err
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert "Traceback" not in captured.err
    for word in words:
        assert word.lower() in captured.err.lower(), captured.err
    return captured.err


def loop_file(tmp_path: Path, old: str = "", new: str = "") -> Path:
    assert old in LOOP
    path = tmp_path / "loop.toml"
    path.write_text(LOOP.replace(old, new, 1) if old else LOOP)
    return path


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("Ts = 1.0", "Ts = 0.0", ["Ts", "0"]),
        ("Ts = 1.0", "Ts = -2.0", ["Ts", "-2"]),
        ("S = 5.0", "S = -5.0", ["S = -5"]),
        ("J = 2.0", "J = -1.0", ["J = -1"]),
        ("T = 10.0", "T = 0.0", ["plant.T", "0"]),
        ("Td = 2.0", "Td = -2.0", ["Td", "-2"]),
        ("K = 1.0", "K = nan", ["plant.K", "nan"]),
        ("Kc = 1.0", "Kc = nan", ["controller.Kc", "nan"]),
        ("K = 1.0", "K = -1.0", ["positive feedback"]),
        ("Td = 2.0", "tau = 2.0", ["tau", "Td"]),
        ("[valve]", "[vale]", ["vale", "valve"]),
        ('"choudhury"', '"choudury"', ["choudury", "choudhury"]),
        ("Kc = 1.0", "Kc = ", ["line 9"]),
        ("n = 500", "n = 1000000000000", ["sampling.n"]),
        ("n = 500", "n = 2", ["sampling.n"]),
        ('type = "foptd"', 'type = "foptdd"', ["foptd"]),
    ],
)
def test_a_wrong_loop_file_is_refused_before_anything_is_written(tmp_path, capsys, old, new, words):
    out = tmp_path / "out.csv"
    refused(capsys, ["simulate", loop_file(tmp_path, old, new), "-o", out], *words)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["loop.toml"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", ["empty"]),
        (bytes(range(256)) * 20, []),
        ("t,op,pv\n0,ä,1\n".encode("utf-16"), []),
        (b"t,op\n0,1\n1,2\n2,3\n", ["pv"]),
        (b"t,op,pv\n0,1,2\n1,2,off\n2,3,4\n3,4,5\n", ["off", "pv"]),
        (b"t,op,pv\n0,1,2\n2,2,3\n1,3,4\n3,4,5\n", ["line 4", "rise"]),
        (b"t,op,pv\n0,1,2\n0,2,3\n0,3,4\n", ["t"]),
        (b"t,op,pv\n0,1,2\n1,2,3\n", ["3"]),
    ],
)
def test_a_wrong_record_is_refused(tmp_path, capsys, content, words):
    path = tmp_path / "rec.csv"
    path.write_bytes(content)
    refused(capsys, ["detect", path, "--method", "horch"], "rec.csv", *words)


def test_missing_files_are_named(tmp_path, capsys):
    refused(capsys, ["detect", tmp_path / "none.csv"], "none.csv")
    refused(capsys, ["simulate", tmp_path / "none.toml", "-o", tmp_path / "x.csv"], "none.toml")
    refused(capsys, ["simulate", tmp_path, "-o", tmp_path / "x.csv"], "holds no run")


def test_unknown_names_are_answered_with_the_nearest(tmp_path, capsys):
    record = tmp_path / "rec.csv"
    record.write_text(RECORD)
    refused(capsys, ["detect", record, "--method", "horhc"], "horhc", "horch")
    refused(capsys, ["simulte"], "simulte", "simulate")
    refused(capsys, ["detect", record, "--jsn"], "--jsn", "--json")
    refused(capsys, ["list", "detectrs"], "detectors")
    refused(capsys, ["run", "smok", "-o", tmp_path / "run"], "smok", "smoke")
    assert not (tmp_path / "run").exists()
    refused(capsys, ["figure", "fig-11-99", "-o", tmp_path / "f"], "fig-11-9")


def test_a_full_disk_leaves_only_the_old_file_as_it_was(tmp_path, capsys):
    loop = loop_file(tmp_path)
    refused(capsys, ["simulate", loop, "-o", "/dev/full"], "/dev/full", "space")
    out = tmp_path / "out.csv"
    out.write_text("old")

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))

    code = "import sys; from simbench.cli import main; sys.exit(main(sys.argv[1:]))"
    # compiled first: the size limit would hit numba's cache too
    assert main(["simulate", str(loop), "-o", str(tmp_path / "warm.csv")]) == 0
    done = subprocess.run(
        [sys.executable, "-c", code, "simulate", str(loop), "-o", str(out)], preexec_fn=small_files,
        capture_output=True, text=True, env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert done.returncode == 2
    assert "too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert out.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["loop.toml", "out.csv", "warm.csv"]


def test_an_unwritable_folder_is_named(tmp_path, capsys):
    refused(
        capsys, ["simulate", loop_file(tmp_path), "-o", "/proc/nothing/out.csv"], "/proc/nothing"
    )


def test_a_record_written_reads_back_to_the_same_bits(tmp_path):
    from simbench.detectors.records.io import read_record
    from simbench.loop.simulate import simulate
    from simbench.scenarios.spec import load_loop

    path = loop_file(tmp_path, "[sampling]", "[noise]\nstd = 0.1\n[sampling]")
    assert main(["simulate", str(path), "-o", str(tmp_path / "r.csv"), "--seed", "3"]) == 0
    back = read_record(tmp_path / "r.csv")
    expected = simulate(load_loop(path), 3).record
    for name in ("op", "pv", "mv", "sp"):
        np.testing.assert_array_equal(getattr(back, name), getattr(expected, name))


def test_a_short_or_dead_record_is_no_error_but_no_decision(tmp_path, capsys):
    import json

    path = tmp_path / "short.csv"
    path.write_text("t,op,pv\n" + "".join(f"{k},50,50\n" for k in range(20)))
    assert main(["detect", str(path), "--method", "horch", "--json"]) == 0
    (verdict,) = json.loads(capsys.readouterr().out)
    assert verdict["verdict"] == "no_decision"
    assert verdict["reason"]
