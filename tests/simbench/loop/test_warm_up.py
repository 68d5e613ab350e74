"""`sampling.warm_up`: samples that are simulated before the record begins, and dropped."""

import pytest

from simbench.bench.scenario.truth import simulate_with_truth
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

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


def test_labels_do_not_hang_on_where_the_record_begins():
    given = loop(disturbance=[])
    (_, truth), (_, again) = simulate_with_truth(given, 3), simulate_with_truth(whole(given), 3)
    assert truth.answer == again.answer == "yes"
    assert truth.period == pytest.approx(again.period, rel=0.02)
