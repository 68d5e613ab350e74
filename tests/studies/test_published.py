"""Methods as published: a variant is its source's numbers and nothing else, and the table holds
both.
"""

import numpy as np
import pytest

from results.studies.published import _columns, rows, variants
from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods
from simbench.detectors.record import LoopRecord


@pytest.mark.parametrize("name", methods.names())
def test_every_method_can_be_asked_as_published(name):
    ours, source = methods.load(name).METHOD, methods.load(f"{name}@published").METHOD
    assert source.defaults() == {**ours.defaults(), **ours.published}
    assert set(ours.published) <= set(ours.thresholds)
    assert all(ours.thresholds[key].source.startswith("own") for key in ours.published), (
        "only rules that no source has"
    )


def test_a_method_as_published_is_the_method_with_the_sources_numbers():
    t = np.arange(3000) / 10
    record = LoopRecord(
        np.sin(t) + 0.2 * np.sin(2 * t),
        -np.sign(np.sin(t - 0.5)) * 1.0,
        1.0,
        process="self-regulating",
    )
    for name in (n for n in methods.names() if methods.load(n).METHOD.published):
        asked = judge(record, [f"{name}@published"])[0]
        expected = judge(record, [name], thresholds={name: methods.load(name).METHOD.published})[0]
        assert (asked.verdict, asked.score, asked.reason) == (
            expected.verdict,
            expected.score,
            expected.reason,
        )


def test_the_gain_is_counted_over_loops_that_only_one_of_the_two_gets_right():
    verdicts, best = np.array([1, 0, -1, 0]), np.array([1, 1, 1, 0])
    columns = _columns(
        "g", verdicts, np.ones(4, dtype=bool), np.array([True, True, True, False]), best
    )
    assert columns["g"] == "0.500 of 4"
    assert columns["g cost"] == "0.375"
    assert columns["g gain"].startswith("+0.500")
    assert (columns["g found"], columns["g false"], columns["g open"]) == (
        "0.333",
        "0.000",
        "0.250",
    )


@pytest.mark.slow
def test_the_table_has_a_row_per_variant_and_leaves_absent_records_out(tmp_path):
    table = rows({"smoke": 12}, tmp_path, tmp_path / "records.csv")
    assert [(r["method"], r["variant"]) for r in table] == [(m, v) for m, v, _ in variants()]
    assert {"smoke", "smoke found"} <= set(table[0])
    assert "real found" not in table[0]
