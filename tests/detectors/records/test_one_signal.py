"""Files of one signal each are joined by their names, and only where each holds one."""

import numpy as np
import pytest

from simbench.detectors.errors import RecordError
from simbench.detectors.records.folder import read_folder
from simbench.detectors.records.io import read_record
from simbench.verbs import judge_files

N = 300
K = np.arange(N)
SIGNALS = {
    "OP": 50 + np.sin(K / 7), "PV": 20 + np.cos(K / 7), "SP": np.full(N, 20.0),
}  # fmt: skip


def write(file, values, head="timestamp,value"):
    lines = [f"2024-01-01 00:{k // 60:02d}:{k % 60:02d},{x:.9g}" for k, x in zip(K, values)]
    file.write_text("\n".join([head, *lines]) + "\n")


@pytest.fixture
def folder(tmp_path):
    for name, values in SIGNALS.items():
        write(tmp_path / f"FIC707.{name}.csv", values)
    return tmp_path


def test_the_record_of_a_transmitter_of_the_valves_position_is_mv(folder):
    write(folder / "ZT707.PV.csv", SIGNALS["OP"] + 1)
    record = read_folder(folder)[0]["FIC707"]
    assert record.mv == pytest.approx(SIGNALS["OP"] + 1, abs=1e-6)
    assert record.pv == pytest.approx(SIGNALS["PV"], abs=1e-6)
    assert "columns: MV is 'ZT707.PV'" in record.notes


def test_two_loops_and_a_whole_record_stay_apart(folder):
    for name, values in SIGNALS.items():
        write(folder / f"LIC9_{name}.csv", 2 * values)
    rows = [f"{k},{50 + k % 3},{k % 5}" for k in K]
    (folder / "TIC3.PV.csv").write_text("\n".join(["t,op,pv", *rows]))
    assert list(read_folder(folder)[0]) == ["FIC707", "LIC9", "TIC3.PV"]
    report = judge_files(folder, ["horch"])
    assert [row["record"] for row in report.as_json()] == ["FIC707", "LIC9", "TIC3.PV"]


def test_files_that_hold_more_than_a_signal_are_not_joined(folder):
    rows = [f"{k},{50 + k % 3},{k % 5}" for k in K]
    (folder / "FIC707.OP.csv").write_text("\n".join(["t,op,pv", *rows]))
    records, refused = read_folder(folder)
    assert list(records) == ["FIC707.OP"]
    assert {*refused} == {"FIC707.PV", "FIC707.SP"}


@pytest.mark.parametrize(
    "column", ["ZT1010.PV", "ZI-1010", "ZIT1010A", "FV1010.POS", "POS", "Travel", "valve travel"]
)
def test_a_column_of_the_valves_position_is_mv_and_is_named(tmp_path, column):
    head = f"t,FIC1010.PV,FIC1010.OP,{column}"
    rows = [f"{k},{k % 5},{50 + k % 3},{40 + k % 7}" for k in K]
    (tmp_path / "rec.csv").write_text("\n".join([head, *rows]))
    record = read_record(tmp_path / "rec.csv")
    assert record.mv == pytest.approx(40 + K % 7)
    assert record.pv == pytest.approx(K % 5)
    assert f"columns: MV is '{column}'" in record.notes


def test_a_position_is_no_output(tmp_path):
    rows = [f"{k},{k % 5},{k % 2},{40 + k % 7}" for k in K]
    (tmp_path / "rec.csv").write_text("\n".join(["t,FIC7.PV,FIC7.SV,FIC7.POS", *rows]))
    with pytest.raises(RecordError, match="no OP column"):
        read_record(tmp_path / "rec.csv")
