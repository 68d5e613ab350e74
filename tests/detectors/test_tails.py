"""Tails: heavy ones are told from Gaussian noise with spikes."""

import numpy as np

from simbench.detectors.signal.spikes import heavy_tails


def test_heavy_tails_are_distinguished_from_gaussian_noise_with_spikes():
    rng = np.random.default_rng(6)
    heavy = [rng.standard_t(df, 2000) for df in (3, 4, 5)]
    spiked = []
    for rate in (0.004, 0.02):
        x = rng.normal(0, 1, 2000)
        hit = rng.random(2000) < rate
        x[hit] += rng.choice([-9, 9], hit.sum())
        spiked.append(x)
    assert all(heavy_tails(x) for x in heavy)
    assert not any(heavy_tails(x) for x in spiked)
    assert not heavy_tails(np.zeros(100))


def test_values_that_stand_still_do_not_draw_the_mixture_to_a_point():
    x = np.random.default_rng(0).standard_normal(4000)
    x[:1800] = 0.0  # as on a line that a historian drew: numpy's warnings are errors here
    assert not heavy_tails(x)


def test_a_wide_share_that_no_spikes_can_be_is_the_noise():
    x = np.random.default_rng(8).standard_normal(3000)
    x[::6] *= 2.5
    assert not heavy_tails(x)
    assert heavy_tails(x, 0.01)
    x = np.random.default_rng(8).standard_normal(3000)
    x[::300] += 12.0
    assert not heavy_tails(x, 0.01)
