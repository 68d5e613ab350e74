"""The panel of archives is printed."""

from results.studies.plant import archives


def test_the_panel_is_printed(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("results.studies.plant.recorded_loops.PANEL", {"as it is": lambda r: r})
    assert archives.main([str(tmp_path), "-n", "1"]) == 0
    assert capsys.readouterr().out.startswith(
        "1 records changed in 1 ways: 0 confident verdicts of stiction added"
    )
