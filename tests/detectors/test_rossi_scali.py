"""Rossi & Scali 2005: relay answer against sine."""

import numpy as np
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.methods.rossi_scali import relay_index
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.half_cycles import HALF_CYCLE_POINTS, relays

POINT = (np.arange(HALF_CYCLE_POINTS) + 0.5) / HALF_CYCLE_POINTS
T = np.arange(4000) / 20


@pytest.mark.parametrize(
    ("hump", "low", "high"),
    [
        (np.sin(np.pi * POINT), -1.0, -0.99),
        (np.minimum(POINT, 1 - POINT), 0.99, 1.0),
        (np.ones(HALF_CYCLE_POINTS), 0.85, 1.0),
    ],
)
def test_index_of_sine_triangle_and_square(hump, low, high):
    assert low <= relay_index(np.repeat(hump[None], 4, axis=0)) <= high


def test_index_is_one_for_every_relay_answer():
    for shape in relays()[::10]:
        assert relay_index(np.repeat(shape[None], 4, axis=0)) > 0.99


def test_verdict_and_score_follow_the_index_and_the_index_the_wave():
    triangle = np.arcsin(np.sin(T)) / (np.pi / 2)
    verdicts = [
        judge(
            LoopRecord(np.cos(T), (1 - share) * np.sin(T) + share * triangle, 0.05), ["rossi_scali"]
        )[0]
        for share in np.linspace(0, 1, 11)
    ]
    indices = [v.indices["eta_rossi"] for v in verdicts]
    assert indices == sorted(indices)
    for verdict in verdicts:
        index = verdict.indices["eta_rossi"]
        word = "stiction" if index > 0.21 else "no_stiction" if index < -0.21 else "no_decision"
        assert verdict.verdict == word
        assert verdict.score == pytest.approx((1 + index) / 2)
