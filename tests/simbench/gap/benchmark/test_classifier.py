"""The two-sample classifier: calibrated where there is no difference, sure where there is one."""

import numpy as np
import pytest
from sklearn.metrics import roc_auc_score

from simbench.gap.benchmark.classifier import FeatureSample, _areas, _Classified, tell_apart

BLOCKS = ("load",) * 6


def _sample(rng, n, shift=0.0, each=1, name=""):
    """`each` records of every unit, which share most of what they are."""
    own = np.repeat(rng.standard_normal((n // each, 6)), each, axis=0)
    x = own + (0.0 if each == 1 else 0.05) * rng.standard_normal((n, 6))
    x[:, 0] += shift
    return FeatureSample(x, tuple(f"{name}{k // each}" for k in range(n)), BLOCKS)


def test_two_samples_of_one_distribution_are_not_told_apart():
    found = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        found.append(tell_apart(_sample(rng, 80, name="s"), _sample(rng, 60, name="r"), seed))
    assert abs(np.mean([one.value for one in found]) - 0.5) < 0.04
    assert np.mean([one.lo <= 0.5 <= one.hi for one in found]) >= 0.75


def test_a_shift_is_told():
    rng = np.random.default_rng(1)
    found = tell_apart(_sample(rng, 80, name="s"), _sample(rng, 60, shift=6.0, name="r"))
    assert found.value > 0.97
    assert found.lo > 0.9


def test_a_unit_that_was_learned_is_not_asked_again():
    rng = np.random.default_rng(2)
    one, other = _sample(rng, 60, each=10, name="a"), _sample(rng, 60, each=10, name="b")
    whole = tell_apart(one, other)
    alone = [
        FeatureSample(s.features, tuple(f"{n}{k}" for k in range(60)), BLOCKS)
        for n, s in zip("sr", (one, other))
    ]
    assert tell_apart(*alone).value > 0.95  # records of one unit recognise each other
    assert whole.value < 0.8
    assert whole.hi - whole.lo > 0.15


def test_the_same_numbers_twice():
    rng = np.random.default_rng(4)
    one, other = _sample(rng, 50, name="s"), _sample(rng, 50, shift=1.0, name="r")
    assert tell_apart(one, other, 3) == tell_apart(one, other, 3)


def test_a_sample_of_a_block_has_its_features_alone():
    x = np.arange(12.0).reshape(3, 4)
    whole = FeatureSample(x, ("a", "b", "c"), ("noise", "load", "noise", "valve"))
    part = whole.of("noise")
    assert part.features.tolist() == x[:, [0, 2]].tolist()
    assert (part.units, part.blocks) == (whole.units, ("noise", "noise"))


def test_the_areas_are_those_of_the_library():
    rng = np.random.default_rng(5)
    label, score = rng.random(70) < 0.4, np.round(rng.random(70), 1)  # with ties
    weights = rng.integers(0, 3, (9, 70)) * rng.random(70)
    told = _Classified(score, label, np.arange(70), weights[0])
    plain = [roc_auc_score(label, score, sample_weight=w) for w in weights]
    assert _areas(told, weights) == pytest.approx(plain, abs=1e-12)
