"""Numbers published for real loops, and every real record judged without an exception."""

import csv

import pytest

from simbench.detectors.judge import judge
from simbench.detectors.plugins.registry import methods
from simbench.detectors.prepared import Prepared
from simbench.detectors.records.io import read_record
from simbench.detectors.signal.half_cycles import misfit, sines, two_line_misfit, typical_means


def read(folder, name, **about):
    return read_record(folder / f"{name}.csv", **about)


def test_pap2_yamashita(real_folder):
    verdict = judge(read(real_folder, "ISDB_PAP2", kind="flow"), ["yamashita"])[0]
    assert verdict.indices["rho1"] == pytest.approx(0.487, abs=0.01)  # printed 0.48
    assert verdict.indices["rho3"] == pytest.approx(0.415, abs=0.01)  # printed 0.41
    assert verdict.verdict == "stiction"


def test_pap4_horch(real_folder):
    verdict = judge(read(real_folder, "ISDB_PAP4"), ["horch"])[0]
    # printed 0.13, reached by no variant
    assert verdict.indices["dtau"] == pytest.approx(0.10, abs=0.02)
    assert verdict.indices["drho"] < 0.02
    assert verdict.verdict == "no_stiction"


def test_chem1_he_and_horch(real_folder):
    record = read(real_folder, "ISDB_CHEM1")
    he, horch = judge(record, ["he", "horch"])
    assert he.indices["eta_two_line"] == pytest.approx(0.844, abs=0.005)  # over every half cycle
    assert he.indices["eta"] == pytest.approx(0.797, abs=0.005)
    assert (he.verdict, horch.verdict) == ("stiction", "stiction")
    humps = Prepared(record).half_cycles("op")
    sine, two_line = typical_means(misfit(humps, sines()), two_line_misfit(humps), left_out=0.1)
    # printed 0.83, without the odd tenth
    assert sine / (sine + two_line) == pytest.approx(0.83, abs=0.005)


def test_pap2_is_stiction_to_the_methods_it_is_published_for(real_folder):
    verdicts = judge(
        read(real_folder, "ISDB_PAP2", kind="flow"),
        ["horch", "yamashita", "rossi_scali", "singhal_salsbury"],
    )
    assert {v.verdict for v in verdicts} == {"stiction"}


def test_dead_lines_are_no_decision_with_the_reason(real_folder):
    for name in ("SGPT_RHT-7050-342-FIC10112_0630-0002", "SGPT_RHT-7050-342-FIC10112_0702-0009"):
        for verdict in judge(read(real_folder, name), ["horch", "he"]):
            assert verdict.verdict == "no_decision"
            assert "PV never changes" in verdict.reason


def test_every_record_is_judged_by_every_method(real_folder):
    with (real_folder / "records.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    fast = [name for name in methods.names() if methods.load(name).METHOD.budget == "fast"]
    kinds = {"concentration": "analyser"}
    assert len(rows) >= 60
    for row in rows:
        record = read(
            real_folder,
            row["id"],
            process=row["dynamics"] or None,
            kind=kinds.get(row["type"], row["type"]) or None,
        )
        for raw in (False, True):
            for verdict in judge(record, fast, raw=raw):
                assert verdict.reason
