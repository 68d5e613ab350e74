"""Pictures by their geometry: what is connected, where the words are, and what the bars show."""

import numpy as np
import pytest

from simbench.detectors.record import LoopRecord
from simbench.gap.report.pictures import (
    draw_loops,
    draw_traces,
)
from simbench.gap.report.view import FIXED, RECORD

RNG = np.random.default_rng(0)


def trace(scale=1.0, mv=True):
    op, pv = (50.0 + scale * RNG.standard_normal(800) for _ in range(2))
    return LoopRecord(op=op, pv=pv, sp=np.full(800, 50.0), mv=op if mv else None, Ts=1.0)


@pytest.mark.parametrize(("share", "warns"), [(0.45, False), (0.55, True)])
@pytest.mark.parametrize(("far", "word"), [(1000.0, "1e+03"), (-1000.0, "-1e+03")])
def test_a_simulation_that_runs_away_is_marked(share, warns, far, word):
    record, beyond = trace(), np.arange(800) < share * 800
    away = trace().with_signals(lambda x: np.where(beyond, far, x))
    for draw in (draw_traces, draw_loops):
        axes = draw("PV", {RECORD: record, FIXED: away}, slice(800)).axes[1]
        words = [t.get_text() for t in axes.texts]
        assert words == [f"runs beyond these axes,\nto {word}"] * warns
