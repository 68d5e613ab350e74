"""What is planted is planted in every loop of a fleet, and answers are counted as they are."""

import numpy as np
import pytest

from results.studies.plant import planted
from results.studies.plant.planted import COMES_AND_GOES, STRENGTHS, plant, summary_lines
from results.studies.plant.trust_claims import TESTING, loops
from simbench.loop.simulate import simulate
from simbench.plant.study.strengths import Size


@pytest.fixture(scope="module")
def scenarios():
    return list(loops(4, TESTING, "smoke"))


@pytest.mark.parametrize("effect", [e for e in STRENGTHS if e != COMES_AND_GOES])
def test_an_effect_changes_every_loop(scenarios, effect):
    for s in scenarios:
        clean = simulate(s.loop, s.seed).record
        middle = {k: float(np.mean(ends)) for k, ends in STRENGTHS[effect].items()}
        loop = plant(s.loop, effect, middle, Size.of(clean))
        assert [e["name"] for e in loop.to_table()["effect"]][-1] == effect
        assert not np.array_equal(simulate(loop, s.seed).record.pv, clean.pv)


def answer(planted, order, predicted=-0.1, p=0.01):
    true = {"he": -0.2, "procedure": -0.1}
    return {
        "planted": planted,
        "p": p,
        "order": order,
        "predicted": {"he": predicted, "procedure": 0.0},
        "true": true,
    }


def test_first_is_first_and_not_among_others():
    rows = [
        answer("quantisation", ["quantisation"]),
        answer("quantisation", ["drift", "quantisation"]),
    ]
    lines = summary_lines(rows)
    words = lines[1].split()
    assert words[:2] == ["quantisation", "1/2"]
    assert words[3:6] == ["2", "2", "10.0"]
    assert lines[-1].split()[:2] == ["all", "1/2"]


def test_fleets_without_effect_are_seldom_distinguished(monkeypatch):
    monkeypatch.setattr(planted, "draw", lambda *a: None)
    monkeypatch.setattr(
        planted, "units", lambda _: np.random.default_rng(1).standard_normal((60, 4))
    )
    share = float(planted.healthy(12, 10, 20)[1].split("p <= 0.05: ")[1].split()[0])
    assert share <= 0.2
