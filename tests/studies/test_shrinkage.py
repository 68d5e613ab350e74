"""The study that compares claimed with true shrinkage of known parameters."""

import json

import numpy as np
import pandas as pd
import pytest

from results.studies import shrinkage as shrinkage_check
from results.studies.shrinkage import WAYS, ShrinkageStudy, main, on_the_way, study, summary
from simbench.loop.effects import EFFECTS

SEED, RECORDS = 101, 3


@pytest.fixture(scope="module")
def found():
    return study(RECORDS, SEED)


def test_every_record_is_compared_or_left_out_with_a_reason(found):
    assert found.pairs.record.nunique() + sum(found.left_out.values()) == RECORDS
    assert (found.pairs.groupby("record").size() == len(WAYS) + 1).all()


def test_nothing_is_claimed_for_nothing_and_most_for_the_truth(found):
    middle = found.pairs.groupby("way")[["claimed", "true"]].median()
    assert abs(middle.true[0.0]) < 0.15
    assert abs(middle.claimed[0.0]) < 0.3
    assert (middle.loc[1.0] > 0.85).all()
    assert (middle.loc[1.0] >= middle.loc[[0.0, 0.25, 0.5, 0.75]].max()).all()


def test_the_wrong_candidate_is_of_another_block(found):
    for row in found.pairs[found.pairs.way.isna()].itertuples():
        assert EFFECTS[row.candidate].block != EFFECTS[row.effect].block


def test_same_seed_same_bits(found):
    again = pd.DataFrame(shrinkage_check._one(SEED, 0)[0])[["claimed", "lo", "hi", "true"]]
    assert np.array_equal(again, found.pairs[found.pairs.record == 0][["claimed", "lo", "hi", "true"]])


def test_files_hold_pairs_summary_and_picture(found, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(shrinkage_check, "study", lambda n, seed, jobs: found)
    assert main(["-n", "3", "-o", str(tmp_path / "new")]) == 0
    table = pd.read_csv(tmp_path / "new" / "pairs.csv")
    assert list(table.columns) == shrinkage_check.COLUMNS
    assert len(table) == len(found.pairs)
    told = json.loads((tmp_path / "new" / "summary.json").read_text())
    assert told == json.loads(capsys.readouterr().out)
    low, high = told["all pairs"]["interval"]
    assert low <= told["all pairs"]["spearman"] <= high
    assert (tmp_path / "new" / "scatter.png").stat().st_size > 1000


def pairs(claimed, true):
    n = len(true)
    rows = [
        [r, "noise", "foptd", "strong", "noise", 1.0, claimed[i], 0, 1, 3, 1, 1, True, true[i]]
        for r in (0, 1)
        for i in range(n)
    ]
    return ShrinkageStudy(pd.DataFrame(rows, columns=shrinkage_check.COLUMNS), {})


def test_rank_correlation_of_a_monotone_claim_is_one_and_of_a_reversed_one_minus_one():
    true = np.array([0.0, 0.2, 0.7, 0.9])
    assert summary(pairs(true**3, true))["all pairs"]["spearman"] == pytest.approx(1.0)
    assert summary(pairs(-true, true))["within records, mean"]["spearman"] == pytest.approx(-1.0)


def test_unresolvable_pairs_do_not_count():
    given = pairs([0.0, 0.2, 0.7, 0.9], [0.0, 0.2, 0.7, 0.9])
    given.pairs.loc[0, "resolvable"] = False
    assert summary(given)["pairs"] == len(given.pairs) - 1


def test_an_interval_that_holds_half_of_the_true_shares_is_said_to():
    given = pairs([0.0, 0.2, 0.7, 0.9], [0.0, 0.2, 0.7, 0.9])
    given.pairs["lo"], given.pairs["hi"] = given.pairs.true - 0.1, given.pairs.true + 0.1
    assert summary(given)["interval holds the truth"] == 1.0
    given.pairs.loc[::2, "lo"] = given.pairs.loc[::2, "true"] + 0.05
    assert summary(given)["interval holds the truth"] == 0.5


@pytest.mark.parametrize("effect", EFFECTS)
def test_the_way_begins_at_identity_and_passes_through_the_truth(effect):
    quantities = EFFECTS[effect].parameters
    truth = {
        name: "loop" if name == "at" else {"lo": 40.0, "hi": 60.0, "rate": 0.01}.get(name, 0.5 * (q.identity or 1.0))
        for name, q in quantities.items()
    }
    assert on_the_way(effect, truth, 1.0, (30.0, 70.0)) == pytest.approx(truth)
    start = on_the_way(effect, truth, 0.0, (30.0, 70.0))
    kept = {"c", "period", "at", *(["rate"] if effect in ("outliers", "load_steps") else [])}
    assert all(start[k] == (truth[k] if k in kept else quantities[k].identity) for k in truth)
