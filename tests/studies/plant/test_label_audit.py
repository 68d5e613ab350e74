"""Turned labels are detected where evidence is clear, and none is suspected where it agrees."""

import numpy as np
import pandas as pd
import pytest

from results.studies.plant import label_audit as audit


@pytest.fixture
def loops():
    sticky = np.arange(24) % 3 == 0
    odds = np.where(sticky, 3.0, -1.0) + 0.3 * np.random.default_rng(0).standard_normal(24)
    return pd.DataFrame({"unit": [f"u{i // 2}" for i in range(24)], "sticky": sticky, "odds": odds})


def test_turned_labels_are_among_the_first_suspected(loops, monkeypatch):
    monkeypatch.setattr(audit, "DRAWS", 10)
    detected, false = audit.turned(loops)
    assert detected > 0.95
    assert false < 0.05


def test_a_label_is_doubted_by_what_other_units_say(loops):
    labels = loops.sticky.to_numpy().copy()
    labels[0] = False
    p = audit.doubts(loops, labels)
    assert p.argmax() == 0
    assert p[0] > audit.SUSPECTED > np.delete(p, 0).max()
