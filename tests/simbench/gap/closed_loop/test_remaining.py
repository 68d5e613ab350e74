"""What remains between a record and its simulations: nothing of its own loop; in numbers of the
plant what another loop lacks.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from simbench.gap.closed_loop.gap import held_out, measure, simulate_runs
from simbench.gap.closed_loop.remaining import remaining
from simbench.gap.closed_loop.summary_features import features
from simbench.gap.intake.check import check
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
        "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
        "sampling": {"Ts": 2.0, "n": 1500},
        "noise": {"std": 0.2},
        "disturbance": [{"type": "coloured", "amplitude": 1, "period": 30}],
    }
)


def left(record, loop=LOOP):
    situation = check(record, LOOP, trusted=False)
    runs = simulate_runs(situation, loop, 0)
    return {
        one.feature: one for one in remaining(situation, measure(situation, *[runs] * 3).features)
    }


def test_of_a_loop_itself_nothing_remains():
    assert left(simulate(LOOP, 9).record) == {}


def test_samples_that_stand_are_counted_and_the_simulated_ones_beside_them():
    record = simulate(LOOP, 9).record
    high = np.minimum(record.op, np.quantile(record.op, 0.7))
    found = left(replace(record, op=high))
    one = found["share of samples of OP at its largest or smallest value (%)"]
    assert one.recorded == pytest.approx(30.0, abs=6.0)
    assert one.simulated[1] < 1.0
    assert one.block == "controller"


def test_sizes_are_in_pv_units_and_sorted_by_distance():
    record = simulate(LOOP, 9).record
    wide = record.pv.mean() + 3.0 * (record.pv - record.pv.mean())
    found = left(replace(record, pv=wide))
    one = found["standard deviation of PV (PV units)"]
    late = slice(held_out(SimpleNamespace(record=record)), None)
    assert one.recorded == pytest.approx(np.std(wide[late]), rel=0.01)
    assert one.simulated[0] == pytest.approx(np.std(record.pv), rel=0.3)
    far = [d.distance for d in found.values()]
    assert far == sorted(far, reverse=True)


@pytest.mark.parametrize(("distance", "recorded", "shown"), [
    (3.1, 2.0, True), (2.9, 2.0, False), (3.1, 1.0, False),
])  # fmt: skip
def test_a_difference_counts_from_three_standard_deviations_beyond_what_the_simulations_do(
    distance, recorded, shown
):
    s = SimpleNamespace(record=SimpleNamespace(n=400, Ts=2.0, S_unit="%"))
    one = SimpleNamespace(recorded=recorded, lo=0.5, hi=1.5, distance=distance)
    # of neighbouring lags the farthest stands for all
    near = SimpleNamespace(recorded=recorded, lo=0.5, hi=1.5, distance=distance - 0.05)
    found = remaining(s, {"op memory 3": near, "op memory 10": one})
    assert [d.feature for d in found] == ["correlation of OP with itself 20 s before"] * shown


def test_a_band_has_its_periods_and_the_size_of_what_swings_in_it():
    n, Ts = 1500, 2.0
    rng = np.random.default_rng(4)
    white = rng.standard_normal((9, n))
    # periods of 8 to 16 s alone, in a band of its own between 9.6 and 19 s
    sos = butter(6, (1 / 16, 1 / 12), "bandpass", fs=1 / Ts, output="sos")
    wave = 5.0 * sosfilt(sos, rng.standard_normal(n))
    s = SimpleNamespace(record=SimpleNamespace(n=n, Ts=Ts, S_unit="%"))
    late, sp = slice(held_out(s), None), np.zeros(n)
    pv = np.vstack([white[:1] + wave, white[1:]])[:, late]
    values = features(white[:, late], pv, sp[late])
    compared = {
        name: SimpleNamespace(recorded=x[0], lo=x[1:].min(), hi=x[1:].max(), distance=9.0)
        for name, x in values.items()
        if name.startswith("pv band") and x[0] > x[1:].max() + 1.0
    }
    (one,) = remaining(s, compared)
    assert "standard deviation of PV at periods of" in one.feature
    low, high = (
        float(x) for x in one.feature.split("periods of ")[1].split(" s ")[0].split(" to ")
    )
    assert low < 16.0
    assert high > 12.0
    assert one.recorded == pytest.approx(np.std(wave[late]), rel=0.25)
