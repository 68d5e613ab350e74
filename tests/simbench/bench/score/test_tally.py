"""Answers counted by groups of loops are what a loop over every answer counts."""

from collections import Counter

import numpy as np
import pytest

from simbench.bench.score.answers import Answers, counted, long_table

N = 400


@pytest.fixture
def answers():
    rng = np.random.default_rng(5)

    def one(name):
        said, failed = rng.integers(0, 3, N).astype(np.int8), rng.random(N) < 0.1
        nothing = np.zeros(N)
        return Answers(name, "stiction", False, said, nothing, rng.random(N) < 0.8, failed, nothing)

    return [one("a"), one("b"), one("c")]


@pytest.fixture
def loops():
    rng = np.random.default_rng(6)
    return {"label": rng.integers(-1, 2, N), "where": rng.integers(0, 4, N)}


def test_every_combination_is_counted(answers, loops):
    counts = counted(long_table(answers), **loops)
    expected = Counter(
        (k, int(a.said[i]), bool(a.applies[i]), bool(a.failed[i]), *place)
        for k, a in enumerate(answers)
        for i, place in enumerate(zip(*(x.tolist() for x in loops.values()), strict=True))
    )
    found = {tuple(row[:-1]): row[-1] for row in counts.itertuples(index=False, name=None)}
    assert found == expected
