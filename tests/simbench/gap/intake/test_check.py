"""What is refused, in one sentence, and what is like it and must be answered: units, other loops,
dead and frozen signals.
"""

from dataclasses import replace

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.gap.closed_loop.as_archived import as_archived
from simbench.gap.closed_loop.loop_from_fit import fixed_loop
from simbench.gap.decide import left_over
from simbench.gap.intake.check import check
from simbench.gap.intake.other_loop import refuse_other_plant
from simbench.gap.likelihood.engine import Engine
from simbench.gap.situation import load_memory
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TABLE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.5, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 2000},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[600.0, 55.0], [1300.0, 50.0]]},
}
STICKY = {"valve": {"model": "choudhury", "S": 6.0, "J": 2.0}}
LOADED = {"disturbance": [{"type": "coloured", "amplitude": 0.6, "period": 30.0}]}


def loop(**more):
    return Loop.from_table({**TABLE, **more})


def run(**more):
    return simulate(loop(**more), seed=3, kick=6.0).record


def admitted(record, baseline):
    situation = check(record, baseline)
    refuse_other_plant(situation)
    return situation


def refused(record, baseline, *words):
    with pytest.raises(RecordError) as caught:
        admitted(record, baseline)
    sentence = str(caught.value)
    assert "\n" not in sentence
    for word in words:
        assert word in sentence


def test_op_in_ma_or_as_a_share_is_refused_and_its_span_settles_it():
    r = run()
    refused(replace(r, op=4.0 + 0.16 * r.op, mv=None), loop(), "OP runs from", "mA", "--op-span")
    refused(replace(r, op=r.op / 100.0, mv=None), loop(), "share of 1", "--op-span")
    assert not check(replace(r, op=4.0 + 0.16 * r.op, op_span=(4.0, 20.0)), loop()).proven


OTHERS = {
    "slow": {
        "plant": {"type": "foptd", "K": 0.3, "T": 200.0, "Td": 30.0},
        "controller": {"type": "PI", "Kc": 8.0, "Ti": 200.0},
    },
    "fast": {
        "plant": {"type": "foptd", "K": 3.0, "T": 5.0, "Td": 1.0},
        "controller": {"type": "PI", "Kc": 0.6, "Ti": 5.0},
    },
    "vessel": {
        "plant": {"type": "integrating", "K": 0.05, "Td": 10.0},
        "controller": {"type": "PI", "Kc": 3.0, "Ti": 80.0},
    },
}


@pytest.mark.parametrize(
    "name", ["slow", *(pytest.param(other, marks=pytest.mark.slow) for other in ("fast", "vessel"))]
)
def test_the_baseline_of_another_loop_is_refused(name):
    refused(run(**LOADED), loop(**OTHERS[name]), "another loop", "Kc", "K =")


def test_a_sticky_valve_does_not_hide_the_other_loop():
    refused(replace(run(**STICKY), mv=None), loop(**OTHERS["slow"]), "another loop")


SLACK = {"controller": {"type": "PI", "Kc": 0.5, "Ti": 60.0}}


@pytest.mark.parametrize("other", [
    SLACK, SLACK | {"plant": {"type": "foptd", "K": 3.6, "T": 20.0, "Td": 4.0}},
    SLACK | {"plant": {"type": "foptd", "K": 1.2, "T": 60.0, "Td": 4.0}},
], ids=["alone", "with another gain", "with another time constant"])  # fmt: skip
@pytest.mark.parametrize("valve", [STICKY, pytest.param({}, marks=pytest.mark.slow)])
def test_other_tuning_is_an_effect_and_no_other_loop(other, valve):
    tuning = admitted(replace(run(**LOADED, **valve), mv=None), loop(**other)).proven["detuning"]
    assert tuning["Kc_factor"] == pytest.approx(3.0, rel=1e-3)
    assert tuning["Ti_factor"] == pytest.approx(1.0 / 3.0, rel=1e-3)


def test_retuned_vessels_are_not_taken_for_other_plants():
    table = {
        "plant": {"type": "integrating", "K": 0.02, "Td": 5.0},
        "controller": {"type": "PI", "Kc": 2.0, "Ti": 90.0},
        "disturbance": [{"type": "coloured", "amplitude": 1.0, "period": 100.0}],
    }
    effect = [{"name": "detuning", "Kc_factor": 0.5, "Ti_factor": 2.0}]
    assert (
        "detuning" in admitted(replace(run(**table, effect=effect), mv=None), loop(**table)).proven
    )


@pytest.mark.parametrize("at", ["loop", "record"])
@pytest.mark.parametrize(
    "other", [{}, {"name": "op_quantisation", "step": 0.5}], ids=["fine", "coarse OP"]
)
def test_op_shows_whether_the_controller_saw_the_spikes(at, other):
    effects = [
        {"name": "outliers", "rate": 0.01, "size": 3.0, "at": at},
        *([other] if other else []),
    ]
    assert check(run(**LOADED, effect=effects), loop()).proven["outliers"]["at"] == at


def test_lines_whose_error_nothing_tells_are_no_light_ones():
    """Behind a schedule the PV that the controller saw is not recovered, and with it no error."""
    pid = {"controller": {"type": "PID", "Kc": 1.5, "Ti": 20.0, "Td": 3.0, "N": 8.0}}
    pid["controller"]["schedule"] = [[45.0, 0.9], [55.0, 1.1]]
    r = run(**pid, **LOADED, effect=[{"name": "compression", "band": 0.4}])
    situation = check(r, loop(**pid))
    assert situation.law.recovered_pv is None
    assert set(situation.proven) == {"compression"}


def test_a_stated_sine_is_as_large_on_pv_as_the_plant_lets_it_through():
    # at 2 pi T a pole takes a factor of the root of 2; K = 1.2
    sine = {"type": "sine", "amplitude": 2.0, "period": 40.0 * np.pi}
    stated = loop(disturbance=[sine, {**sine, "at": "output"}])
    seen = [(40.0 * np.pi, 2.4 / np.sqrt(2.0)), (40.0 * np.pi, 2.0)]
    assert check(run(), stated).data.sines == tuple(pytest.approx(one) for one in seen)


def test_stated_steps_and_drifts_count_where_they_enter_before_the_plant():
    parts = [
        {"type": "steps", "amplitude": 3.0, "period": 300.0},
        {"type": "steps", "amplitude": 9.0, "period": 300.0, "at": "output"},
        {"type": "ramp", "amplitude": 4.0, "period": 8000.0},
        {"type": "random_walk", "amplitude": 1.5, "period": 8000.0},
    ]
    record, stated = run(), loop(disturbance=parts)
    far = record.duration / 8000.0
    seen = check(record, stated).data.loads
    assert seen["steps"] == pytest.approx(3.0 * np.sqrt(2.0))
    assert seen["slow"] == pytest.approx(np.hypot(4.0 * far, 2.0 * 1.5 * np.sqrt(far)))
    assert check(record, stated, trusted=False).data.loads == {}


def test_a_stated_filter_is_taken_off_pv_whose_noise_is_then_the_stated_one():
    filtered = {"effect": [{"name": "sensor_lag", "tau": 3.0}]}
    situation = admitted(run(**filtered), loop(**filtered))
    plain = admitted(run(), loop())
    assert situation.data.noise == pytest.approx(plain.data.noise)
    assert situation.noise == pytest.approx(0.1 * np.sqrt(np.tanh(1 / 6.0)))  # what is seen of it
    quick = [float(np.std(np.diff(one.data.y, 3))) for one in (situation, plain)]
    assert quick[0] == pytest.approx(quick[1], rel=0.05)
    # the model of the unfiltered record holds for this one
    assert residual_free(situation)


def residual_free(situation):
    engine = Engine(situation.data, load_memory(situation))
    found = left_over.memory_and_input(engine.base(), engine.data)
    return max(found.values()) < 18.0


@pytest.mark.parametrize(("share", "ordinary"), [(0.6, True), (3.0, False)])
@pytest.mark.parametrize("at", ["loop", "record"])
def test_the_lattice_of_an_ordinary_card_is_in_every_simulation_and_a_coarse_one_is_a_gap(
    share, ordinary, at
):
    card = {"name": "quantisation", "step": share * 0.1, "at": at}
    situation = admitted(run(effect=[card]), loop())
    assert ("quantisation" in situation.stated) == ordinary
    assert ("quantisation" in situation.proven) != ordinary


@pytest.mark.parametrize(("step", "ordinary"), [(0.1, True), (0.13, False), (1.0, False)])
def test_op_with_one_decimal_is_what_an_archive_writes_and_another_step_is_a_gap(step, ordinary):
    record = run()
    rounded = replace(record, op=step * np.round(record.op / step))
    situation = admitted(rounded, loop())
    assert ("op_quantisation" in situation.stated) == ordinary
    assert ("op_quantisation" in situation.proven) != ordinary


@pytest.mark.parametrize("count", [0, 4, 400])
def test_a_few_scans_that_stand_on_record_twice_are_left_out(count):
    record = run(**LOADED)
    rows = np.sort(np.append(np.arange(record.n), np.arange(300, 300 + count)))
    situation = admitted(record.with_signals(lambda x: x[rows]), loop(**LOADED))
    # many that repeat are how an archive writes
    assert situation.record.n == record.n + (count if count == 400 else 0)
    assert any("stand on record twice" in note for note in situation.notes) == (count == 4)
    # a loop that is identified from the record has its length
    identified = check(record.with_signals(lambda x: x[rows]), loop(**LOADED), trusted=False)
    assert identified.record.n == record.n + count


def test_a_controller_that_runs_several_times_a_sample_is_no_other_one():
    steps = {"setpoint": {"value": 50.0, "steps": [[600.0, 75.0], [1000.0, 50.0], [1400.0, 75.0]]}}
    quick = run(**steps, sampling={"Ts": 0.25, "n": 8000}, noise={"std": 0.02})
    situation = admitted(quick.with_signals(lambda x: x[::4], Ts=1.0), loop(noise={"std": 0.02}))
    assert situation.unexplained_law == ""
    assert not situation.law.quick
    # one whose integral is quick shows it plainly, and is simulated so
    fast = {"controller": {"type": "PI", "Kc": 0.8, "Ti": 6.0}, "noise": {"std": 0.1}}
    plainly = run(**fast, sampling={"Ts": 0.25, "n": 8000})
    shown = admitted(plainly.with_signals(lambda x: x[::4], Ts=1.0), loop(**fast))
    assert (shown.law.quick, shown.unexplained_law, shown.pace) == (True, "", 3)
    assert any("several times a sample" in note for note in shown.notes)
    # a loop file that states its pace is simulated at it, and every fourth sample is on record
    stated = admitted(situation.record, loop(noise={"std": 0.02}, sampling={"Ts": 0.25}))
    assert stated.pace == 4
    simulated = fixed_loop(stated, Engine(stated.data, load_memory(stated)).base(), {})
    fast = simulate(simulated, seed=1).record
    assert (fast.n, fast.Ts, simulated.plant.Td) == (8000, 0.25, pytest.approx(4.0, rel=0.1))
    assert [x.size for x in as_archived(stated, fast.op, fast.pv)] == [2000, 2000]
