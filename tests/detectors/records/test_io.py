"""Loaders: every format gives the same record, holes are bridged or cut and said, and each bad file
is one sentence.
"""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from simbench.detectors.errors import RecordError
from simbench.detectors.records.folder import read_folder
from simbench.detectors.records.io import read_record
from simbench.detectors.records.labels import read_labels

REAL = Path(__file__).parents[3] / ".." / "shared" / "data" / "real"
needs_real = pytest.mark.skipif(not REAL.is_dir(), reason=f"real records are not here ({REAL})")

N = 40
OP = np.round(50 + np.sin(np.arange(N) / 3), 6)
PV = np.round(10 + np.cos(np.arange(N) / 3), 6)


def write(folder, rows, head="t,op,pv", name="loop.csv"):
    file = folder / name
    file.write_text("\n".join([head, *rows]) + "\n")
    return file


def rows(t=None, op=OP, pv=PV, sep=","):
    t = 2 * np.arange(N) if t is None else t
    return [f"{a}{sep}{b}{sep}{c}" for a, b, c in zip(t, op, pv, strict=True)]


def frame():
    return pd.DataFrame({"t_s": 2.0 * np.arange(N), "SP": 10.0, "OP": OP, "PV": PV})


def same(record):
    assert record.Ts == pytest.approx(2.0)
    assert np.array_equal(record.op, OP)
    assert np.array_equal(record.pv, PV)
    assert record.notes == ()


@pytest.mark.parametrize(
    "head", ["t,op,pv", "T_S,OP,PV", "Time,FIC101.OP,PV (m3/h)", "timestamp , Op, pV"]
)
def test_columns_are_identified_by_name_in_any_case(tmp_path, head):
    same(read_record(write(tmp_path, rows(), head)))


def test_parquet_and_excel_give_the_same_record(tmp_path):
    frame().to_parquet(tmp_path / "a.parquet")
    frame().assign(
        t_s=pd.Timestamp("2024-01-01") + pd.to_timedelta(2 * np.arange(N), unit="s")
    ).to_excel(tmp_path / "a.xlsx", index=False)
    for name in ("a.parquet", "a.xlsx"):
        record = read_record(tmp_path / name)
        same(record)
        assert record.sp is not None
        assert np.all(record.sp == 10)


def isdb(folder):
    loop = {
        "SP": 10.0,
        "PV": PV,
        "OP": OP,
        "Ts": 2,
        "Type": 1,
        "Comments": "Level control; no stiction",
    }
    other = {
        "SP": np.full(N, 3.0),
        "PV": PV,
        "OP": OP,
        "Ts": 5.0,
        "Type": "Flow",
        "Comments": ["FC145", "stiction"],
    }
    file = folder / "isdb10.mat"
    savemat(
        file,
        {
            "cdata": {
                "chemicals": {"loop1": loop, "loop2": other},
                "mining": {"loop1": {**other, "OP": OP[:3]}},
            }
        },
    )
    return file


def test_isdb_loop_is_read_with_what_the_file_states_about_it(tmp_path):
    record = read_record(isdb(tmp_path), loop="chemicals.loop1")
    same(record)
    assert (record.kind, record.process, record.tag) == ("level", "integrating", "chemicals.loop1")
    assert record.sp is not None
    assert np.all(record.sp == 10)
    second = read_record(isdb(tmp_path), loop="chemicals.loop2")
    assert (second.kind, second.process, second.Ts) == ("flow", None, 5.0)


def test_isdb_file_reads_as_a_folder_and_names_what_it_refuses(tmp_path):
    records, refused = read_folder(isdb(tmp_path))
    assert list(records) == ["chemicals.loop1", "chemicals.loop2"]
    assert "no OP column" in refused["mining.loop1"]


def test_isdb_file_with_several_loops_asks_which(tmp_path):
    with pytest.raises(
        RecordError, match="holds 3 loops; name one of them, which is needed, like chemicals"
    ):
        read_record(isdb(tmp_path))
    with pytest.raises(RecordError, match=r"no loop 'chemicals.loop9', did you mean"):
        read_record(isdb(tmp_path), loop="chemicals.loop9")


def test_column_mapping_goes_before_names(tmp_path):
    file = write(tmp_path, rows(), "clock,output,measured")
    same(read_record(file, columns={"t": "clock", "op": "output", "pv": "measured"}))
    with pytest.raises(RecordError, match="no column 'outptu' for op, did you mean 'output'"):
        read_record(file, columns={"op": "outptu", "pv": "measured"})


def test_what_the_caller_knows_reaches_the_record(tmp_path):
    record = read_record(
        write(tmp_path, rows()),
        kind="diff_pressure",
        process="integrating",
        op_span=(0, 200),
        Ts=7.0,
    )
    assert (record.kind, record.process, record.op_span, record.Ts) == (
        "pressure",
        "integrating",
        (0, 200),
        7.0,
    )


def test_holes_of_three_samples_are_bridged_by_straight_lines_and_noted(tmp_path):
    op, pv = OP.astype(object).copy(), PV.astype(object).copy()
    op[10:13], pv[12] = "", ""
    record = read_record(write(tmp_path, rows(op=op, pv=pv)))
    assert record.n == N
    assert record.notes == ("gaps: 3 of 40 samples missing, bridged by straight lines",)
    assert np.allclose(record.op[9:14], np.linspace(OP[9], OP[13], 5))
    assert np.array_equal(record.op[13:], OP[13:])


def test_a_hole_of_four_samples_splits_and_the_longest_part_is_judged(tmp_path):
    pv = PV.astype(object).copy()
    pv[10:14] = ""
    record = read_record(write(tmp_path, rows(pv=pv)))
    assert np.array_equal(record.pv, PV[14:])
    assert record.notes[0].startswith("gaps: judged samples 14 to 39 of 40")


@pytest.mark.parametrize(("lost", "kept"), [(3, 40), (4, 25)])
def test_missing_rows_count_like_empty_cells(tmp_path, lost, kept):
    lines = rows()
    record = read_record(write(tmp_path, lines[: 15 - lost] + lines[15:]))
    assert record.n == kept
    assert record.notes


def test_uneven_time_is_noted(tmp_path):
    t = 2.0 * np.arange(N)
    t[20:] += 0.5
    record = read_record(write(tmp_path, rows(t)))
    assert record.n == N
    assert "1 of 39 time steps differ from Ts = 2 s" in record.notes[0]
    t = 2.0 * np.arange(N) + 0.004 * (-1) ** np.arange(N)
    assert read_record(write(tmp_path, rows(t))).notes == ()


def test_more_than_a_fifth_missing_is_refused(tmp_path):
    pv = PV.astype(object).copy()
    pv[::5] = ""
    assert read_record(write(tmp_path, rows(pv=pv))).n > 3
    pv[1] = ""
    with pytest.raises(RecordError, match="9 of 40 samples are missing; at most 20% may be"):
        read_record(write(tmp_path, rows(pv=pv)))


def test_empty_set_point_means_unknown_and_a_partial_one_is_held(tmp_path):
    head, sp = "t,op,pv,sp", np.full(N, 10.0).astype(object)
    lines = rows()
    assert read_record(write(tmp_path, [r + "," for r in lines], head)).sp is None
    sp[20:] = 12.0
    sp[18:20] = ""
    record = read_record(
        write(tmp_path, [f"{r},{s}" for r, s in zip(lines, sp, strict=True)], head)
    )
    assert record.sp is not None
    assert np.array_equal(record.sp, np.repeat([10.0, 12.0], 20))
    assert record.notes == ("gaps: 2 of 40 samples of SP missing, bridged",)
    sp[1:39] = ""
    record = read_record(
        write(tmp_path, [f"{r},{s}" for r, s in zip(lines, sp, strict=True)], head)
    )
    assert record.sp is None
    assert "SP has holes" in record.notes[0]


@pytest.mark.parametrize("name", ["sp", "mv"])
@pytest.mark.parametrize(
    ("hole", "n", "known"),
    [(slice(8, 11), 40, True), (slice(8, 12), 28, True), (slice(15, 30), 40, False)],
)
def test_holes_of_mv_and_of_sp_split_like_any_unless_that_costs_half_of_the_record(
    tmp_path, name, hole, n, known
):
    x = np.arange(N).astype(object)
    x[hole] = ""
    record = read_record(
        write(tmp_path, [f"{r},{s}" for r, s in zip(rows(), x, strict=True)], f"t,op,pv,{name}")
    )
    assert record.n == n
    assert (getattr(record, name) is not None) is known
    assert np.array_equal(record.pv, PV[N - n :])
    assert record.notes
    assert all(note.startswith("gaps") for note in record.notes)


def test_notes_survive_blinding(tmp_path):
    pv = PV.astype(object).copy()
    pv[5] = ""
    assert read_record(write(tmp_path, rows(pv=pv))).without_mv().notes


BAD = {
    "missing": (None, "does not exist"),
    "empty": (b"", "is empty"),
    "binary": (bytes(range(256)) * 9, "is binary"),
    "number with its unit": (
        "t,op,pv\n0,1,2\n1,1,2 °C\n".encode("latin-1"),
        "line 3: pv is '2 °C'",
    ),
    "no PV column": (b"t,op\n0,1\n", "no PV column; columns are: t, op"),
    "text in PV": (b"t,op,pv\n0,1,2\n1,1,2\n2,1,high\n3,1,2\n", "line 4: pv is 'high'"),
    "infinite PV": (b"t,op,pv\n0,1,2\n1,1,inf\n2,1,2\n", "line 3: pv is infinite"),
    "time runs back": (b"t,op,pv\n0,1,2\n2,1,2\n1,1,2\n", r"line 4: t does not rise \(2, then 1\)"),
    "time stands still": (b"t,op,pv\n0,1,2\n0,1,2\n0,1,2\n", "line 3: t does not rise"),
    "time is text": (b"t,op,pv\n0,1,2\nlater,1,2\n2,1,2\n", "line 3: t is 'later'"),
    "time is missing": (b"t,op,pv\n0,1,2\n,1,2\n2,1,2\n", "line 3: t is"),
    "no time column": (b"op,pv\n1,2\n1,2\n1,2\n", "no time column"),
    "two samples": (b"t,op,pv\n0,1,2\n1,1,2\n", "2 samples; at least 3"),
    "header only": (b"t,op,pv\n", "0 samples; at least 3"),
    "ragged": (b"t,op,pv\n0,1,2\n1,2\n2,1,2\n", "line 3: 2 cells; the header has 3"),
    "column twice": (b"t,op,pv,PV\n0,1,2,3\n", "column 'pv' appears twice"),
    "blank": (b"\n\n", "has no header line"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_file_is_one_clear_sentence(tmp_path, case):
    content, sentence = BAD[case]
    file = tmp_path / "bad.csv"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(RecordError, match=sentence) as caught:
        read_record(file)
    assert "bad.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("Ts", [0, -1, float("nan")])
def test_sampling_period_must_be_positive(tmp_path, Ts):
    with pytest.raises(RecordError, match="sampling period must be a number above 0"):
        read_record(write(tmp_path, rows()), Ts=Ts)


def test_folder_without_a_record_is_refused(tmp_path):
    with pytest.raises(RecordError, match="no loop record found"):
        read_folder(tmp_path)
    with pytest.raises(RecordError, match="does not exist"):
        read_folder(tmp_path / "nowhere")


def test_folder_keeps_good_records_and_names_the_others(tmp_path):
    write(tmp_path, rows(), name="good.csv")
    write(tmp_path, ["1,2"], "a,b", name="other.csv")
    records, refused = read_folder(tmp_path, each={"good": {"kind": "flow"}})
    assert list(records) == ["good"]
    assert records["good"].kind == "flow"
    assert "no PV column" in refused["other"]


def test_files_whose_names_look_alike_are_all_read(tmp_path):
    for name in ("a.csv", "a.txt", "b.csv", "n\\udcff.csv", "n\udcff.csv"):
        write(tmp_path, rows(), name=name)
    records, refused = read_folder(tmp_path)
    assert (len(records), refused) == (5, {})
    assert {"a.csv", "a.txt", "b"} < set(records)


def test_labels_read_with_underscores_as_hyphens(tmp_path):
    file = write(
        tmp_path,
        ["a,stiction,diff_pressure,self_regulating", "b,no_stiction,none,"],
        "id,label,type,dynamics",
    )
    table = read_labels(file)
    assert (table["a"]["kind"], table["a"]["process"], table["a"]["unit_group"]) == (
        "diff-pressure",
        "self-regulating",
        "a",
    )
    assert (table["b"]["kind"], table["b"]["process"]) == ("", "")
    with pytest.raises(RecordError, match="needs the columns id"):
        read_labels(write(tmp_path, ["a,1"], "name,label", name="x.csv"))


@needs_real
def test_every_real_record_is_read():
    table = read_labels(REAL / "records.csv")
    each = {name: {"kind": row["kind"], "process": row["process"]} for name, row in table.items()}
    records, _ = read_folder(REAL, each=each)
    assert set(records) == set(table)
    assert len(records) == 64
    assert records["ISDB_PAP4"].kind == "analyser"
    assert records["SGPT_2411PDIC10321_0606-0007"].kind == "pressure"
    assert records["NPK_FIC-211"].n == 6585
    assert records["NPK_FIC-211"].notes


@pytest.mark.parametrize("column", ["ZT1010.PV", "ZIT1010A", "FV1010.POS", "valve travel"])
def test_a_column_of_the_valves_position_is_mv_and_no_output(tmp_path, column):
    rows = "".join(f"{k},{k % 5},{50 + k % 3},{40 + k % 7}\n" for k in range(300))
    file = tmp_path / "rec.csv"
    file.write_text(f"t,FIC1010.PV,FIC1010.OP,{column}\n{rows}")
    record = read_record(file)
    assert record.mv == pytest.approx(40 + np.arange(300) % 7)
    assert f"columns: MV is '{column}'" in record.notes
    file.write_text(f"t,FIC1010.PV,FIC1010.SV,{column}\n{rows}")
    with pytest.raises(RecordError, match="no OP column"):
        read_record(file)
