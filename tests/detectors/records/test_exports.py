"""One loop as twelve systems export it: read right, or refused with the command that reads it;
never silently wrong.
"""

from __future__ import annotations

import os
import shlex
import sys
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from simbench.detectors.errors import RecordError
from simbench.detectors.records import tables
from simbench.detectors.records.folder import read_folder
from simbench.detectors.records.io import read_record, read_records
from simbench.detectors.records.roles import column_pairs

N, TS = 300, 5.0
START = datetime(2024, 3, 4, 22, 50, 0)
K = np.arange(N)
OP = np.round(48 + 6 * np.abs((K % 50) / 25 - 1) + 0.3 * np.sin(K), 2)
PV = np.round(1210 + 15 * np.sin(K / 8) + 2 * np.cos(1.7 * K), 1)
SP = np.full(N, 1210.0)
T = [START + timedelta(seconds=TS * k) for k in range(N)]
BAND_OP, BAND_PV = 0.9, 4.0
LOOP = (("PV", PV), ("OP", OP), ("SP", SP))


def stamps(form="%Y-%m-%d %H:%M:%S"):
    return [t.strftime(form) for t in T]


def wide(head, *columns, sep=","):
    return (
        "\n".join([head, *(sep.join(map(str, row)) for row in zip(*columns, strict=True))]) + "\n"
    )


def german_file(head, *times):
    return wide(head, *times, comma(PV), comma(OP), comma(SP), sep=";")


def three(time, pv, op, sp, form="%Y-%m-%d %H:%M:%S", sep=","):
    return wide(sep.join((time, pv, op, sp)), stamps(form), PV, OP, SP, sep=sep)


def comma(values):
    return [f"{v}".replace(".", ",") for v in values]


def rows(form, line):
    """Return a row per time and tag, as `line` writes it of time, tag and value."""
    lines = [
        line.format(t=t, n=f"FIC101.{tag}", v=x[k])
        for k, t in enumerate(stamps(form))
        for tag, x in LOOP
    ]
    return "\n".join(lines) + "\n"


def paired(heads):
    """Return a column of times before every signal."""
    return wide(",".join(heads), stamps(), PV, stamps(), OP, stamps(), SP)


def sheet(table, **options):
    def write(path):
        pd.DataFrame(table).to_excel(path, header=False, index=False, **options)

    return write


def excel(*above):
    return sheet(
        [
            *above,
            *(
                [t.to_pydatetime() if hasattr(t, "to_pydatetime") else t, *v]
                for t, *v in zip(T, PV, OP, SP)
            ),
        ]
    )


def german(values):
    return [f"{v:,.2f}".replace(",", " ").replace(".", ",").replace(" ", ".") for v in values]


def book(**sheets):
    def write(path):
        with pd.ExcelWriter(path) as file:
            for name, table in sheets.items():
                pd.DataFrame(table).to_excel(file, sheet_name=name, header=False, index=False)

    return write


TABLE = [["Time", "PV", "OP", "SP"], *([t, *v] for t, *v in zip(T, PV, OP, SP, strict=True))]
ZULU = [datetime(2026, 10, 25, 0, 50, tzinfo=UTC) + timedelta(seconds=TS * k) for k in range(N)]
SUMMER = [t.astimezone(timezone(timedelta(hours=1 + (t.hour == 0)))).isoformat() for t in ZULU]


WORDS = "%d-%b-%y %H:%M:%S"
DA, BAD = (
    [0 if k in (40, 41) else 192 for k in K],
    [0.0 if k in (40, 41) else v for k, v in enumerate(PV)],
)
FLAG = ["Bad" if k in (40, 41) else "Good" for k in K]
FINE = ["Good"] * N
SERIAL = [f"{45355 + (22 * 3600 + 50 * 60 + TS * k) / 86400:.9f}" for k in K]
TICKS = [int((t - datetime(1, 1, 1)).total_seconds()) * 10**7 for t in T]


GERMAN = "%d.%m.%Y %H:%M:%S"

# system: export -> content of a CSV, or (content, suffix, options)
READ = {
    # AVEVA PI
    "two spaces between date and time": wide(
        "Date, Time,PV,OP,SP", stamps("%d/%m/%Y "), stamps(" %H:%M:%S"), PV, OP, SP
    ),
    "pi: server in the path": three(
        "Timestamp", r"\\PISRV\FIC101.PV", r"\\PISRV\FIC101.OP", r"\\PISRV\FIC101.SP", WORDS
    ),
    # Ignition
    "ignition: path": three(
        "t_stamp",
        "[default]Unit1/FIC101/PV",
        "[default]Unit1/FIC101/OP",
        "[default]Unit1/FIC101/SP",
    ),
    "ignition: folders of another loop": (
        wide(
            "t_stamp,[default]U1/FIC101/PV,[default]U1/FIC101/OP,[default]U1/FIC102/PV,[default]U1/FIC102/OP",
            stamps(),
            PV,
            OP,
            OP,
            PV,
        ),
        "csv",
        {"tag": "FIC101"},
    ),
    "ignition: milliseconds": wide(
        "t_stamp,Unit1/FIC101/PV,Unit1/FIC101/OP,Unit1/FIC101/SP",
        [1709592600000 + 5000 * int(k) for k in K],
        PV,
        OP,
        SP,
    ),
    # Honeywell
    "honeywell: experion": three(
        "Time", "FIC101.PV", "FIC101.OP", "FIC101.SP", "%d/%m/%Y %H:%M:%S"
    ),
    # Yokogawa
    "yokogawa: MV and SV": three(
        "Time", "FIC101.PV", "FIC101.MV", "FIC101.SV", "%Y/%m/%d %H:%M:%S"
    ),
    # Emerson
    "deltav: parameters": three(
        "Timestamp", "FIC101/PID1/PV.CV", "FIC101/PID1/OUT.CV", "FIC101/PID1/SP.CV"
    ),
    # Foxboro
    "foxboro": three("Time", "UNIT1:FIC101.MEAS", "UNIT1:FIC101.OUT", "UNIT1:FIC101.SPT"),
    # Excel
    "excel: title and merged loop": (
        excel(["Trend", "", "", ""], ["", "FIC101", "", ""], ["Time", "PV", "OP", "SP"]),
        "xlsx",
        {},
    ),
    "excel: time merged down": (
        excel(["Report", "", "", ""], ["Time", "FIC101", "", ""], ["", "PV", "OP", "SP"]),
        "xlsx",
        {},
    ),
    "excel: units below": (
        excel(["Time", "PV", "OP", "SP"], ["", "m3/h", "%", "m3/h"]),
        "xlsx",
        {},
    ),
    "excel: separator named": (
        "sep=;\n"
        + german_file(
            "Time;PV;OP;SP",
            stamps(),
        )
    ),
    # decimal commas and code pages
    "german": german_file(
        "Date;Time;PV;OP;SP",
        stamps("%d.%m.%Y"),
        stamps("%H:%M:%S"),
    ),
    "german, in its code page": german_file(
        "Time;FIC101 PV (°C);FIC101 OP;FIC101 SP (°C)",
        stamps(GERMAN),
    ).encode("cp1252"),
    "apart by spaces": (
        "\n".join(["t pv op sp", *(f"{5 * k} {PV[k]}  {OP[k]} {SP[k]}" for k in K)]) + "\n",
        "txt",
        {},
    ),
    # names
    "unit at the end": three("time_s", "pv_kPa", "op_pct", "sp_kPa").replace("time_s", "time"),
    "signal first": three("Time", "PV_FIC101", "OP_FIC101", "SP_FIC101"),
    "nothing between": three("Time", "FIC101PV", "FIC101OP", "FIC101SP"),
    "words run together": three("DateTime", "ProcessValue", "ControllerOutput", "SetPoint"),
    "words": three(
        "Date Time", "FIC101 Process Value", "FIC101 Controller Output", "FIC101 Set Point"
    ),
    "transmitter and valve": three("Time", "FT-101.PV", "FV-101.OUT", "FIC-101.SP"),
    "numbered": (wide("Time,PV1,OP1,PV2,OP2", stamps(), OP, PV, PV, OP), "csv", {"tag": "2"}),
    "newest first": wide("Time,PV,OP,SP", stamps()[::-1], PV[::-1], OP[::-1], SP[::-1]),
    "no separator but underscores": three("time", "feed_flow_pv", "feed_flow_op", "feed_flow_sp"),
    # written before the reader was looked at
    "thousand points and decimal commas": wide(
        "Timestamp;PV;OP;SP",
        stamps(GERMAN),
        *map(german, (PV, OP, SP)),
        sep=";",
    ).encode("cp1252"),
    "utf-16, date and time apart": (
        wide(
            "Date\tTime\tF1.PV\tF1.OP\tF1.SP",
            stamps("%d/%m/%Y"),
            stamps("%H:%M:%S"),
            PV,
            OP,
            SP,
            sep="\t",
        ).encode("utf-16"),
        "txt",
        {},
    ),
    "workbook: record after a sheet of notes": (
        book(Info=[["Report", "Value"], ["Unit", "FCC"]], Trend=TABLE),
        "xlsx",
        {},
    ),
    "workbook: a sheet per loop": (
        book(FIC101=TABLE, LIC7=[[*row[:3], 0] for row in TABLE]),
        "xlsx",
        {"tag": "FIC101"},
    ),
    "time zone through the end of summer time": wide("timestamp,pv,op,sp", SUMMER, PV, OP, SP),
    "every row twice": wide(
        "time,PV,OP,SP",
        *([x for x in column for _ in (0, 1)] for column in (stamps(), PV, OP, SP)),
    ),
    "summary below": (
        three("Time", "PV", "OP", "SP") + "Average,1210,50,1210\nMinimum,1190,40,1210\n"
    ),
    "four rows of heads": wide(
        "Tag,FIC101.PV,FIC101.MV,FIC101.SV\nDescription,Flow,Output,Target\nUnits,m3/h,%,m3/h\nQuality,Good,Good,Good",
        stamps("%Y/%m/%d %H:%M:%S"),
        PV,
        OP,
        SP,
    ),
    "milliseconds in a column": wide(
        "Date;Time;Millitm;F1_PV;F1_CO;F1_SP",
        stamps("%m/%d/%Y"),
        stamps("%H:%M:%S"),
        [0] * N,
        PV,
        OP,
        SP,
        sep=";",
    ),
    "cells that say their unit": wide(
        "Time;PV;OP;SP",
        stamps(GERMAN),
        *([f"{v} {u}" for v in german(x)] for x, u in ((PV, "m3/h"), (OP, "%"), (SP, "m3/h"))),
        sep=";",
    ),
    "gain in parentheses": three(
        "Time (UTC)", "FIC101 PV (m3/h)", "FIC101 OP (%)", "FIC101 SP (m3/h)"
    ),
    # states in place of numbers, summaries, several heads
    "pi: words in place of values": wide(
        "Timestamp,FIC101.PV,FIC101.OP,FIC101.SP",
        stamps(WORDS),
        [{40: "No Data", 41: "I/O Timeout"}.get(int(k), v) for k, v in enumerate(PV)],
        OP,
        SP,
    ),
    "rockwell: utf-16": three(
        "Timestamp",
        "[PLC1]FIC101.PV",
        "[PLC1]FIC101.OUT",
        "[PLC1]FIC101.SP",
        "%m/%d/%Y %I:%M:%S %p",
    ).encode("utf-16"),
    "days of a spreadsheet": wide(
        "Time;PV;OP;SP", comma(SERIAL), comma(PV), comma(OP), comma(SP), sep=";"
    ),
    "quoted thousands": wide("Time,PV,OP", stamps(), [f'"{v:,.1f}"' for v in PV], OP),
    "french thousands": wide(
        "Time;PV;OP",
        stamps("%d/%m/%Y %H:%M:%S"),
        [f"{v:,.1f}".replace(",", "\u202f").replace(".", ",") for v in PV],
        comma(OP),
        sep=";",
    ),
    "ticks of .NET": wide("Time,PV,OP,SP", TICKS, PV, OP, SP),
    "digits of a date": three("Time", "PV", "OP", "SP", "%Y%m%d%H%M%S"),
    "milliseconds after a colon": three("Time", "PV", "OP", "SP", "%d/%m/%Y %H:%M:%S:000"),
    "time in brackets": wide("t [ms],PV,OP,SP", 5000 * K, PV, OP, SP),
    "elapsed minutes": wide("Elapsed (min),PV,OP,SP", [f"{k / 12:.6f}" for k in K], PV, OP, SP),
    "day first, over midnight": wide(
        "Time,PV,OP,SP",
        [(t + timedelta(minutes=65)).strftime("%d/%m/%Y %H:%M:%S") for t in T],
        PV,
        OP,
        SP,
    ),
    "a number for no data": wide(
        "Time,PV,OP,SP",
        stamps(),
        [-9999 if k in (40, 41) else v for k, v in enumerate(PV)],
        OP,
        SP,
    ),
    "two exports in one file": "".join(
        three("Time", "PV", "OP", "SP").splitlines(True)[i]
        for i in [*range(101), 0, *range(101, N + 1)]
    ),
}


def written(folder, content, suffix):
    path = folder / f"loop.{suffix}"
    if callable(content):
        content(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def right(record):
    """Whether a record is the loop."""
    if record.Ts != pytest.approx(TS, abs=1e-3) or record.n != N:
        return False
    # of two samples that some exports call bad a straight line is the best guess
    assert np.abs(record.pv - PV).max() < 5 * BAND_PV
    far = [
        np.abs(record.op - OP).max() / BAND_OP,
        np.abs(record.pv - PV)[[k for k in K if k not in (40, 41)]].max() / BAND_PV,
    ]
    return max(far) == 0.0 and (record.sp is None or np.array_equal(record.sp, SP))


# export -> part of its notes; the others are read without one, or with the names of their columns
NOTES = dict(
    line.split(" | ")
    for line in """
honeywell: experion | %d/%m/%Y
day first, over midnight | leaves holes of days
german, in its code page | read as Windows-1252
excel: units below | line 2 taken as units
excel: title and merged loop | 2 lines above the header left out
pi: words in place of values | 1 cells of FIC101.PV say 'No Data' and count as missing
a number for no data | 2 cells of PV hold -9999 and count as missing
foxboro | PV is 'UNIT1:FIC101.MEAS'
yokogawa: MV and SV | OP is 'FIC101.MV'
deltav: parameters | OP is 'FIC101/PID1/OUT.CV'
ignition: milliseconds | counts milliseconds since 1970
elapsed minutes | is in min
""".strip().splitlines()
)
# whose names or times say too little -> what is asked, and what the user then gives
ASKING = {
    "numbered": ("op=NAME,pv=NAME", {"columns": {"op": "OP2", "pv": "PV2"}}),
    "days of a spreadsheet": ("--ts SECONDS", {"Ts": TS}),
    "ticks of .NET": ("--ts SECONDS", {"Ts": TS}),
    "digits of a date": ("--ts SECONDS", {"Ts": TS}),
    "milliseconds after a colon": ("--ts SECONDS", {"Ts": TS}),
}
QUIET = {
    "ignition: path",
    "time zone through the end of summer time",
    "gain in parentheses",
}


def export(name):
    """Return what a file holds, the end of its name, and the options with which it is read."""
    content, suffix, options = (
        READ[name] if isinstance(READ[name], tuple) else (READ[name], "csv", {})
    )
    return content, suffix, {**options, **ASKING.get(name, ("", {}))[1]}


@pytest.mark.parametrize("name", ASKING)
def test_what_names_or_times_leave_open_is_asked_for(tmp_path, name):
    content, suffix, options = export(name)
    asked, given = ASKING[name]
    known = {key: value for key, value in options.items() if key not in given}
    with pytest.raises(RecordError) as caught:
        read_record(written(tmp_path, content, suffix), **known)
    assert asked in caught.value.cure


# layouts that pandas makes into a table of a row per time -> by which function
REFUSED = {
    "a row per time and tag": (
        "Tag,Timestamp,Value\n" + rows("%d-%b-%y %H:%M:%S", "{n},{t},{v}"),
        "pivot_table",
    ),
    "times under the name of a signal": (
        paired(("FIC101.PV", "", "FIC101.OP", "", "FIC101.SP", "")),
        "merge_asof",
    ),
    "times before each signal": (
        paired(("Time", "FIC101.PV", "Time", "FIC101.OP", "Time", "FIC101.SP")),
        "merge_asof",
    ),
    "one value a row": (
        "t,op,pv\n" + "".join(f"{k},{OP[k]},\n{k},,{PV[k]}\n" for k in K),
        "groupby",
    ),
    "one signal": (wide("timestamp,FIC101.PV", stamps(), PV), "merge"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_another_layout_is_refused_with_what_makes_it_a_table(tmp_path, name):
    content, function = REFUSED[name]
    with pytest.raises(RecordError, match="a row per time with a column each") as caught:
        read_record(written(tmp_path, content, "csv"))
    assert caught.value.sentence.partition("makes by ")[2].startswith(function)
    assert caught.value.cure == ""


@pytest.mark.parametrize("name", READ)
def test_export_is_read_right(tmp_path, name):
    assert {*NOTES, *QUIET, *ASKING} <= {*READ}
    content, suffix, options = export(name)
    record = read_record(written(tmp_path, content, suffix), **options)
    assert right(record), (record.n, record.Ts, record.notes)
    assert NOTES.get(name, "") in " | ".join(record.notes)
    assert not (name in QUIET and record.notes)


TWO = (stamps(), PV, OP, OP, PV)
# what is open -> (content, options, options of its cure)
ASKED = {
    "two loops": (wide("Time,FIC101.PV,FIC101.OP,LIC7.PV,LIC7.OP", *TWO), {}, ["--tag", "FIC101"]),
    "a wrong tag": (
        wide("Time,FIC101.PV,FIC101.OP,LIC7.PV,LIC7.OP", *TWO),
        {"tag": "FIC110"},
        ["--tag", "FIC101"],
    ),
    "two loops by path": (
        wide("Time,U1/FIC101/PV,U1/FIC101/OP,U1/LIC7/PV,U1/LIC7/OP", *TWO),
        {},
        ["--tag", "U1/FIC101"],
    ),
    "MV is the output": (
        wide("Time,PV,SV,MV", stamps(), PV, SP, OP),
        {},
        ["--columns", "op=NAME,pv=PV"],
    ),
    "CV is the output": (
        wide("Time,FIC101.PV,FIC101.CV", stamps(), PV, OP),
        {},
        ["--columns", "op=NAME,pv=FIC101.PV"],
    ),
    "unnamed signal": (wide("Time,Flow,OP", stamps(), PV, OP), {}, ["--columns", "op=OP,pv=NAME"]),
    "two clocks": (
        wide("Local Time,UTC Time,PV,OP", stamps(), stamps(), PV, OP),
        {},
        ["--columns", "t=NAME"],
    ),
    "no time": (wide("PV,OP", PV, OP), {}, ["--ts", "1"]),
    "clock set back": (
        wide("Time,PV,OP", [*stamps()[:200], *stamps()[100:200]], PV, OP),
        {},
        ["--ts", "5"],
    ),
    "volts": (
        wide("Time,PV,OP [V]", stamps(), PV, np.round(1 + 0.04 * OP, 3)),
        {},
        ["--op-span", "1", "5"],
    ),
    "two loops by number": (
        wide("Time,FT-101.PV,FV-101.OUT,LT-102.PV,LV-102.OUT", *TWO),
        {"columns": {"op": "FV-101.OUT"}},
        ["--columns", "pv=NAME"],
    ),
    "counts": (
        wide("Time,PV,OP [counts]", stamps(), PV, np.round(10.23 * OP)),
        {},
        ["--op-span", "0", "1023"],
    ),
    "a share of 1": (
        wide("Time,PV,OP", stamps(), PV, np.round(OP / 100, 4)),
        {},
        ["--op-span", "0", "1"],
    ),
    "other numbers": (
        wide("Time,FT7.PV,FV8.OP", stamps(), PV, OP),
        {},
        ["--columns", "op=FV8.OP,pv=FT7.PV"],
    ),
}


# what the user alone can name -> the column that it is
NAMED = {
    "MV is the output": ("op=NAME", "op=MV"), "CV is the output": ("op=NAME", "op=FIC101.CV"),
    "unnamed signal": ("pv=NAME", "pv=Flow"), "two clocks": ("t=NAME", "t=Local Time"),
    "two loops by number": ("pv=NAME", "pv=FT-101.PV"),
}  # fmt: skip


def options_of(words):
    values = (
        dict.fromkeys(["--columns"], column_pairs(words[1:])) if words[0] == "--columns" else {}
    )
    values |= (
        {"--tag": words[-1]}
        if words[0] == "--tag"
        else {"--ts": float(words[-1])}
        if words[0] == "--ts"
        else {}
    )
    names = {"--columns": "columns", "--tag": "tag", "--ts": "Ts"}
    return (
        {"op_span": tuple(map(float, words[1:]))}
        if words[0] == "--op-span"
        else {names[k]: v for k, v in values.items()}
    )


@pytest.mark.parametrize("name", ASKED)
def test_refusal_ends_with_the_options_that_read_the_file(tmp_path, name):
    content, options, cure = ASKED[name]
    file = written(tmp_path, content, "csv")
    with pytest.raises(RecordError) as caught:
        read_record(file, **options)
    assert shlex.split(caught.value.cure) == cure
    assert str(caught.value).endswith(caught.value.cure)
    typed = options_of([word.replace(*NAMED.get(name, ("", ""))) for word in cure])
    if "columns" in typed:
        typed["columns"] = {**options.get("columns", {}), **typed["columns"]}
    assert np.allclose(read_record(file, **{**options, **typed}).pv, PV)


@pytest.mark.parametrize(
    ("mark", "words"),
    [
        (" C", "unit: 'C' after each value of PV is taken as its unit"),
        (" m3/h", None),
    ],
)
def test_a_unit_after_every_value_is_reported(tmp_path, mark, words):
    marked = [f"{x}{mark}" for x in PV]
    record = read_record(written(tmp_path, wide("Time,PV,OP", stamps(), marked, OP), "csv"))
    assert np.allclose(record.pv, PV)
    assert words is None or words in record.notes


@pytest.mark.parametrize("rows", [100, 6000])
def test_an_underscore_makes_no_number_in_a_column_of_any_length(tmp_path, rows):
    lines = [f"{k},{50 + k % 7},{'1_2' if k == 70 else 20 + k % 5}" for k in range(rows)]
    (tmp_path / "rec.csv").write_text("\n".join(["t,OP,PV", *lines, ""]))
    with pytest.raises(RecordError, match="line 72: PV is '1_2'"):
        read_record(tmp_path / "rec.csv")


LARGE = [("MOST_PARQUET_ROWS", "has 400 rows; at most 100"), ("MOST_PARQUET_BYTES", "unpacks to")]


@pytest.mark.parametrize(("limit", "words"), LARGE)
def test_a_large_parquet_file_is_refused_before_it_is_read(tmp_path, monkeypatch, limit, words):
    file = tmp_path / "rec.parquet"
    pd.DataFrame({"t": np.arange(400.0), "op": 50.0, "pv": 20.0}).to_parquet(file)
    monkeypatch.setattr(tables, limit, 100)
    monkeypatch.setattr(parquet, "read_table", lambda *path, **how: pytest.fail("it was read"))
    with pytest.raises(RecordError, match=words):
        read_record(file)


def test_a_text_that_repeats_in_a_parquet_file_is_kept_once(tmp_path):
    n = 400_000
    text = pa.DictionaryArray.from_arrays(np.zeros(n, dtype=np.int32), ["y" * 100_000])
    signals = {"t": np.arange(n), "op": np.arange(n) % 50, "pv": np.arange(n) % 20}
    parquet.write_table(pa.table({**signals, "note": text}), tmp_path / "rec.parquet")
    assert read_record(tmp_path / "rec.parquet").n == n  # 40 GB, each text for itself


@pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes")
def test_a_file_name_that_is_no_text_costs_nothing_but_its_beauty(tmp_path):
    for name in (b"good", b"n\xff", b"e\x1b[31m", "r\u202e".encode()):
        (tmp_path / os.fsdecode(name + b".csv")).write_text(wide("Time,PV,OP", stamps(), PV, OP))
    records, refused = read_folder(tmp_path)
    assert (sorted(records), refused) == (["e\\x1b[31m", "good", "n\\udcff", "r\\u202e"], {})
    assert sorted(r.tag for r in records.values()) == sorted(records)


def test_who_writes_am_and_pm_writes_the_month_first_and_what_else_is_open_is_noted(tmp_path):
    american = read_record(
        written(tmp_path, three("Time", "PV", "OP", "SP", "%m/%d/%Y %I:%M:%S %p"), "csv")
    )
    open_ = read_record(
        written(tmp_path, three("Time", "PV", "OP", "SP", "%d/%m/%Y %H:%M:%S"), "csv")
    )
    assert (
        american.meta["start"]
        == open_.meta["start"]
        == pytest.approx((START - datetime(1970, 1, 1)).total_seconds())
    )
    assert "day and month may stand the other way round" in open_.notes[0]


def test_a_table_without_a_header_is_refused_without_a_guess(tmp_path):
    with pytest.raises(RecordError, match="no header line"):
        read_record(
            written(tmp_path, "\n".join(wide("", stamps(), PV, OP).splitlines()[1:]), "csv")
        )


@pytest.mark.parametrize("name", ["Time", None])
def test_a_data_frame_stored_with_its_index_is_read(tmp_path, name):
    frame = pd.DataFrame({"PV": PV, "OP": OP}, index=pd.DatetimeIndex(T, name=name))
    frame.to_parquet(tmp_path / "loop.parquet")
    assert right(read_record(tmp_path / "loop.parquet"))


@pytest.mark.parametrize("said", [FLAG, DA, [k not in (40, 41) for k in K], ["Bad"] * N])
@pytest.mark.parametrize("name", ["Quality", "FIC101.PV.Quality"])
def test_a_quality_of_the_samples_is_the_callers_to_decide(tmp_path, name, said):
    file = written(tmp_path, wide(f"Time,PV,{name},OP", stamps(), BAD, said, OP), "csv")
    with pytest.raises(RecordError, match=f"column '{name}' says .* of samples") as caught:
        read_record(file)
    assert caught.value.cure == "--columns quality=none"
    assert read_record(file, columns={"quality": "none"}).pv.tolist() == BAD
    with pytest.raises(RecordError, match="quality=none, which reads none, is allowed"):
        read_record(file, columns={"quality": name})


@pytest.mark.parametrize("name", ["", "q_pv", "Trust"])
def test_words_of_quality_are_no_signal_whatever_their_column_is_called(tmp_path, name):
    file = written(tmp_path, wide(f"Time,PV,{name},OP", stamps(), PV, FLAG, OP), "csv")
    with pytest.raises(RecordError, match="says 'bad' and 'good' of samples"):
        read_record(file)
    file = written(tmp_path, wide(f"Time,PV,{name},OP", stamps(), PV, FINE, OP), "csv")
    record = read_record(file)
    assert right(record)
    assert "counts for nothing" in record.notes[0]


def test_states_of_something_else_are_no_quality(tmp_path):
    said = ["Running" if k % 50 else "Stopped" for k in K]
    file = written(tmp_path, wide("Time,PV,Status,OP", stamps(), PV, said, OP), "csv")
    assert "quality: column 'Status' counts for nothing" in read_record(file).notes


@pytest.mark.parametrize("mark", [" ?", " (Q)", "*", " Q", " Bad"])
def test_a_mark_after_a_value_is_no_number(tmp_path, mark):
    marked = [f"{x}{mark}" if k == 40 else x for k, x in enumerate(PV)]
    with pytest.raises(RecordError, match=r"line 42: PV is '.*'; a number"):
        read_record(written(tmp_path, wide("Time,PV,OP", stamps(), marked, OP), "csv"))


def test_every_loop_of_a_file_is_a_record(tmp_path):
    file = written(tmp_path, wide("Time,FIC101.PV,FIC101.OP,LIC7.PV,LIC7.OP", *TWO), "csv")
    records, refused = read_records(file)
    assert list(records) == ["FIC101", "LIC7"]
    assert np.array_equal(records["LIC7"].op, PV)
    assert not refused


def test_only_the_longest_stretch_in_automatic_is_read_and_the_shares_are_noted(tmp_path):
    modes = ["MAN"] * 60 + ["AUTO"] * 200 + ["MAN"] * 10 + ["CAS"] * 30
    file = written(tmp_path, wide("Time,PV,OP,Mode", stamps(), PV, OP, modes), "csv")
    record = read_record(file)
    assert np.array_equal(record.pv, PV[60:260])
    assert "AUTO 67%, CAS 10%, MAN 23%; judged samples 60 to 259 of 300 (67%)" in " ".join(
        record.notes
    )
    assert read_record(file, automatic=False).n == N


def test_an_output_that_may_be_in_milliamperes_or_counts_is_noted(tmp_path):
    low = written(tmp_path, wide("Time,PV,OP", stamps(), PV, np.round(4 + 0.16 * OP, 3)), "csv")
    assert "add --op-span 4 20" in read_record(low).notes[-1]
    assert read_record(low, op_span=(4, 20)).op_percent == pytest.approx(OP, abs=0.01)
    share = [1.04, *np.round(OP[1:] / 100, 5)]  # a share of 1 that overruns once
    over = read_record(written(tmp_path, wide("Time,PV,OP", stamps(), PV, share), "csv"))
    assert "add --op-span 0 1" in over.notes[-1]
    counts = read_record(
        written(tmp_path, wide("Time,PV,OP", stamps(), PV, np.round(40.95 * OP)), "txt")
    )
    assert "add --op-span 0 4095" in counts.notes[-1]
    assert counts.S_unit == "OP units"


def test_a_table_of_loops_states_what_the_file_does_not(tmp_path):
    file = written(tmp_path, wide("Time,A,B,C,D", *TWO), "csv")
    table = tmp_path / "plant.toml"
    table.write_text(
        '[[loop]]\ntag = "FIC1"\nkind = "flow"\nop_span = [0, 200]\ncolumns = {pv = "A", op ='
        ' "B"}\n[[loop]]\ntag = "LIC2"\ncolumns = {pv = "C", op = "D"}\n'
    )
    records, _ = read_records(file, loops=table)
    assert (records["FIC1"].kind, records["FIC1"].op_span, records["FIC1"].tag) == (
        "flow",
        (0.0, 200.0),
        "FIC1",
    )
    assert np.array_equal(records["LIC2"].pv, OP)
    assert np.array_equal(read_record(file, loops=table, tag="LIC2").pv, OP)
    table.write_text('[[loop]]\ntag = "A"\nknd = "flow"\n')
    with pytest.raises(RecordError, match="unknown key 'knd', did you mean 'kind'"):
        read_records(file, loops=table)


def test_a_tag_names_the_loop_of_a_file_whose_columns_name_none_but_not_of_every_file(tmp_path):
    file = written(tmp_path, three("Time", "PV", "OP", "SP"), "csv")
    for record in (
        read_record(file, tag="FIC1"),
        read_record(file, loop="FIC1"),
        *read_records(file, tag="FIC1")[0].values(),
    ):
        assert record.tag == "FIC1"
        assert "tag: no column names a loop; the only one is read as FIC1" in record.notes
        assert np.array_equal(record.pv, PV)
    with pytest.raises(RecordError, match="no column of loop 'FIC1'"):
        read_folder(tmp_path, tag="FIC1")
    table = tmp_path / "plant.toml"
    table.write_text('[[loop]]\ntag = "FIC1"\n[[loop]]\ntag = "LIC2"\n')
    with pytest.raises(RecordError, match="no column of loop 'FIC1'") as refused:
        read_record(file, loops=table)
    assert "--tag" not in str(refused.value)
    assert set(read_records(file, loops=table)[1]) == {"FIC1", "LIC2"}
    table.write_text(f'[[loop]]\ntag = "FIC1"\nfile = "{file.name}"\n')
    assert np.array_equal(read_records(file, loops=table)[0]["FIC1"].pv, PV)


def test_of_two_columns_for_a_signal_the_one_of_its_plain_name_is_taken_else_one_is_asked_for(
    tmp_path,
):
    cells = stamps(), PV, [x + 1 for x in PV], OP
    record = read_record(written(tmp_path, wide("Time,PV,PV_avg,OP", *cells), "csv"))
    assert np.array_equal(record.pv, PV)
    with pytest.raises(RecordError, match=r"PV\.raw or PV_avg may be PV") as caught:
        read_record(written(tmp_path, wide("Time,PV.raw,PV_avg,OP", *cells), "csv"))
    assert caught.value.cure == "--columns pv=NAME"


# what is open -> (content, part of the question)
OPEN = {
    "three decimals after a comma, tabs": (
        wide("Time\tOP\tPV", stamps(), comma([f"{v:.3f}" for v in OP]), K, sep="\t"),
        "may be",
    ),
    "comma here, point there": (
        wide("Time;OP;PV", stamps(), comma(OP), PV, sep=";"),
        "one of them is needed",
    ),
    "points for thousands alone": (
        wide("Time;OP;PV", stamps(), OP, [f"{v:,}".replace(",", ".") for v in 980 + K], sep=";"),
        "beside whole",
    ),
    "a tenth of a spreadsheet's day": (
        wide("time,OP,PV", [45000 + 0.1 * k for k in K], OP, PV),
        "8.64e.03 s if it counts days",
    ),
    "time in fortnights": (wide("Time (fn),OP,PV", K, OP, PV), "known units of time"),
    "an unknown state": (wide("Time,OP,PV", stamps(), OP, ["odd", *PV[1:]]), "line 2: PV is 'odd'"),
    "a third missing at random": (
        wide(
            "Time,OP,PV",
            stamps(),
            OP,
            np.where(np.random.default_rng(1).random(N) < 0.33, "", PV.astype(str)),
        ),
        "missing",
    ),
}


@pytest.mark.parametrize("name", OPEN)
def test_what_is_open_is_asked_for(tmp_path, name):
    content, sentence = OPEN[name]
    with pytest.raises(RecordError, match=sentence) as caught:
        read_record(written(tmp_path, content, "csv"))
    assert "\n" not in str(caught.value)


def test_milliamperes_are_a_standard_and_noted(tmp_path):
    file = written(tmp_path, wide("Time,OP [mA],PV", stamps(), 4 + 0.16 * OP, PV), "csv")
    record = read_record(file)
    assert record.op_percent == pytest.approx(OP)
    assert "4 to 20 mA" in record.notes[0]


def test_three_decimals_next_to_whole_numbers_of_their_size_are_decimals(tmp_path):
    sp = np.where(K > 60, "514.503", "512")
    record = read_record(written(tmp_path, wide("t,op,pv,sp", K, OP, PV, sp), "csv"))
    assert record.sp is not None
    assert record.sp.max() == 514.503
