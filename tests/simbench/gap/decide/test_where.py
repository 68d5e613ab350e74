"""Where the gap lies: the right block, both blocks of two, nothing of nothing, and an interval that says what is not known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from detectors.record import LoopRecord
from scenarios.spec import Loop
from simbench.gap.decide.assess import Assessment, assess
from simbench.gap.decide.block_residuals import law_residuals, loglik, mv_residuals, sample_misfit
from simbench.gap.decide.where import DRAWS, BlockShare, Where, _Resampling, where
from simbench.gap.diagnosis import diagnose
from simbench.gap.intake.check import check
from simbench.gap.report.page import write_page
from simbench.gap.situation import Situation
from simbench.loop.effects import BLOCKS, EFFECTS, block_of
from simbench.loop.simulate import simulate

BASE = {
    "plant": {"type": "foptd", "K": 1.5, "T": 20, "Td": 3.5},
    "controller": {"type": "PI", "Kc": 0.6, "Ti": 18},
    "sampling": {"Ts": 1.0, "n": 800},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50, "steps": [[60, 56], [300, 45], [550, 52]]},
    "disturbance": [{"type": "coloured", "amplitude": 0.6, "period": 30.0}],
}
STRONG = {
    "detuning": {"Kc_factor": 1.6}, "saturation": {"lo": 0.0, "hi": 51.0}, "op_quantisation": {"step": 0.8},
    "error_deadband": {"width": 0.5}, "stiction": {"S": 5.0, "J": 2.0}, "deadband": {"S": 4.0},
    "gain_mismatch": {"factor": 1.8}, "dead_time_mismatch": {"extra": 4.0}, "extra_lag": {"tau": 10.0},
    "noise": {"factor": 3.0}, "quantisation": {"step": 0.5}, "outliers": {"rate": 0.02, "size": 3.0},
    "compression": {"band": 0.5}, "oscillation": {"amplitude": 3.0, "period": 60.0},
    "load_steps": {"rate": 0.006, "size": 5.0},
}  # fmt: skip


@cache
def checked(*effects: str, mv: bool = False) -> Situation:
    truth = Loop.from_table({**BASE, "effect": [{"name": e, **STRONG[e]} for e in effects]})
    record = simulate(truth, seed=2).record
    return check(record if mv else replace(record, mv=None), Loop.from_table({**BASE, "disturbance": []}))


@cache
def assessed(*effects: str, mv: bool = False) -> Assessment:
    return assess(checked(*effects, mv=mv))


def orderly(placed: Where) -> None:
    assert list(placed.blocks) == list(BLOCKS)
    total = sum(placed.shares.values())
    assert total == pytest.approx(1.0) or total == 0.0
    for s in placed.blocks.values():
        assert 0.0 <= s.lo <= s.share <= s.hi <= 1.0
        assert s.says.endswith(".")


@pytest.mark.parametrize(("effect", "mv"), [
    ("detuning", False), ("deadband", False), ("deadband", True), ("gain_mismatch", False), ("dead_time_mismatch", True),
    ("noise", False), ("quantisation", False), ("oscillation", False),
])  # fmt: skip
def test_the_block_with_the_effect_has_the_largest_share(effect, mv):
    placed = where(assessed(effect, mv=mv))
    orderly(placed)
    assert max(placed.shares, key=placed.shares.__getitem__) == block_of(effect)
    assert placed.blocks[block_of(effect)].share > 0.6


@pytest.mark.parametrize(("pair", "mv"), [
    (("detuning", "deadband"), False), (("noise", "oscillation"), False), (("deadband", "noise"), True),
    (("quantisation", "saturation"), True),
])  # fmt: skip
def test_both_blocks_of_two_effects_get_a_share(pair, mv):
    placed = where(assessed(*pair, mv=mv))
    orderly(placed)
    for effect in pair:
        assert placed.blocks[block_of(effect)].share > 0.03
        assert placed.blocks[block_of(effect)].lo > 0.0
    assert sum(placed.shares[block_of(e)] for e in pair) > 0.85


@pytest.mark.parametrize("mv", [False, True])
def test_nothing_is_shared_where_nothing_beats_no_effect(mv):
    placed = where(assessed(mv=mv))
    assert [(s.share, s.lo, s.hi) for s in placed.blocks.values()] == [(0.0, 0.0, 0.0)] * 5
    assert all(s.says for s in placed.blocks.values())
    assert set(where(assessed("deadband"), level=2000.0).shares.values()) == {0.0}


def test_a_recorded_mv_settles_what_op_and_pv_leave_open():
    open_, settled = where(assessed("extra_lag")), where(assessed("extra_lag", mv=True))
    assert open_.blocks["process"].hi - open_.blocks["process"].lo > 0.3
    assert open_.blocks["valve"].hi > 0.1
    assert settled.blocks["valve"].hi == 0.0
    assert settled.blocks["process"].share > open_.blocks["process"].share


def test_two_explanations_that_fit_alike_share_alike():
    found = assessed("extra_lag")
    c = found.candidates["extra_lag"]
    twins = {e: replace(c, effect=e) for e in ("valve_lag", "extra_lag", "sensor_lag")}
    gains = dict.fromkeys(EFFECTS, -10.0) | dict.fromkeys(twins, c.log_likelihood_gain)
    placed = where(replace(found, candidates=twins, log_likelihood_gains=gains, chosen=["extra_lag"], unexplained={}))
    for block in ("valve", "process", "sensor"):
        assert placed.blocks[block].share == pytest.approx(1 / 3, abs=1e-9)


def test_what_two_named_effects_explain_alike_is_not_counted_twice():
    found = assessed("noise", "oscillation")
    a, b = found.chosen
    assert {block_of(a), block_of(b)} == {"sensor", "disturbance"}
    alone, other = found.candidates[a].log_likelihood_gain, found.candidates[b].log_likelihood_gain
    joint = alone + found.log_likelihood_gains_on_top[b]
    other = max(other, 0.0)
    placed = where(found)
    assert placed.shares[block_of(b)] == pytest.approx(0.5 * (other + joint - alone) / joint, abs=0.05)


def test_same_seed_same_bits_and_another_seed_stays_inside():
    found = assessed("noise", "oscillation")
    first, again, other = where(found), where(found), where(found, seed=9)
    assert first == again
    for block, s in first.blocks.items():
        assert s.lo - 0.02 <= other.shares[block] <= s.hi + 0.02


def test_shares_do_not_depend_on_the_unit_of_pv():
    effects, factor = ("detuning", "deadband"), 64.0
    s = checked(*effects)
    wide = LoopRecord(op=s.op, pv=s.record.pv * factor, sp=s.sp * factor, Ts=s.record.Ts, op_span=(0.0, 100.0))
    other = s.baseline.with_("plant.K", 1.5 * factor).with_("controller.Kc", 0.6 / factor).with_("noise.std", 0.1 * factor)
    plain, scaled = where(assessed(*effects)), where(assess(check(wide, other)))
    for block in BLOCKS:
        assert scaled.shares[block] == pytest.approx(plain.shares[block], abs=0.02)


def test_resampled_sums_are_those_of_whole_blocks_taken_one_by_one():
    x = np.random.default_rng(0).standard_normal((2, 230))
    pick = _Resampling(230, 13.0, np.random.default_rng(1))
    fast = pick.sums(x)
    assert fast.shape == (2, DRAWS + 1)
    for i in range(2):
        assert fast[i, 0] == pytest.approx(x[i].sum())
        for k in (0, 7, DRAWS - 1):
            drawn = np.concatenate([x[i, start : start + 13] for start in pick.starts[k]])
            assert fast[i, k + 1] == pytest.approx(drawn.mean() * 230)


def test_resampling_spreads_as_the_mean_of_correlated_samples_does():
    rng = np.random.default_rng(3)
    e = rng.standard_normal(4000)
    x = np.convolve(e, np.ones(5), "full")[:4000]  # moving average: the mean's std is 5/sqrt(n)
    drawn = _Resampling(4000, 60.0, rng).sums(x)[1:] / 4000
    assert np.std(drawn) == pytest.approx(5.0 / np.sqrt(4000), rel=0.25)


def test_samplewise_likelihoods_sum_to_the_fits_own():
    found = assessed("noise", "oscillation")
    for c in found.candidates.values():
        assert np.sum(loglik(c.fit)) == pytest.approx(c.fit.loglik, rel=1e-12)


def test_the_baselines_law_leaves_nothing_but_what_the_controller_does_otherwise():
    assert law_residuals(checked("deadband"))[2] < 1e-18
    s = checked("detuning")
    bare, freed, share = law_residuals(s)
    e = s.sp - np.asarray(s.record.pv)
    # 0.6 of the baseline's Kc is what the plant's has more
    assert bare[1:] == pytest.approx(0.6 * 0.6 * (np.diff(e) + e[1:] / 18.0), abs=1e-6)
    assert np.abs(freed).max() < 1e-6
    assert share == pytest.approx((0.6 / 1.6) ** 2, rel=1e-3)


@pytest.mark.parametrize("effect", ["saturation", "error_deadband", "op_quantisation"])
def test_the_controllers_own_effect_leaves_little_of_what_the_bare_law_leaves(effect):
    bare, freed, _ = law_residuals(checked(effect))
    assert 0.0 <= np.sum(freed**2) < 0.05 * np.sum(bare**2)


def test_the_fitted_map_leaves_little_of_mv_and_an_offset_is_no_misfit():
    s, p = checked("deadband", mv=True), {"S": 4.0}
    bare, freed = mv_residuals(s, "deadband", p)
    assert 0.5 < np.std(bare) <= 2.0 + 1e-9  # half the band, either side
    assert np.std(freed) < 0.02 * np.std(bare)
    moved = replace(s, record=replace(s.record, mv=np.asarray(s.record.mv) + 3.0))
    assert mv_residuals(moved, "deadband", p)[0] == pytest.approx(bare)


def test_rounding_counts_with_the_power_of_its_errors():
    assert sample_misfit(checked("quantisation")).mean() == pytest.approx(0.5**2 / 6, rel=0.05)


@pytest.fixture(scope="module")
def report():
    truth = Loop.from_table({**BASE, "effect": [{"name": "deadband", **STRONG["deadband"]}]})
    return diagnose(simulate(truth, seed=2).record, Loop.from_table({**BASE, "disturbance": []}))


def test_text_and_page_show_the_interval_where_one_was_found_and_do_without(report, tmp_path):
    placed = Where({b: BlockShare(0.8 if b == "valve" else 0.05, 0.03, 0.88, f"Seen in the {b}.") for b in BLOCKS})
    shown = replace(report, blocks=placed.shares, details={**report.details, "where": placed})
    assert "where: controller 5 % [3, 88], valve 80 % [3, 88], process" in shown.as_text()
    bare = replace(shown, details={k: v for k, v in report.details.items() if k != "where"})
    assert "where: controller 5 %, valve 80 %, process" in bare.as_text()
    assert bare.where == {}
    pages = []
    for r in (shown, bare):
        write_page(r, tmp_path / "page.html")
        pages.append((tmp_path / "page.html").read_text(encoding="utf-8"))
    assert "Seen in the valve." in pages[0]
    assert "In brackets" in pages[0]
    assert "In brackets" not in pages[1]
