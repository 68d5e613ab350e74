"""Pictures by their geometry: what is connected, where the words are, and what the bars show."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from simbench.detectors.record import LoopRecord
from simbench.gap.report.pictures import (
    LOOK,
    _limits,
    draw_gap,
    draw_loops,
    draw_traces,
    fill_ranking,
)
from simbench.gap.report.view import BASELINE, FIXED, NEAREST, RECORD, SHOWN, TUNED

RNG = np.random.default_rng(0)


def trace(scale=1.0, mv=True):
    op, pv = (50.0 + scale * RNG.standard_normal(800) for _ in range(2))
    return LoopRecord(op=op, pv=pv, sp=np.full(800, 50.0), mv=op if mv else None, Ts=1.0)


def test_the_axes_hold_the_record_and_what_is_near():
    record = np.array([0.0, 10.0])
    assert _limits([record]) == pytest.approx((-0.4, 10.4))
    assert _limits([record, np.array([-5.0, 16.0])]) == pytest.approx((-5.4, 16.4))
    assert _limits([record, np.array([-90.0, 900.0])]) == pytest.approx((-20.4, 30.4))
    assert _limits([np.array([3.0, 3.0])]) == pytest.approx((2.96, 3.04))


def test_bars_are_as_long_as_their_numbers_from_the_top_down():
    axes = Figure().add_subplot()
    fill_ranking(axes, {"stiction": 0.91, "noise": 0.05})
    assert [p.get_width() for p in axes.patches] == pytest.approx([0.91, 0.05])
    assert axes.patches[0].get_y() > axes.patches[1].get_y()
    assert [t.get_text() for t in axes.texts] == ["0.91", "0.05"]
    assert 1.0 < axes.get_xlim()[1] < 1.3
    gap = draw_gap({"before": 4.0, "after": 1.2, "floor": 0.9, "plant floor": 1.1}).axes[0]
    assert [p.get_width() for p in gap.patches] == pytest.approx([4.0, 1.2, 0.9, 1.1])
    assert gap.lines[0].get_xdata() == pytest.approx([1.1, 1.1])
    assert 4.0 < gap.get_xlim()[1] < 5.0


DRAWN = {
    "traces": lambda runs: draw_traces("PV", runs, slice(300)),
    "loops": lambda runs: draw_loops("PV", runs, slice(300)),
}  # fmt: skip


@pytest.mark.parametrize(
    ("draw", "high"),
    # an inch or so for each panel, and what the axes' words need
    [("traces", 0.5 + 5 * 1.15), ("loops", 0.3 + 3 * 1.85)],
)
def test_pictures_fit_on_a_phone_and_every_line_has_the_colour_of_its_loop(draw, high):
    runs = {name: trace() for name in (RECORD, BASELINE, TUNED, FIXED, NEAREST)}
    figure = DRAWN[draw](runs)
    assert figure.get_size_inches() == pytest.approx((4.6, high))
    colours = set(LOOK.values())
    for line in (line for axes in figure.axes for line in axes.lines):
        assert 0.6 <= line.get_linewidth() <= 2.0
        assert (line.get_alpha() or 1.0) >= 0.8
        assert to_hex(line.get_color()).upper() in colours | {"#6E6E6E"}
    # what the record shows takes the place of the effect, never beside it
    assert len(colours) == len(LOOK) - 2 == 5
    assert LOOK[SHOWN] == LOOK[FIXED]


@pytest.mark.parametrize(("signal", "up", "lines"), [("PV", "PV", 2), ("OP", "OP (%)", 1)])
def test_traces_have_a_named_panel_each_and_a_set_point_under_pv_only(signal, up, lines):
    runs = {RECORD: trace(), BASELINE: trace(), FIXED: trace()}
    panels = draw_traces(signal, runs, slice(100, 300)).axes
    assert [len(a.lines) for a in panels] == [lines] * 3
    assert [a.get_ylabel() for a in panels] == [up] * 3
    assert [a.get_title(loc="left") for a in panels] == [RECORD, BASELINE, FIXED]
    assert [a.get_xlabel() for a in panels] == ["", "", "time (s)"]
    assert panels[0].lines[-1].get_xdata()[[0, -1]].tolist() == [100.0, 299.0]
    assert draw_loops("MV", runs, slice(800)).get_supylabel() == "MV (%)"


@pytest.mark.parametrize(("share", "warns"), [(0.45, False), (0.55, True)])
@pytest.mark.parametrize(("far", "word"), [(1000.0, "1e+03"), (-1000.0, "-1e+03")])
def test_a_simulation_that_runs_away_is_marked(share, warns, far, word):
    record, beyond = trace(), np.arange(800) < share * 800
    away = trace().with_signals(lambda x: np.where(beyond, far, x))
    for draw in (draw_traces, draw_loops):
        axes = draw("PV", {RECORD: record, FIXED: away}, slice(800)).axes[1]
        words = [t.get_text() for t in axes.texts]
        assert words == [f"runs beyond these axes,\nto {word}"] * warns
