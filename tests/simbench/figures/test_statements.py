"""The statements of the chapter about its figures, checked on the numbers drawn."""

import numpy as np
import pandas as pd
import pytest

from simbench.detectors.judge import judge
from simbench.detectors.signal.half_cycles import split
from simbench.figures._correlation import marks
from simbench.figures._fits import eta, half_cycle_fits
from simbench.figures._folder import FIGURES
from simbench.loop.simulate import simulate
from simbench.theory.predict import predict


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


def harmonics(x: np.ndarray, periods: int) -> np.ndarray:
    """Power of harmonics 1, 2, ... of a series of whole periods."""
    power = np.abs(np.fft.rfft(x - x.mean())) ** 2
    return power[periods : 20 * periods : periods]


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


@pytest.mark.parametrize("name", PANELS)
@pytest.mark.parametrize("i", range(6))
def test_mv_keeps_its_jumps(drawn, name, i):
    c = cycle(drawn, name, i)
    J = 5.0 / (2 * PANELS[name][i][2])
    jumps = np.abs(np.diff(c["MV (%)"]))
    assert np.count_nonzero(jumps > 0.9 * J) == 6, "three periods hold six slip jumps"


@pytest.mark.parametrize("name", PANELS)
@pytest.mark.parametrize("i", range(6))
@pytest.mark.parametrize("signal", ["OP (%)", "PV - SP"])
def test_a_symmetric_cycle_has_odd_harmonics_only(drawn, name, i, signal):
    power = harmonics(cycle(drawn, name, i)[signal].to_numpy(), periods=3)
    even, odd = power[1::2].sum(), power[0::2].sum()
    assert even / odd < 0.01


def test_a_sine_disturbance_leaves_no_harmonics(drawn):
    d = drawn("fig_11_13")
    trend = d[(d.panel == "no stiction") & (d.part == "trend")]
    for signal in ("OP (%)", "PV - SP"):
        power = harmonics(trend[signal].to_numpy(), periods=4)  # 800 samples of 0.5 s, period 100 s
        assert power[1:].sum() / power[0] < 0.01


def test_example_11_3_verdicts_follow_w_Ti_though_no_valve_sticks(drawn):
    verdicts = drawn("fig_11_16").groupby("w_Ti").verdict.first()
    assert verdicts.to_dict() == {10.0: "no_stiction", 1.0: "no_decision", 0.1: "stiction"}


def test_example_11_3_has_the_phase_shifts_of_the_text():
    figure = FIGURES.load("fig_11_16")
    for (w_Ti, (_, Kc)), shift in zip(figure.CASES.items(), (np.pi, 3 * np.pi / 4, np.pi / 2)):
        record = simulate(figure.loop(w_Ti, Kc)).record.window(6000, 12000)
        wave = np.exp(-2j * np.pi * record.t / figure.PERIOD)
        measured = abs(
            np.angle(
                ((record.op - record.op.mean()) @ wave) / ((record.pv - record.pv.mean()) @ wave)
            )
        )
        assert measured == pytest.approx(np.pi - np.arctan(1 / w_Ti), abs=0.02)
        assert measured == pytest.approx(shift, abs=0.12)


@pytest.mark.parametrize("name", ["fig_11_13", "fig_11_14", "fig_11_16"])
def test_indices_read_off_the_drawn_correlation_are_the_detectors(drawn, name):
    d = drawn(name)
    for column in ("panel", "w_Ti"):
        if column in d:
            parts = [part.dropna(subset=["Phi (-)"]) for _, part in d.groupby(column)]
            break
    else:
        parts = [d]
    for part in parts:
        points = marks(part)
        assert points.dtau == pytest.approx(part["dtau (-)"].iloc[0], abs=1e-6)
        assert points.drho == pytest.approx(part["drho (-)"].iloc[0], abs=1e-6)


def test_even_correlation_without_and_odd_correlation_with_stiction(drawn):
    d = (
        drawn("fig_11_13")
        .dropna(subset=["dtau (-)"])
        .groupby("panel")[["dtau (-)", "drho (-)"]]
        .first()
    )
    assert d.loc["no stiction", "dtau (-)"] < 1 / 3
    assert d.loc["no stiction", "drho (-)"] < 0.072
    assert d.loc["stiction", "dtau (-)"] > 2 / 3
    assert d.loc["stiction", "drho (-)"] > 1 / 3


@pytest.mark.parametrize("panel", ["(a) self-regulating", "(b) integrating"])
@pytest.mark.parametrize("J", [5.0, 2.0, 0.0])
def test_marked_intersections_are_what_predict_says(drawn, panel, J):
    figure, d = FIGURES.load("fig_11_8"), drawn("fig_11_8")
    marked = d[(d.panel == panel) & (d.curve == "intersection") & (d["J (%)"] == J)]
    balances = predict(figure.loop(panel, J))["describing_function"]
    assert len(marked) == len(balances)
    for mark, one in zip(marked.to_dict("records"), balances):
        assert mark["period (s)"] == pytest.approx(one["period"], rel=1e-6)
        assert mark["A (%)"] == pytest.approx(one["amplitude"], rel=1e-6)


def test_a_dead_band_meets_the_integrating_loop_only(drawn):
    marks_ = drawn("fig_11_8").query("curve == 'intersection' and `J (%)` == 0")
    assert marks_.panel.tolist() == ["(b) integrating"]


def test_marked_intersections_lie_on_both_curves(drawn):
    d = drawn("fig_11_8")
    for mark in d[d.curve == "intersection"].to_dict("records"):
        at = complex(mark["Re"], mark["Im"])
        for curve in (
            d[(d.panel == mark["panel"]) & (d.curve == "L")],
            d[(d.panel == mark["panel"]) & (d["J (%)"] == mark["J (%)"])],
        ):
            distance = np.abs(curve["Re"] + 1j * curve["Im"] - at)
            assert distance.nsmallest(2).iloc[-1] < 0.05 * abs(at)


def test_hysteresis_is_measured_on_mv_and_dead_band_on_op(drawn):
    figure, d = FIGURES.load("fig_11_4"), drawn("fig_11_4")
    full = d[d.part == "full traverse"]
    for panel, expected in (("(a) hysteresis", 15.0), ("(c) hysteresis + dead-band", 35.0)):
        low, high = figure.branches(full[full.panel == panel], "OP (%)", 50.0, "MV (%)")
        assert high - low == pytest.approx(expected)
    low, high = figure.branches(full[full.panel == "(b) dead-band"], "MV (%)", 25.0, "OP (%)")
    assert high - low == pytest.approx(20.0)


def test_dead_zone_has_no_memory_and_the_others_have(drawn):
    d = drawn("fig_11_4")
    for panel, part in d[d.part == "full traverse"].groupby("panel"):
        spread = part.groupby("OP (%)")["MV (%)"].agg(np.ptp)
        assert (spread.max() > 10) == (panel != "(d) dead-zone")


def test_a_sticky_valve_runs_through_the_three_phases_in_order(drawn):
    phase = drawn("fig_11_5").phase
    order = phase[phase != phase.shift()].tolist()
    # up: stick, jump, move, pause at D, jump, move; back: stick, jump, move; and the first reversal
    # again
    assert order == ["sticking", "jump", "motion"] * 3 + ["sticking"]


def test_stick_band_after_a_pause_is_J_and_after_a_reversal_S(drawn):
    d = drawn("fig_11_5")
    jumps = d.index[d.phase == "jump"]
    waits = [
        d[:i][(d.phase[:i] == "motion")].index.max() if (d.phase[:i] == "motion").any() else 0
        for i in jumps
    ]
    widths = [abs(d["OP (%)"][i - 1] - d["OP (%)"][w]) for i, w in zip(jumps, waits)]
    figure = FIGURES.load("fig_11_5")
    assert np.allclose(widths, [figure.S, figure.J, figure.S], atol=0.3)


def test_only_stiction_and_stribeck_hold_harder_at_rest_than_in_motion(drawn):
    d = drawn("fig_11_7")
    for panel, part in d.groupby("panel"):
        rest = part[part["velocity (mm/s)"] == 0]["friction (N)"].max()
        moving = part[part["velocity (mm/s)"] > 1e-9]["friction (N)"]
        assert (rest > moving.min() + 100) == (panel[:3] in ("(c)", "(d)"))
        assert np.allclose(part["friction (N)"].to_numpy(), -part["friction (N)"].to_numpy()[::-1])


def test_symbols_are_those_of_the_ramps_and_holds(drawn):
    d = drawn("fig_11_10")
    expected = {1: "I", 0: "S", -1: "D"}
    assert [expected[int(s)] for s in np.sign(np.diff(d["x (%)"]))] == d.symbol[1:].tolist()


def test_rho3_sees_the_first_two_shapes_and_misses_the_third(drawn):
    rho = drawn("fig_11_11").groupby("panel")[["rho1 (-)", "rho3 (-)"]].first()
    assert (rho["rho1 (-)"] > 0.25).all()
    assert (rho["rho3 (-)"] > 0.25).tolist() == [True, True, False]


def test_triangle_fits_a_sticky_loops_op_better_than_a_sine(drawn):
    d = drawn("fig_11_17")
    sine, triangle = (((d["signal"] - d[fit]) ** 2).mean() for fit in ("sine", "triangle"))
    assert triangle < sine / 2
    assert eta(d) == pytest.approx(sine / (sine + triangle))


@pytest.mark.parametrize(
    ("wave", "expected"), [(np.sin, 0.0), (lambda x: np.arcsin(np.sin(x)), 1.0)]
)
def test_drawn_fits_give_the_detectors_eta_on_pure_waves(wave, expected):
    x = wave(2 * np.pi * (np.arange(2000) + 0.3) / 80)
    assert eta(half_cycle_fits(x, 80.0)) == pytest.approx(expected, abs=0.02)


def test_most_points_of_the_ellipse_figure_lie_between_its_limits(drawn):
    d = drawn("fig_11_20")
    share = d["fitness (-)"].iloc[0]
    assert share >= 0.6
    # recomputed from the drawn curves: a point is inside the outer and outside the inner limit
    x0, y0 = (
        0.5 * (c.max() + c.min())
        for c in (d[d.curve == "ellipse"]["OP"], d[d.curve == "ellipse"]["PV"])
    )

    def angle_radius(name):
        part = d[d.curve == name]
        z = (part["OP"] - x0) + 1j * (part["PV"] - y0)
        return np.angle(z), np.abs(z)

    at, radius = angle_radius("data")
    inner, outer = (
        np.interp(at, *map(np.asarray, zip(*sorted(zip(*angle_radius(n))))), period=2 * np.pi)
        for n in ("inner limit", "outer limit")
    )
    assert np.mean((radius >= inner) & (radius <= outer)) == pytest.approx(share, abs=0.01)


def test_apparent_stiction_is_the_chord_through_the_centre_along_op(drawn):
    d = drawn("fig_11_20")
    ring = d[d.curve == "ellipse"]
    x0, y0 = (0.5 * (ring[c].max() + ring[c].min()) for c in ("OP", "PV"))
    sides = [ring[ring["OP"] > x0].sort_values("PV"), ring[ring["OP"] < x0].sort_values("PV")]
    at = [np.interp(y0, side["PV"], side["OP"]) for side in sides]
    assert np.ptp(at) == pytest.approx(d["S_apparent"].iloc[0], rel=1e-3)
    a, b, alpha = (d[c].iloc[0] for c in ("a (%)", "b (%)", "alpha (rad)"))
    assert np.ptp(at) == pytest.approx(
        2 * a * b / np.hypot(a * np.sin(alpha), b * np.cos(alpha)), rel=1e-3
    )  # Eq 11.15


def test_table_11_2_shapes_are_what_the_classifier_sees(drawn):
    agreement = drawn("table_11_2").groupby(["process", "action", "signal"]).agreement.first()
    assert (agreement >= 0.75).all()
    assert agreement.mean() > 0.95


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


def test_the_flow_chart_is_the_procedure(drawn):
    from simbench.detectors.procedure import CONCLUSIONS, FLOW

    d = drawn("fig_11_27")
    flow = [
        (step, answer, target)
        for step, (_, answers) in FLOW.items()
        for answer, target in answers.items()
    ]
    assert list(zip(d.source, d.answer, d.target)) == flow
    assert set(d[d.verdict != ""].target) == set(CONCLUSIONS)


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


def test_a_lower_gain_slows_a_stiction_cycle_and_keeps_its_amplitude(drawn):
    d = drawn("fig_11_24").groupby("Kc")[["period (s)", "amplitude (%)", "verdict"]].first()
    assert d["period (s)"][0.6] / d["period (s)"][1.0] > 1.5
    assert d["amplitude (%)"][0.6] == pytest.approx(d["amplitude (%)"][1.0], rel=0.1)
    assert d["verdict"][1.0] == "stiction"


def test_a_lower_gain_leaves_the_period_of_an_outside_oscillation(drawn):
    d = drawn("fig_11_25").groupby("Kc")[["period (s)", "amplitude (%)", "verdict"]].first()
    assert d["period (s)"][0.6] == pytest.approx(d["period (s)"][1.0], rel=0.01)
    assert d["amplitude (%)"][0.6] < 0.8 * d["amplitude (%)"][1.0]
    assert d["verdict"][1.0] == "no_stiction"


@pytest.mark.parametrize("name", ["fig_11_24", "fig_11_25"])
def test_periods_told_beside_the_gain_change_are_those_drawn(drawn, name):
    for _, part in drawn(name).groupby("Kc"):
        op = part["OP (%)"].to_numpy()[len(part) // 6 :]
        up = np.flatnonzero((op[:-1] < op.mean()) & (op[1:] >= op.mean()))
        assert np.diff(up).mean() == pytest.approx(part["period (s)"].iloc[0], rel=0.03)  # Ts = 1 s


def test_travel_test_finds_J_in_the_same_direction_and_S_reversed(drawn):
    d = drawn("fig_11_26")
    valve = FIGURES.load("fig_11_26").loop().valve.parameters
    assert valve["J"] <= d["J measured (%)"].iloc[0] <= valve["J"] + 0.2
    assert valve["S"] <= d["S measured (%)"].iloc[0] + 1e-9 <= valve["S"] + 0.2
    # the sums are those of the drawn steps
    for phase, name in ((1, "J"), (2, "S")):
        op = d["OP (%)"][(d.phase == phase) | (d.phase.shift(-1) == phase)]
        assert abs(op.iloc[-1] - op.iloc[0]) == pytest.approx(d[f"{name} measured (%)"].iloc[0])


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
