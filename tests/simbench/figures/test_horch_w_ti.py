"""Horch's verdict follows w Ti, whatever the valve does."""

import numpy as np
import pytest

from results.studies.own_ground import BARS, sections
from simbench.bench.execute.run import run_grid
from simbench.detectors.errors import UserError
from simbench.figures.horch_w_ti import BOUNDS, data, draw

W_TI = [0.2, 0.45, 0.54, 0.62, 0.7, 1.0, 1.4, 1.6, 1.85, 2.1, 4.0]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("own") / "run"
    few = {"repeats": 1, "Td_over_T": 0.3, "Td_over_Ti": 0.05, "S_over_2J": 0.5, "tuning": "slow"}
    return run_grid("own-ground", folder, ["horch", "he"], sets=few, axes={"w_Ti": W_TI})


@pytest.fixture(scope="module")
def horch(run):
    return data(run)


def test_the_index_is_the_law_of_a_linear_loop_for_both_valves(horch):
    law = 2 / np.pi * np.arctan(1 / horch.w_Ti)
    assert {True, False} == set(horch.sticky)
    # the method takes signals as they come: noise moves what it measures
    off = np.abs(horch.dtau - law)
    assert off[horch.noise_ratio == 0.02].max() < 0.05
    assert off.max() < 0.1


def test_the_verdict_switches_where_the_bounds_say(horch):
    for _, part in horch.groupby("sticky"):
        x = part.w_Ti.to_numpy()
        cuts = np.sqrt(x[1:] * x[:-1])
        for verdict, (_, expected) in BOUNDS.items():
            answered = (part.verdict == verdict).to_numpy()
            # where a cut separates the verdict from the rest with the fewest exceptions
            wrong = np.array(
                [(((x < c) if verdict == "stiction" else (x > c)) != answered).sum() for c in cuts]
            )
            assert abs(np.log(cuts[wrong == wrong.min()].mean() / expected)) < 0.15


def test_both_valves_are_in_one_picture(horch):
    names = [t.get_text() for t in draw(horch).axes[0].get_legend().get_texts()]
    assert sum("valve" in name for name in names) == 2


def test_sections_are_scored_by_the_method_they_are_named_after(run):
    scores = sections(run)
    assert set(scores.section) == {"he", "he, integrating", "horch"}
    assert (scores.method == scores.section.str.split(",").str[0]).all()
    assert set(scores.bar.dropna()) == set(BARS.values())
    whole = scores[scores.noise_ratio == "all"].set_index("section")
    parts = scores[scores.noise_ratio != "all"].groupby("section").n.sum()
    assert (whole.n == parts).all()


def test_a_run_without_the_section_is_one_sentence(tmp_path):
    folder = run_grid("smoke", tmp_path / "run", ["horch"], sets={"disturbance": "none"})
    with pytest.raises(UserError, match="own-ground"):
        data(folder)
