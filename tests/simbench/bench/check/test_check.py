"""The gate: silent about chance and about other machines, loud about detectors that became
worse.
"""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from bench_fixtures import change_answers
from typer.testing import CliRunner

from simbench.bench.check.check import check_books, check_run, update_baseline
from simbench.bench.check.check_power import smallest_loss_found
from simbench.bench.execute.run import run_grid
from simbench.bench.statistics import mcnemar
from simbench.bench.store.reading import RunError, read_book
from simbench.cli import app
from simbench.cli.common import wrap_lines
from simbench.detectors.plugins.registry import methods

N = 600
TRUTH = np.arange(N) % 2


@pytest.fixture
def base(book, noisy):
    verdict, score = noisy(np.random.default_rng(0), TRUTH, 0.8)
    return book(verdict, TRUTH, score)


def worse(check):
    return {(r["method"], r["what"]) for r in check.tests[check.tests["worse"]].to_dict("records")}


def test_the_same_answers_pass_and_are_paired(base):
    check = check_books(base, base)
    assert not check.failed
    assert check.flips.empty
    assert "may fall by 1 percentage point (" in check.basis
    assert "one of 2 percentage points of all must be" in check.basis
    assert check.tests["p"].eq(1).all()


def test_order_of_scenarios_and_methods_does_not_matter(base):
    turn = np.random.default_rng(1).permutation(N)
    arrays = {k: getattr(base, k)[::-1, turn] for k in ("verdict", "score", "failed", "runtime")}
    other = replace(
        base,
        ids=base.ids[turn],
        hashes=base.hashes[turn],
        digests=base.digests[turn],
        methods=base.methods[::-1],
        truth={k: v[turn] for k, v in base.truth.items()},
        axes={k: v[turn] for k, v in base.axes.items()},
        **arrays,
    )
    check = check_books(other, base)
    assert check.flips.empty


BROKEN = {
    "always stiction": (lambda v: np.ones_like(v), "no false alarm"),
    "always no stiction": (lambda v: np.zeros_like(v), "no miss"),
    "never decides": (lambda v: np.full_like(v, 2), "detection"),
    "the other way round": (lambda v: 1 - v, "detection"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_detector_fails_and_only_it(base, how, with_answers):
    broken, what = BROKEN[how]
    now = with_answers(base, "m1", broken(base.verdict[1]))
    check = check_books(now, base)
    assert ("m1", what) in worse(check)
    assert {m for m, _ in worse(check)} == {"m1"}


def test_a_score_that_lost_its_sense_fails_though_verdicts_stand(base, with_answers):
    now = with_answers(base, "m2", base.verdict[2], -base.score[2])
    assert worse(check_books(now, base)) == {("m2", "AUC")}


def with_verdicts(run, verdict):
    return replace(run, verdict=verdict[None].astype(np.int8))


def test_where_no_loss_at_all_could_be_found_the_check_cannot_tell(book):
    # right on 4 of 20: to lose these is chance, and what was wrong before cannot become worse
    truth = np.arange(20) % 2
    base = book([np.where(np.arange(20) < 4, truth, 1 - truth)], truth)
    check = check_books(with_verdicts(base, 1 - truth), base)
    assert check.result == "cannot tell"
    said = check.as_text()
    assert said.startswith("cannot tell: m0: no loss could be found with these loops")
    assert check_books(base, base).result == "same", "the same answers are no loss"


def test_copies_of_a_record_are_compared_once(book):
    # three answers lost, forty times over, are no more than three
    truth = np.arange(48) % 2
    hashes = [f"{k:016d}" for k in range(48)] * 40
    base = book([np.tile(truth, 40)], np.tile(truth, 40), hashes=hashes)
    missed = np.where(np.arange(48) < 3, 1 - truth, truth)
    check = check_books(with_verdicts(base, np.tile(missed, 40)), base)
    assert check.result == "cannot tell"
    assert "1872 copies of records" in check.basis


@pytest.mark.parametrize(("won", "net"), [(0, 0.02), (0.03, 0.05), (0.06, 0.05)])
def test_a_loss_is_found_as_often_as_the_power_says(won, net):
    n, level, rng = 900, 0.005, np.random.default_rng(7)
    share = smallest_loss_found(n, level, round(won * n))
    gained = rng.binomial(n, won, 400)
    lost = rng.poisson(n * (won + share), 400)
    found = np.mean([mcnemar(a, b, worse=True) < level for a, b in zip(lost, gained, strict=True)])
    assert found == pytest.approx(0.8, abs=0.06)
    assert share < net


def test_a_few_loops_of_a_grid_do_not_pass_for_the_grid(book):
    truth = np.arange(48) % 2
    base = book([truth], truth)
    two = book([[0, 0]], [1, 0], ids=base.ids[:2])
    assert check_books(two, base).result != "same"


def on_another_processor(base, share, rng, noisy, accuracy=0.8):
    """The same loops: a share of them settled otherwise, with another record and, now and then,
    truth; answers as good as before.
    """
    other = rng.random(N) < share
    digests = np.where(other, np.char.add(b"x", base.digests), base.digests).astype("S16")
    truth = np.where(other & (rng.random(N) < 0.05), 1 - TRUTH, TRUTH).astype(np.int8)
    verdict, score = noisy(rng, truth, accuracy)
    arrays = {
        "verdict": np.where(other, verdict, base.verdict),
        "score": np.where(other, score, base.score),
    }
    labels = {**dict.fromkeys(("sticky", "predicted"), base.truth["sticky"]), "cycled": truth}
    labels["cycled_word"] = np.array(["no", "yes"])[truth]
    return replace(
        base,
        digests=digests,
        hashes=np.where(other, b"other", base.hashes).astype("S16"),
        truth=labels,
        **arrays,
    )


def test_another_processor_seldom_alarms_and_hides_no_fault(base, noisy, with_answers):
    rng = np.random.default_rng(8)
    runs = [on_another_processor(base, 0.27, rng, noisy) for _ in range(12)]
    assert sum(check_books(now, base).failed for now in runs) <= 1
    broken = with_answers(
        runs[0], "m1", np.where(rng.random(N) < 0.1, 1 - runs[0].verdict[1], runs[0].verdict[1])
    )
    assert {m for m, _ in worse(check_books(broken, base))} == {"m1"}


def test_a_fall_within_the_margin_is_no_regression_and_beyond_it_is(book, with_answers):
    truth = np.arange(20_000) % 2
    base = book([truth], truth)
    for lost, failed in ((60, False), (140, True)):  # of 10 000 positives: 0.6 and 1.4 points
        verdict = truth.copy()
        verdict[np.flatnonzero(truth)[:lost]] = 0
        check = check_books(with_answers(base, "m0", verdict), base)
        detection = check.tests[
            (check.tests["what"] == "detection") & (check.tests["truth"] == "cycled")
        ].iloc[0]
        assert detection.p < 1e-6
        assert check.failed == failed
        assert not check_books(with_answers(base, "m0", verdict), base, margin=0.02).failed


def test_missing_methods_scenarios_new_errors_and_a_changed_truth_fail(base, book):
    without = replace(
        base,
        methods=base.methods[:2],
        verdict=base.verdict[:2],
        score=base.score[:2],
        failed=base.failed[:2],
    )
    assert "method m2 is in the baseline, not in the run" in check_books(without, base).problems
    part = book(base.verdict[:, :500], TRUTH[:500], base.score[:, :500])
    assert (
        "100 of the baseline's 600 scenarios are not in the run" in check_books(part, base).problems
    )
    failing = replace(base, failed=base.failed | (np.arange(N) == 5))
    assert (
        "method m0 raised an error on 1 scenarios where it had none"
        in check_books(failing, base).problems
    )
    turned = replace(base, truth={**base.truth, "cycled": np.where(np.arange(N) == 5, 0, TRUTH)})
    assert check_books(turned, base).problems == (
        "the truth 'cycled' of 1 scenarios with the same records has changed",
    )


def test_loops_that_nobody_has_in_common_are_refused(base):
    strangers = np.char.add(b"x", base.ids).astype("S16")
    with pytest.raises(RunError, match="no scenario in common; run the baseline's own"):
        check_books(base, replace(base, ids=strangers))


METHODS = ["horch", "he", "yamashita"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_grid("smoke", tmp_path_factory.mktemp("check") / "run", METHODS, progress=False)


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """The run with a method that became stricter, and one more method."""
    module = methods.load("yamashita")
    stricter = replace(module.METHOD.thresholds["rho3_min"], default=0.9)
    changed = replace(module.METHOD, thresholds={**module.METHOD.thresholds, "rho3_min": stricter})
    place = tmp_path_factory.mktemp("check") / "moved"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "METHOD", changed)
        return run_grid("smoke", place, [*METHODS, "ellipse"], progress=False)


def test_a_baseline_answers_like_the_run_it_was_made_from(run, tmp_path):
    base = tmp_path / "baseline"
    text = update_baseline(run, base)
    assert "48 scenarios of grid smoke x 3 methods" in text
    assert re.search(r"of detections and .* of false alarms would be found", text)
    assert re.search(r"must cover \d+ loops", text)
    assert not check_run(run, base).failed
    assert check_run(run, base).tests.equals(check_run(run, run).tests)
    for kind in ("scenarios", "verdicts"):
        parts = (run / f"{kind}.parquet").iterdir()
        assert (base / f"{kind}.parquet").stat().st_size < sum(f.stat().st_size for f in parts)
    # at most 1.5 kB per scenario is committed
    assert sum(f.stat().st_size for f in base.iterdir()) < 48 * 1500


def test_updating_names_what_moves(run, moved, tmp_path):
    base = tmp_path / "baseline"
    update_baseline(run, base)
    assert update_baseline(run, base).endswith("nothing moved")
    assert check_run(moved, base).failed
    text = update_baseline(moved, base)
    assert "+ method ellipse" in text
    assert "yamashita: detection against 'sticky' fell from" in text
    assert not check_run(moved, base).failed


def test_a_folder_of_something_else_is_not_made_a_baseline(run, tmp_path):
    (tmp_path / "manifest.json").write_text('{"name": "an app"}')
    (tmp_path / "scores.csv").write_text("game,score\n")
    before = {f.name: f.read_bytes() for f in tmp_path.iterdir()}
    with pytest.raises(RunError, match="holds no baseline, so nothing was written there"):
        update_baseline(run, tmp_path)
    assert {f.name: f.read_bytes() for f in tmp_path.iterdir()} == before


def test_a_run_without_any_method_of_the_baseline_is_worse(run, tmp_path):
    update_baseline(run, tmp_path / "base")
    other = run_grid("smoke", tmp_path / "other", ["ellipse"], progress=False)
    code, said, _ = checked(other, "--against", tmp_path / "base")
    assert (code, said["result"]) == (1, "worse")
    assert "method yamashita is in the baseline, not in the run" in said["reasons"]


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


def test_exact_fails_on_changed_scores_but_not_on_last_bits(base, with_answers):
    said, score = base.verdict[0], base.score[0].copy()
    finer = with_answers(base, "m0", said, score * (1.0 + 1e-5))
    assert check_books(finer, base, exact=True).result == "same"
    score[:3] += 1.0
    check = check_books(with_answers(base, "m0", said, score), base, exact=True)
    assert check.reasons == ["exact: 3 of 600 scores of m0 changed"]


def test_exact_asks_for_the_same_records_and_lets_plug_ins_change(base, with_answers):
    other = replace(base, hashes=np.where(np.arange(N) < 3, b"other", base.hashes).astype("S16"))
    assert "exact: 3 of 600 records differ" in check_books(other, base, exact=True).reasons[0]
    verdict = base.verdict[0].copy()
    verdict[7] = 1 - verdict[7]
    run = with_answers(base, "m0", verdict, base.score[0])
    stranger = replace(run, manifest={**run.manifest, "plugins": {"m0": "digest"}})
    assert check_books(stranger, base, exact=True).result == "same"


def test_a_failure_fits_a_screen_and_begins_with_what_fell(base, with_answers, book):
    many = book([base.verdict[0]] * 12, TRUTH)
    now = many
    for method in many.methods:
        now = with_answers(now, method, np.zeros(N, dtype=np.int8))
    check = check_books(now, many, exact=True)
    text = wrap_lines(check.as_text())
    lines = text.splitlines()
    assert lines[0].startswith("worse: m0 is right in 50.0 % of the loops, before ")
    assert " answers lost, " in " ".join(lines[:2])
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 100
    assert "more, which --json lists" in text


def checked(*words):
    """What the command ends with and prints as JSON."""
    said = CliRunner().invoke(app, ["check", *map(str, words), "--json"])
    return said.exit_code, json.loads(said.stdout), said.exception


def test_the_exit_code_tells_four_results_apart(run, moved, tmp_path, monkeypatch):
    base = tmp_path / "baseline"
    update_baseline(run, base)
    code, said, _ = checked(run, "--against", base)
    n = sum(said["bits"].values())
    assert (code, said["result"], said["bits"]["equal"]) == (0, "same", n)
    code, said, _ = checked(moved, "--against", base)
    assert (code, said["result"]) == (1, "worse")
    other = run_grid("smoke", tmp_path / "other", METHODS, sets={"seed": 99})
    _, said, error = checked(other, "--against", base)
    assert isinstance(error, RunError)  # which ends the command with 2
    assert said["result"] == "not comparable"
    assert "differ in the scenarios" in said["reason"]
    few = read_book(run)
    said = few.verdict[0].copy()
    said[np.flatnonzero((said == few.truth["cycled"]) & (few.applicable[0] != 0))[:2]] = 2
    monkeypatch.setattr(
        "simbench.bench.check.check.read_book",
        lambda folder: change_answers(few, "horch", said) if folder == run else few,
    )
    code, said, _ = checked(run, "--against", base)
    assert (code, said["result"]) == (3, "cannot tell")
