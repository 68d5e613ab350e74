"""trust(): the contract's keys, three answers, and the text for readers."""

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from recorded import RESTING, resting
from recorded import STICKY as STUCK

from simbench.cli import main
from simbench.detectors.record import LoopRecord
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.files import write_record
from simbench.gap.diagnosis import conclude
from simbench.gap.stiction.candidate_loops import CandidateLoops
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, load_loop
from simbench.trust.trust import FEW as LEAST
from simbench.trust.trust import trust

MODULE = import_module("simbench.trust.trust")  # its name is that of a function, too

FEW = {"methods": ["he,horch"], "healthy": 20, "each": 4}


@pytest.fixture(scope="module")
def sticky():
    return resting(1, **STUCK)


@pytest.fixture(scope="module")
def trusted(sticky):
    return trust(sticky, **FEW)


def test_plain_stiction_is_called_so(trusted):
    assert trusted.conclusion.verdict == STICTION
    assert trusted.probability > 0.75


def test_workers_change_no_answer(sticky, trusted):
    assert trust(sticky, **FEW, jobs=2).as_json() == trusted.as_json()


def test_a_wild_sample_changes_no_verb_s_conclusion(sticky, trusted, tmp_path, capsys):
    pv = np.array(sticky.pv)
    pv[pv.size // 2] = 1e9
    wild = replace(sticky, pv=pv)
    note = "outliers: 1 sample of PV contradicts its neighbours on both sides and counts as missing"
    again = trust(wild, **FEW, help_wanted=False)
    assert again.conclusion.verdict == conclude(wild).verdict == trusted.conclusion.verdict
    assert again.probability == conclude(wild).probability
    assert note in again.conclusion.notes
    file = tmp_path / "wild.csv"
    write_record(wild, file)
    for words in (("diagnose",), ("gap", "diagnose", "--identify")):
        assert main([*words, str(file)]) == 0
        shown = " ".join("".join(capsys.readouterr()).split())
        assert note in shown
        assert "1e+09" not in shown
        assert f"(probability of stiction {again.probability:.2f})" in shown


def test_how_near_the_loop_of_the_replicates_is_to_the_record_is_said_as_a_diagnosis_measures_it(
    trusted, sticky, monkeypatch
):
    gap, floor = trusted.candidates.nearness()
    assert 0.0 < gap < 1.5 * floor
    assert trusted.notes[0] == (
        f"simulations of this loop are {gap:.2f} from the record, whose parts are {floor:.2f} apart"
    )
    monkeypatch.setattr(CandidateLoops, "nearness", lambda loops: (1.6, 1.0))
    far = trust(sticky, **FEW, help_wanted=False)
    assert "another loop's" in far.far
    assert far.as_text().startswith("The replicates are another loop's: they are ")
    assert far.far in far.as_json()["notes"]
    assert not [n for n in far.notes if n.startswith("simulations of this loop")]


def test_a_quiet_loop_is_denied_only_above_a_size_that_is_said():
    answer = trust(resting(2), **FEW, help_wanted=False)
    assert answer.conclusion.verdict in (NO_STICTION, NO_DECISION)
    assert answer.probability is not None
    assert answer.probability < 0.75
    if answer.smallest_visible is not None:
        assert f"{answer.smallest_visible[0]:.2g}" in answer.as_text()
    assert answer.conclusion.above in answer.conclusion.reason
    assert bool(answer.conclusion.above) == (answer.conclusion.verdict == NO_STICTION)


def test_a_record_whose_twins_do_not_move_as_it_does_is_still_judged(sticky, monkeypatch):
    monkeypatch.setattr(MODULE, "draw_replicates", lambda *a, **k: [])
    answer = trust(sticky, **FEW)
    assert answer.conclusion.verdict == STICTION
    assert answer.best is None
    assert answer.smallest_visible is None
    assert "does not move as the record does" in answer.power_line()


def test_a_set_point_step_at_the_start_of_a_record_leaves_it_its_twins():
    """Ahead of the record the twins stand at the old set point, which is no motion of theirs."""
    record = (
        simulate(load_loop(Path(__file__).parents[3] / "docs/example/loop.toml"), 1)
        .record.without_mv()
        .window(0, 1500)
    )
    answer = trust(record, methods=["he"], healthy=20, each=4, help_wanted=False)
    assert answer.best is not None
    assert answer.power


def test_a_long_record_of_a_plant_has_twins_enough_to_say_what_would_have_shown(
    sticky, monkeypatch
):
    monkeypatch.setattr(MODULE, "LONG_RECORD", 100)
    few = trust(sticky, methods=["he"], healthy=16, each=2, help_wanted=False)
    assert LEAST <= sum(S == 0 for S, _ in few.twins) <= 16
    assert few.power


def test_the_smallest_visible_is_that_of_the_method_most_often_right_whatever_its_verdict(
    sticky, trusted, monkeypatch
):
    keenest = max(
        (m for m in trusted.methods if m.verdict.applicable is not False),
        key=lambda m: m.rule.right,
    )
    assert keenest.power[-1].S == trusted.power[-1].S
    if keenest.rule.cut is None:
        assert trusted.power == keenest.power
    monkeypatch.setattr(MODULE, "likelier_verdict", lambda probability: NO_STICTION)
    assert trust(sticky, **FEW, help_wanted=False).smallest_visible == trusted.smallest_visible


@pytest.mark.parametrize(
    ("probability", "answer"),
    [
        pytest.param(0.9, STICTION, marks=pytest.mark.slow),
        pytest.param(0.6, NO_DECISION, marks=pytest.mark.slow),
        (0.1, NO_STICTION),
    ],
)
def test_a_size_that_would_show_is_denied_where_stiction_is_improbable(
    sticky, monkeypatch, probability, answer
):
    # twins are drawn as ever: it is the conclusion that is asked
    measured, draw = CandidateLoops.probability, MODULE.draw_replicates

    def drawn(around, *counts, **more):
        with monkeypatch.context() as m:
            m.setattr(CandidateLoops, "probability", measured)
            return draw(around, *counts, **more)

    monkeypatch.setattr(MODULE, "draw_replicates", drawn)
    monkeypatch.setattr(CandidateLoops, "probability", probability)
    # of four twins to a size one more that is missed hides them all
    trusted = trust(sticky, **{**FEW, "each": 8}, help_wanted=False)
    assert trusted.smallest_visible is not None
    assert trusted.conclusion.verdict == answer


def test_of_methods_that_agree_with_the_probability_the_best_on_the_twins_is_trusted(
    trusted,
):
    made = [m for m in trusted.methods if m.verdict.applicable is not False]
    agreeing = [m for m in made if m.verdict_here == STICTION]
    assert trusted.best.rule.right == max(m.rule.right for m in agreeing)
    assert trusted.best in agreeing
    assert "of the methods that agree with the conclusion" in trusted.as_text()


def test_the_text_states_where_no_method_agrees_with_the_probability(sticky, monkeypatch):
    monkeypatch.setattr(CandidateLoops, "probability", 0.1)
    trusted = trust(sticky, methods=["he"], healthy=15, each=2, help_wanted=False)
    assert trusted.best.verdict_here == STICTION
    assert "none agrees with the probability" in trusted.as_text()


def test_a_dead_record_is_no_error_and_no_verdict():
    flat = LoopRecord(op=np.full(300, 50.0), pv=np.sin(np.arange(300.0)), Ts=1.0)
    answer = trust(flat, **FEW)
    assert answer.conclusion.verdict == NO_DECISION
    assert answer.as_json()["probability"] is None
    assert answer.as_json()["best"] is None
    assert "OP is constant (50)" in answer.as_text()
    json.dumps(answer.as_json(), allow_nan=False)


@pytest.mark.parametrize("part", [STUCK, {"effect": [{"name": "stiction", "S": 4.0, "J": 2.0}]}])
def test_a_given_loop_with_friction_in_its_valve_still_has_healthy_twins(sticky, part):
    loop = Loop.from_table(RESTING | part)
    answer = trust(sticky, loop, **FEW, help_wanted=False)
    assert answer.candidates is not None
    assert answer.candidates.trusted
    assert answer.candidates.probability == pytest.approx(answer.conclusion.probability)
    assert any("friction" in n for n in answer.notes)
    assert min(answer.twins) == (0.0, 0.0)


def test_the_verbs_answer_on_files(tmp_path, capsys, sticky):
    record, page = tmp_path / "FIC1.csv", tmp_path / "page.html"
    write_record(sticky, record)
    assert main(["trust", str(record), "--method", "he", "--html", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["best"] == "he"
    text = page.read_text(encoding="utf-8")
    assert "http" not in text.replace("http://www.w3.org", "")
    assert "probability of stiction" in text
    assert main(["detect", str(record), "--method", "he", "--power", "--json"]) == 0
    out, err = capsys.readouterr()
    json.loads(out)
    assert "power: smallest stiction that he with " in err


def test_the_loop_may_be_the_path_of_its_file(monkeypatch):
    asked = []
    # the package offers the function under the same name
    home = import_module("simbench.trust.trust")
    monkeypatch.setattr(home, "_trust", lambda record, loop, *_: asked.append(loop))
    for path in ("docs/example/model.toml", Path("docs/example/model.toml")):
        home.trust(op=np.arange(60.0), pv=np.arange(60.0), Ts=1.0, loop=path)
    assert asked == [load_loop("docs/example/model.toml")] * 2


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        ((), ""),
        (("he",), "; these replicates cannot tell it from he."),
        (("he", "horch"), "; these replicates cannot tell it from he and horch."),
        (tuple("abcdefg"), "; these replicates cannot tell it from a, b, c, d and 3 more."),
    ],
)
def test_methods_that_the_replicates_cannot_tell_apart_are_named(trusted, rivals, said):
    line = replace(trusted, rivals=rivals).advice()[-1]
    assert line.endswith(f"of the methods that agree with the conclusion{said or '.'}")


@pytest.mark.parametrize(
    ("seen", "ends", "said"),
    [
        ((2.0, 1.0), (1.5, 2.8), "S = 2 (90 % interval 1.5 to 2.8), J = 1 "),
        ((2.0, 1.0), (1.5, np.inf), "S = 2 (90 % interval 1.5 to beyond the sizes tried), J = 1 "),
        (None, (5.0, np.inf), "none of the sizes tried (90 % interval of S from 5 % of travel on)"),
        (None, (np.inf, np.inf), "none of the sizes tried"),
    ],
)
def test_the_smallest_visible_size_has_an_interval(trusted, seen, ends, said):
    line = replace(trusted, smallest_visible=seen, visible_range=ends).advice()[0]
    assert f"simulated replicates of this loop: {said}" in line
