"""Every number of a calibration counted again, loop by loop, on runs made up in memory."""

import math
from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.calibrate import abstention, calibrate_books, cut_for, roc
from simbench.bench.statistics import auc, wilson

WRONG = 0.1


@pytest.fixture
def runs(book):
    """Two runs of one method, with ties, unknown scores and loops that are neither."""

    def make(seed, n=240):
        rng = np.random.default_rng(seed)
        truth = rng.choice([-1, 0, 1], n, p=[0.1, 0.5, 0.4])
        score = np.round(truth + rng.normal(0, 0.6, n), 1)
        score[rng.random(n) < 0.05] = np.nan
        made = book(rng.integers(0, 3, n), truth, score=score, methods=["m"])
        raw = np.round(truth + rng.normal(0, 0.5, (1, n)), 1).astype(np.float32)
        return replace(made, manifest={**made.manifest, "seed": seed}, score_raw=raw)

    return make(1), make(2)


def test_every_number_of_a_calibration(runs):
    a, b = runs
    calibration = calibrate_books(a, b, WRONG)
    row = calibration.table.iloc[0]
    healthy = [s for s, t in zip(a.score[0], a.truth["cycled"]) if t == 0]
    above = [c for c in healthy if c == c and np.mean([s > c for s in healthy]) <= WRONG]
    assert row.cut == pytest.approx(min(above))
    loops = [
        (t == 1, s, r, v)
        for t, s, r, v in zip(
            b.truth["cycled"], b.score[0].astype(float), b.score_raw[0].astype(float), b.verdict[0]
        )
        if t >= 0
    ]
    for name, answers in (
        ("false_alarm", [s > row.cut for t, s, *_ in loops if not t]),
        ("detection", [s > row.cut for t, s, *_ in loops if t]),
    ):
        assert row[name] == pytest.approx(np.mean(answers))
        assert (row[f"{name}_lo"], row[f"{name}_hi"]) == pytest.approx(
            tuple(map(float, wilson(sum(answers), len(answers))))
        )
    assert row.published_false_alarm == pytest.approx(
        np.mean([v == 1 for t, *_, v in loops if not t])
    )
    assert row.published_detection == pytest.approx(np.mean([v == 1 for t, *_, v in loops if t]))
    low, high = row.no_stiction_below, row.stiction_above
    answers = [(True if r > high else False if r <= low else None, t) for t, _, r, _ in loops]
    decided = [(x, t) for x, t in answers if x is not None]
    assert row.coverage == pytest.approx(len(decided) / len(answers))
    assert row.wrong_decided == pytest.approx(np.mean([x != t for x, t in decided]))
    known = [(s, t) for t, s, *_ in loops if not math.isnan(s)]
    area = auc(*zip(*known))
    assert (row.auc, row.auc_lo, row.auc_hi) == pytest.approx((area.value, area.lo, area.hi))
    assert row.informative
    assert (calibration.about["positives"], calibration.about["negatives"]) == (
        sum(t for t, *_ in loops),
        sum(not t for t, *_ in loops),
    )
    assert (calibration.about["seed_a"], calibration.about["seed_b"]) == (1, 2)
    assert calibration.abstaining == {"m": {"stiction_above": high, "no_stiction_below": low}}


def test_a_score_that_tells_nothing_is_not_informative(runs):
    a, b = runs
    noise = np.random.default_rng(0).normal(size=b.score.shape).astype(np.float32)
    assert not calibrate_books(a, replace(b, score=noise), WRONG).table.informative[0]
    assert "Not informative here" in calibrate_books(a, replace(b, score=noise), WRONG).as_text()


def test_a_method_without_two_thresholds_shows_no_share_of_decided_loops(runs):
    a, b = runs
    noise = np.random.default_rng(0).normal(size=a.score_raw.shape).astype(np.float32)
    row = calibrate_books(replace(a, score_raw=noise), b, WRONG).as_text().splitlines()[4]
    assert row.split()[-2:] == ["-", "-"]
    assert calibrate_books(a, b, WRONG).as_text().splitlines()[4].split()[-1] != "-"


@pytest.mark.parametrize("share", [0.01, 0.05, 0.3])
def test_a_cut_is_the_lowest_score_that_few_exceed(share):
    healthy = np.round(np.random.default_rng(5).normal(size=83), 1)
    cut = cut_for(healthy, share)
    assert np.mean(healthy > cut) <= share
    lower = healthy[healthy < cut]
    assert np.mean(healthy > lower.max()) > share
    assert cut_for(np.append(healthy, [np.nan] * 20_000), share) == -math.inf
    assert math.isnan(cut_for(np.array([]), share))


def test_a_band_on_the_score_itself():
    # at the lower cut "no", at the upper one nothing
    score = np.repeat([0.0, 1.0, 2.0], 40)
    low, high = abstention(
        score, np.repeat([0, 1, 1], 40) * np.tile([1, 0], 60) + np.repeat([0, 0, 1], 40) > 0, 0.1
    )
    assert (low, high) == (0.0, 1.0)
    assert abstention(np.array([np.nan]), np.array([True]), 0.1) == (-math.inf, math.inf)
    assert abstention(np.zeros(4), np.array([True, False] * 2), 0.1) == (-math.inf, math.inf)


def test_points_of_the_roc_are_shares_above_their_threshold():
    rng = np.random.default_rng(6)
    positive = rng.random(500) < 0.4
    score = positive + rng.normal(size=500)
    score[:20] = np.nan
    curve = roc(score, positive)
    assert 150 < len(curve) <= 202
    for threshold, false_alarm, detection in curve.iloc[::17].to_numpy():
        assert false_alarm == pytest.approx(np.mean([s > threshold for s in score[~positive]]))
        assert detection == pytest.approx(np.mean([s > threshold for s in score[positive]]))
