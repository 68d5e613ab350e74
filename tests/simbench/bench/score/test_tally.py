"""Answers counted by groups of loops are what a loop over every answer counts."""

from collections import Counter

import numpy as np
import pytest

from simbench.bench.score.answers import Answers
from simbench.bench.score.pairing import Paired
from simbench.bench.score.tally import RATES, counted, long_table, share_frame, tallied
from simbench.bench.statistics import mcnemar, rate

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


def test_a_group_comes_to_what_its_answers_are(answers, loops):
    table = tallied(counted(long_table(answers), **loops), ["where", "method"])
    assert len(table) == 12
    for (where, k), row in table.iterrows():
        a = answers[k]
        here = [i for i in range(N) if loops["where"][i] == where]
        known = [i for i in here if loops["label"][i] >= 0]
        covered = [i for i in known if a.applies[i]]
        sticky = [i for i in covered if loops["label"][i] == 1]
        right = sum(a.said[i] == loops["label"][i] for i in covered)
        open_ = sum(a.said[i] == 2 for i in covered)
        found = sum(a.said[i] == 1 for i in sticky)
        alarms = sum(a.said[i] == 1 for i in covered) - found
        assert (row["n"], row["n_all"], row["applicable"]) == (len(known), len(here), len(covered))
        assert row["positives"] == sum(loops["label"][i] == 1 for i in known)
        assert row["missed"] == sum(a.said[i] == 0 for i in sticky)
        assert (row["open_sticky"] + row["open_other"], row["right"]) == (open_, right)
        assert row["errors"] == sum(a.failed[i] for i in known)
        m = len(covered)
        expected = (
            rate(right, m),
            rate(right, m - open_),
            rate(open_, m),
            rate(found, len(sticky)),
            rate(alarms, m - len(sticky)),
            rate(right, len(known)),
        )
        for name, share in zip(RATES, expected, strict=True):
            assert tuple(row[[name, f"{name}_lo", f"{name}_hi"]]) == pytest.approx(share)


def test_without_loops_there_is_nothing_to_count(answers):
    columns = ("said", "applies", "failed")
    none = [a._replace(**{name: getattr(a, name)[:0] for name in columns}) for a in answers]
    counts = counted(long_table(none), label=np.empty(0, dtype=int))
    assert len(tallied(counts, ["method"])) == 0


def test_a_share_of_nothing_is_not_known(answers, loops):
    table = tallied(counted(long_table(answers), **loops), ["method"])
    share = share_frame("share", 0 * table["found"], 0 * table["n"])
    assert share["share"].isna().all()
    assert share["share_lo"].eq(0).all()
    assert share["share_hi"].eq(1).all()


def test_wins_ties_and_losses_of_two_sets_of_answers():
    first = np.array([1, 1, 1, 0, 0, 1], dtype=bool)
    second = np.array([1, 0, 0, 1, 0, 0], dtype=bool)
    paired = Paired.of(first, second)
    assert paired == (6, 3, 2, 1)
    assert paired.p == mcnemar(1, 3)
    assert paired.p_worse == mcnemar(3, 1, worse=True)
    assert Paired.of(second, first) == (6, 1, 2, 3)
