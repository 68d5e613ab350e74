"""The measurements of the store, on a handful of scenarios."""

import json

import pytest

from results.studies import store_study


def test_seconds_of_handing_out_are_those_after_the_start_without_scoring(
    tmp_path, monkeypatch, capsys
):
    """The clock shows 3 s after the start and at 10 s after the run, of which scoring took
    2.
    """
    clock = iter([3.0, 4.0, 6.0, 10.0])
    monkeypatch.setattr(store_study.time, "process_time", lambda: next(clock))
    monkeypatch.setattr(store_study.pieces, "finish", lambda: None)
    monkeypatch.setattr(
        store_study,
        "run_grid",
        lambda *_, resume=False, **__: store_study.pieces.finish() if resume else None,
    )
    assert store_study._client(str(tmp_path), "smoke", "horch", "1", "") == 0
    assert json.loads(capsys.readouterr().out) == {"start": 3.0, "handing_out": 5.0, "scoring": 2.0}


@pytest.mark.slow  # dask starts four workers, twice in place of killed ones
def test_a_cluster_killed_and_resumed_has_the_tables_of_an_undisturbed_run(capsys):
    pytest.importorskip("distributed")
    assert store_study.main(["cluster", "--n", "3000"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["equal"]
    assert printed["scenarios"] >= 3000
    assert (
        0
        < printed["killed_after"][0]
        < printed["killed_after"][1]
        <= printed["found"]
        < printed["pieces"]
    )
