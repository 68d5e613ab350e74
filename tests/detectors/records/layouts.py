"""One loop as files hold it: what each is, the options it is read with, and what is noted; or the
words of the refusal, with the options that it ends with.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
from scipy.io import savemat

N, TS = 300, 5.0
START = datetime(2024, 3, 4, 22, 50)
K = np.arange(N)
OP = np.round(48 + 6 * np.abs((K % 50) / 25 - 1) + 0.3 * np.sin(K), 2)
PV = np.round(1210 + 15 * np.sin(K / 8) + 2 * np.cos(1.7 * K), 1)
SP = np.full(N, 1210.0)
T = [START + timedelta(seconds=TS * k) for k in range(N)]
ZULU = [datetime(2026, 10, 25, 0, 50, tzinfo=UTC) + timedelta(seconds=TS * k) for k in range(N)]


def stamps(form="%Y-%m-%d %H:%M:%S", times=T):
    """Return the times of all samples in a form."""
    return [t.strftime(form) for t in times]


def wide(head, *columns, sep=","):
    """Return a table: a head, and a row per sample."""
    rows = [sep.join(map(str, row)) for row in zip(*columns, strict=True)]
    return "\n".join([head, *rows]) + "\n"


def named(pv, op, sp="SP", time="Time", form="%Y-%m-%d %H:%M:%S"):
    """Return a table of the loop under other names, its times in another form."""
    return wide(f"{time},{pv},{op},{sp}", stamps(form), PV, OP, SP)


def german(head, *times):
    """Return a table with semicolons and decimal commas."""
    commas = [[str(x).replace(".", ",") for x in column] for column in (PV, OP, SP)]
    return wide(head, *times, *commas, sep=";")


def book(**sheets):
    """Return what writes a workbook of some sheets."""

    def write(path):
        with pd.ExcelWriter(path) as file:
            for name, table in sheets.items():
                pd.DataFrame(table).to_excel(file, sheet_name=name, header=False, index=False)

    return write


def mat(**variables):
    """Return what writes a file as MATLAB does."""
    return lambda path: savemat(path, variables)


TABLE = [["Time", "PV", "OP", "SP"], *([t, *v] for t, *v in zip(T, PV, OP, SP, strict=True))]
TWO = (stamps(), PV, OP, OP, PV)
LOOPS = wide("Time,FIC101.PV,FIC101.OP,LIC7.PV,LIC7.OP", *TWO)
LONG = [
    f"{t},FIC101.{tag},{x[k]}"
    for k, t in enumerate(stamps())
    for tag, x in (("PV", PV), ("OP", OP))
]
SUMMER = [t.astimezone(timezone(timedelta(hours=1 + (t.hour == 0)))).isoformat() for t in ZULU]
LATER = [t + timedelta(minutes=65) for t in T]
PART = np.where(np.isin(K, (40, 41)), "Bad", PV.astype(str))
MAT = {"PV": PV, "OP": OP, "SP": SP, "Ts": TS}

# name -> (content, ending, options, part of the notes; "" where there are none but of the names)
READ = {
    "names in any case": (named("pV", "oP", "sP", "TIME"), "csv", {}, ""),
    "seconds": (wide("t_s,PV,OP", TS * K, PV, OP), "csv", {}, ""),
    "milliseconds in brackets": (wide("t [ms],PV,OP", 5000 * K, PV, OP), "csv", {}, "is in ms"),
    "milliseconds since 1970": (
        wide("t_stamp,PV,OP", [1709592600000 + 5000 * int(k) for k in K], PV, OP),
        "csv",
        {},
        "counts milliseconds since 1970",
    ),
    "tag": (named(r"\\SRV\FIC101.PV", r"\\SRV\FIC101.OP", r"\\SRV\FIC101.SP"), "csv", {}, ""),
    "path": (named("[default]U1/F1/PV", "[default]U1/F1/OP", time="t_stamp"), "csv", {}, ""),
    "words added": (named("FIC101/PID1/PV.CV", "FIC101/PID1/OUT.CV"), "csv", {}, "OP is 'FIC101"),
    "words": (named("F1 Process Value", "F1 Control Output", "F1 Set Point"), "csv", {}, "PV is"),
    "words run together": (named("ProcessValue", "ControlOutput", "SetPoint"), "csv", {}, "PV is"),
    "units in names": (named("F1 PV (m3/h)", "F1 OP (%)", time="Time (UTC)"), "csv", {}, ""),
    "units at the end": (named("pv_kPa", "op_pct", "sp_kPa", "time"), "csv", {}, ""),
    "transmitter and valve": (named("FT-101.PV", "FV-101.OUT", "FIC-101.SP"), "csv", {}, "OP is"),
    "one of two loops": (LOOPS, "csv", {"tag": "FIC101"}, ""),
    "columns given": (
        wide("Time,Flow,CV,SP", stamps(), PV, OP, SP),
        "csv",
        {"columns": {"pv": "Flow", "op": "CV"}},
        "",
    ),
    "the column of the signal's own name": (
        wide("Time,PV,PV_avg,OP", stamps(), PV, PV + 1, OP),
        "csv",
        {},
        "",
    ),
    "columns counted": (
        wide("1,2,3", TS * K, PV, OP).partition("\n")[2],
        "txt",
        {"columns": {"t": "1", "pv": "2", "op": "3"}},
        "columns are counted from 1",
    ),
    "no time": (wide("PV,OP", PV, OP), "csv", {"Ts": TS}, ""),
    "apart by spaces": (wide("t  pv op", TS * K, PV, OP, sep="  "), "txt", {}, ""),
    "apart by tabs, utf-16": (
        wide("Time\tPV\tOP", stamps("%Y/%m/%d %H:%M:%S"), PV, OP, sep="\t").encode("utf-16"),
        "txt",
        {},
        "",
    ),
    "mark of a byte order": (named("PV", "OP").encode("utf-8-sig"), "csv", {}, ""),
    "decimal commas": (
        german("Date;Time;PV;OP;SP", stamps("%d.%m.%Y"), stamps("%H:%M:%S")),
        "csv",
        {},
        "",
    ),
    "separator named": ("sep=;\n" + german("Time;PV;OP;SP", stamps()), "csv", {}, "1 lines above"),
    "a code page": (
        german("Time;PV (°C);OP;SP (°C)", stamps()).encode("cp1252"),
        "csv",
        {},
        "read as Windows-1252",
    ),
    "titles and units": (
        "# plant 7\nTrend of a day\n" + named("PV", "OP").replace("\n", "\ns,m3/h,%,m3/h\n", 1),
        "csv",
        {},
        "line 4 taken as units",
    ),
    "milliamperes": (
        wide("Time,PV,OP [mA]", stamps(), PV, np.round(4 + 0.16 * OP, 4)),
        "csv",
        {},
        "4 to 20 mA taken as 0 to 100 %",
    ),
    "header repeated": (
        wide("Time,PV,OP", stamps()[:9], PV[:9], OP[:9])
        + wide("Time,PV,OP", stamps()[9:], PV[9:], OP[9:]),
        "csv",
        {},
        "",
    ),
    "every row twice": (
        wide("Time,PV,OP", *([x for x in c for _ in (0, 1)] for c in (stamps(), PV, OP))),
        "csv",
        {},
        "300 rows that repeat the one above left out",
    ),
    "newest first": (wide("Time,PV,OP", stamps()[::-1], PV[::-1], OP[::-1]), "csv", {}, "falls"),
    "zones at the end of summer time": (wide("timestamp,pv,op", SUMMER, PV, OP), "csv", {}, ""),
    "day first, over midnight": (
        wide("Time,PV,OP", stamps("%d/%m/%Y %H:%M:%S", LATER), PV, OP),
        "csv",
        {},
        "%d/%m/%Y",
    ),
    "month first, AM and PM": (
        wide("Time,PV,OP", stamps("%m/%d/%Y %I:%M:%S %p"), PV, OP),
        "csv",
        {},
        "%m/%d/%Y",
    ),
    "states": (wide("Time,PV,OP", stamps(), PART, OP), "csv", {}, "2 cells of PV say 'Bad'"),
    "a number for no data": (
        wide("Time,PV,OP", stamps(), np.where(PART == "Bad", -9999, PV), OP),
        "csv",
        {},
        "2 cells of PV hold -9999",
    ),
    "quality not asked for": (
        wide("Time,PV,Quality,OP", stamps(), PV, PART == "Bad", OP),
        "csv",
        {"columns": {"quality": "none"}},
        "'Quality' counts for nothing",
    ),
    "quality without a difference": (
        wide("Time,PV,Quality,OP", stamps(), PV, ["Good"] * N, OP),
        "csv",
        {},
        "counts for nothing",
    ),
    "a loop in every row": (
        wide(
            "Time,loop_tag,PV,OP",
            [t for t in stamps() for _ in (0, 1)],
            ["F1", "L2"] * N,
            [x for x in PV for _ in (0, 1)],
            [x for x in OP for _ in (0, 1)],
        ),
        "csv",
        {"tag": "F1"},
        "",
    ),
    "remarks in a column of tags": (
        wide("Time,PV,OP,name", stamps(), PV, OP, [f"note {k}" for k in K]),
        "csv",
        {},
        "",
    ),
    "excel": (
        book(Trend=[["Trend", "", "", ""], TABLE[0], ["", "m3/h", "%", "m3/h"], *TABLE[1:]]),
        "xlsx",
        {},
        "1 lines above",
    ),
    "excel, a sheet of notes first": (
        book(Info=[["Report"], ["FCC"]], Trend=TABLE),
        "xlsx",
        {},
        "",
    ),
    "excel, a sheet per loop": (
        book(F1=TABLE, L2=[[*row[:3], 0] for row in TABLE]),
        "xlsx",
        {"tag": "F1"},
        "",
    ),
    "parquet": (
        lambda path: pd.DataFrame({"Time": T, "PV": PV, "OP": OP}).to_parquet(path),
        "parquet",
        {},
        "",
    ),
    "parquet, times in its index": (
        lambda path: pd.DataFrame({"PV": PV, "OP": OP}, pd.DatetimeIndex(T)).to_parquet(path),
        "parquet",
        {},
        "'index' holds time stamps",
    ),
    "matlab, signals": (mat(**MAT), "mat", {}, ""),
    "matlab, with times": (mat(t=TS * K, pv=PV, op=OP), "mat", {}, ""),
    "matlab, one of two loops": (
        mat(cdata={"chemicals": {"loop1": MAT, "loop2": {**MAT, "PV": OP}}}),
        "mat",
        {"tag": "chemicals.loop1"},
        "",
    ),
    "matlab, other names": (
        mat(y=PV, u=OP),
        "mat",
        {"columns": {"pv": "y", "op": "u"}, "Ts": TS},
        "",
    ),
}

# name -> (content, options, words of the refusal, the options that it ends with)
REFUSED = {
    "nothing": (b"", {}, "is empty", ""),
    "binary": (bytes(range(256)) * 9, {}, "is binary", ""),
    "blank": (b"\n\n", {}, "has no header line", ""),
    "text in PV": ("t,op,pv\n0,1,2\n1,1,2\n2,1,high\n", {}, "line 4: pv is 'high'", ""),
    "a number with its unit": ("t,op,pv\n0,1,2\n1,1,2 C\n", {}, "line 3: pv is '2 C'", ""),
    "infinite PV": ("t,op,pv\n0,1,2\n1,1,inf\n2,1,2\n", {}, "line 3: pv is 'inf'", ""),
    "an underscore in a number": ("t,op,pv\n0,1,2\n1,1,1_2\n", {}, "line 3: pv is '1_2'", ""),
    "a mark after a number": (
        wide("Time,PV,OP", stamps(), [*PV[:9], "9 ?", *PV[10:]], OP),
        {},
        "line 11: PV is '9 [?]'",
        "",
    ),
    "time runs back": (
        "t,op,pv\n0,1,2\n2,1,2\n1,1,3\n",
        {},
        r"line 4: t does not rise \(2.0, then 1.0\)",
        "",
    ),
    "a clock set back": (
        wide("Time,PV,OP", [*stamps()[:200], *stamps()[100:200]], PV, OP),
        {},
        "does not rise",
        "",
    ),
    "a coarse clock": (wide("t,PV,OP", K // 2, PV, OP), {}, "does not rise", "--ts 0.4983"),
    "time is text": ("t,op,pv\n0,1,2\nlater,1,2\n2,1,2\n", {}, "line 3: t is 'later'", ""),
    "a time is missing": ("t,op,pv\n0,1,2\n,1,2\n2,1,2\n", {}, "line 3: t is empty", ""),
    "two samples": ("t,op,pv\n0,1,2\n1,1,2\n", {}, "2 samples; at least 3", ""),
    "ragged": ("t,op,pv\n0,1,2\n1,2\n2,1,2\n", {}, "line 3: 2 cells; the header has 3", ""),
    "a column twice": (
        wide("Time,PV,PV,OP", stamps(), PV, OP, OP),
        {},
        r"PV or PV \(3\) may be PV",
        "--columns pv=PV",
    ),
    "a role twice": (
        wide("Time,PV.raw,PV_avg,OP", stamps(), PV, OP, OP),
        {},
        "may be PV",
        "--columns pv=PV.raw",
    ),
    "three decimals after a comma": (
        wide("Time\tOP\tPV", stamps(), [f"{x:.3f}".replace(".", ",") for x in OP], K, sep="\t"),
        {},
        "may be",
        "",
    ),
    "a comma here, a point there": (
        wide("Time;OP;PV", stamps(), [str(x).replace(".", ",") for x in OP], PV, sep=";"),
        {},
        "one of them is needed",
        "",
    ),
    "days of a spreadsheet": (
        wide("Time,PV,OP", 45355 + K * TS / 86400, PV, OP),
        {},
        "rises by 5.79e-05",
        "--ts 5",
    ),
    "time in fortnights": (wide("Time (fn),PV,OP", K, PV, OP), {}, "is in 'fn'; one of ms", ""),
    "two clocks": (
        wide("Local Time,UTC Time,PV,OP", stamps(), stamps(), PV, OP),
        {},
        "may be the time",
        "--columns 't=Local Time'",
    ),
    "no time": (wide("PV,OP", PV, OP), {}, "no time column", "--ts 1"),
    "a clock of another name": (
        wide("k,PV,OP", TS * K, PV, OP),
        {},
        "no time column",
        "--columns t=k",
    ),
    "a clock as a signal": (
        wide("PV,k,OP", PV, TS * K, OP),
        {"columns": {"pv": "k"}},
        "rises as time does",
        "",
    ),
    "a third missing": (
        wide("Time,PV,OP", stamps(), np.where(K % 3, PV.astype(str), ""), OP),
        {},
        "100 of 300 samples are missing; at most 20% may be",
        "",
    ),
    "uneven times": (
        wide("t,PV,OP", np.cumsum(np.random.default_rng(1).exponential(1, N)), PV, OP),
        {},
        "samples are missing",
        "--resample linear",
    ),
    "two loops": (LOOPS, {}, "2 loops: FIC101, LIC7", "--tag FIC101"),
    "a wrong tag": (LOOPS, {"tag": "FIC110"}, "no column of loop 'FIC110'", "--tag FIC101"),
    "two loops by number": (
        wide("Time,FT7.PV,FV8.OP", stamps(), PV, OP),
        {},
        "name two loops",
        "--columns pv=FT7.PV,op=FV8.OP",
    ),
    "MV may be the output": (
        wide("Time,PV,SV,MV", stamps(), PV, SP, OP),
        {},
        "no OP column",
        "--columns t=Time,op=MV",
    ),
    "a signal of another name": (
        wide("Time,Flow,OP", stamps(), PV, OP),
        {},
        "no PV column",
        "--columns t=Time,pv=Flow",
    ),
    "no header": (
        wide("1,2,3", TS * K, PV, OP).partition("\n")[2],
        {},
        "no PV column; columns are: 1, 2, 3",
        "--columns t=1,pv=2,op=3",
    ),
    "a name misspelt": (
        LOOPS,
        {"columns": {"op": "FIC11.OP"}},
        "no column 'FIC11.OP' for op, did you mean 'FIC101.OP'",
        "",
    ),
    "volts": (
        wide("Time,PV,OP [V]", stamps(), PV, 1 + 0.04 * OP),
        {},
        "OP is in 'v'",
        "--op-span 1 5",
    ),
    "a share of 1": (
        wide("Time,PV,OP", stamps(), PV, OP / 100),
        {},
        "a share of 1 or %",
        "--op-span 0 1",
    ),
    "quality": (
        wide("Time,PV,Trust,OP", stamps(), PV, np.where(PART == "Bad", "Bad", "Good"), OP),
        {},
        "says 'bad' and 'good' of samples",
        "--columns quality=none",
    ),
    "a row per time and tag": (
        "Time,Tag,Value\n" + "\n".join(LONG),
        {},
        "a row per time with a column each .* makes by pivot_table",
        "",
    ),
    "times before each signal": (
        wide("Time,F1.PV,Time,F1.OP", stamps(), PV, stamps(), OP),
        {},
        "a row per time with a column each .* makes by merge_asof",
        "",
    ),
    "one value a row": (
        "t,op,pv\n" + "".join(f"{k},{OP[k]},\n{k}.5,,{PV[k]}\n" for k in K),
        {},
        "a row per time with a column each .* makes by groupby",
        "",
    ),
    "one signal": (
        wide("timestamp,FIC101.PV", stamps(), PV),
        {},
        "a row per time with a column each .* makes by merge",
        "",
    ),
}


def written(folder, content, suffix):
    """Write a file of some content."""
    path = folder / f"loop.{suffix}"
    if callable(content):
        content(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path
