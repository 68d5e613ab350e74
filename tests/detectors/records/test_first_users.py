"""Tables as first users bring them: without a header, long with a loop's name, as MATLAB saves
them, with units in the cells.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from simbench.cli import main
from simbench.detectors.errors import RecordError
from simbench.detectors.records.io import read_record, read_records

T = np.arange(40.0)
OP, PV = 50 + 5 * np.sin(T / 3), 20 + np.cos(T / 3)
PUBLIC = Path(__file__).parents[4] / "shared" / "data" / "public" / "reader"


def written(path, head, rows):
    path.write_text("\n".join([*([head] if head else []), *rows]) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("mark", [",", ";", "  ", "\t"])
def test_columns_of_a_table_without_a_header_are_counted(tmp_path, mark):
    rows = [
        mark.join(f"{x:.4e}" for x in (k, p, 7.0, o)) for k, p, o in zip(T, PV, OP, strict=True)
    ]
    path = written(tmp_path / "rec.dat", "", rows)
    record = read_record(path, columns={"op": "4", "pv": "2"}, Ts=180.0)
    assert np.allclose(record.op, OP, rtol=1e-3)
    assert np.allclose(record.pv, PV, rtol=1e-3)
    assert record.Ts == 180.0
    assert any("counted from 1" in n for n in record.notes)
    with pytest.raises(RecordError, match="no header line, the first holds numbers") as refused:
        read_record(path)
    assert refused.value.cure == "--columns t=1,pv=2,op=4"
    assert read_record(path, columns={"t": "1", "pv": "2", "op": "4"}).Ts == 1.0


def test_a_clock_is_never_proposed_as_a_signal(tmp_path):
    rows = [f"{3.0 * k},{p},{o}" for k, p, o in zip(T, PV, OP, strict=True)]
    path = written(tmp_path / "rec.csv", "", rows)
    with pytest.raises(RecordError, match="'1', given as PV, rises from row to row") as refused:
        read_record(path, columns={"pv": "1", "op": "2"})
    assert not refused.value.cure
    with pytest.raises(RecordError, match="no time column") as refused:
        read_record(path, columns={"pv": "2", "op": "3"})
    assert refused.value.cure == "--columns t=1"
    named = written(tmp_path / "named.csv", "k,PV,OP", rows)
    with pytest.raises(RecordError, match="no time column") as refused:
        read_record(named)
    assert refused.value.cure == "--columns t=k"
    assert read_record(named, columns={"t": "k"}).Ts == 3.0
    bare = written(tmp_path / "bare.csv", "", [row.partition(",")[2] for row in rows])
    with pytest.raises(RecordError, match="no time column") as refused:
        read_record(bare, columns={"pv": "1", "op": "2"})
    assert refused.value.cure == "--ts 1"


def test_the_range_of_a_record_is_never_proposed_as_that_of_its_valve(tmp_path):
    rows = [f"{k},{p},{o / 25.0 - 2.0}" for k, p, o in zip(T, PV, OP, strict=True)]
    notes = read_record(written(tmp_path / "rec.csv", "t,PV,OP", rows)).notes
    (unit,) = [note for note in notes if note.startswith("unit: ")]
    assert unit.endswith("of travel is not known (--op-span LO HI states it)")
    counts = [f"{k},{p},{40 * o}" for k, p, o in zip(T, PV, OP, strict=True)]
    notes = read_record(written(tmp_path / "counts.csv", "t,PV,OP", counts)).notes
    assert any("add --op-span 0 4095" in note for note in notes)


def test_a_line_with_a_fault_is_named_as_the_file_counts(tmp_path):
    rows = [f"{o},{p}" for o, p in zip(OP, PV, strict=True)]
    path = written(tmp_path / "rec.csv", "", [*rows[:10], "x,1", *rows[10:]])
    with pytest.raises(RecordError, match="line 11: "):
        read_record(path, columns={"op": "1", "pv": "2"}, Ts=1.0)


def test_a_table_that_names_the_loop_of_every_row_is_several_loops(tmp_path, capsys):
    rows = []
    for k in range(T.size):
        for tag, shift in (("FIC-1", 0.0), ("LIC-2", 10.0)):
            rows.append(f"2026-01-01T00:00:{k:02d},{tag},{PV[k] + shift},{OP[k]},AUTO,GOOD")
    path = written(tmp_path / "long.csv", "timestamp,loop_tag,pv,op,mode,quality", rows)
    records, refused = read_records(path)
    assert set(records) == {"FIC-1", "LIC-2"}
    assert not refused
    assert np.allclose(records["LIC-2"].pv, PV + 10.0)
    assert read_record(path, tag="FIC-1").n == T.size
    with pytest.raises(RecordError, match="2 loops, FIC-1, LIC-2"):
        read_record(path)
    assert main(["detect", str(path), "--method", "horch"]) == 0
    assert "2 records" in capsys.readouterr().out


def test_words_that_are_no_mode_are_counted(tmp_path):
    rows = [
        f"{k},{o},{p},{'UNKNOWN' if k > 28 else 'AUTO'}" for k, o, p in zip(T, OP, PV, strict=True)
    ]
    notes = read_record(written(tmp_path / "rec.csv", "t,op,pv,mode", rows)).notes
    assert any(n.startswith("mode: 11 samples say 'UNKNOWN'") for n in notes)


@pytest.mark.parametrize(
    "content",
    [
        {"PV": PV, "OP": OP, "SP": np.full(T.size, 20.0), "Ts": 1.0},
        {"t": T, "pv": PV, "op": OP},
        {"plant": {"loop1": {"PV": PV, "OP": OP, "Ts": 1.0}}},
        {"FIC101": {"PV": PV, "OP": OP, "Ts": 1.0}},
    ],
    ids=["signals", "with times", "other root", "one structure"],
)
def test_matlab_files_are_read_as_save_writes_them(tmp_path, content, capsys):
    savemat(tmp_path / "loop.mat", content)
    record = read_record(tmp_path / "loop.mat")
    assert np.allclose(record.pv, PV)
    assert np.allclose(record.op, OP)
    assert record.Ts == 1.0
    assert main(["detect", str(tmp_path / "loop.mat"), "--method", "horch"]) == 0
    assert "records" not in capsys.readouterr().out.splitlines()[0]


def test_matlab_files_with_other_names_take_columns(tmp_path):
    savemat(tmp_path / "loop.mat", {"y": PV, "u": OP, "h": 1.0})
    record = read_record(tmp_path / "loop.mat", columns={"pv": "y", "op": "u"}, Ts=2.0)
    assert np.allclose(record.pv, PV)
    assert record.Ts == 2.0
    savemat(tmp_path / "none.mat", {"h": 1.0})
    with pytest.raises(RecordError, match="variables PV and OP"):
        read_record(tmp_path / "none.mat")


def test_files_are_written_before_the_text_is_printed(tmp_path, monkeypatch):
    rows = [f"{k},{o},{p}" for k, o, p in zip(T, OP, PV, strict=True)]
    path = written(tmp_path / "rec.csv", "t,op,pv", rows)
    table = tmp_path / "q.csv"

    def closed(*_, **__):
        raise BrokenPipeError

    monkeypatch.setattr("simbench.cli.detect.show", closed)
    main(["detect", str(path), "--method", "horch", "--csv", str(table)])
    assert table.read_text(encoding="utf-8").startswith("method,")


@pytest.mark.skipif(not PUBLIC.is_dir(), reason="../shared/data/public/reader is absent")
@pytest.mark.parametrize(
    ("name", "given", "loops"),
    [
        ("g3_degC.csv", {}, 1),
        ("g_grafana_sep.csv", {}, 1),
        ("long_three_loops.csv", {}, 3),
        ("save_PV_OP_SP_Ts.mat", {}, 1),
        ("save_t_pv_op.mat", {}, 1),
        ("tep_no_header.dat", {"columns": {"op": "51", "pv": "21"}, "Ts": 180.0}, 1),
    ],
)
def test_what_people_published_is_read(name, given, loops):
    records, refused = read_records(PUBLIC / name, **given)
    assert len(records) == loops
    assert not refused


@pytest.mark.parametrize(
    ("saved", "cure"),
    [
        ({"data": np.c_[T, PV, OP]}, "t=1,pv=2,op=3"),
        ({"data": np.c_[T, PV, OP].T}, "t=1,pv=2,op=3"),
        ({"simout": {"time": T, "signals": {"values": np.c_[PV, OP]}}}, "pv=1,op=2"),
    ],
)
def test_a_matrix_of_matlab_or_simulink_is_read_by_its_columns(tmp_path, saved, cure):
    savemat(tmp_path / "run.mat", saved)
    with pytest.raises(RecordError, match="columns have no names") as refused:
        read_record(tmp_path / "run.mat")
    assert refused.value.cure == f"--columns {cure}"
    columns = dict(pair.split("=") for pair in cure.split(","))
    record = read_record(tmp_path / "run.mat", columns=columns)
    assert record.Ts == 1.0
    assert np.array_equal(record.pv, PV)
    assert np.array_equal(record.op, OP)


def test_a_matrix_beside_its_time_is_read_too(tmp_path):
    savemat(tmp_path / "run.mat", {"tout": 3.0 * T, "yout": np.c_[PV, OP]})
    with pytest.raises(RecordError, match="no time column") as refused:
        read_record(tmp_path / "run.mat", columns={"pv": "1", "op": "2"})
    assert refused.value.cure == "--columns t=tout"
    record = read_record(tmp_path / "run.mat", columns={"pv": "1", "op": "2", "t": "tout"})
    assert record.Ts == 3.0


def test_a_pace_that_no_loop_has_is_noted(tmp_path):
    def pace(step, **about):
        rows = [f"{step * k},{p},{o}" for k, p, o in zip(T, PV, OP, strict=True)]
        notes = read_record(written(tmp_path / "rec.csv", "t,PV,OP", rows), **about).notes
        return [note for note in notes if "is slower than such loops are recorded" in note]

    assert pace(1000)[0].endswith("if the times count milliseconds, add --ts 1")
    assert pace(250, kind="flow")[0].endswith("--ts 0.25")
    assert not pace(60, kind="flow")
    assert not pace(250, kind="temperature")
