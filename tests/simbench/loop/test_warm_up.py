"""`sampling.warm_up`: samples that are simulated before the record begins, and dropped."""

import numpy as np
import pytest

from simbench.bench.scenario.oracle import judge_oracle
from simbench.bench.scenario.truth import simulate_with_truth
from simbench.loop.simulate import simulate, simulate_batch, valve_tail
from simbench.scenarios.spec import Loop, Scenario

WARM_UP, N = 137, 400


def loop(**more):
    return Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
            "controller": {"type": "PI", "Kc": 1, "Ti": 10},
            "valve": {"model": "choudhury", "S": 5, "J": 2},
            "sampling": {"Ts": 1, "n": N, "warm_up": WARM_UP},
            "noise": {"std": 0.1},
            "setpoint": {"value": 50, "steps": [[0, 53], [200, 52]]},
            "disturbance": [{"type": "random_walk", "amplitude": 1, "period": 60, "at": "input"}],
            **more,
        }
    )


def whole(given):
    return given.with_("sampling", {"Ts": 1, "n": WARM_UP + N})


@pytest.mark.parametrize(
    "more", [{}, {"disturbance": []}, {"effect": [{"name": "compression", "band": 0.2}]}]
)
def test_a_record_is_the_end_of_the_longer_run_bit_by_bit(more):
    run, longer = simulate(loop(**more), 3), simulate(whole(loop(**more)), 3)
    assert run.record.n == N
    for name in ("op", "pv", "sp", "mv"):
        assert (getattr(run.record, name) == getattr(longer.record, name)[WARM_UP:]).all()
    for name in ("mv", "load_in", "load_out"):
        assert (getattr(run, name) == getattr(longer, name)[WARM_UP:]).all()


def test_times_of_set_point_and_loads_count_from_the_start_of_the_run():
    sp = simulate(loop(), 3).record.sp
    assert (sp[: 200 - WARM_UP] == 53).all()
    assert (sp[200 - WARM_UP :] == 52).all()


def test_the_tail_and_the_quiet_sample_count_from_the_record():
    given = loop()
    assert (simulate(given, 3, tail=50).mv[N:] == valve_tail(given, 3, 50, None)).all()
    assert (
        valve_tail(given, 3, 50, N - 9) == valve_tail(whole(given), 3, 50, WARM_UP + N - 9)
    ).all()


def test_labels_do_not_hang_on_where_the_record_begins():
    given = loop(disturbance=[])
    (_, truth), (_, again) = simulate_with_truth(given, 3), simulate_with_truth(whole(given), 3)
    assert truth.answer == again.answer == "yes"
    assert truth.period == pytest.approx(again.period, rel=0.02)


def test_a_batch_gives_the_same_bits():
    loops = [loop(disturbance=[]), loop(), whole(loop(disturbance=[]))]
    for run, one in zip(simulate_batch(loops, [3, 3, 3]), loops, strict=True):
        assert (run.record.pv == simulate(one, 3).record.pv).all()


def test_the_oracle_knows_where_the_run_started():
    given = loop(disturbance=[])
    verdict = judge_oracle(Scenario(loop=given, seed=3), simulate(given, 3))
    assert verdict.verdict == "stiction"
    assert verdict.S == pytest.approx(5.0, rel=0.1)
    healthy = loop(valve={"model": "ideal"})
    assert (
        judge_oracle(Scenario(loop=healthy, seed=3), simulate(healthy, 3)).verdict == "no_stiction"
    )


def test_without_it_a_run_starts_in_equilibrium_and_nothing_is_written():
    still = loop(
        setpoint={"value": 50}, disturbance=[], noise={"std": 0}, sampling={"Ts": 1, "n": N}
    )
    assert np.ptp(simulate(still).record.pv) == 0.0
    assert "warm_up" not in still.to_table()["sampling"]
