"""The blind check keeps its word: same seed, same records; answers unreadable without the key."""

import csv
import hashlib
import io
import json
import os
import shutil
import signal
import tomllib
from pathlib import Path

import pytest

from results.studies.withheld import truth
from results.studies.withheld.answering import answer
from results.studies.withheld.making import Plan, make
from results.studies.withheld.opening import open_
from simbench.detectors.errors import ParameterError
from simbench.loop.effects import EFFECTS
from simbench.scenarios.spec import Loop

PLAN = Plan(1, 2, 0, 1, ("noise", "gain_mismatch"), ("medium",))


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    place = tmp_path_factory.mktemp("withheld")
    commitment = make(place / "set", place / "keys" / "set.key", seed=4, plan=PLAN)
    return place / "set", place / "keys" / "set.key", commitment


def answers_of(folder, key):
    return list(csv.DictReader(io.StringIO(truth.read(folder, key)[0])))


def test_the_folder_holds_neutral_records_baselines_and_no_plain_answers(made):
    folder, _, commitment = made
    names = sorted(p.name for p in (folder / "records").iterdir())
    assert names == [f"r000{i}.{end}" for i in range(1, 6) for end in ("csv", "toml")]
    assert sorted(p.name for p in folder.iterdir()) == ["commitment.txt", "records"]
    assert (folder / "commitment.txt").read_text().strip() == commitment
    for path in (folder / "records").glob("*.toml"):
        loop = Loop.from_table(tomllib.loads(path.read_text()), path.name)
        assert not loop.effect
        assert not loop.disturbance
        assert not any(word in path.read_text() for word in EFFECTS if word != "noise")


def test_ids_are_shuffled_and_mv_is_written_where_the_answers_say_so(made):
    folder, key, _ = made
    rows = answers_of(folder, key)
    kinds = [row["kind"] for row in rows]
    assert kinds != sorted(kinds, key=["single", "none", "two", "foreign"].index)
    for row in rows:
        header = (folder / "records" / f"{row['id']}.csv").read_text().split("\n", 1)[0]
        assert ("mv" in header.split(",")) == (row["mv"] == "True")


def test_the_key_alone_holds_the_answers_and_only_its_owner_reads_it(made):
    folder, key, _ = made
    assert {row["effect"] for row in answers_of(folder, key)} > {"noise", "none"}
    assert key.stat().st_mode & 0o077 == 0


def test_the_commitment_is_the_hash_of_the_key(made):
    _, key, commitment = made
    assert hashlib.sha256(key.read_bytes()).hexdigest() == commitment
    assert len(bytes.fromhex(json.loads(key.read_text())["salt"])) == 32


@pytest.mark.parametrize("broken", ["answers", "salt", "commitment"])
def test_a_changed_answer_salt_or_commitment_is_noticed(made, tmp_path, broken):
    _, key, published = made
    parts = json.loads(key.read_text())
    if broken in parts:
        # a random salt may have no digit that could be counted on
        parts[broken] = parts[broken][:-1] + ("1" if parts[broken][-1] == "0" else "0")
    (tmp_path / "commitment.txt").write_text("0" * 64 if broken == "commitment" else published)
    (tmp_path / "key").write_text(json.dumps(parts))
    with pytest.raises(ParameterError, match="commitment"):
        open_(tmp_path, tmp_path / "key")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a process is killed")
def test_a_call_killed_between_key_and_records_begins_anew_and_its_seed_gives_the_same_set(
    made, tmp_path, monkeypatch
):
    child = os.fork()
    if child == 0:
        monkeypatch.setattr(Path, "rename", lambda *_: os.kill(os.getpid(), signal.SIGKILL))
        make(tmp_path / "set", tmp_path / "k", seed=4, plan=PLAN)
        os._exit(0)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL
    assert (tmp_path / "k").exists()
    assert not (tmp_path / "set" / "records").exists()
    with pytest.raises(ParameterError, match="exists already"):
        make(tmp_path / "other", tmp_path / "k", seed=4, plan=PLAN)
    again = make(tmp_path / "set", tmp_path / "k", seed=4, plan=PLAN)
    assert again != made[2]  # salted: equal answers must not show
    assert answers_of(tmp_path / "set", tmp_path / "k") == answers_of(*made[:2])
    assert {f.name for f in (tmp_path / "set").iterdir()} == {f.name for f in made[0].iterdir()}
    for path in (made[0] / "records").iterdir():
        assert path.read_bytes() == (tmp_path / "set" / "records" / path.name).read_bytes()


def test_answering_resumes_and_tries_failures_again(theirs):
    first, second = (theirs / "answers" / f"{name}.json" for name in "ab")
    broken = ["a"]

    def diagnose(record, baseline):
        if record.stem in broken:
            raise ValueError("no idea")
        return {"effect": "none", "block": "none"}

    assert answer(theirs, diagnose=diagnose) == 3
    assert "no idea" in json.loads(first.read_text())["error"]
    second.write_text(json.dumps({"effect": "kept"}))
    broken.clear()
    assert answer(theirs, diagnose=diagnose) == 1
    assert [json.loads(f.read_text())["effect"] for f in (first, second)] == ["none", "kept"]
    assert answer(theirs, diagnose=diagnose) == 0


def test_workers_answer_as_one_process_does(theirs):
    alone = theirs.parent / "alone"
    shutil.copytree(theirs, alone)
    assert answer(theirs, 2) == answer(alone, 1) == 3
    for name in "abc":
        file = f"answers/{name}.json"
        assert (theirs / file).read_text() == (alone / file).read_text()
