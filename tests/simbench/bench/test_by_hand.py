"""Small parts of the benchmark on cases worked out by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.bench import statistics as of
from simbench.bench.execute import compute_piece as piece
from simbench.bench.execute.failures import Failures
from simbench.bench.scenario import truth
from simbench.bench.store import manifest
from simbench.detectors.record import LoopRecord
from simbench.loop.motion import Motion, largest_sine, motion
from simbench.scenarios.spec import Loop


def test_statistics_of_the_fewest_cases():
    assert str(of.Estimate(0.8123, 0.79, 0.8305)) == "0.812 (0.790 to 0.831)"
    up, down = [1, 2, 3, 4], [4, 3, 2, 1]
    two, one = [False, False, True, True], [False, False, False, True]
    assert of.auc_drop(up, down, two) == 0.0  # no spread, and a fall
    assert of.auc_drop(down, up, two) == 1.0
    assert of.auc_drop(up, down, one) == 1.0  # one case has no variance
    assert math.isnan(of.area(np.array([0, 1]), np.array([True, True])))
    assert of.auc([1, 1], [True, False]).value == 0.5


def test_a_motion_with_few_reversals_has_what_can_be_computed():
    none, one, two, three = (
        Motion(np.arange(k) * 10, np.array([0.0, 4.0, 1.0])[:k], 90) for k in range(4)
    )
    assert [m.swing for m in (none, one, two, three)] == [0.0, 0.0, 4.0, 3.5]
    assert [math.isnan(m.period) for m in (none, one, two, three)] == [True, True, True, False]
    assert three.period == 20.0
    assert (none.lasting, three.lasting) == (0.0, 0.0)  # nothing in the last third
    late = Motion(np.array([70, 80]), np.array([0.0, 1.0]), 90)
    assert late.lasting == math.inf
    # swings 4, 4, 1 about 10, 35, 60
    fading = Motion(np.array([0, 20, 50, 70]), np.array([0.0, 4.0, 0.0, 1.0]), 90)
    assert fading.lasting == 0.25


def test_a_turn_counts_when_it_goes_back_by_more_than_the_least():
    wave = np.array([0.0, 2.0, 1.0, 2.5, 0.0, 0.0, 3.0])
    assert motion(wave, 1.0).positions.tolist() == [2.5, 0.0]
    assert motion(wave, 0.99).positions.tolist() == [2.0, 1.0, 2.5, 0.0]
    assert motion(wave, 2.5).positions.tolist() == []
    assert motion(-wave, 1.0).positions.tolist() == [-2.5, 0.0]
    assert motion(wave, 1.0).at.tolist() == [3, 5]  # the last sample before the valve turns


@pytest.mark.parametrize(
    ("period", "inside"),
    [(100.0, True), (34.0, True), (290.0, True), (30.0, False), (330.0, False)],
)
def test_the_largest_sine_is_looked_for_within_a_factor_of_three(period, inside):
    wave = 2.0 * np.sin(2 * np.pi * np.arange(6600) / period)
    assert (largest_sine(wave, 100.0) > 1.8) is inside


def loop(**more):
    table = {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    }
    return Loop.from_table(
        table
        | {"valve": {"model": "choudhury", "S": 5, "J": 2}, "sampling": {"Ts": 1.0, "n": 400}}
        | more
    )


@pytest.mark.parametrize(("S", "J", "least"), [(5.0, 2.0, 1.0), (5.0, 0.0, 0.25), (0.0, 0.0, 1e-6)])
def test_the_least_swing_is_half_the_jump_or_a_twentieth_of_the_band(S, J, least):
    assert truth.least_swing(loop(valve={"model": "choudhury", "S": S, "J": J})) == pytest.approx(
        least
    )


def test_noise_goes_off_at_the_end_and_up_to_three_quarters_of_a_period_before():
    assert truth._quiet_moments(loop(), 40.0) == [400]
    assert truth._quiet_moments(loop(noise={"std": 0.1}), 40.0) == [400, 390, 380, 370]
    assert truth._quiet_moments(loop(noise={"std": 0.1}), 1000.0) == [400, 150, 0]


@pytest.mark.parametrize(
    ("reversals", "swing", "expected"),
    [(6, 1.0, True), (5, 1.0, False), (6, 0.99, False), (60, 3.0, True), (0, 0.0, False)],
)
def test_a_valve_swings_that_turns_six_times_by_the_least(reversals, swing, expected):
    assert truth._keeps_swinging(SimpleNamespace(reversals=reversals, swing=swing), 1.0) is expected


@pytest.mark.parametrize(
    ("reversals", "late", "expected"),
    [(1, 1.0, "unclear"), (5, 1.0, "unclear"), (5, 0.9, "no"), (0, 1.0, "no")],
)
def test_a_valve_that_turned_seldom_and_still_moves_is_unclear(reversals, late, expected):
    tail = np.zeros(90)
    tail[-15:] = late
    moved = SimpleNamespace(reversals=reversals, swing=5.0, lasting=1.0)
    assert truth._goes_on_by_itself(loop(), 0, tail, moved, 1.0, 0) == expected


def test_failures_are_counted_and_those_of_plug_ins_as_well():
    failures = Failures(10, 2, {"he": 4, "mine": 8}, {"he: why": 4})
    assert (
        str(failures)
        == "2 of 10 scenarios could not be simulated; method he failed on 4 of 8 records; "
        "method mine failed on 8 of 8 records (most often: he: why)"
    )
    assert failures.above(0.99)
    assert not failures.above(1.0)
    assert str(Failures(10, 0)) == ""
    assert not Failures(0, 0).above(0.0)


def test_a_record_is_known_by_every_bit_of_every_signal():
    x = np.arange(8.0)
    seen = set()
    for at in (None, "sp", "op", "pv", "mv"):
        signals = {name: x.copy() for name in ("sp", "op", "pv", "mv")}
        if at:
            signals[at][-1] = np.nextafter(signals[at][-1], 9.0)
        seen.add(piece.record_hash(LoopRecord(Ts=1.0, **signals)))
    assert len(seen) == 5
    assert all(len(h) == 16 for h in seen)


def test_the_commit_is_read_from_a_checkout_on_a_branch_off_it_and_from_a_linked_tree(
    tmp_path, monkeypatch
):
    def commit(tree):
        monkeypatch.setattr(
            manifest, "__file__", str(tree / "simbench" / "bench" / "store" / "manifest.py")
        )
        return manifest._read_commit.__wrapped__()

    git = tmp_path / "main" / ".git"
    (git / "refs" / "heads").mkdir(parents=True)
    (git / "refs" / "heads" / "one").write_text("1111\n")
    (git / "HEAD").write_text("ref: refs/heads/one\n")
    assert commit(tmp_path / "main") == "1111"
    linked = git / "worktrees" / "other"
    linked.mkdir(parents=True)
    (linked / "commondir").write_text("../..\n")
    (linked / "HEAD").write_text("2222\n")  # no branch
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / ".git").write_text(f"gitdir: {linked}\n")
    assert commit(tmp_path / "other") == "2222"
    (linked / "HEAD").write_text("ref: refs/heads/one\n")
    assert commit(tmp_path / "other") == "1111"
    assert commit(tmp_path / "nowhere") is None
