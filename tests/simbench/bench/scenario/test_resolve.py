"""Rules of a grid: what one run of the sticky twin settles, and that a grid gives no label away."""

import math
from dataclasses import replace

import pytest

from simbench.bench.scenario import resolve as rules
from simbench.bench.scenario.resolve import (
    first_guess,
    measure_cycle,
    resolve,
    sampled_ultimate_gain,
)
from simbench.scenarios.grid import load_grid
from simbench.scenarios.sample import Sample
from simbench.scenarios.spec import Loop


def loop(S=5.0, J=2.0, Kc=1.0, **more):
    return Loop.from_table(
        {
            "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
            "controller": {"type": "PI", "Kc": Kc, "Ti": 10},
            "valve": {"model": "choudhury", "S": S, "J": J},
            "sampling": {"Ts": 1},
            **more,
        }
    )


@pytest.fixture(scope="module")
def smoke():
    grid = load_grid("smoke")
    return [(group, resolve(group)) for group in grid.groups()]


@pytest.mark.parametrize(("J", "period"), [(2.0, 94.4), (5.0, 40.4), (7.0, 30.11)])
def test_the_first_guess_is_the_exact_law(J, period):
    assert first_guess(loop(J=J)) == pytest.approx(period, abs=0.02)
    assert measure_cycle(loop(J=J)).period == pytest.approx(period, rel=0.1)


def test_noise_and_disturbance_do_not_change_what_is_measured():
    driven = [{"type": "sine", "amplitude": 3, "period": 30, "at": "output"}]
    assert measure_cycle(loop(noise={"std": 1.0}, disturbance=driven)) == measure_cycle(loop())


def test_ids_are_unique_and_stay_when_asked_again(smoke):
    ids = [s.id for _, scenarios in smoke for s in scenarios]
    assert len(set(ids)) == len(ids)
    grid = load_grid("smoke")
    assert [s.id for g in grid.groups() for s in resolve(g)] == ids


def test_resolved_numbers_do_not_hang_on_the_last_bits(smoke):
    for _, scenarios in smoke:
        for s in scenarios:
            for x in (s.loop.sampling.Ts, s.loop.noise.std):
                assert float(f"{x:.3g}") == x


def test_the_ultimate_gain_knows_the_sampling():
    plant, controller = {"type": "foptd", "K": 1, "T": 10, "Td": 10}, {"type": "P", "Kc": 1}
    slow = {"plant": plant, "controller": controller, "sampling": {"Ts": 0.01}}
    fine = sampled_ultimate_gain(Loop.from_table(slow))
    coarse = sampled_ultimate_gain(Loop.from_table({**slow, "sampling": {"Ts": 5.0}}))
    assert fine == pytest.approx(2.26, abs=0.01)
    assert coarse < 0.95 * fine


def test_w_Ti_of_the_cycle_is_what_the_cell_asks_for():
    grid = load_grid(
        "smoke",
        {
            "w_Ti": 1.0,
            "Td_over_T": 0.5,
            "process": "foptd",
            "S_over_2J": 0.5,
            "disturbance": "none",
        },
    )
    group = grid.group(0)
    loop = resolve(group)[0].loop
    assert 2 * math.pi * loop.controller.Ti / measure_cycle(loop).period == pytest.approx(
        1.0, rel=0.06
    )


def ids_of(grid):
    return {s.id: s.loop_digest for g in grid.groups() for s in resolve(g)}


def test_an_id_says_what_was_asked_for_and_no_computed_number(monkeypatch):
    few = {"disturbance": ["none"], "S_over_2J": [0.5]}
    asked = ids_of(load_grid("smoke", axes=few))
    # as on a machine that measures other cycles
    measured = rules.measure_cycle
    monkeypatch.setattr(
        rules,
        "measure_cycle",
        lambda twin: replace(measured(twin), period=1.3 * measured(twin).period),
    )
    elsewhere = ids_of(load_grid("smoke", axes=few))
    assert list(elsewhere) == list(asked)
    assert elsewhere != asked


def test_more_repeats_keep_the_ids_of_the_first_and_a_sample_has_those_of_the_grid():
    few = {"disturbance": ["none"]}
    asked = ids_of(load_grid("smoke", axes=few))
    assert asked.items() <= ids_of(load_grid("smoke", {"repeats": 2}, few)).items()
    sample = ids_of(Sample.of(load_grid("smoke", axes=few), 5))
    assert len(sample) == 5
    assert sample.items() <= asked.items()
