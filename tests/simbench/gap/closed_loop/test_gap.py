"""The gap's ruler: what is resolvable, and the share that closes."""

from types import SimpleNamespace

import numpy as np
import pytest

from simbench.gap.closed_loop.gap import closed, held_out, measure
from simbench.gap.closed_loop.summary_features import features, unsteadiness

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
    assert closed(before, after, 1.0) == pytest.approx(share)


@pytest.mark.parametrize(("off", "resolvable"), [(0.9, False), (2.0, True)])
def test_a_gap_is_resolvable_from_one_and_a_half_floors(off, resolvable):
    s = SimpleNamespace(record=SimpleNamespace(pv=WHITE[0], n=N), op=WHITE[1], sp=np.zeros(N))
    assert held_out(s) == 2600
    real = np.array(list(features(WHITE[1][2600:], WHITE[0][2600:], np.zeros(1400)).values()))
    rng = np.random.default_rng(1)
    runs = [
        SimpleNamespace(features=real + o + rng.standard_normal((8, real.size)))
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
    assert np.mean([b for b, _ in shrinkage.per_feature.values()]) == pytest.approx(
        shrinkage.before, rel=0.02
    )
    assert np.mean([a for _, a in shrinkage.per_feature.values()]) == pytest.approx(
        shrinkage.after, rel=0.02
    )


@pytest.mark.parametrize(("moved", "times"), [(0.0, 1.0), (1.0, 1.0), (6.0, 5.3)])
def test_a_record_that_does_not_repeat_itself_has_a_wider_floor(moved, times):
    # two runs of unit spread are 2/sqrt(pi) = 1.13 apart on average; so far off is `moved`
    sims = np.random.default_rng(3).standard_normal((8, 4000))
    stretches = np.array([np.zeros(4000), np.full(4000, moved), np.full(4000, -moved)])
    assert unsteadiness(stretches, sims, np.ones(4000)) == pytest.approx(times, rel=0.02)
