"""A folder of records: each is diagnosed by itself, with the loop file beside it if any."""

import json

import pytest
from random_case import random_case

from simbench.cli import main
from simbench.files import write_record
from simbench.gap import diagnose
from simbench.gap.folder import diagnose_folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two records with their loop files, and a file that is none."""
    place = tmp_path_factory.mktemp("records")
    for seed, effect in ((3, "detuning"), (4, "gain_mismatch")):
        case = random_case(seed, (effect,))
        write_record(case.record, place / f"{effect}.csv")
        (place / f"{effect}.toml").write_text(case.baseline.to_toml())
    (place / "torn.csv").write_text("t,op,pv\n0,1,2\n1,x,2\n")
    return place


def test_every_record_is_answered_as_it_is_alone(folder, capsys):
    assert main(["gap", "diagnose", str(folder), "--json"]) == 1
    answers = {a["record"]: a for a in json.loads(capsys.readouterr().out)}
    assert set(answers) == {"detuning", "gain_mismatch", "torn"}
    alone = diagnose(str(folder / "detuning.csv"), str(folder / "detuning.toml")).as_json()
    assert answers["detuning"] == {"record": "detuning", **json.loads(json.dumps(alone))}
    assert answers["torn"]["effect"] is None
    assert "torn" in answers["torn"]["reason"]


def test_effects_are_counted_for_any_number_of_workers(folder):
    one, two = (diagnose_folder(folder, jobs=jobs) for jobs in (1, 2))
    assert one == two
    assert sum(one.counts().values()) == 2
    assert "detuning" in one.counts()
    lines = one.as_text().splitlines()
    assert lines[0].startswith("Records in which each effect was named: ")
    assert lines[-1].startswith("torn: ")


def test_without_loop_files_every_loop_is_identified(folder):
    answers = diagnose_folder(folder, identify=True).answers
    assert set(answers) == {"detuning", "gain_mismatch"}
    beside = diagnose_folder(folder).answers
    assert answers["detuning"] != beside["detuning"]


def test_what_is_for_one_loop_is_refused_of_a_folder(folder, capsys):
    assert main(["gap", "diagnose", str(folder), "--html", "page.html"]) == 2
    assert "--html is for the records of one loop" in capsys.readouterr().err
