"""Sections of grid own-ground: right of decided against the bar, and no more undecided than a
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
        verdicts = np.concatenate(
            [truth[:right], 1 - truth[right : right + wrong], np.full(undecided, 2)]
        )
        truth, verdicts = (
            np.append(truth, np.full(unclear, -1)),
            np.append(verdicts, np.ones(unclear, int)),
        )
        axes = {
            "block": np.full(truth.size, section),
            "noise_ratio": np.where(np.arange(truth.size) % 2, 0.05, 0.02),
        }
        made = book(verdicts, truth, methods=[method], axes=axes)
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


@pytest.mark.parametrize(("answers", "code"), [((10, 0, 0), 0), ((5, 5, 0), 1)])
def test_a_missed_bar_is_an_exit_code(scored, capsys, answers, code):
    scored(*answers)
    assert own_ground.main(["run"]) == code
    assert "no_decision" in capsys.readouterr().out
