"""A folder of records: each is diagnosed by itself, with the loop file beside it if any."""

import json
import re

import pytest
from random_case import random_case

from simbench.cli import main
from simbench.files import write_record
from simbench.gap import diagnose
from simbench.gap.folder import FolderDiagnosis, diagnose_folder


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


def test_several_folders_are_one_table_in_which_no_record_stands_twice(folder, tmp_path, capsys):
    write_record(random_case(5, ("stiction",)).record, tmp_path / "more.csv")
    (tmp_path / "detuning.csv").write_text((folder / "detuning.csv").read_text())
    assert main(["gap", "diagnose", str(folder), str(tmp_path), "--identify"]) == 1
    text = capsys.readouterr().out
    for name in ("detuning", "gain_mismatch", "more"):
        assert sum(line.startswith(f"{name} ") for line in text.splitlines()) == 1
    record = str(folder / "detuning.csv")
    assert main(["gap", "diagnose", str(folder), record]) == 2
    assert "detuning.csv is no folder" in capsys.readouterr().err


def test_a_folder_says_how_near_its_simulations_come_and_what_remains():
    gap = {"before": 4.0, "after": 1.4, "floor": 0.8, "plant_floor": 1.0, "near": True}
    rest = {
        "feature": "kurtosis of PV", "block": "sensor", "recorded": 9.0, "simulated": [2.0, 3.0],
        "distance": 7.0,
    }  # fmt: skip
    answer = {
        "effect": "unknown", "block": "sensor", "effects": [{"probability": 0.6}], "gap": gap,
        "remaining": [rest], "conclusion": {"verdict": "no_stiction"},
    }  # fmt: skip
    far = answer | {"gap": gap | {"after": 1.6, "near": False}}
    lines = FolderDiagnosis({"A": answer, "B": far}, {}).as_text().splitlines()
    assert lines[1:3] == [
        "Within 1.5 floors of the simulation: 0.00 of the records before, 0.00 after.",
        "Within 1.5 floors of the plant: 0.00 of the records before, 0.50 after.",
    ]
    assert [line.split()[8] for line in lines[4:7]] == ["near", "yes", "no"]
    assert lines[-1] == "B: sensor: kurtosis of PV is 9, simulated 2 to 3"
    assert not any(line.startswith("A: ") for line in lines)


@pytest.mark.parametrize("option", ["--write-loop", "--healthy"])
def test_what_is_for_one_loop_is_refused_of_a_folder(folder, capsys, option):
    assert main(["gap", "diagnose", str(folder), option, "page.html"]) == 2
    assert f"{option} is for the records of one loop" in capsys.readouterr().err


def test_the_page_of_a_folder_has_a_row_per_record_and_why_others_have_none(folder, tmp_path):
    page = tmp_path / "page.html"
    assert main(["gap", "diagnose", str(folder), "--html", str(page)]) == 1
    text = page.read_text(encoding="utf-8")
    assert re.search(r"detuning 1.{0,20}gain mismatch 1|gain mismatch 1.{0,20}detuning 1", text)
    assert text.count("<tr") >= 3
    assert "<svg" in text
    assert "torn" in text
    assert main(["gap", "diagnose", str(folder), "--html", str(folder / "detuning.csv")]) == 2
