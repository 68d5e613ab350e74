"""Every file that is read back, replaced by one that executes when it is unpickled: it is refused,
and nothing runs.
"""

import json
import os
import pickle
import shutil
from pathlib import Path

import numpy as np
import pytest

from simbench.bench.execute import pieces
from tests.simbench.boundary.conftest import answer_to, asked, run_verb
from tests.simbench.boundary.test_hostile import write
from tests.simbench.boundary.test_loops import text as loop_text

RUN = "run smoke --method horch_histogram --set disturbance=none"


class Trap:
    def __reduce__(self):
        return os.system, (f"touch {os.environ['CAUGHT']}",)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    home = tmp_path_factory.mktemp("home")
    (home / "loop.toml").write_text(loop_text())
    write(home / "rec.csv", np.arange(900))
    (home / "cuts.json").write_text("{}")
    answer_to(f"{RUN} -o {home}/run")
    answer_to(f"check {home}/run --against {home}/baseline --update")
    return home


READ = {
    "rec.csv": "detect rec.csv",
    "rec.parquet": "detect rec.parquet",
    "rec.xlsx": "detect rec.xlsx",
    "rec.mat": "detect rec.mat",
    "loop.toml": "predict loop.toml",
    "run/manifest.json": "score run",
    "run/verdicts.parquet/00000000.parquet": "score run",
    "run/scenarios.parquet/00000000.parquet": "score run",
    "baseline/manifest.json": "check run --against baseline",
    "baseline/verdicts.parquet": "check run --against baseline",
    "grid.toml": "run grid.toml -o new",
    "labels.csv": "detect . --labels labels.csv",
}


def test_a_trap_is_refused_and_not_sprung(home, here, monkeypatch):
    monkeypatch.setenv("CAUGHT", str(here / "caught"))
    for file, words in READ.items():
        with monkeypatch.context() as patch:
            patch.chdir(shutil.copytree(home, here / file.replace("/", "-")))
            Path(file).write_bytes(pickle.dumps(Trap()))
            assert asked(words)[0] == 2, words
    assert not (here / "caught").exists()


def test_a_receipt_that_is_a_trap_is_worked_again(here, monkeypatch):
    monkeypatch.setenv("CAUGHT", str(here / "caught"))
    words = f"{RUN} -o run --resume --json"
    with monkeypatch.context() as patch:
        patch.setattr(pieces, "finish", lambda *given: (_ for _ in ()).throw(KeyboardInterrupt))
        assert run_verb(words)[0] == 130
    receipts = list((here / "run" / "receipts").iterdir())
    assert receipts
    for receipt in receipts:
        receipt.write_bytes(pickle.dumps(Trap()))
    assert json.loads(answer_to(words))["run"] == "run"
    assert not (here / "caught").exists()
