"""Quiet loops are as quiet as they are said to be, and every third one sticks."""

import numpy as np

from results.studies.plant import archives
from results.studies.plant.archives import quiet


def test_two_of_three_valves_are_sound_and_noise_is_small():
    drawn = [quiet(number) for number in range(3)]
    assert [sticky for _, sticky in drawn] == [False, False, True]
    for record, _ in drawn:
        assert record.n <= archives.LONGEST
        assert np.std(np.diff(record.pv, 2)) < 0.2 * np.ptp(record.pv)


def test_the_panel_is_printed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("results.studies.plant.recorded_loops.PANEL", {"as it is": lambda r: r})
    assert archives.main([str(tmp_path), "-n", "1"]) == 0
    assert capsys.readouterr().out.startswith(
        "1 records changed in 1 ways: 0 confident verdicts of stiction added"
    )
