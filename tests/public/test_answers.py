"""What scripts rely on in the answers: verbs and options, the keys of every JSON, run tables, exit
codes.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import typer.main

from simbench.cli import app, main

STEP = "[setpoint]\nsteps = [[10, 55]]\n"
STICKY = '[valve]\nmodel = "choudhury"\nS = 5.0\nJ = 2.0\n'
LOOP = """[plant]
type = "foptd"
K = 1.0
T = 10.0
Td = 2.0
[controller]
type = "PI"
Kc = 1.0
Ti = 10.0
[sampling]
Ts = 1.0
n = 1200
[noise]
std = 0.1
"""
FRICTION = {"stiction", "deadband"}
CONCLUSION = {"verdict", "probability", "cause", "reason", "next", "notes"}
VERDICT = {"method", "verdict", "score", "indices", "S", "J", "S_unit", "applicable", "reason"}
EFFECTS = {
    "valve": {
        "stiction",
        "deadband",
        "deadzone",
        "valve_lag",
        "valve_characteristic",
        "slew_limit",
    },
    "process": {"gain_mismatch", "time_constant_mismatch", "dead_time_mismatch", "extra_lag"},
    "sensor": {
        "noise",
        "quantisation",
        "sensor_lag",
        "compression",
        "outliers",
        "drift",
        "frozen_sensor",
    },
    "disturbance": {"oscillation", "load_steps", "load_drift"},
    "controller": {
        "saturation",
        "detuning",
        "error_deadband",
        "op_quantisation",
        "derivative_action",
        "missed_executions",
    },
}
METHODS = {
    "horch",
    "horch_histogram",
    "he",
    "rossi_scali",
    "yamashita",
    "kano_a",
    "kano_b",
    "singhal_salsbury",
    "choudhury",
    "ellipse",
    "bicoherence",
    "surrogate",
    "srinivasan",
    "hammerstein",
    "stenman",
    "horch_isaksson",
    "procedure",
    "gbt44693",
    "arx_stiction",
}
INDICES = {
    "horch": {"dtau", "drho"}, "he": {"eta", "eta_two_line"}, "yamashita": {"rho1", "rho2", "rho3"},
    "rossi_scali": {"eta_rossi"}, "singhal_salsbury": {"r_area"}, "bicoherence": {"ngi", "nli"},
    "ellipse": {"fitness", "S_apparent"},
}  # fmt: skip
OPTIONS = {
    "simulate": "-o --seed --from --id",
    "valve": "--model --param -o",
    "predict": "--json",
    "detect": (
        "--method --process --kind --op-span --pv-span --columns --ts --tag --labels"
        " --plugin --csv --html --json"
    ),
    "diagnose": "--json",
    "confirm gain-change": "--records --ratio --json",
    "confirm travel": "--record --json",
    "run": (
        "-o -j --method --n --plugin --backend --address --resume --set --axis --fresh-seeds --json"
    ),
    "score": "--paired --report --by --json",
    "check": "--against",
    "figure": "-o --isdb",
    "gap diagnose": "--baseline --identify -j --no-bootstrap --json --html --write-loop",
    "contract": "",
    "list": "--json",
}


RUN = ["--method", "horch,he,yamashita,bicoherence,oracle"]


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("public")
    # the bicoherence asks for twelve cycles, here of 100 s
    sticky, slow = LOOP.replace("n = 1200", "n = 1500"), LOOP.replace("Kc = 1.0", "Kc = 0.6")
    for name, text in {"sticky": sticky + STICKY + STEP, "slow": slow + STICKY + STEP}.items():
        (folder / f"{name}.toml").write_text(text)
        files = [str(folder / f"{name}.toml"), "-o", str(folder / f"{name}.csv")]
        assert main(["simulate", *files, "--seed", "1"]) == 0
    (folder / "model.toml").write_text(LOOP)
    assert main(["run", "smoke", "-o", str(folder / "run"), *RUN]) == 0
    return folder


@pytest.fixture
def answer(place, capsys):
    """Run a verb with --json in the folder of the files; nothing but JSON may stand on stdout."""

    def run(words: str, code: int = 0):
        capsys.readouterr()
        files = [str(place / w) if (place / w).exists() else w for w in words.split()]
        status = main([*files, "--json"])
        out, err = capsys.readouterr()
        assert status == code, err
        return json.loads(out)

    return run


def finite(value) -> bool:
    if isinstance(value, dict):
        return all(map(finite, value.values()))
    if isinstance(value, list):
        return all(map(finite, value))
    return not isinstance(value, float) or math.isfinite(value)


@pytest.mark.parametrize("verb", OPTIONS)
def test_a_verb_has_its_options(verb):
    command = typer.main.get_command(app)
    for word in verb.split():
        command = command.commands[word]
    known = {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
    assert set(OPTIONS[verb].split()) <= known


def test_names(answer):
    names = {
        kind: {row["name"] for row in answer(f"list {kind}")}
        for kind in ("detectors", "valves", "grids", "effects", "figures")
    }
    assert names["detectors"] == METHODS | {"likelihood"}
    assert names["effects"] == set().union(*EFFECTS.values())
    assert names["grids"] >= {"smoke", "table-11-3", "chapter", "own-ground", "ci", "plant"}
    assert names["figures"] >= {"table-11-4"} | {f"fig-11-{k}" for k in range(4, 28)}
    assert names["valves"] >= {
        "ideal",
        "deadband",
        "deadzone",
        "choudhury",
        "choudhury_literal",
        "kano",
        "he",
        "stenman",
        "coulomb",
        "karnopp",
        "stribeck",
        "lugre",
    }


def test_predict(answer, place):
    answered = answer("predict sticky.toml")
    assert set(answered) == {"table_11_3", "refined", "describing_function", "exact", "reason"}
    assert set(answered["describing_function"][0]) == {"period", "amplitude", "stable"}
    assert set(answered["exact"]) == {"period", "amplitude", "kick_min"}
    # OP's half peak-to-peak, and the smallest kick that starts the cycle, as runs show them
    quiet = place / "quiet.toml"
    quiet.write_text(LOOP.replace("std = 0.1", "std = 0.0") + STICKY)
    swings = []
    for kick in (answered["exact"]["kick_min"] - 0.02, answered["exact"]["kick_min"] + 0.02):
        assert (
            main(["simulate", str(quiet), "-o", str(place / "quiet.csv"), "--kick", str(kick)]) == 0
        )
        swings.append(np.ptp(pd.read_csv(place / "quiet.csv").op[-500:]) / 2)
    assert swings[0] == pytest.approx(0.0, abs=1e-6)
    assert swings[1] == pytest.approx(answered["exact"]["amplitude"], rel=0.1)
    (place / "zone.toml").write_text(LOOP + '[valve]\nmodel = "deadzone"\nD = 5.0\n')
    zone = answer("predict zone.toml")
    assert (zone["table_11_3"], zone["refined"], zone["exact"]) == (None, None, None)


def test_detect(answer, place):
    answered = answer("detect sticky.csv --method all")
    assert {v["method"] for v in answered} == METHODS
    for v in answered:
        assert set(v) == VERDICT | {"conclusion"}
        assert set(v["conclusion"]) == CONCLUSION
        assert v["verdict"] in ("stiction", "no_stiction", "no_decision")
        assert v["applicable"] in (True, False, None)
        assert INDICES.get(v["method"], set()) | {"regularity", "period_s"} <= set(v["indices"])
    assert finite(answered)
    (place / "two").mkdir(exist_ok=True)
    for name in ("a", "b"):
        (place / "two" / f"{name}.csv").write_bytes((place / "sticky.csv").read_bytes())
    assert {(v["record"], v["method"]) for v in answer("detect two --method he")} == {
        ("a", "he"),
        ("b", "he"),
    }


def test_the_table_marks_the_tests_of_nonlinearity(place, capsys):
    assert main(["detect", str(place / "sticky.csv"), "--method", "he,bicoherence,surrogate"]) == 0
    assert (
        "note: nonlinearity tests, not counted for or against stiction: bicoherence, surrogate"
        in capsys.readouterr().out
    )


def test_diagnose_and_confirm(answer, place):
    assert {"verdict", "reason", "steps", "verdicts", "next_test"} <= set(
        answer("diagnose sticky.csv")
    )
    for words in (
        "gain-change sticky.toml",
        "gain-change --records sticky.csv slow.csv --ratio 0.6",
    ):
        answered = answer(f"confirm {words}")
        assert answered["verdict"] == "stiction"
        assert {"reason", "shift", "shift_interval", "before", "after"} <= set(answered)
        assert (
            answered["before"]["period_interval"][0]
            < answered["before"]["period"]
            < answered["before"]["period_interval"][1]
        )
    answered = answer("confirm travel sticky.toml")
    assert answered["verdict"] == "stiction"
    assert answered["S_interval"][0] <= 5.0 <= answered["S_interval"][1] + 1e-9


def test_score_and_the_run_tables(answer, place, capsys):
    answered = answer("score run")
    assert isinstance(answered["resolution"], float)
    assert set(answered["benchmark"]) >= {"name", "version", "hash"}
    rows = pd.DataFrame(answered["rows"])
    assert set(rows) == {
        "method",
        "truth",
        "process",
        "n",
        "applicable",
        "accuracy",
        "accuracy_decided",
        "no_decision",
        "sensitivity",
        "false_positives",
        "accuracy_all",
        "auc",
        "accuracy_lo",
        "accuracy_hi",
        "sees_mv",
        "rank",
        "sensitivity_at_5",
        "cost",
        "home",
        "division",
        "name",
        "answered",
        "population",
    }
    assert set(rows.truth) == {"sticky", "predicted", "cycled"}
    assert set(rows.process) == {"all", "self-regulating", "integrating"}
    assert set(rows.method) == {
        "horch",
        "he",
        "yamashita",
        "bicoherence",
        "oracle",
        "always_no",
        "always_yes",
        "no_waveform",
        "rhythm",
    }
    assert (
        rows[
            rows.method.isin(
                ["oracle", "always_no", "always_yes", "no_waveform", "rhythm", "bicoherence"]
            )
        ]["rank"]
        .isna()
        .all()
    )
    assert finite(answered)
    verdicts, scenarios = (
        pd.read_parquet(place / "run" / f"{t}.parquet") for t in ("verdicts", "scenarios")
    )
    assert not verdicts.duplicated(["scenario_id", "method"]).any()
    assert set(verdicts.scenario_id) == set(scenarios.scenario_id)
    assert {"sticky", "predicted", "refined", "theory", "cycled"} <= set(scenarios)
    assert {
        "Td_over_T",
        "Td_over_Ti",
        "S_over_2J",
        "noise_ratio",
        "disturbance",
        "tuning",
        "samples_per_period",
    } <= set(scenarios)
    assert set(scenarios.cycled) <= {"yes", "no", "entrained", "unclear"}
    cycling = scenarios.cycled[scenarios.cycled.isin(["yes", "no"])]
    assert 0.45 <= (cycling == "yes").mean() <= 0.55
    assert (scenarios.Td_over_T.isna() == (scenarios.process == "integrating")).all()
    assert main(["run", "smoke", "-o", str(place / "again"), *RUN, "--resume"]) == 0
    for t in ("verdicts", "scenarios"):
        a, b = (
            pd.read_parquet(place / run / f"{t}.parquet").drop(columns="runtime_s", errors="ignore")
            for run in ("run", "again")
        )
        pd.testing.assert_frame_equal(a, b, check_exact=True)


def test_gap_diagnose(answer, place):
    answered = answer("gap diagnose sticky.csv --baseline model.toml --no-bootstrap")
    assert set(answered) == {
        "block",
        "effect",
        "effects",
        "group",
        "ranking",
        "set",
        "gap",
        "shrinkage",
        "remaining",
        "blocks",
        "next_test",
        "notes",
        "probability_of_stiction",
        "conclusion",
    }
    assert (answered["block"], answered["effect"]) == ("valve", "stiction")
    assert set(answered["effects"][0]) == {"block", "effect", "parameters", "probability"}
    assert 1 <= len(answered["effects"]) <= 2
    assert {r["effect"] for r in answered["ranking"]} == {"none", "unknown"}.union(
        *EFFECTS.values()
    )
    for row in answered["ranking"]:
        assert set(row) == {
            "effect",
            "block",
            "probability",
            "gap_before",
            "gap_after",
            "group",
            "parameters",
        }
        if row["effect"] not in ("none", "unknown"):
            assert row["effect"] in EFFECTS[row["block"]]
    assert {r["block"] for r in answered["ranking"] if r["effect"] == "none"} == {"none"}
    assert sum(r["probability"] for r in answered["ranking"]) == pytest.approx(1.0)
    assert set(answered["gap"]) == {
        "before",
        "recalibrated",
        "after",
        "floor",
        "resolvable",
        "plant_floor",
        "near",
    }
    assert answered["ranking"][0]["effect"] == answered["effect"]
    friction = [r["probability"] for r in answered["ranking"] if r["effect"] in FRICTION]
    assert sum(friction) == pytest.approx(answered["conclusion"]["probability"])
    assert answered["set"][0] == answered["effect"]
    assert set(answered["shrinkage"]) == {"value", "lo", "hi"}
    assert set(answered["blocks"]) == {*EFFECTS, "unknown"}
    assert sum(answered["blocks"].values()) == pytest.approx(1.0)
    assert finite(answered)
    # set point, operating point and length are the record's
    other = (
        LOOP.replace("n = 1200", "n = 77")
        + "[operating_point]\nop0 = 20\npv0 = 3\n[setpoint]\nvalue = -9\nsteps = [[3, 4]]\n"
    )
    (place / "other.toml").write_text(other)
    again = answer("gap diagnose sticky.csv --baseline other.toml")
    assert {k: v for k, v in again.items() if k != "notes"} == {
        k: v for k, v in answered.items() if k != "notes"
    }


@pytest.mark.parametrize(("Ts", "code"), [(1.005, 0), (1.02, 2)])
def test_the_baseline_samples_like_the_record(place, capsys, Ts, code):
    (place / "ts.toml").write_text(LOOP.replace("Ts = 1.0", f"Ts = {Ts}"))
    assert (
        main(["gap", "diagnose", str(place / "sticky.csv"), "--baseline", str(place / "ts.toml")])
        == code
    )
