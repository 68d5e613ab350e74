"""The statements of the chapter about its figures, checked on the numbers drawn."""

import numpy as np
import pandas as pd
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.signal.half_cycles import split
from simbench.figures._folder import FIGURES
from simbench.loop.simulate import simulate


def wave_likeness(x: np.ndarray, period: float) -> dict[str, float]:
    """Mean correlation of the half cycles with a square, a half sine and a triangle."""
    humps = split(x - x.mean(), period)
    t = (np.arange(humps.shape[1]) + 0.5) / humps.shape[1]
    shapes = {
        "square": np.ones(t.size),
        "sine": np.sin(np.pi * t),
        "triangle": 1 - np.abs(2 * t - 1),
    }
    lengths = np.linalg.norm(humps, axis=1)
    return {
        name: float(np.mean(humps @ shape / lengths) / np.linalg.norm(shape))
        for name, shape in shapes.items()
    }


PANELS = {name: FIGURES.load(name).PANELS for name in ("fig_11_9", "fig_11_9_integrating")}
COLUMNS = {"fig_11_9": "Td_over_T", "fig_11_9_integrating": "Td_over_Ti"}


def cycle(drawn, name: str, i: int) -> pd.DataFrame:
    panel, ratio, jump = PANELS[name][i]
    d = drawn(name)
    return d[(d.panel == panel) & (d[COLUMNS[name]] == ratio) & (d.S_over_2J == jump)]


def samples_per_period(c: pd.DataFrame) -> float:
    return float(c["period (s)"].iloc[0] / np.diff(c["t (s)"].iloc[:2])[0])


@pytest.mark.parametrize("panel", ["a", "b"])
def test_pv_turns_from_square_over_sine_to_triangle_as_the_ratio_falls(drawn, panel):
    wanted = [i for i, p in enumerate(PANELS["fig_11_9"]) if p[0] == panel]
    alike = [
        wave_likeness(
            (c := cycle(drawn, "fig_11_9", i))["PV - SP"].to_numpy(), samples_per_period(c)
        )
        for i in wanted
    ]
    assert [max(a, key=a.__getitem__) for a in alike] == ["square", "sine", "triangle"]
    assert alike[0]["square"] > alike[1]["square"] > alike[2]["square"]
    assert alike[0]["triangle"] < alike[1]["triangle"] < alike[2]["triangle"]


@pytest.mark.parametrize("i", range(6))
def test_op_of_a_self_regulating_loop_is_most_like_a_triangle(drawn, i):
    c = cycle(drawn, "fig_11_9", i)
    alike = wave_likeness(c["OP (%)"].to_numpy(), samples_per_period(c))
    assert max(alike, key=alike.__getitem__) == "triangle"


@pytest.mark.parametrize("i", range(6))
def test_pv_of_an_integrating_loop_is_most_like_a_triangle(drawn, i):
    c = cycle(drawn, "fig_11_9_integrating", i)
    alike = wave_likeness(c["PV - SP"].to_numpy(), samples_per_period(c))
    assert max(alike, key=alike.__getitem__) == "triangle"


def test_example_11_3_verdicts_follow_w_Ti_though_no_valve_sticks(drawn):
    verdicts = drawn("fig_11_16").groupby("w_Ti").verdict.first()
    assert verdicts.to_dict() == {10.0: "no_stiction", 1.0: "no_decision", 0.1: "stiction"}


def test_a_dead_band_meets_the_integrating_loop_only(drawn):
    marks_ = drawn("fig_11_8").query("curve == 'intersection' and `J (%)` == 0")
    assert marks_.panel.tolist() == ["(b) integrating"]


def test_rho3_sees_the_first_two_shapes_and_misses_the_third(drawn):
    rho = drawn("fig_11_11").groupby("panel")[["rho1 (-)", "rho3 (-)"]].first()
    assert (rho["rho1 (-)"] > 0.25).all()
    assert (rho["rho3 (-)"] > 0.25).tolist() == [True, True, False]


def test_table_11_3_holds_but_for_the_two_cells_it_is_too_coarse_for(drawn):
    d = drawn("table_11_3").set_index(["process", "controller", "nonlinearity"])
    for cell, row in d.iterrows():
        share = row.cycled / row.simulated
        if cell == ("self-regulating", "P", "stick-slip"):
            assert 0.2 < share < 0.8
        elif cell == ("self-regulating", "PI", "dead-band"):
            assert 0.0 < share < 0.2
        else:
            assert share > 0.9 if row.table == "limit cycles" else share == 0.0


def test_the_cycles_drawn_are_called_stiction_where_the_chapter_says_so():
    figure = FIGURES.load("fig_11_17")
    record = simulate(figure.loop(), seed=1).record
    assert judge(record, ["he"])[0].verdict == "stiction"


def test_the_path_of_a_diagnosis_is_drawn(drawn, tmp_path):
    from simbench.detectors.errors import ParameterError
    from simbench.detectors.procedure import diagnose
    from simbench.figures import draw_path

    figure = FIGURES.load("fig_11_17")
    diagnosis = diagnose(simulate(figure.loop(), seed=1).record)
    draw_path(diagnosis, tmp_path / "path.svg")
    assert (tmp_path / "path.svg").read_text(encoding="utf-8").rstrip().endswith("</svg>")
    with pytest.raises(ParameterError, match=r"\.svg, \.png or \.pdf"):
        draw_path(diagnosis, tmp_path / "path.docx")


def test_table_11_1_marks_what_is_wrong_with_each_valve(drawn):
    d = drawn("table_11_1").set_index("parameter")
    figure = FIGURES.load("table_11_1")
    wrong = {
        name: [p.split(" (")[0] for p in d.index if not d.loc[p, f"{name}: ok"]]
        for name in figure.VALVES
    }
    assert wrong == {
        "good valve": [],
        "worn linkage": ["hysteresis"],
        "sticky, oversized": ["process gain", "stiction"],
    }
    assert d.loc["hysteresis (%)", "worn linkage"] == pytest.approx(4.5, abs=0.3)
    assert d.loc["noise band (%)", "good valve"] == pytest.approx(0.2, rel=0.3)
