"""Recorded loops are counted by record and by unit, and changed as archives change them."""

import numpy as np
import pandas as pd
import pytest

from results.studies.plant import recorded_loops as recorded
from results.studies.plant.recorded_loops import PANEL, counted
from simbench.detectors.record import LoopRecord
from simbench.files import write_record


@pytest.fixture(scope="module")
def wave():
    t = np.arange(600.0)
    return LoopRecord(op=50 + np.sin(t / 7), pv=3 * np.cos(t / 7) + 0.01 * t, Ts=2.0)


@pytest.mark.parametrize("name", PANEL)
def test_an_archive_keeps_the_hours_and_the_shape(wave, name):
    seen = PANEL[name](wave)
    assert seen.n * seen.Ts == pytest.approx(wave.n * wave.Ts, rel=0.01)
    assert seen.op.size == seen.pv.size
    again = np.interp(np.arange(wave.n) * wave.Ts, np.arange(seen.n) * seen.Ts, seen.pv)
    assert np.std(again - wave.pv) < 0.4 * np.std(wave.pv)
    assert not (seen.n == wave.n and np.array_equal(seen.pv, wave.pv))


def test_a_unit_is_called_by_most_of_its_records_and_by_the_likelihood_from_all_of_them():
    rows = pd.DataFrame(
        {
            "unit": list("aaabbc"),
            "loop": list("aaabbc"),
            "sticky": [True] * 3 + [False] * 3,
            "procedure": [True, False, False, True, False, False],
            "odds": [4.0, 4.0, -1.0, 3.0, -3.0, None],
        }
    )
    by_record, by_loop, by_unit = counted(rows, "likelihood")
    assert "found 2 of 3" in by_record
    assert "false alarms 1 of 3" in by_record
    assert "found 1 of 1" in by_loop
    assert "false alarms 0 of 2" in by_unit
    assert "found 0 of 1" in counted(rows, "procedure")[2]


def test_only_records_with_a_label_that_nobody_doubts_are_asked_about_and_once(
    wave, tmp_path, monkeypatch, capsys
):
    good = {
        "unit_group": "u",
        "loop": "l",
        "label": "stiction",
        "label_doubt": "",
        "usable": 1,
        "primary": 1,
        "dynamics": "integrating",
    }
    rows = [good, good | {"label_doubt": "why"}, good | {"label": "unknown"}, good | {"primary": 0}]
    pd.DataFrame([{"id": f"r{i}", **row} for i, row in enumerate(rows)]).to_csv(
        tmp_path / "records.csv", index=False
    )
    for i in range(4):
        write_record(wave, tmp_path / f"r{i}.csv")
    asked = []
    monkeypatch.setattr(
        recorded, "weighed", lambda r: asked.append(r.process) or {"procedure": True, "odds": None}
    )
    for _ in range(2):
        assert recorded.main([str(tmp_path), "-o", str(tmp_path / "kept")]) == 0
    assert asked == ["integrating"]
    assert "procedure    by unit    found 1 of 1" in capsys.readouterr().out
