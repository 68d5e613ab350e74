"""`simbench gap diagnose` end to end: the contract's JSON, a loop file that simulates like the
plant, one-sentence refusals.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import welch

from detectors.errors import ParameterError
from detectors.record import LoopRecord
from detectors.records.io import read_record
from scenarios.spec import Loop, load_loop
from simbench.cli import main
from simbench.files import write_record
from simbench.gap import command
from simbench.loop.simulate import simulate

HEALTHY = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 2000},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[600.0, 55.0], [1300.0, 50.0]]},
}
STICKY = {**HEALTHY, "valve": {"model": "choudhury", "S": 6.0, "J": 2.0}}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A record of a sticky loop, with MV and without, and the loop file that knows nothing of the
    friction.
    """
    place = tmp_path_factory.mktemp("gap")
    record = simulate(Loop.from_table(STICKY), seed=3, kick=6.0).record
    write_record(record, place / "FIC101.csv")
    write_record(replace(record, mv=None), place / "no_mv.csv")
    (place / "loop.toml").write_text(Loop.from_table(HEALTHY).to_toml())
    return place


@pytest.fixture(scope="module")
def answer(place):
    """The verb's JSON, as another program would read it, and the loop file it wrote."""
    words = [
        "gap",
        "diagnose",
        "FIC101.csv",
        "--baseline",
        "loop.toml",
        "--no-bootstrap",
        "--json",
        "--write-loop",
        "fixed.toml",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "simbench.cli", *words],
        cwd=place,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_next_test_has_the_contracts_keys(answer):
    keys = {"test", "size", "hold_s", "separates", "p_right_after", "says"}
    assert answer["next_test"] is None or set(answer["next_test"]) == keys
    assert all(isinstance(note, str) for note in answer["notes"])
    chances = [line["probability"] for line in answer["ranking"]]
    assert chances == sorted(chances, reverse=True)


def test_missing_stiction_is_found_in_the_valve_and_closes_the_gap(answer):
    assert (answer["block"], answer["effect"]) == ("valve", "stiction")
    assert answer["ranking"][0]["effect"] == "stiction"
    assert answer["effects"][0]["parameters"]["S"] == pytest.approx(6.0, rel=0.1)
    assert max(answer["blocks"], key=answer["blocks"].__getitem__) == "valve"
    assert answer["gap"]["resolvable"]
    assert answer["shrinkage"]["value"] > 0.7
    assert answer["shrinkage"]["lo"] <= answer["shrinkage"]["value"] <= answer["shrinkage"]["hi"]


def likeness(record):
    """Logarithms of the sizes of PV, OP and OP's changes and of OP's mean frequency, between two
    set-point changes.
    """
    settled = slice(800, 1300)
    pv, op = record.pv[settled], record.op[settled]
    f, power = welch(op, nperseg=op.size)
    centre = np.sum(f[1:] * power[1:]) / np.sum(power[1:])
    return np.log([np.std(pv), np.std(op), np.std(np.diff(op)), centre])


def test_the_loop_file_it_writes_simulates_like_the_record(answer, place):
    assert (
        main(["simulate", str(place / "fixed.toml"), "-o", str(place / "fixed.csv"), "--seed", "5"])
        == 0
    )
    real = likeness(read_record(place / "FIC101.csv"))
    assert read_record(place / "fixed.csv").n == 2000
    # single runs of the true loop itself, too, differ by up to half in their mean frequency
    fixed = np.median(
        [likeness(simulate(load_loop(place / "fixed.toml"), seed=s).record) for s in range(5, 12)],
        axis=0,
    )
    bare = likeness(simulate(Loop.from_table(HEALTHY), seed=5).record)
    assert np.abs(fixed - real).max() < np.log(1.5)
    assert np.abs(bare - real).max() > np.log(3.0)
    loop = load_loop(place / "fixed.toml")
    assert [part.name for part in loop.effect] == ["stiction"]
    assert loop.sampling.n == 2000
    assert [list(step) for step in loop.setpoint.steps] == [[600.0, 55.0], [1300.0, 50.0]]


def test_the_blind_checks_function_is_importable_by_name_and_gives_json(place, answer):
    found = pickle.loads(pickle.dumps(command.one_file))(place / "FIC101.csv", place / "loop.toml")
    assert json.loads(json.dumps(found)) == answer
    assert pickle.loads(pickle.dumps(command.one_file)) is command.one_file


def test_records_of_one_loop_give_one_answer_and_no_baseline_is_needed(place, capsys):
    two = [str(place / "FIC101.csv"), str(place / "no_mv.csv")]
    assert (
        main(
            [
                "gap",
                "diagnose",
                *two,
                "--baseline",
                str(place / "loop.toml"),
                "--no-bootstrap",
                "--json",
            ]
        )
        == 0
    )
    assert json.loads(capsys.readouterr().out)["effect"] == "stiction"
    assert main(["gap", "diagnose", two[0], "--identify", "--no-bootstrap", "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert sum(line["probability"] for line in alone["ranking"]) == pytest.approx(1.0, abs=1e-9)
    total = sum(alone["blocks"].values())
    assert total == pytest.approx(round(total), abs=1e-9)
    assert round(total) in (0, 1)


def refused(capsys, place, arguments, *words):
    """Check exit 2, one sentence on stderr with these words in it, nothing on stdout, and no file
    written.
    """
    before = {p.name for p in place.iterdir()}
    where = [str(place / a) if a.endswith((".csv", ".toml", ".html")) else a for a in arguments]
    code = main(
        ["gap", "diagnose", *where, "--no-bootstrap", "--write-loop", str(place / "never.toml")]
    )
    captured = capsys.readouterr()
    assert code == 2, captured.err
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    for word in words:
        assert word.lower() in captured.err.lower(), captured.err
    assert {p.name for p in place.iterdir()} == before


def changed(place, name, change):
    """Write a changed copy of the record and return its name."""
    frame = change(pd.read_csv(place / "FIC101.csv"))
    frame.to_csv(place / name, index=False)
    return name


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: f.drop(columns="pv"), ["pv"]),
        (lambda f: f.assign(t_s=2.0 * f["t_s"]), ["Ts", "2 s", "1 s"]),
        (lambda f: f.assign(mv=4.0 + 0.16 * f["mv"]), ["mv", "%"]),
        (lambda f: f.assign(mv=f["mv"] / 100.0), ["mv", "%"]),
        (lambda f: f.assign(mv=30.0 * f["mv"] - 200.0), ["mv", "%"]),
        (lambda f: f.assign(op=50.0), ["op", "constant"]),
        (lambda f: f.assign(pv=50.0), ["pv", "constant"]),
        (lambda f: f.head(30), ["30 samples"]),
    ],
    ids=[
        "no PV",
        "other Ts",
        "MV in mA",
        "MV as share",
        "MV in other units",
        "constant OP",
        "constant PV",
        "too short",
    ],
)
def test_a_wrong_record_is_refused_in_one_sentence(change, words, place, capsys):
    refused(capsys, place, [changed(place, "wrong.csv", change), "--baseline", "loop.toml"], *words)


DIRECT = {"type": "PI", "Kc": 1.5, "Ti": 20.0, "direction": "direct"}


@pytest.mark.parametrize(
    "other",
    [
        {"plant": {"type": "foptd", "K": -1.2, "T": 20.0, "Td": 4.0}, "controller": DIRECT},
        {"controller": {"type": "PI", "Kc": 0.05, "Ti": 20.0}},
    ],
    ids=["other direction", "other controller"],
)
def test_the_baseline_of_another_loop_is_refused(other, place, capsys):
    (place / "other.toml").write_text(Loop.from_table({**HEALTHY, **other}).to_toml())
    refused(capsys, place, ["FIC101.csv", "--baseline", "other.toml"], "another loop", "Kc")


def test_a_baseline_is_named_or_identified_but_not_both(place, capsys):
    refused(capsys, place, ["FIC101.csv"], "--baseline", "--identify")
    refused(
        capsys,
        place,
        ["FIC101.csv", "--baseline", "loop.toml", "--identify"],
        "--baseline",
        "--identify",
    )


def partial(place, name, *sections):
    """Write a loop file of the healthy loop with these sections only."""
    text = Loop.from_table(HEALTHY).to_toml().split("\n\n")
    (place / name).write_text(
        "\n\n".join(p for p in text if p.strip("[ \n").split("]")[0] in sections)
    )
    return place / name


def said_without(place, capsys, record, *sections):
    """The verb's answer to a record beside a loop file of these sections only."""
    words = [
        str(place / record),
        "--baseline",
        str(partial(place, "part.toml", *sections)),
        "--no-bootstrap",
        "--json",
    ]
    assert main(["gap", "diagnose", *words]) == 0
    return json.loads(capsys.readouterr().out)


def test_without_a_plant_the_tuning_is_still_judged_and_what_is_left_open_is_said(place, capsys):
    retuned = Loop.from_table(HEALTHY | {"controller": {"type": "PI", "Kc": 0.75, "Ti": 12.0}})
    write_record(replace(simulate(retuned, seed=3).record, mv=None), place / "retuned.csv")
    answer = said_without(place, capsys, "retuned.csv", "controller", "sampling", "noise")
    assert answer["effect"] == "detuning"
    assert answer["effects"][0]["parameters"]["Kc_factor"] == pytest.approx(0.5, rel=0.05)
    assert answer["effects"][0]["parameters"]["Ti_factor"] == pytest.approx(0.6, rel=0.05)
    notes = " ".join(answer["notes"])
    assert "no [plant] given, identified from the record: foptd, K = " in notes
    assert "gain_mismatch" in notes
    assert "[controller]" not in notes


def test_without_a_plant_an_agreeing_tuning_is_no_effect(place, capsys):
    write_record(
        replace(simulate(Loop.from_table(HEALTHY), seed=3).record, mv=None), place / "healthy.csv"
    )
    assert said_without(place, capsys, "healthy.csv", "controller")["effect"] == "none"


def test_without_a_controller_the_plant_is_still_compared(place, capsys):
    weaker = Loop.from_table(HEALTHY | {"plant": HEALTHY["plant"] | {"K": 0.6}})
    write_record(replace(simulate(weaker, seed=3).record, mv=None), place / "weaker.csv")
    answer = said_without(place, capsys, "weaker.csv", "plant", "sampling", "noise")
    assert answer["effect"] == "gain_mismatch"
    assert answer["effects"][0]["parameters"]["factor"] == pytest.approx(0.5, rel=0.1)
    notes = " ".join(answer["notes"])
    assert "no [controller] given, identified from the record: PI, Kc = 1.5, Ti = 20" in notes
    assert "detuning cannot be judged" in notes


def test_sampling_may_be_left_to_the_record_alone(place, capsys):
    answer = said_without(place, capsys, "FIC101.csv", "plant", "controller", "noise")
    assert answer["effect"] == "stiction"
    assert "baseline: no [sampling] given, identified from the record: Ts = 1" in answer["notes"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[noise]\nstd = 0.1\n", ["neither [plant] nor [controller]", "--identify"]),
        ("", ["neither [plant] nor [controller]"]),
        ("[plnt]\nK = 1.2\n[controller]\ntype = 'PI'\nKc = 1.5\nTi = 20.0\n", ["plnt", "plant"]),
        ("[controller]\ntype = 'PI'\nKc = -1.5\nTi = 20.0\n", ["controller.Kc"]),
        (
            "[controller]\ntype = 'PI'\nKc = 1.5\nTi = 20.0\ndirection = 'up'\n",
            ["controller.direction"],
        ),
        ("[plant]\ntype = 'foptd'\nK = 'big'\nT = 1.0\n", ["plant.K"]),
        ("plant = 3\n", ["plant"]),
    ],
    ids=[
        "noise only",
        "empty",
        "misspelt",
        "negative gain",
        "unknown direction",
        "gain in words",
        "no section",
    ],
)
def test_a_partial_baseline_that_says_something_wrong_is_refused(text, words, place, capsys):
    (place / "bad.toml").write_text(text)
    refused(capsys, place, ["FIC101.csv", "--baseline", "bad.toml"], *words)


def test_missing_files_are_refused_by_name(place, capsys):
    refused(capsys, place, ["absent.csv", "--baseline", "loop.toml"], "absent.csv")
    refused(capsys, place, ["FIC101.csv", "--baseline", "absent.toml"], "absent.toml")


@pytest.mark.parametrize(
    ("window", "length"), [(None, 200), ((0, 200), 200), ((0, 3), 3), ((50, 60), 10)]
)
def test_a_window_is_cut_out_of_the_record(window, length):
    record = LoopRecord(op=np.arange(200.0), pv=np.arange(200.0), Ts=1.0)
    assert command._cut(record, window, "loop.csv").n == length


@pytest.mark.parametrize("window", [(-1, 100), (0, 201), (50, 50), (60, 50)])
def test_a_window_that_the_record_does_not_hold_is_refused(window):
    record = LoopRecord(op=np.arange(200.0), pv=np.arange(200.0), Ts=1.0)
    with pytest.raises(ParameterError, match=r"loop.csv: --window .*FROM < TO within 0..200"):
        command._cut(record, window, "loop.csv")
