"""Sections on their own ground: right of decided against the bar, and no more undecided than a
quarter.
"""

import numpy as np
import pytest

from results.studies import own_ground
from results.studies.own_ground import sections


@pytest.fixture
def scored(book, monkeypatch):
    """Score one section of a run made up of right, wrong and undecided answers, with and without
    noise.
    """

    def score(right, wrong, undecided, section="he", method="he", unclear=0):
        n = right + wrong + undecided
        truth = np.resize([1, 0, 1], n)
        said = np.concatenate(
            [truth[:right], 1 - truth[right : right + wrong], np.full(undecided, 2)]
        )
        truth, said = np.append(truth, np.full(unclear, -1)), np.append(said, np.ones(unclear, int))
        axes = {
            "block": np.full(truth.size, section),
            "noise_ratio": np.where(np.arange(truth.size) % 2, 0.05, 0.02),
        }
        made = book(said, truth, methods=[method], axes=axes)
        monkeypatch.setattr(own_ground.RunArrays, "read", lambda run: made)
        return sections("run")

    return score


@pytest.mark.parametrize(
    ("answers", "section", "met"),
    [
        ((90, 10, 0), "he", True),
        ((89, 11, 0), "he", False),
        ((85, 15, 0), "he, integrating", True),
        ((84, 16, 0), "he, integrating", False),
        ((75, 0, 25), "he", True),
        ((74, 0, 26), "he", False),
        ((0, 0, 10), "he", False),
    ],
)
def test_the_bar_and_the_most_undecided(scored, answers, section, met):
    assert scored(*answers, section).met[0] == met


def test_what_is_neither_yes_nor_no_is_left_out(scored):
    found = scored(9, 1, 0, unclear=7)
    assert found.n[0] == 10
    assert found.right[0] == 0.9
    assert found.n[1] + found.n[2] == 10
    assert found.noise_ratio.tolist() == ["all", "0.02", "0.05"]


def test_the_index_that_follows_w_ti_has_no_bar_and_strangers_no_row(scored):
    found = scored(0, 10, 0, "horch", "horch")
    assert found.met.all()
    assert found.right[0] == 0.0
    assert scored(9, 1, 0, section="kano_a").empty


@pytest.mark.parametrize(("answers", "code"), [((10, 0, 0), 0), ((5, 5, 0), 1)])
def test_a_missed_bar_is_an_exit_code(scored, capsys, answers, code):
    scored(*answers)
    assert own_ground.main(["run"]) == code
    assert "no_decision" in capsys.readouterr().out
