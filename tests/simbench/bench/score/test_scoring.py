"""Scores and calibration against slow recounts and hand-made cases."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from simbench.bench.execute.run import run_grid
from simbench.bench.score import no_waveform
from simbench.bench.score.answers import home_of
from simbench.bench.score.names import ALL, OF_NOT_OSCILLATING, OF_OSCILLATING
from simbench.bench.score.scoring import score_book, score_run
from simbench.bench.store.benchmark import FROM_RECORDS
from simbench.cli import main
from simbench.detectors.verdict import NO_DECISION, STICTION
from simbench.scenarios.grid import make_grid
from simbench.scenarios.spec import Loop

LOOP = Loop.from_table(
    {
        "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
        "controller": {"type": "PI", "Kc": 1, "Ti": 10},
        "valve": {"model": "choudhury", "S": 5, "J": 2},
        "sampling": {"Ts": 2, "n": 1000},
        "setpoint": {"value": 50, "steps": [[10, 53]]},
    }
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """One run of three methods: of either kind of process, of self-regulating ones alone, with
    MV.
    """
    return run_grid("smoke", tmp_path_factory.mktemp("run") / "done", ["he", "horch", "yamashita"])


@pytest.fixture(scope="module")
def joined(finished):
    verdicts, scenarios = (
        pd.read_parquet(finished / f"{t}.parquet") for t in ("verdicts", "scenarios")
    )
    return verdicts.merge(scenarios, on="scenario_id", suffixes=("", "_s"))


@pytest.fixture(scope="module")
def scores(finished):
    return score_run(finished)


@pytest.fixture(scope="module")
def rows(scores):
    return scores.table.set_index(["method", "truth", "process", "population"]).sort_index()


@pytest.mark.parametrize("population", [ALL, OF_OSCILLATING, OF_NOT_OSCILLATING])
@pytest.mark.parametrize("process", ["all", "self-regulating", "integrating"])
@pytest.mark.parametrize("truth", ["sticky", "predicted", "cycled"])
def test_the_table_is_a_plain_count(rows, joined, truth, process, population):
    verdict = joined.verdict
    positive = joined.cycled == "yes" if truth == "cycled" else joined[truth].astype(bool)
    known = joined.cycled.isin(["yes", "no"]) if truth == "cycled" else joined[truth].notna()
    if population != ALL:
        known &= joined.oscillating == (population == OF_OSCILLATING)
    if process != "all":
        known &= (
            joined.process == {"self-regulating": "foptd", "integrating": "integrating"}[process]
        )
    for method in ("he", "horch", "yamashita"):
        use = known & (joined.method == method)
        row = rows.loc[(method, truth, process, population)]
        # horch is made for self-regulating loops alone
        covered = use & ((joined.process == "foptd") | (method != "horch"))
        answers, true = verdict[covered], positive[covered]
        right = (answers == STICTION) == true
        right &= answers != NO_DECISION
        assert (row.n, row.applicable) == (use.sum(), covered.sum())
        assert row.accuracy_all == pytest.approx(right.sum() / use.sum())
        if not covered.any():
            assert np.isnan(
                [row.accuracy, row.accuracy_decided, row.no_decision, row.sensitivity, row.auc]
            ).all()
            assert row["rank"] is None or np.isnan(row["rank"])
            continue
        assert row.accuracy == pytest.approx(right.mean())
        assert row.accuracy_decided == pytest.approx(
            right[answers != NO_DECISION].mean(), nan_ok=True
        )
        assert row.no_decision == pytest.approx((answers == NO_DECISION).mean())
        assert row.sensitivity == pytest.approx((answers[true] == STICTION).mean(), nan_ok=True)
        assert row.false_positives == pytest.approx(
            (answers[~true] == STICTION).mean(), nan_ok=True
        )
        assert row.accuracy_lo <= row.accuracy <= row.accuracy_hi


def test_auc_is_sklearns_on_the_very_scores_of_the_tables(rows, joined):
    from sklearn.metrics import roc_auc_score

    use = (joined.method == "he") & joined.cycled.isin(["yes", "no"])
    assert (joined.score[use & ~joined.oscillating] == -np.inf).all()
    known = use & joined.score.notna()
    row = rows.loc[("he", "cycled", "all", ALL)]
    assert row.scored == known.sum()
    assert row.auc == pytest.approx(
        roc_auc_score(joined.cycled[known] == "yes", joined.score[known].clip(-1e9))
    )


def test_yardsticks_answer_always_the_same(scores):
    block = scores.rows().set_index("method")
    no, yes = block.loc["always_no"], block.loc["always_yes"]
    assert (no.sensitivity, no.false_positives, yes.sensitivity, yes.false_positives) == (
        0.0,
        0.0,
        1.0,
        1.0,
    )
    assert no.accuracy_all + yes.accuracy_all == pytest.approx(1.0)
    assert no.auc == yes.auc == 0.5
    assert block.loc[["always_no", "always_yes"], "rank"].isna().all()


def test_a_method_that_does_not_apply_is_not_undecided(book):
    truth = np.tile([1, 0], 20)
    verdict = np.array([truth, np.where(np.arange(40) < 20, truth, 2)])
    processes = np.array(["foptd"] * 20 + ["integrating"] * 20)
    run = book(verdict, truth, axes={"process": processes})
    run.applicable[1, 20:] = 0
    shown = ["applicable", "accuracy", "no_decision", "sensitivity", "accuracy_all"]
    partial = score_book(run).rows().set_index("method")
    assert partial.loc["m1", shown].tolist() == [20, 1, 0, 1, 0.5]
    undecided = (
        score_book(book(verdict, truth, axes={"process": processes})).rows().set_index("method")
    )
    assert undecided.loc["m1", shown].tolist() == [40, 0.5, 0.5, 0.5, 0.5]


def test_axis_rows_add_up_to_the_whole(scores):
    for axis in ("disturbance", "S_over_2J", "noise_ratio"):
        rows = scores.by_axis[scores.by_axis.axis == axis].query("method == 'he'")
        whole = scores.rows(population=ALL).set_index("method").loc["he"]
        assert rows.n.sum() == whole.n
        assert (rows.accuracy_all * rows.n).sum() == pytest.approx(whole.accuracy_all * whole.n)


def test_cost_counts_no_decision_as_half_an_error_or_as_asked(book):
    truth = np.tile([1, 0], 30)
    verdict = np.where(np.arange(60) < 30, truth, np.where(np.arange(60) < 50, 2, 1 - truth))
    run = book(verdict, truth)
    assert score_book(run).rows().set_index("method").loc["m0", "cost"] == pytest.approx(
        (10 + 20 / 2) / 60
    )
    assert score_book(run, undecided=1.0).rows().set_index("method").loc[
        "m0", "cost"
    ] == pytest.approx(0.5)


def test_the_table_is_ranked_by_cost_not_by_silence(book):
    rng = np.random.default_rng(4)
    truth = np.tile([1, 0], 500)
    verdict = np.array(
        [
            np.where(rng.random(1000) < 0.5, truth, 2),
            np.where(rng.random(1000) < 0.62, truth, 1 - truth),
        ]
    )
    shown = score_book(book(verdict, truth)).rows().set_index("method")
    assert shown.loc["m0", "accuracy"] < shown.loc["m1", "accuracy"]
    assert shown.loc[["m0", "m1"], "rank"].tolist() == [1, 2]


def test_a_large_run_counts_all_loops_and_orders_a_sample_of_whole_groups(book, monkeypatch):
    rng = np.random.default_rng(8)
    n = 6000
    truth = rng.integers(0, 2, n)
    verdict = np.array([np.where(rng.random(n) < s, truth, 2 * (s < 0.8)) for s in (0.9, 0.7)])
    run = replace(book(verdict, truth), groups=np.repeat(np.arange(n // 3), 3))
    run = replace(run, score=truth + rng.normal(size=(2, n)), design=rng.normal(size=(n, 6)))
    whole = score_book(run)
    monkeypatch.setattr(no_waveform, "MOST_ORDERED", 1500)
    run = replace(run)
    part = score_book(run)
    taken = np.bincount(run.groups[no_waveform.sample_of(run.groups)], minlength=n // 3)
    assert set(taken) == {0, 3}
    assert part.counts["sampled"] == taken.sum() == 1500
    one, other = (x.rows().set_index("method") for x in (whole, part))
    counted = ["n", "n_all", "positives", "accuracy", "sensitivity", "cost", "errors", "rank"]
    pd.testing.assert_frame_equal(one.loc[["m0", "m1"], counted], other.loc[["m0", "m1"], counted])
    assert other.applicable.to_dict() == {
        **one.applicable,
        "no_waveform": 1500,
        "rhythm": 1500,
    }
    width = [(t.cost_hi - t.cost_lo).loc["m0"] for t in (one, other)]
    assert width[0] == pytest.approx(width[1], rel=0.15)
    assert other.loc["m0", "scored"] == 1500
    assert other.auc["m0"] == pytest.approx(one.auc["m0"], abs=0.05)
    assert "rest on 1500 scenarios, drawn at random" in " ".join(part.as_text().split())
    assert "drawn at random" not in whole.as_text()
    assert part.as_json()["sampled"] == 1500


def test_scores_are_a_table_a_picture_and_a_notebook_cell(scores):
    frame = scores.to_frame()
    assert frame.equals(scores.ranking())
    assert frame.method.tolist() == scores.rows().method.tolist()
    assert frame.shape[1] == 10
    axes = scores.plot()
    bars = [p.get_width() for p in axes.patches]
    # what orders the bars is what they show
    assert bars == pytest.approx(sorted(frame.cost, reverse=True), nan_ok=True)
    canvas = axes.figure.canvas
    canvas.draw()
    assert all(t.get_window_extent().x0 >= 0 for t in axes.get_yticklabels())
    assert axes.figure.dpi >= 200
    assert "another rank" in scores._repr_html_()
    assert "\n" not in repr(scores)


def test_a_method_tuned_on_loops_like_those_of_a_users_grid_is_marked(book):
    truth = np.tile([1, 0], 30)
    about = {"Td_over_T": 0.5, "cell_S_over_2J": 1.0}

    def marked(share, **changed):
        """Return the home of a method where a share of the loops is within the ranges."""
        here = np.arange(60) < 60 * share
        axes = {k: np.where(here, v, 100.0) for k, v in (about | changed).items()}
        axes["process"] = np.full(60, "foptd")
        run = book([truth], truth, axes=axes)
        run.manifest["methods"]["m0"] = {**run.manifest["methods"]["m0"], "fitted_on": ["chapter"]}
        return home_of("m0", run)

    assert marked(1.0) == marked(0.6) == "siblings"
    assert marked(0.4) == marked(1.0, Td_over_T=3.0) == marked(1.0, cell_S_over_2J=0.3) == "no"


def test_rates_over_an_axis_are_printed_and_given_as_json(finished, joined, capsys):
    scores = score_run(finished)
    rows = scores.along("disturbance")
    for row in rows[rows.method == "he"].to_dict("records"):
        use = joined[(joined.method == "he") & joined.cycled.isin(["yes", "no"])]
        use = use[use.disturbance == row["disturbance"]]
        hit, sticks = use.verdict == STICTION, use.cycled == "yes"
        assert row["n"] == len(use)
        assert row["sensitivity"] == pytest.approx(hit[sticks].mean(), nan_ok=True)
        assert row["false_positives"] == pytest.approx(hit[~sticks].mean(), nan_ok=True)
    assert set(rows.method) == {"he", "horch", "yamashita"}
    assert main(["score", str(finished), "--by", "disturbance"]) == 0
    said = capsys.readouterr().out
    assert "\ndisturbance  method" in said
    assert "accuracy" in said
    assert "no_waveform" not in said  # no ranking before it
    assert main(["score", str(finished), "--by", "disturbance", "--json"]) == 0
    by = json.loads(capsys.readouterr().out)["by"]
    assert by["axis"] == "disturbance"
    assert len(by["rows"]) == len(rows)
    assert main(["score", str(finished), "--by", "disturbanc"]) == 2
    assert "did you mean 'disturbance'" in capsys.readouterr().err


def test_a_gap_in_the_answers_neither_helps_nor_harms(book):
    rng, truth = np.random.default_rng(9), np.arange(2000) % 2
    said = np.where(rng.random(2000) < 0.8, truth, 1 - truth)
    run = book([said, said, np.full(2000, 2)], truth)
    run.applicable[1, ::12] = 0
    ranks = score_book(run).rows().set_index("method")["rank"]
    assert ranks["m0"] == ranks["m1"] == 1
    run.applicable[1, ::8] = 0
    assert np.isnan(score_book(run).rows().set_index("method")["rank"]["m1"])


def test_loops_with_one_record_and_the_same_labels_count_once(book):
    # forty copies of each of forty records: counts, intervals and areas are those of one of each
    truth = np.arange(40) % 2
    verdict = np.array([np.where(np.arange(40) < 30, truth, 1 - truth)])
    once = book(verdict, truth, ids=[f"{k:016d}" for k in range(40)])
    copies = book(np.tile(verdict, 40), np.tile(truth, 40), hashes=list(once.ids) * 40)
    columns = ["n", "accuracy", "accuracy_lo", "accuracy_hi", "cost", "auc", "no_decision"]
    one, many = (score_book(run).rows().set_index("method") for run in (once, copies))
    pd.testing.assert_frame_equal(one.loc[["m0"], columns], many.loc[["m0"], columns])
    assert "1560 of 1600 loops have the record of another bit for bit" in (
        " ".join(score_book(copies).as_text().split())
    )
    assert score_book(copies).as_json()["copies"] == 1560
    assert score_book(once).as_json()["copies"] == 0


def test_a_grid_that_draws_copies_is_told_when_it_is_loaded_and_ranks_nothing(tmp_path, capsys):
    table = {**LOOP.to_table(), "sampling": {"Ts": 2, "n": 300}}
    content = {"title": "same", "repeats": 40, "loop": table, "axes": {"valve.S": [0.0, 5.0]}}
    text = score_run(run_grid(make_grid(content), tmp_path / "run", ["he"])).as_text()
    assert "repeats of its first loop are the same record" in capsys.readouterr().err
    assert "78 of 80 loops have the record of another" in text
    assert "There is no ranking" in text
    run_grid(make_grid(content, sets={"noise.std": 0.1}), tmp_path / "noisy", ["he"])
    assert "same record" not in capsys.readouterr().err


def test_where_no_ranking_is_possible_the_reason_is_printed(book):
    few = np.tile([1, 0], 9)
    text = score_book(book([few, few], few)).as_text()
    assert (
        "There is no ranking: 18 oscillating loops have a clear label, and 30 are needed." in text
    )
    assert score_book(book([few, few], few)).rows()["rank"].isna().all()
    unclear = score_book(book(np.ones(40), np.full(40, -1)))
    assert "There is no ranking: 0 oscillating loops have a clear label" in unclear.as_text()
    whole = " ".join(unclear.as_text(full=True).split())
    assert "0 yes, 0 no, 0 entrained, 40 unclear" in whole
    truth = np.tile([1, 0], 30)
    partly = book([truth, truth], truth)
    partly.applicable[:, 20:] = 0
    partial = score_book(partly).as_text()
    assert "There is no ranking: no method answers 90 % of the 60 loops; m0 answers 20." in partial
    alone = score_book(book(truth, truth)).as_text()
    assert "Only one method covers these loops" in alone


def advised(book, said, source=FROM_RECORDS):
    """Return the first sentence of the ranking of a run whose grid has this source."""
    told = book(said, np.tile([1, 0], 60))
    told = replace(told, manifest={**told.manifest, "grid_content": {"source": source}})
    return " ".join(score_book(told).as_text().split("\n\n")[0].split())


def test_a_run_made_from_records_begins_with_the_method_to_rely_on(book):
    truth = np.tile([1, 0], 60)
    silent = np.full(120, 2)
    assert advised(book, [truth, silent]) == (
        "Rely on m0 for such loops: on 120 simulations of loops like these m0 is right in 100% and"
        " wrong in 0%."
    )
    two = advised(book, [truth, truth, silent])
    assert two.endswith("wrong in 0%; these loops do not tell it from m1.")
    wrong = advised(book, [np.roll(truth, 1), silent])
    assert wrong.startswith("No method is known to be worth more here than no answer: on 120")
    assert advised(book, [truth, silent], "own").startswith("grid ")


def test_loops_that_do_not_oscillate_have_another_table(book):
    rng = np.random.default_rng(6)
    going = np.arange(200) < 100
    truth = np.where(going, rng.integers(0, 2, 200), 0)
    run = replace(
        book(np.where(going, truth, 1), truth),
        oscillating=going,
    )
    assert "loops that do not oscillate (" in score_book(run).as_text(full=True)
    still = score_book(run).rows(population=OF_NOT_OSCILLATING).set_index("method").loc["m0"]
    assert (still.n, still.false_positives, still.no_decision) == (100, 1.0, 0.0)
    lines = score_book(run).as_text(full=True).splitlines()
    at = next(
        k
        for k, line in enumerate(lines)
        if line.startswith("loops that do not oscillate (100, 0 positive)")
    )
    assert lines[at + 2].split() == ["m0", "100", "1.00", ".00"]


def test_a_method_that_failed_more_often_than_allowed_has_no_rank(book):
    truth = np.tile([1, 0], 50)
    run = book([truth, truth, truth], truth)
    run.failed[1, :20] = True
    ranks = [
        score_book(run, allow_failed=share).rows().set_index("method")["rank"]["m1"]
        for share in (0.0, 0.2)
    ]
    assert np.isnan(float(ranks[0] if ranks[0] is not None else "nan"))
    assert ranks[1] == 1
    assert "Not ranked, too many errors: m1 failed on 20 records." in score_book(run).as_text()
    assert "Not ranked" not in score_book(run, allow_failed=0.2).as_text()
