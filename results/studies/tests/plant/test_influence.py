"""What is changed in a record keeps what it should, and the same seed draws the same changes."""

import numpy as np
import pandas as pd
import pytest

from results.studies.plant import influence as study

FRAME = pd.DataFrame(
    {"pv": np.sin(np.arange(200.0)), "op": np.cos(np.arange(200.0)), "sp": np.zeros(200)}
)


def test_a_unit_and_an_offset_change_pv_and_sp_alike():
    changed = study.scaled(("pv", "sp"), 1e-6, 1e3)(FRAME)
    assert np.ptp(changed.pv) == pytest.approx(1e-6 * np.ptp(FRAME.pv))
    assert changed.sp[0] == pytest.approx(1e-3 * np.ptp(FRAME.pv))
    assert changed.op.equals(FRAME.op)
    assert study.scaled(("pv", "sp"), 2.0)(FRAME[["pv", "op"]]).pv.equals(2.0 * FRAME.pv)


def test_the_same_seed_draws_the_same_changes():
    one, other = (study.disturbed(np.random.default_rng(3))(FRAME) for _ in range(2))
    assert one.equals(other)
    assert not one.equals(FRAME)
