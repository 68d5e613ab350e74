"""The public names: loaded late, typed, completed, and a wrong one answered with the right one."""

from __future__ import annotations

import json
import rlcompleter
import subprocess
import sys

import matplotlib
import numpy as np
import pytest

import simbench as sb
import simbench.detectors as detectors
import simbench.scenarios as scenarios
from simbench.cli import main
from simbench.detectors.errors import RecordError, UnknownName
from simbench.detectors.methods import horch

PACKAGES = [sb, sb.gap, detectors, scenarios]
PIPED = {"capture_output": True, "text": True, "check": True}
TABLES = {
    "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "sampling": {"Ts": 1, "n": 1200},
    "setpoint": {"steps": [[10, 55]]},
}


@pytest.fixture(scope="module")
def run():
    return sb.Loop(**TABLES).simulate(seed=1)


def test_importing_brings_in_next_to_nothing():
    bare, loaded = (
        set(subprocess.run([sys.executable, "-c", code], **PIPED).stdout.split())
        for code in ("import sys; print(*sys.modules)", "import sys, simbench; print(*sys.modules)")
    )
    assert not {"numpy", "pandas", "numba", "detectors"} & loaded
    assert len(loaded - bare) < 60  # in addition to what Python loads itself


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there_and_completed(package):
    completer = rlcompleter.Completer({"p": package})
    for name in package.__all__:
        assert getattr(package, name) is not None
        assert completer.complete(f"p.{name}", 0).rstrip("()") == f"p.{name}"


NEAR = [(sb, "scoer", "score"), (sb, "Lop", "Loop"), (sb.gap, "diagnos", "diagnose")]


@pytest.mark.parametrize(("package", "wrong", "right"), NEAR)
def test_a_wrong_name_is_answered_with_the_nearest(package, wrong, right):
    with pytest.raises(AttributeError, match=f"did you mean '{right}'"):
        getattr(package, wrong)


def test_a_loop_simulates_itself_and_is_the_loop_of_the_file(tmp_path, run):
    loop = sb.Loop(**TABLES)
    (tmp_path / "loop.toml").write_text(loop.to_toml())
    again = sb.load_loop(tmp_path / "loop.toml")
    assert again == loop
    assert np.array_equal(again.simulate(1).record.pv, run.record.pv)
    assert again.with_("valve.S", 1.0).simulate(1).record.n == 1200
    assert again.predict() == sb.predict(scenarios.load_loop(tmp_path / "loop.toml"))


def test_a_record_a_run_and_a_file_are_judged_alike(tmp_path, run):
    run.to_frame().to_csv(tmp_path / "a.csv", index=False)
    about = {"process": "self-regulating", "op_span": (0, 100)}
    answers = [
        sb.detect(s, ["horch", "he"], **about).as_json()
        for s in (run, run.record, tmp_path / "a.csv")
    ]
    assert answers[0] == answers[1] == answers[2]
    assert sb.diagnose(run).as_json() == sb.diagnose(run.record).as_json()
    with pytest.raises(UnknownName, match="did you mean 'horch'"):
        sb.detect(run, "horhc")
    with pytest.raises(UnknownName, match="did you mean 'horch'"):
        sb.detect(run, "horch")["horhc"]
    with pytest.raises(RecordError, match="list is no record"):
        sb.detect([1, 2])


def test_results_become_tables_pictures_and_notebook_cells(run):
    matplotlib.use("Agg")
    again = sb.detect(run.to_frame(), ["he"])["he"]
    assert again.indices == sb.detect(run, ["he"])["he"].indices
    report = sb.detect(run, ["horch", "he", "kano_a"])
    frame = report.to_frame()
    assert frame.method.tolist() == ["horch", "he", "kano_a"]
    assert {"S_lo", "J_hi", "reason", "period_s"} <= set(frame)
    assert len(run.plot()) == 2
    pv, op = (axes.get_lines()[0] for axes in run.plot())
    assert np.array_equal(pv.get_ydata(), run.record.pv)
    assert np.array_equal(op.get_ydata(), run.record.op)
    things = {
        "self-regulating": run,
        "choudhury": sb.Loop(**TABLES),
        "kano_a": report,
        "Next": sb.diagnose(run),
    }
    for word, thing in things.items():
        html = thing._repr_html_()
        assert "<table" in html
        assert word in html


def test_python_concludes_what_the_command_line_concludes(tmp_path, run, capsys):
    path = tmp_path / "rec.csv"
    run.to_frame().to_csv(path, index=False)
    assert main(["detect", str(path), "--method", "likelihood", "--json"]) == 0
    (printed,) = json.loads(capsys.readouterr().out)
    assert sb.detect(path, "likelihood").conclusion.as_json() == printed["conclusion"]
    assert sb.detect(path, "horch").conclusion is None
    assert main(["diagnose", str(path), "--json"]) == 0
    diagnosed = json.loads(capsys.readouterr().out)
    assert json.loads(json.dumps(sb.diagnose(path).as_json())) == diagnosed
    assert sb.diagnose(path).conclusion.as_json() == diagnosed["conclusion"]


def test_results_show_themselves_in_one_line(run):
    detected, diagnosed = sb.detect(run, "horch"), sb.diagnose(run)
    assert repr(detected) == "Report: 1 verdict on 1 record"
    for thing in (detected, diagnosed, diagnosed.conclusion, diagnosed.procedure):
        assert "\n" not in repr(thing)
        assert len(repr(thing)) < 300
        assert thing._repr_html_()


def test_the_verbs_of_a_check_are_functions(tmp_path):
    folder = sb.run("smoke", "horch", out=tmp_path / "run", sets={"disturbance": "none"})
    assert sb.check(folder, folder).result == "same"
    assert repr(sb.check(folder, folder)).endswith(": same")
    assert sb.contract(horch.__file__).kept
