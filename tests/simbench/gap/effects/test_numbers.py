"""From a fit to the numbers of the loop file, and what an effect takes for its own: cases with
known answers.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from effect_draws import DRAWS, Yardstick, between
from scipy.stats import norm, t

from simbench.gap.effects import (
    Recogniser,
    load_drift,
    load_steps,
    oscillation,
    outliers,
    recogniser,
)
from simbench.gap.effects._lattice import levels_of
from simbench.gap.effects._recogniser import clip
from simbench.gap.likelihood import kernels

PLANT = {"K": -2.0, "T": 20.0, "Td": 5.0}
DATA = SimpleNamespace(n=1000, K=2.0, T=10.0, Td=4.0, noise=0.2)
SITUATION = SimpleNamespace(data=DATA, record=SimpleNamespace(Ts=2.0))


def fit(K=1.0, own=(), jumps=(), lasting=True, **theta):
    """Return a fit with gain K, its bias and onset, and an effect's own linear numbers."""
    spec = SimpleNamespace(jumps=jumps, lasting=lasting, pole="")
    return SimpleNamespace(K=K, beta=np.array([K, 0.3, 0.7, *own]), theta=theta, spec=spec)


@pytest.mark.parametrize(
    ("effect", "found", "numbers"),
    [
        ("valve_lag", fit(tau=3.0), {"tau": 6.0}),
        ("extra_lag", fit(tau=3.0), {"tau": 6.0}),
        ("sensor_lag", fit(tau=3.0), {"tau": 6.0}),
        ("dead_time_mismatch", fit(Td=7.0), {"extra": 6.0}),
        ("dead_time_mismatch", fit(Td=1.0), {"extra": -6.0}),
        ("time_constant_mismatch", fit(T=30.0), {"factor": 3.0}),
        ("time_constant_mismatch", fit(T=300.0), {"factor": 20.0}),
        ("gain_mismatch", fit(K=0.5), {"factor": 0.25}),
        ("gain_mismatch", fit(K=0.01), {"factor": 0.05}),
        ("noise", fit(noise_std=0.5), {"factor": 2.5}),
        ("stiction", fit(S=5.0, J=2.0), {"S": 5.0, "J": 2.0}),
        ("deadzone", fit(D=3.0, c=50.0), {"D": 3.0, "c": 50.0}),
        ("valve_characteristic", fit(R=0.001), {"R": 0.01}),
        ("drift", fit(own=(40.0,), walk=0.3), {"rate": 0.02, "walk": 0.3 / np.sqrt(2.0)}),
        (
            "load_drift",
            fit(K=-0.5, own=(40.0,), load_walk=0.3),
            {"rate": -0.04, "walk": 0.6 / np.sqrt(2.0)},
        ),
    ],
)
def test_a_fits_numbers_are_those_of_the_loop_file(effect, found, numbers):
    assert recogniser(effect).numbers(found, SITUATION) == pytest.approx(numbers)


def test_a_sine_on_pv_is_as_large_at_the_input_as_the_plant_makes_it_small():
    # 3-4-5: amplitude 5; at a period of 2 pi T the pole takes a factor of the root of 2
    found = recogniser("oscillation").numbers(
        fit(K=2.0, own=(3.0, 4.0), period=20 * np.pi, T=10.0), SITUATION
    )
    assert found == pytest.approx({"amplitude": 2.5 * np.sqrt(2.0), "period": 40 * np.pi})
    vessel = SimpleNamespace(data=SimpleNamespace(T=0.0, K=2.0), record=SITUATION.record)
    found = recogniser("oscillation").numbers(fit(K=2.0, own=(3.0, 4.0), period=20 * np.pi), vessel)
    assert found["amplitude"] == pytest.approx(0.25)


@pytest.mark.parametrize("effect", ["oscillation", "load_drift", "load_steps"])
def test_a_load_behind_a_valve_that_never_moved_has_a_size(effect):
    still = fit(
        K=0.0, own=(3.0, 4.0), jumps=(200,), period=60.0, T=10.0, load_walk=0.3, load_jump=8.0
    )
    assert all(np.isfinite(x) for x in recogniser(effect).numbers(still, SITUATION).values())


def test_load_steps_are_counted_and_sized_in_percent_of_op():
    found = load_steps.numbers(fit(K=-2.0, jumps=(200, 500, 700), load_jump=8.0), SITUATION)
    # two parts of 8 are a jump of 8 sqrt(2), between levels that spread by 8: 4 % at the input
    assert found == pytest.approx({"rate": 3 / 2000.0, "size": 4.0})


@pytest.mark.parametrize(
    ("beside", "height", "lasting", "ordinary"),
    [
        (0.5, 3.0, True, False),
        (0.24, 3.0, True, True),
        (0.26, 3.0, True, False),
        (0.5, 0.69, True, True),
        (0.5, 0.72, True, False),
        (0.5, 3.0, False, True),
    ],
)
def test_jumps_that_the_ordinary_load_may_make_are_ordinary(beside, height, lasting, ordinary):
    # a jump of two parts of .707 is one of twice a load of .5
    found = fit(jumps=(100, 200), lasting=lasting, load=beside, load_jump=height)
    assert load_steps.ordinary(found, fit(load=1.0)) == ordinary


@pytest.mark.parametrize("T", [0.0, 20.0])
def test_a_load_drifts_by_a_ramp_that_enters_before_the_plant(T):
    seen, walks = [], []

    class Engine:
        data = SimpleNamespace(n=1001, T=T, y=np.linspace(0.0, 1.0, 1001))

        def grid(self, spec, theta, points):
            walks.append([p["load_walk"] for p in points])
            return [SimpleNamespace(theta=theta | points[-1])]

        def fit(self, spec, theta):
            seen.append(spec.channels)
            return theta

    spec = SimpleNamespace(join=lambda other: other)
    _, count = load_drift.fit(Engine(), SimpleNamespace(spec=spec, theta={"T": T}))
    ((line,),) = seen
    assert count == 2.0
    # from next to nothing to all that PV (or what moves a vessel) does within the record
    size = 1.0 / np.sqrt(12.0) if T else 0.0
    assert np.ravel(walks)[[0, -1]] == pytest.approx(
        size / np.sqrt(1001.0) * np.array([1e-3, 1.0]), rel=2e-3, abs=1e-12
    )
    assert line[0] == pytest.approx(0.0, abs=1e-12)
    if T:
        # a ramp of one in a thousand samples comes through a first-order plant T late
        assert np.diff(line)[300:] == pytest.approx(1e-3, rel=1e-3)
        assert 1000 - 1000 * line[-1] == pytest.approx(T + 0.5, abs=0.1)
    else:
        assert line[-1] == pytest.approx(500.0, rel=2e-3)


@pytest.mark.parametrize(
    ("after", "gone"), [(0.0, True), (0.45, True), (0.55, False), (1.0, False)]
)
def test_a_spike_is_gone_a_sample_later_and_a_step_is_not(after, gone):
    pv = np.zeros(50)
    pv[20], pv[21:] = 3.0, 3.0 * after
    assert outliers._gone_again(pv, 20) == gone
    assert not outliers._gone_again(pv, 0)
    assert not outliers._gone_again(pv, 49)


def innovations(height, count, neighbour=0.0):
    rng = np.random.default_rng(5)
    x = np.clip(rng.standard_normal(3000), -3.5, 3.5)
    places = np.linspace(200, 2800, count).astype(int)
    x[places] = height
    x[places + 1] = neighbour * height
    return x, places


@pytest.mark.parametrize(
    ("height", "count", "neighbour", "found"),
    [
        (9.0, 12, 0.0, True),
        (9.0, 2, 0.0, False),
        (9.0, 3, 0.0, True),
        (5.0, 12, 0.65, True),
        (5.0, 12, 0.75, False),
        (3.5, 12, 0.0, False),
        (5.0, 12, 0.0, True),
    ],
)
def test_spikes_are_a_mixture_where_they_are_large_alone_and_several(
    height, count, neighbour, found
):
    x, places = innovations(height, count, neighbour)
    pv = np.zeros(x.size)
    pv[places] = height
    s = SimpleNamespace(record=SimpleNamespace(pv=pv), law=SimpleNamespace(known=False))
    score = outliers.by_innovations(SimpleNamespace(residual=x, theta={"noise_std": 0.1}), s)
    assert (score is not None) == found
    if score is not None:
        gain, p = score
        assert gain > 0.0 or height < 6.0 or count < 4
        assert p["rate"] == pytest.approx(count / (x.size - kernels.SKIP), rel=0.01)
        assert p["size"] == pytest.approx(0.1 * height, rel=0.05)
        assert p["at"] == "record"


def test_levels_are_counted_and_spaced_and_a_fine_signal_has_none():
    rng = np.random.default_rng(0)
    said = levels_of(0.5 * np.round(rng.normal(0.0, 2.0, 500)), rng.normal(0.0, 1.0, 500))
    assert said.startswith("500 samples on ")
    assert "0.5 apart" in said
    assert levels_of(rng.normal(0.0, 1.0, 500), rng.normal(0.0, 1.0, 500)) == ""


def test_sizes_run_geometrically_from_barely_to_grossly():
    assert [between(x, 0.5, 8.0) for x in (0.0, 0.5, 1.0)] == pytest.approx([0.5, 2.0, 8.0])
    assert [clip(x, 0.05, 20.0) for x in (0.0, 3.0, 99.0)] == [0.05, 3.0, 20.0]


YARDSTICK = SimpleNamespace(
    op=2.0,
    op_change=0.5,
    pv=0.3,
    noise=0.1,
    lag=24.0,
    pace=20.0,
    gain=1.5,
    Td=4.0,
    seconds=1000.0,
    integral=True,
    record=SimpleNamespace(Ts=1.0, op=np.random.default_rng(0).normal(50.0, 2.0, 2000)),
)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("effect", DRAWS)
def test_a_drawn_effect_grows_from_barely_there_to_gross(effect, seed):
    draw = DRAWS[effect]
    assert draw is not None
    size = draw(YARDSTICK, np.random.default_rng(seed))
    sizes = [size(x) for x in (0.0, 0.5, 1.0)]
    numbers = {k: [p[k] for p in sizes] for k in sizes[0] if not isinstance(sizes[0][k], str)}
    growth = {k: abs(np.diff(v)) for k, v in numbers.items() if len(set(v)) > 1}
    assert growth, "nothing grows"
    for k, v in numbers.items():
        assert list(v) in (sorted(v), sorted(v, reverse=True)), k


@pytest.mark.parametrize(
    ("effect", "name", "low", "high"),
    [
        ("valve_lag", "tau", 0.72, 192.0),
        ("extra_lag", "tau", 0.72, 192.0),
        ("sensor_lag", "tau", 0.72, 192.0),
        ("compression", "band", 0.01, 1.5),
        ("error_deadband", "width", 0.06, 6.0),
        ("quantisation", "step", 0.01, 3.0),
        ("op_quantisation", "step", 0.05, 9.0),
        ("stiction", "S", 0.4, 25.0),
        ("deadzone", "D", 0.4, 20.0),
        ("outliers", "size", 0.75, 12.0),
        ("deadband", "S", 0.4, 30.0),
        ("load_steps", "size", 0.4, 20.0),
        ("oscillation", "amplitude", 0.1, 20.0),
    ],
)
def test_barely_and_grossly_are_measured_by_the_loop(effect, name, low, high):
    # OP moves by 2 % (0.5 % a sample), PV by 0.3 and by a noise of 0.1, within 24 s
    size = DRAWS[effect](YARDSTICK, np.random.default_rng(1))
    assert [size(0.0)[name], size(1.0)[name]] == pytest.approx([low, high])


@pytest.mark.parametrize(
    ("effect", "high"),
    [("gain_mismatch", 6.0), ("time_constant_mismatch", 8.0), ("valve_characteristic", 90.0)],
)
def test_factors_are_drawn_either_way(effect, high):
    ends = {
        float(next(iter(DRAWS[effect](YARDSTICK, np.random.default_rng(s))(1.0).values())))
        for s in range(20)
    }
    assert sorted(ends) == pytest.approx([1.0 / high, high])


@pytest.mark.parametrize("seed", range(8))
def test_saturation_cuts_off_the_share_that_is_drawn(seed):
    size, op = (
        DRAWS["saturation"](YARDSTICK, np.random.default_rng(seed)),
        YARDSTICK.record.op,
    )
    for x, share in ((0.0, 0.0005), (0.5, 0.015), (1.0, 0.45)):
        p = size(x)
        assert p["lo"] < p["hi"]
        for cut in (np.mean(op < p["lo"]), np.mean(op > p["hi"])):
            assert cut == 0.0 or cut == pytest.approx(share, abs=1.5e-3)
        assert p["lo"] > 0.0 or p["hi"] < 100.0


def test_a_jump_is_drawn_from_a_tenth_of_the_band_to_all_of_it():
    draws = [DRAWS["stiction"](YARDSTICK, np.random.default_rng(s))(0.5) for s in range(60)]
    shares = [p["J"] / p["S"] for p in draws]
    assert 0.1 <= min(shares) < 0.2
    assert 0.9 < max(shares) <= 1.0


class Sines:
    """An engine whose likelihood is what is left of one signal beside the channels."""

    def __init__(self, signal):
        self.signal, self.data = signal, SimpleNamespace(n=signal.size)

    def evaluate(self, spec, theta):
        X = np.column_stack(spec.channels)
        left = self.signal - X @ np.linalg.lstsq(X, self.signal, rcond=None)[0]
        return (-0.5 * float(left @ left),)

    def fit(self, spec, theta, search):
        return SimpleNamespace(loglik=self.evaluate(spec, theta)[0], spec=spec, theta=dict(theta))


@pytest.mark.parametrize("period", [7.3, 41.7, 190.0])
def test_the_period_of_a_sine_in_the_innovations_is_found(period):
    signal = 0.8 * np.sin(2 * np.pi * np.arange(1000) / period + 1.0) + np.random.default_rng(
        0
    ).standard_normal(1000)
    base = SimpleNamespace(
        residual=signal, spec=SimpleNamespace(join=lambda other: other), theta={"load": 1.0}
    )
    found, count = oscillation.fit(Sines(signal), base)
    # periods in the record
    assert 1000 / found.theta["period"] == pytest.approx(1000 / period, abs=0.1)
    assert found.loglik > -0.5 * 1.1 * 1000
    assert count == 4.0
    assert found.theta["load"] == 0.5


@pytest.mark.parametrize(
    ("effect", "name", "ends"),
    [
        ("drift", "rate", {(0.0006, 0.18)}),
        ("drift", "walk", {(0.3 / np.sqrt(1000.0), 180 / np.sqrt(1000.0))}),
        ("load_drift", "rate", {(0.0006, 0.04)}),
        ("load_drift", "walk", {(0.2 / np.sqrt(1000.0), 20 / np.sqrt(1000.0))}),
        ("dead_time_mismatch", "extra", {(0.72, 96.0), (-0.4, -4.0)}),
        ("noise", "factor", {(1.05, 12.0), (0.95, 0.05)}),
        ("detuning", "Kc_factor", {(1.05, 6.0), (1 / 1.05, 1 / 6.0), (1.0, 1.0)}),
        ("detuning", "Ti_factor", {(1.1, 8.0), (1 / 1.1, 1 / 8.0), (1.0, 1.0)}),
    ],
)
def test_kinds_and_ways_are_all_drawn_and_each_from_barely_to_grossly(effect, name, ends):
    # a ramp on PV is measured by what OP does through the gain of 1.5: 3 units within 1000 s
    sizes = [DRAWS[effect](YARDSTICK, np.random.default_rng(s)) for s in range(60)]
    found = {(float(size(0.0)[name]), float(size(1.0)[name])) for size in sizes}
    if name == "rate":
        assert {np.sign(low) for low, _ in found} == {-1.0, 0.0, 1.0}
        found = {(abs(low), abs(high)) for low, high in found}
    if name in ("rate", "walk"):
        assert (0.0, 0.0) in found
        found -= {(0.0, 0.0)}
    found = sorted({(round(low, 9), round(high, 9)) for low, high in found})
    assert len(found) == len(ends)
    for got, expected in zip(found, sorted(ends)):
        assert got == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("integral", [True, False])
def test_a_proportional_controller_has_no_integral_to_detune(integral):
    loop = SimpleNamespace(**{**vars(YARDSTICK), "integral": integral})
    factors = {
        DRAWS["detuning"](loop, np.random.default_rng(s))(1.0)["Ti_factor"] for s in range(30)
    }
    assert factors == ({1.0, 8.0, 1 / 8.0} if integral else {1.0})


@pytest.mark.parametrize("unit", [0.2, 1.0, 3.0])
def test_evidence_for_spikes_has_no_unit(unit):
    x, places = innovations(9.0, 12)
    pv = np.zeros(x.size)
    pv[places] = 9.0
    s = SimpleNamespace(record=SimpleNamespace(pv=pv), law=SimpleNamespace(known=True))
    gain, p = outliers.by_innovations(
        SimpleNamespace(residual=unit * x, theta={"noise_std": 0.1}), s
    )
    assert gain == pytest.approx(
        outliers.by_innovations(SimpleNamespace(residual=x, theta={"noise_std": 0.1}), s)[0]
    )
    # twelve samples of nine standard deviations: some 12 x 81/2 nats, less what heavy tails take
    # back
    assert 30.0 < gain < 300.0
    assert p["at"] == "loop"


def test_a_dead_zone_is_drawn_where_op_is():
    centres = [DRAWS["deadzone"](YARDSTICK, np.random.default_rng(s))(0.5)["c"] for s in range(100)]
    assert np.mean(centres) == pytest.approx(50.0, abs=0.8)
    assert np.std(centres) == pytest.approx(2.0, rel=0.25)


@pytest.mark.parametrize(
    ("k", "found"), [(6, True), (400, True), (990, True), (3, False), (997, False)]
)
def test_a_load_jump_is_placed_where_it_is_but_at_no_end_of_the_record(k, found):
    n = 1000
    theta = {
        "T": 5.0,
        "load_time": 20.0,
        "load_lag": 0.5,
        "load": 0.5,
        "noise_std": 0.1,
        "colour": 0.1,
    }
    # PV answers a jump one sample later
    response = 1.0 - np.exp(-np.arange(n) / 5.0)
    white = kernels.whiten(response[None, :], 5.0, 0.0, 20.0, 0.5, 0.5, 0.0, 0.0, 0.1, 0.1, 10.0)[
        0
    ][0]
    residual = 0.02 * np.random.default_rng(0).standard_normal(n)
    residual[k:] += 5.0 * white[: n - k]
    engine = SimpleNamespace(data=SimpleNamespace(n=n, T=5.0), spread=10.0)
    places, heights = load_steps._jumps(engine, SimpleNamespace(theta=theta, residual=residual))
    assert (places[0] == k) == found
    assert all(5 <= place < n - 5 for place in places)
    if found:
        # what is left once the jump is taken out is a hundredth of it
        assert heights * np.sqrt(len(places)) == pytest.approx(5.0, rel=0.1)


def test_kc_and_ti_are_detuned_alone_and_together_each_way():
    def ways(loop):
        drawn = [DRAWS["detuning"](loop, np.random.default_rng(s))(1.0) for s in range(120)]
        return {(np.sign(np.log(p["Kc_factor"])), np.sign(np.log(p["Ti_factor"]))) for p in drawn}

    assert ways(YARDSTICK) == {(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)} - {(0, 0)}
    assert ways(SimpleNamespace(**{**vars(YARDSTICK), "integral": False})) == {(1, 0), (-1, 0)}


@pytest.mark.parametrize(
    ("effect", "name", "low", "high"),
    [("load_steps", "rate", 4.0, 25.0), ("outliers", "rate", 2.0, 50.0)],
)
def test_so_many_events_are_drawn_for_a_thousand_seconds(effect, name, low, high):
    counts = [
        1000.0 * DRAWS[effect](YARDSTICK, np.random.default_rng(s))(0.5)[name] for s in range(200)
    ]
    assert low <= min(counts) < low + 0.05 * (high - low)
    assert high - 0.1 * (high - low) < max(counts) <= high


def test_the_period_of_a_drawn_oscillation_lies_within_the_loops_pace_and_twenty_times_that():
    periods = [
        DRAWS["oscillation"](YARDSTICK, np.random.default_rng(s))(0.5)["period"] for s in range(200)
    ]
    assert 20.0 <= min(periods) < 23.0
    assert 350.0 < max(periods) <= 400.0
    slow = SimpleNamespace(**{**vars(YARDSTICK), "pace": 1e-3})
    assert DRAWS["oscillation"](slow, np.random.default_rng(0))(0.5)["period"] == 4.0


def test_what_a_file_does_not_say_of_an_effect_adds_nothing():
    bare = Recogniser()
    assert (
        bare.initial_op_offset({"S": 3.0}),
        bare.mean_op_shift({"rate": 1.0}, 100.0, 2.0),
        bare.numbers(None, None),
    ) == (
        0.0,
        0.0,
        {},
    )
    assert bare.proven(None) is bare.by_innovations(None, None) is bare.smallest(None) is None
    assert bare.remark(None) == ""
    assert bare.possible(None)
    assert not bare.masked_by_archive(None)
    # an exact map leaves little of an ideal valve's misfit, friction most of it
    assert (bare.by_mv_leaves, recogniser("stiction").by_mv_leaves) == (0.3, 0.85)


def yardstick_of(op, e):
    record = SimpleNamespace(op=np.asarray(op), e=np.asarray(e), duration=600.0)
    return Yardstick(record, 0.1, 20.0, 20.0, 1.0, 4.0, True)


def test_a_yardstick_is_the_loops_own_size():
    y = yardstick_of(np.resize([50.0, 53.0], 100), np.resize([-1.0, 0.0, 1.0], 99))
    assert (y.op, y.seconds) == (1.5, 600.0)
    assert y.op_change == pytest.approx(np.std(np.diff(y.record.op)))
    # two of three lie one off the median
    assert y.pv == pytest.approx(1.4826)
    still = yardstick_of(np.full(100, 50.0), np.zeros(99))
    assert (still.op, still.op_change, still.pv) == (0.05, 1e-3, 0.0)


@pytest.mark.parametrize(("noise", "rounding", "band", "drowned"), [
    (0.1, None, 0.0, False), (0.1, (0.5, "loop"), 0.0, True), (0.1, None, 0.2, True),
])  # fmt: skip
def test_noise_is_not_judged_where_rounding_or_compression_makes_its_own(
    noise, rounding, band, drowned
):
    s = SimpleNamespace(archive=SimpleNamespace(rounding=rounding, band=band))
    assert recogniser("noise").masked_by_archive(s) == drowned


@pytest.mark.parametrize("height", [6.0, 9.0])
def test_evidence_for_spikes_is_that_of_rare_wide_gaussians_among_narrow_ones(height):
    x, places = innovations(height, 12)
    pv = np.zeros(x.size)
    pv[places] = height
    s = SimpleNamespace(record=SimpleNamespace(pv=pv), law=SimpleNamespace(known=True))
    gain, _ = outliers.by_innovations(SimpleNamespace(residual=x, theta={"noise_std": 0.1}), s)
    judged = x[kernels.SKIP :]
    narrow, rate = 1.4826 * np.median(np.abs(judged)), 12 / judged.size
    # all spikes are of one height here, which is then the wide one's standard deviation
    mixture = np.log(
        (1.0 - rate) * norm.pdf(judged, scale=narrow) + rate * norm.pdf(judged, scale=height)
    )
    tails = [
        t.logpdf(judged, nu, scale=s * np.std(judged)).sum()
        for nu in (6, 10, 20)
        for s in np.linspace(0.4, 1.0, 13)
    ]
    plain = max(norm.logpdf(judged, scale=np.std(judged)).sum(), *tails)
    assert gain == pytest.approx(float(np.sum(mixture) - plain) - np.log(judged.size), rel=1e-6)


def test_heavy_tails_of_the_noise_are_no_spikes():
    x = np.random.default_rng(5).standard_t(7, 3000)
    s = SimpleNamespace(record=SimpleNamespace(pv=x), law=SimpleNamespace(known=True))
    found = outliers.by_innovations(SimpleNamespace(residual=x, theta={"noise_std": 0.1}), s)
    assert found is None or found[0] < 0.0
