"""He 2007: triangle against sine."""

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.methods.he import triangle_indices
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.half_cycles import HALF_CYCLE_POINTS

POINT = (np.arange(HALF_CYCLE_POINTS) + 0.5) / HALF_CYCLE_POINTS
T = np.arange(4000) / 20


@pytest.mark.parametrize(
    ("hump", "eta", "two_line"),
    [
        (np.sin(np.pi * POINT), 0.0, 0.0),
        (np.minimum(POINT, 1 - POINT), 1.0, 0.99),
        (np.ones(HALF_CYCLE_POINTS), 0.340, 1.0),
    ],
)
def test_indices_of_the_three_waves(hump, eta, two_line):
    indices = triangle_indices(np.repeat(hump[None], 4, axis=0))
    assert indices[0] == pytest.approx(eta, abs=0.006)
    assert indices[1] == pytest.approx(two_line, abs=0.01)


def test_score_is_eta_and_orders_sine_mixture_triangle():
    triangle = np.arcsin(np.sin(T)) / (np.pi / 2)
    waves = [(1 - share) * np.sin(T) + share * triangle for share in (0.0, 0.3, 0.5, 0.8, 1.0)]
    verdicts = [judge(LoopRecord(wave, np.cos(T), 0.05), ["he"])[0] for wave in waves]
    assert [v.score for v in verdicts] == sorted(v.score for v in verdicts)
    assert all(v.score == v.indices["eta"] for v in verdicts)
    assert [verdicts[0].verdict, verdicts[-1].verdict] == ["no_stiction", "stiction"]
