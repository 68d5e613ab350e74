"""Records against a grid: no difference is reported where there is none, a planted one is, and its
name ranks first.
"""

import json
from functools import wraps

import numpy as np
import pytest

from simbench.cli import main
from simbench.detectors.record import LoopRecord
from simbench.files import write_record
from simbench.loop.simulate import simulate
from simbench.plant.command import study_folder
from simbench.plant.study import forward_selection as joining
from simbench.plant.study import page as study_page
from simbench.plant.study import study as plant_study
from simbench.plant.study.forward_selection import draw
from simbench.plant.study.loop_features import looks
from simbench.plant.study.result import Contribution, Study
from simbench.plant.study.strengths import Size, absolute, relative, scales, with_effect
from simbench.plant.study.study import study
from simbench.plant.study.two_sample import (
    FeatureScaler,
    classifier_test,
    feature_tests,
    mmd,
    mmd_test,
)
from simbench.plant.study.written_grid import write_grid
from simbench.scenarios.grid import load_grid


def normal(seed, n, shift=0.0, features=5):
    return np.random.default_rng(seed).standard_normal((n, features)) + shift


def test_the_distance_is_rejected_about_as_often_as_it_should_be_where_there_is_none():
    small = 0
    for seed in range(30):
        a, b = normal([seed, 0], 15), normal([seed, 1], 15)
        small += mmd_test(FeatureScaler.of(a, b), a, b, np.random.default_rng(seed))["p"] <= 0.1
    assert 1 <= small <= 8


def test_kernel_and_classifier_detect_a_shift():
    a, b, rng = normal(0, 30), normal(1, 20, 1.2), np.random.default_rng(2)
    ruler = FeatureScaler.of(a, b)
    result = mmd_test(ruler, a, b, rng)
    assert result["p"] < 0.01
    assert result["lo"] <= result["value"] <= result["hi"]
    auc, p = classifier_test(ruler.measured(a), ruler.measured(b), rng)
    assert auc > 0.9
    assert p < 0.05


def test_the_kernel_distance_agrees_with_its_slow_form():
    a, b = normal(3, 7), normal(4, 6, 0.8)
    ruler = FeatureScaler.of(a, b)

    def mean(x, y, same):
        k = ruler.kernel(x, y)
        pairs = [k[i, j] for i in range(len(x)) for j in range(len(y)) if not (same and i == j)]
        return np.mean(pairs)

    slow = mean(a, a, True) + mean(b, b, True) - 2 * mean(a, b, False)
    assert mmd(ruler, a, b) == pytest.approx(np.sqrt(max(slow, 0.0)))


def test_the_feature_that_differs_ranks_first():
    a, b = normal(5, 30), normal(6, 30)
    b[:, 2] += 3.0
    rows = feature_tests(FeatureScaler.of(a, b), list("vwxyz"), a, b)
    assert rows[0]["name"] == "x"
    assert float(rows[0]["shift"]) > 1.5
    assert all(float(r["p"]) > 0.05 for r in rows[1:])


@pytest.fixture(scope="module")
def grid_loops():
    return draw("smoke", 10, 1)


def test_looks_do_not_change_with_units(grid_loops):
    r = grid_loops[0].record
    other = LoopRecord(
        op=r.op, pv=5.0 - 3.0 * r.pv, sp=5.0 - 3.0 * r.sp, Ts=60 * r.Ts, process=r.process
    )
    plain = LoopRecord(op=r.op, pv=-r.pv, sp=-r.sp, Ts=r.Ts, process=r.process)
    a, b = looks(other), looks(plain)
    assert a.keys() == b.keys()
    assert all(a[k] == pytest.approx(b[k], abs=1e-6) for k in a)


def test_a_strength_comes_back_from_where_it_was_taken(grid_loops):
    size, other = grid_loops[0].size, Size(3.0, 20.0, 50.0)
    strength = {"step": 0.5, "at": "record"}
    assert absolute(
        "quantisation", relative("quantisation", strength, size), size
    ) == pytest.approx(strength)
    assert absolute("quantisation", relative("quantisation", strength, size), other)[
        "step"
    ] == pytest.approx(0.5 * 3.0 / size.pv)
    assert scales("quantisation", strength) == {"step": "pv"}
    assert scales("drift", {"rate": 1.0}) is None


@pytest.fixture(scope="module")
def planted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plant")
    for i, s in enumerate(draw("smoke", 8, 7)[:8]):
        loop = with_effect(s.loop, "quantisation", {"step": 1.2 * s.size.pv, "at": "record"})
        write_record(simulate(loop, s.seed).record.without_mv(), folder / f"L{i}.csv")
    return folder


def test_the_planted_effect_ranks_first_and_brings_the_grid_nearer(planted, monkeypatch):
    # every loop has the same effect: the diagnosis of one serves for all
    monkeypatch.setattr(
        plant_study, "resumed", lambda ask, about, **_: [ask(*about[0])] * len(about)
    )
    result = study(planted, "smoke", methods=["he"], groups=10)
    assert result.distance["p"] < 0.05
    assert result.effects[0].effect == "quantisation"
    assert result.effects[0].distance_after < result.distance["value"]
    answer = json.loads(json.dumps(result.as_json(), allow_nan=False))
    keys = {"records", "loops", "distance", "features", "effects", "simulated", "real", "notes"}
    assert set(answer) == keys
    assert set(answer["effects"][0]) == {"effect", "share", "distance_after", "costs"}
    assert set(answer["distance"]) == {"value", "lo", "hi", "p"}


def test_a_killed_study_goes_on_and_leaves_only_its_page(planted, tmp_path, monkeypatch):
    page, asked, whole = tmp_path / "study.html", [], plant_study._diagnosed
    keep = tmp_path / "study.html.diagnosed"

    @wraps(whole)  # the annotations state what it returns
    def until_the_third(record, baseline):
        asked.append(record.tag)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return {}

    monkeypatch.setattr(plant_study, "_diagnosed", until_the_third)
    monkeypatch.setattr(plant_study, "draw", lambda grid, groups, seed: draw(grid, 6, seed))
    with pytest.raises(KeyboardInterrupt):
        study_folder(planted, "smoke", html=page, jobs=1)
    assert keep.exists()
    assert not page.exists()
    study_folder(planted, "smoke", html=page, jobs=1)
    # the one that was killed is asked again, the two before it are not
    assert len(asked) == 9
    assert [f.name for f in tmp_path.iterdir()] == ["study.html"]


def test_a_strength_is_that_of_a_loop_that_has_the_effect(grid_loops):
    for s in grid_loops:
        hit = joining._hit(s, "oscillation", {"amplitude": 0.2, "period": 1.0})
        effect, size = hit.loop.to_table()["effect"][-1], Size.of(hit.record)
        measured = effect["amplitude"] / size.op
        # one that resonates is given no more than twice what it would be by its size
        assert measured == pytest.approx(0.2, rel=0.1) or effect["amplitude"] == pytest.approx(
            0.4 * s.size.op
        )
        assert effect["period"] == pytest.approx(s.size.period)


def test_friction_replaces_friction(grid_loops):
    before = [s for s in grid_loops if s.representative]
    after = joining._with(before, joining.Way("stiction", 1.0, ({"S": 0.9, "J": 0.5},), 0))
    assert all(s.sticky for s in after)
    assert any(not s.sticky for s in before)


def test_too_few_loops_are_refused_in_one_sentence(planted, tmp_path, capsys):
    few = tmp_path / "few"
    few.mkdir()
    (few / "a.csv").write_text((planted / "L0.csv").read_text())
    assert main(["gap", "study", str(few), "--grid", "smoke"]) == 2
    assert "at least 5" in capsys.readouterr().err


def result_with(*effects):
    distance = {"value": 0.3, "lo": 0.2, "hi": 0.4, "p": 0.01}
    accuracy = {"he": 0.5}, {}, {"he": 0.4}
    return Study(8, 8, distance, (0.7, 0.1), [], effects, *accuracy, ("one",), "plant")


def test_the_grid_written_draws_the_effect_in_its_share(tmp_path):
    strengths = {"step": 0.4, "at": "record"}, {"step": 0.6, "at": "loop"}
    result = result_with(Contribution("quantisation", 0.5, 0.1, {"he": -0.1}, strengths))
    assert write_grid(result, tmp_path / "mine.toml") == []
    grid = load_grid(tmp_path / "mine.toml")
    assert len(grid) == len(load_grid("plant"))
    assert (tmp_path / "mine.toml").read_text().count('"found_quantisation"') == 10
    named = [e.name for i in range(30) for d in grid.group(i).drafts for e in d.effects]
    assert named.count("quantisation") > 5


@pytest.mark.parametrize(
    ("costs", "words", "table"),
    [
        (
            {"he": 0.02, "horch": -0.1, "kano_a": -0.004, "procedure": -0.2},
            "accuracy procedure -20, horch -10 points",
            "procedure",
        ),
        ({"he": 0.02, "horch": 0.0}, "no method is less often right", "none"),
    ],
)
def test_the_dearest_methods_are_named_and_none_where_an_effect_costs_nothing(costs, words, table):
    result = result_with(Contribution("quantisation", 0.5, 0.1, costs, ()))
    assert f"+ quantisation: in 50% of the loops; distance then 0.10; {words}" in result.as_text()
    assert study_page._effects(result)["costs most, alone"].tolist() == [table]


def test_a_study_without_an_effect_to_draw_is_an_answer_and_no_error(tmp_path, monkeypatch):
    monkeypatch.setattr("simbench.plant.study.study.study", lambda *a, **k: result_with())
    (tmp_path / "plant").mkdir()
    grid = tmp_path / "mine.toml"
    answer = study_folder(tmp_path / "plant", "smoke", write_grid=grid)
    why = f"no grid is written to {grid}: the study has no effect that a grid can draw"
    assert answer.notes == ("one", why)
    assert not grid.exists()
