"""The learned reference: what it does not see, and the rows of its table."""

import numpy as np
import pytest

from results.studies.learned import PERIODS, POINTS, rows, window_of

T = np.arange(600) / 30.0  # 20 periods of 30 samples


def test_a_window_tells_neither_amplitude_nor_offset_nor_period():
    op, pv = np.sin(2 * np.pi * T), np.cos(2 * np.pi * T)
    plain = window_of(op, pv, 30.0)
    assert plain.shape == (2, PERIODS * POINTS)
    assert window_of(7.0 * op + 40.0, -0.01 * pv + 3.0, 30.0) == pytest.approx(
        plain * [[1.0], [-1.0]], abs=1e-9
    )
    slow = np.arange(1200) / 60.0
    slow = window_of(np.sin(2 * np.pi * slow), np.cos(2 * np.pi * slow), 60.0)
    # both end with their last sample, at another phase
    assert np.abs(np.fft.rfft(slow)) == pytest.approx(np.abs(np.fft.rfft(plain)), abs=3.0)
    assert np.argmax(np.abs(np.fft.rfft(slow)), axis=1) == pytest.approx([PERIODS, PERIODS])


@pytest.mark.slow
def test_the_table_has_a_row_for_home_and_away_and_every_method():
    table = rows(["smoke"], 24, 12, ["he"])
    assert [r["method"] for r in table] == ["random kernels", "no waveform", "he"]
    assert table[0]["learned on"] == "smoke, other seeds"
    assert len({r["n"] for r in table}) == 1
    assert all(0.0 <= float(r["cost"]) <= 1.0 for r in table)
