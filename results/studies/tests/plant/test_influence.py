"""What is changed in a record, and what counts as staying."""

import numpy as np
import pandas as pd
import pytest

from results.studies.plant import influence as study
from results.studies.plant.influence import Answer

FRAME = pd.DataFrame(
    {"pv": np.sin(np.arange(200.0)), "op": np.cos(np.arange(200.0)), "sp": np.zeros(200)}
)


def test_a_frozen_tail_stands_still_in_both_signals():
    changed = study.frozen(0.25)(FRAME)
    assert (changed.loc[150:, ["pv", "op"]] == FRAME.loc[149, ["pv", "op"]]).all(axis=None)
    assert changed.loc[:149].equals(FRAME.loc[:149])


@pytest.mark.parametrize("name", study.VALUES)
def test_wild_samples_are_far_from_all_others_or_none(name):
    changed = study.wild("pv", study.VALUES[name], np.array([0.0, 0.5, 0.999]))(FRAME)
    moved = np.flatnonzero(changed.pv != FRAME.pv)
    assert set(moved) <= {0, 99, 198}
    assert changed.op.equals(FRAME.op)
    if name != "0":
        assert len(moved) == 3
        assert (np.abs(changed.pv[moved]) > 10.0).all()


def test_a_unit_and_an_offset_change_pv_and_sp_alike():
    changed = study.scaled(("pv", "sp"), 1e-6, 1e3)(FRAME)
    assert np.ptp(changed.pv) == pytest.approx(1e-6 * np.ptp(FRAME.pv))
    assert changed.sp[0] == pytest.approx(1e-3 * np.ptp(FRAME.pv))
    assert changed.op.equals(FRAME.op)
    assert study.scaled(("pv", "sp"), 2.0)(FRAME[["pv", "op"]]).pv.equals(2.0 * FRAME.pv)


def test_last_bits_are_no_more():
    moved = (study.shaken(FRAME) - FRAME)[["pv", "op"]].to_numpy()
    assert 0.0 < np.abs(moved).max() < 1e-8


def test_the_same_seed_draws_the_same_changes():
    one, other = (study.disturbed(np.random.default_rng(3))(FRAME) for _ in range(2))
    assert one.equals(other)
    assert not one.equals(FRAME)


def test_staying_turning_and_not_telling_are_counted():
    yes, no = Answer("stiction", 0.9, False), Answer("no_stiction", 0.1, True)
    open_, silent = Answer("no_decision", 0.88, True), Answer("no_decision", None, True)
    text = study.counted([(yes, yes), (yes, no), (yes, open_), (silent, silent)])
    assert text.startswith("2 of 4 conclusions stay (0.500), 3 stay or become cannot tell")
    assert "1 turn round; 3 probabilities stay within 0.05" in text
