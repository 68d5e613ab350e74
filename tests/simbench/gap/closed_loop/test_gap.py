"""The gap's ruler: what is resolvable, and the share that closes."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.closed_loop import gap
from simbench.gap.closed_loop.gap import closed_share, held_out, measure
from simbench.gap.closed_loop.summary_features import features

N = 4000
WHITE = np.random.default_rng(0).standard_normal((2, N))


@pytest.mark.parametrize(
    ("before", "after", "share"),
    [
        (3.0, 0.2, 1.0),
        (3.0, 4.0, -0.5),
        (3.0, 99.0, -1.0),
        (5.0, 2.0, 0.75),
    ],
)
def test_the_share_that_closes_is_of_what_lies_above_the_floor(before, after, share):
    assert closed_share(before, after, 1.0) == pytest.approx(share)


@pytest.mark.parametrize(("n", "count"), [(1000, 64), (8000, 32), (10**6, 8)])
def test_the_shorter_a_record_the_more_often_its_loop_is_simulated(n, count, monkeypatch):
    asked = []
    monkeypatch.setattr(gap, "run_with_seeds", lambda loop, seed, count, kick: asked.append(count))
    assert gap.simulate_runs(SimpleNamespace(record=SimpleNamespace(n=n)), None, 0) is None
    assert asked == [count]


@pytest.mark.parametrize(("off", "resolvable"), [(0.9, False), (2.0, True)])
def test_a_gap_is_resolvable_from_one_and_a_half_floors(off, resolvable):
    s = SimpleNamespace(record=SimpleNamespace(pv=WHITE[0], n=N), op=WHITE[1], sp=np.zeros(N))
    assert held_out(s) == 2600
    real = np.array(list(features(WHITE[1][2600:], WHITE[0][2600:], np.zeros(1400)).values()))
    rng = np.random.default_rng(1)
    runs = [
        SimpleNamespace(
            features=real + o + rng.standard_normal((8, real.size)),
            archived=rng.standard_normal((8, 2, N)),
        )
        for o in (off, off / 2, 0.0)
    ]
    shrinkage = measure(s, *runs)
    assert shrinkage.resolvable == resolvable
    # eight seeds: each lies sqrt(8/7) from the mean of the others, at sqrt(2/pi) on average
    assert shrinkage.floor == pytest.approx(np.sqrt(8 / 7 * 2 / np.pi), abs=0.1)
    assert shrinkage.after < 0.5
    # white noise repeats itself better than these runs do
    assert shrinkage.plant_floor == shrinkage.floor
    if resolvable:
        assert shrinkage.before == pytest.approx(off, rel=0.1)
        assert shrinkage.recalibrated == pytest.approx(off / 2, rel=0.15)
        assert shrinkage.value == 1.0
        assert 0.6 < shrinkage.lo <= shrinkage.hi == 1.0
    else:
        assert (shrinkage.value, shrinkage.lo, shrinkage.hi) == (None, 0.0, 0.0)
    each = shrinkage.features.values()
    assert np.mean([one.before for one in each]) == pytest.approx(shrinkage.before, rel=0.02)
    assert np.mean([one.distance for one in each]) == pytest.approx(shrinkage.after, rel=0.02)
    assert [one.recorded for one in each] == pytest.approx(list(real))
    last = runs[2].features
    assert [(one.lo, one.hi) for one in each] == list(zip(last.min(axis=0), last.max(axis=0)))


def measured(*, pv=0.0, sims=0.0, sp=0.0):
    """Return the measure of white noise with something added along the record, the simulations or
    the set point.
    """
    rng = np.random.default_rng(3)
    white = rng.standard_normal((9, 2, N))
    white[0, 1] += pv
    white[1:, 1] += sims
    level = np.full(N, 0.0) + sp
    s = SimpleNamespace(record=SimpleNamespace(pv=white[0, 1], n=N), op=white[0, 0], sp=level)
    late = white[1:, :, held_out(s) :]
    found = features(late[:, 0], late[:, 1], level[held_out(s) :])
    runs = SimpleNamespace(features=np.array(list(found.values())).T, archived=white[1:])
    return measure(s, runs, runs, runs)


SLOW = 3.0 * np.sin(np.arange(N) / 40.0) * (np.arange(N) < N // 2)


def test_a_record_that_repeats_itself_as_its_simulations_do_has_their_floor():
    found = measured()
    assert found.floor <= found.plant_floor < 1.25 * found.floor


def test_a_record_that_does_not_repeat_itself_has_a_wider_floor():
    found = measured(pv=SLOW)
    assert found.plant_floor > 2.0 * found.floor
    # what the simulation does as well is no lack of repetition
    found = measured(pv=SLOW, sims=SLOW)
    assert found.plant_floor < 1.25 * found.floor


def test_a_set_point_that_moves_in_one_part_only_widens_no_floor():
    found = measured(sp=5.0 * (np.arange(N) > 3000))
    assert found.plant_floor < 1.25 * found.floor
