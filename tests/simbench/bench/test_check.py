"""The gate: silent about chance and about other machines, loud about detectors that became worse."""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from simbench.bench.baseline import read_book
from simbench.bench.check import check_run, compare_books, update_baseline
from simbench.bench.run import run_grid
from simbench.bench.store import RunError

N = 600
TRUTH = np.arange(N) % 2


@pytest.fixture
def base(book, noisy):
    verdict, score = noisy(np.random.default_rng(0), TRUTH, 0.8)
    return book(verdict, TRUTH, score)


def worse(check):
    return {(r["method"], r["what"]) for r in check.tests[check.tests["worse"]].to_dict("records")}


def test_the_same_answers_pass_and_are_paired(base):
    check = compare_books(base, base)
    assert check.paired
    assert not check.failed
    assert check.flips.empty
    assert check.tests["p"].eq(1).all()


def test_order_of_scenarios_and_methods_does_not_matter(base):
    turn = np.random.default_rng(1).permutation(N)
    arrays = {k: getattr(base, k)[::-1, turn] for k in ("verdict", "verdict_raw", "score", "score_raw", "failed", "runtime")}
    other = replace(
        base,
        ids=base.ids[turn],
        hashes=base.hashes[turn],
        methods=base.methods[::-1],
        truth={k: v[turn] for k, v in base.truth.items()},
        axes={k: v[turn] for k, v in base.axes.items()},
        **arrays,
    )
    check = compare_books(other, base)
    assert check.paired
    assert check.flips.empty


BROKEN = {
    "always stiction": (lambda v: np.ones_like(v), "no false alarm"),
    "always no stiction": (lambda v: np.zeros_like(v), "no miss"),
    "never decides": (lambda v: np.full_like(v, 2), "detection"),
    "the other way round": (lambda v: 1 - v, "detection"),
}


@pytest.mark.parametrize("how", BROKEN)
@pytest.mark.parametrize("same_records", [True, False])
def test_a_broken_detector_fails_and_only_it(base, how, same_records, with_answers):
    broken, what = BROKEN[how]
    now = with_answers(base, "m1", broken(base.verdict[1]))
    if not same_records:
        now = replace(now, hashes=np.char.add(b"x", now.hashes).astype("S16"))
    check = compare_books(now, base)
    assert check.paired == same_records
    assert ("m1", what) in worse(check)
    assert {m for m, _ in worse(check)} == {"m1"}


def test_a_score_that_lost_its_sense_fails_though_verdicts_stand(base, with_answers):
    now = with_answers(base, "m2", base.verdict[2], -base.score[2])
    assert worse(compare_books(now, base)) == {("m2", "AUC")}


def test_narrowing_the_grey_zone_fails_when_it_buys_false_alarms(book, with_answers):
    # no decision becomes stiction: no answer that was right is lost
    undecided = np.where(np.arange(N) % 10 < 3, 2, TRUTH)
    base = book([undecided], TRUTH)
    now = with_answers(base, "m0", np.where(undecided == 2, 1, undecided))
    check = compare_books(now, base)
    assert ("m0", "no false alarm") in worse(check)
    assert not check.tests["what"].isin(["detection", "rejection"])[check.tests["worse"]].any()


def test_a_threshold_that_trades_misses_for_false_alarms_fails_at_equal_accuracy(base, with_answers):
    verdict = base.verdict[0].copy()
    gain = np.flatnonzero((TRUTH == 1) & (verdict == 0))[:30]
    loss = np.flatnonzero((TRUTH == 0) & (verdict == 0))[:30]
    verdict[gain], verdict[loss] = 1, 1
    check = compare_books(with_answers(base, "m0", verdict), base)
    assert ("m0", "rejection") in worse(check)
    assert ("m0", "detection") not in worse(check)


def test_flips_are_named_with_what_they_were(base, with_answers):
    verdict = base.verdict[0].copy()
    verdict[7] = 2
    check = compare_books(with_answers(base, "m0", verdict), base)
    (flip,) = check.flips.to_dict("records")
    assert (flip["scenario_id"], flip["method"], flip["now"]) == (base.ids[7].decode(), "m0", "no_decision")
    assert flip["was"] == ("stiction" if base.verdict[0][7] else "no_stiction")
    assert not check.failed
    assert flip["scenario_id"] in check.as_text()


def test_other_records_of_equal_detectors_seldom_alarm(book, noisy):
    rng = np.random.default_rng(5)

    def run(seed):
        verdict, score = noisy(rng, TRUTH, 0.8, methods=8)
        return book(verdict, TRUTH, score, ids=[f"{seed}.{i}" for i in range(N)], grid_hash=f"seed {seed}")

    base = run(0)
    assert sum(compare_books(run(seed), base).failed for seed in range(1, 26)) <= 2


def test_other_records_are_said_to_be_other_records(base):
    now = replace(base, hashes=np.where(np.arange(N) == 3, b"another", base.hashes))
    check = compare_books(now, base)
    assert not check.paired
    assert "1 of 600 common records differ" in check.basis
    assert "2 points" in check.basis
    assert not check.failed


def test_missing_methods_scenarios_new_errors_and_a_changed_truth_fail(base, book):
    without = replace(base, methods=base.methods[:2], verdict=base.verdict[:2], score=base.score[:2], failed=base.failed[:2])
    assert "method m2 is in the baseline, not in the run" in compare_books(without, base).problems
    part = book(base.verdict[:, :500], TRUTH[:500], base.score[:, :500])
    assert "100 of the baseline's 600 scenarios are not in the run" in compare_books(part, base).problems
    failing = replace(base, failed=base.failed | (np.arange(N) == 5))
    assert "method m0 raised an error on 1 scenarios where it had none" in compare_books(failing, base).problems
    turned = replace(base, truth={**base.truth, "cycled": np.where(np.arange(N) == 5, 0, TRUTH)})
    assert compare_books(turned, base).problems == ("the truth 'cycled' of 1 scenarios with the same records has changed",)


def test_another_grid_is_refused(base):
    with pytest.raises(RunError, match=r"'toy'.*'ci'"):
        compare_books(base, replace(base, manifest={**base.manifest, "grid": "ci"}))


def test_texts_carry_the_verdict(base, with_answers):
    check = compare_books(with_answers(base, "m1", 1 - base.verdict[1]), base)
    assert check.as_text().startswith("check FAILED")
    assert "m1: detection" in check.as_markdown()
    assert check.as_junit().startswith('<?xml version="1.0" encoding="utf-8"?>')
    suite = ET.fromstring(check.as_junit().encode())
    assert suite.get("tests") == "4"
    assert [c.get("name") for c in suite if c.find("failure") is not None] == ["m1"]
    content = json.loads(json.dumps(check.as_json(), allow_nan=False))
    assert content["failed"] is True
    assert len(content["flips"]) == len(check.flips) == N


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_grid("smoke", tmp_path_factory.mktemp("check") / "run", ["horch", "he", "yamashita"], progress=False)


def test_a_baseline_answers_like_the_run_it_was_made_from(run, tmp_path):
    base = tmp_path / "baseline"
    text = update_baseline(run, base)
    assert "48 scenarios of grid smoke x 3 methods" in text
    assert not check_run(run, base).failed
    assert check_run(run, base).tests.equals(check_run(run, run).tests)
    for kind in ("scenarios", "verdicts"):
        assert (base / f"{kind}.parquet").stat().st_size < (run / f"{kind}.parquet").stat().st_size
    assert sum(f.stat().st_size for f in base.iterdir()) < 48 * 1000  # at most 1 kB per scenario is committed
    assert update_baseline(run, base).endswith("nothing moved")


def test_updating_says_what_moves(run, tmp_path):
    base = tmp_path / "baseline"
    update_baseline(run, base)
    moved = run_grid(
        "smoke", tmp_path / "moved", ["horch", "he", "yamashita", "ellipse"], progress=False,
        thresholds={"yamashita": {"rho3_min": 0.9}},
    )  # fmt: skip
    assert check_run(moved, base).failed
    text = update_baseline(moved, base)
    assert "+ method ellipse" in text
    assert "yamashita: detection against 'sticky' fell from" in text
    assert not check_run(moved, base).failed


def test_old_formats_strangers_and_damage_are_refused(run, tmp_path):
    base = tmp_path / "baseline"
    update_baseline(run, base)
    manifest = json.loads((base / "manifest.json").read_text())
    (base / "manifest.json").write_text(json.dumps({**manifest, "format": 0}))
    with pytest.raises(RunError, match="format version 0"):
        check_run(run, base)
    assert "not compared with the old one" in update_baseline(run, base)
    with pytest.raises(RunError, match="holds no run"):
        check_run(tmp_path / "nowhere", base)
    content = (base / "verdicts.parquet").read_bytes()
    (base / "verdicts.parquet").write_bytes(content[:-40])
    with pytest.raises(RunError, match=r"damaged|not the table"):
        read_book(base)
