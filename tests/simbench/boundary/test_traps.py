"""Every file that is read back, replaced by one that executes when it is unpickled: it is refused,
and nothing runs.
"""

import json
import os
import pickle
import shutil

import numpy as np
import pytest

from simbench.cli import main
from tests.simbench.boundary.test_fuzz import asked
from tests.simbench.boundary.test_hostile import write
from tests.simbench.boundary.test_loops import text as loop_text


class Trap:
    def __reduce__(self):
        return os.system, (f"touch {os.environ['CAUGHT']}",)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    home = tmp_path_factory.mktemp("home")
    (home / "loop.toml").write_text(loop_text())
    write(home / "rec.csv", np.arange(900))
    (home / "cuts.json").write_text("{}")
    run = [
        "run",
        "smoke",
        "-o",
        str(home / "run"),
        "--method",
        "horch_histogram",
        "--set",
        "disturbance=none",
    ]
    assert main(run) == 0
    assert main(["check", str(home / "run"), "--against", str(home / "baseline"), "--update"]) == 0
    return home


READ = {
    "rec.csv": "detect rec.csv",
    "rec.parquet": "detect rec.parquet",
    "rec.xlsx": "detect rec.xlsx",
    "rec.mat": "detect rec.mat",
    "loop.toml": "predict loop.toml",
    "cuts.json": "detect rec.csv --thresholds cuts.json",
    "run/manifest.json": "score run",
    "run/verdicts.parquet/00000000.parquet": "score run",
    "run/scenarios.parquet/00000000.parquet": "score run",
    "baseline/manifest.json": "check run --against baseline",
    "baseline/verdicts.parquet": "check run --against baseline",
    "baseline/history.csv": "history baseline",
    "grid.toml": "run grid.toml -o new",
    "labels.csv": "detect . --labels labels.csv",
}


@pytest.mark.parametrize("file", READ)
def test_a_trap_is_refused_and_not_sprung(home, tmp_path, monkeypatch, file):
    shutil.copytree(home, tmp_path / "home")
    monkeypatch.chdir(tmp_path / "home")
    monkeypatch.setenv("CAUGHT", str(tmp_path / "caught"))
    (tmp_path / "home" / file).write_bytes(pickle.dumps(Trap()))
    code, said = asked(READ[file].split())
    assert code == 2, said
    assert not (tmp_path / "caught").exists()


def test_a_receipt_that_is_a_trap_is_worked_again(home, tmp_path, monkeypatch, capsys):
    from simbench.bench.execute import run as run_module

    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CAUGHT", str(tmp_path / "caught"))
    words = [
        "run",
        "smoke",
        "-o",
        "run",
        "--method",
        "horch_histogram",
        "--set",
        "disturbance=none",
        "--resume",
        "--json",
    ]
    finish = run_module.pieces.finish
    with monkeypatch.context() as patch:
        patch.setattr(
            run_module.pieces, "finish", lambda *given: (_ for _ in ()).throw(KeyboardInterrupt)
        )
        assert main(words) == 130
    receipts = list((tmp_path / "run" / "receipts").iterdir())
    assert receipts
    for receipt in receipts:
        receipt.write_bytes(pickle.dumps(Trap()))
    capsys.readouterr()
    assert run_module.pieces.finish is finish
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["run"] == "run"
    assert not (tmp_path / "caught").exists()
