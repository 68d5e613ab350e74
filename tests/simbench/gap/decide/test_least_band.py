"""A band narrower than three steps of MV's digits, or three standard deviations of its noise, is
none.
"""

import numpy as np
import pytest

from simbench.gap.decide.recorded_mv import _drop_narrow, least_band

RNG = np.random.default_rng(1)
WAVE = 50.0 + 5.0 * np.sin(np.arange(2000.0) / 40.0)


def test_digits_and_noise_set_the_least_band():
    assert least_band(np.round(WAVE, 1)) == pytest.approx(0.3, rel=0.4)
    noisy = WAVE + 0.2 * RNG.standard_normal(WAVE.size)
    assert least_band(noisy) == pytest.approx(0.6, rel=0.1)
    assert least_band(WAVE) < 0.02


def test_a_narrower_band_has_no_evidence_and_other_maps_keep_theirs():
    found = (90.0, {"S": 0.2, "J": 0.1})
    assert _drop_narrow("stiction", found, 0.3) == (0.0, {"S": 0.2, "J": 0.1})
    assert _drop_narrow("stiction", found, 0.1) == found
    assert _drop_narrow("valve_lag", (90.0, {"tau": 0.1}), 0.3)[0] == 90.0
