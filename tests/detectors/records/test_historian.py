"""One record as historians would export it: read right and said, or refused in one sentence; never
silently wrong.
"""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import pandas as pd
import pytest

from detectors.errors import RecordError
from detectors.records.archive import base_step, stored_on_change
from detectors.records.io import read_record

N, TS = 400, 5.0
START = datetime(2024, 3, 4, 23, 50, 0)
K = np.arange(N)
OP = np.round(48 + 6 * np.abs((K % 50) / 25 - 1) + 0.3 * np.sin(K), 2)
PV = np.round(1210 + 15 * np.sin(K / 8) + 2 * np.cos(1.7 * K), 1)
SP = np.full(N, 1210.0)
T = [START + timedelta(seconds=TS * k) for k in range(N)]
LOST = (31, 32, 150)  # samples that some variants lose; short enough to be bridged
BAND_OP, BAND_PV = 0.9, 4.0


def stamps(form="%Y-%m-%d %H:%M:%S"):
    return [t.strftime(form) for t in T]


def text(head, *columns, sep=","):
    return (
        "\n".join([head, *(sep.join(map(str, row)) for row in zip(*columns, strict=True))]) + "\n"
    )


def losing(values, word):
    return [word if k in LOST else v for k, v in enumerate(values)]


def comma(values):
    return [f"{v}".replace(".", ",") for v in values]


def grouped(values):
    return [f"{v:,.1f}".translate(str.maketrans(",.", ".,")) for v in values]


def changes(values, band):
    """Return the samples an exception report keeps: those further than `band` from the last one
    kept, and the ends.
    """
    kept = [0]
    for k in range(1, len(values)):
        if abs(values[k] - values[kept[-1]]) > band:
            kept.append(k)
    return sorted({*kept, len(values) - 1})


def sparse(values, band):
    kept = set(changes(values, band))
    return [v if k in kept else "" for k, v in enumerate(values)]


def long_rows(*tags, keep=lambda tag, k: True):
    rows = [(T[k], name, values[k]) for name, values in tags for k in K if keep(name, k)]
    return sorted(rows, key=lambda r: r[0])


def long_text(rows, head="Timestamp,Tag,Value"):
    return (
        "\n".join([head, *(f"{t:%d-%b-%y %H:%M:%S},{name},{value}" for t, name, value in rows)])
        + "\n"
    )


def excel(path):
    rows = [
        ["Report of FIC101", "", "", ""],
        ["", "", "", ""],
        ["Timestamp", "SP", "OP", "PV"],
        *zip(T, SP, OP, PV),
    ]
    pd.DataFrame(rows).to_excel(path, header=False, index=False)


KEPT = {
    "FIC101.OP": set(changes(OP, BAND_OP)),
    "FIC101.PV": set(changes(PV, BAND_PV)),
    "FIC101.SP": {0},
}
GOOD = ["Bad" if k in LOST else "Good" for k in K]
DA = [0 if k in LOST else 192 for k in K]
WRONG = [0.0 if k in LOST else v for k, v in enumerate(PV)]

# name -> (content: text, bytes or a function that writes the file; suffix; what the note must say,
# "" = nothing)
READ = {
    "am and pm, month first": (
        text("Time,SP,OP,PV", stamps("%m/%d/%Y %I:%M:%S %p"), SP, OP, PV),
        "csv",
        "%m/%d/%Y",
    ),
    "day first, over midnight": (
        text("Time,SP,OP,PV", stamps("%d/%m/%Y %H:%M:%S"), SP, OP, PV),
        "csv",
        "%d/%m/%Y",
    ),
    "decimal commas": (
        text("Time;SP;OP;PV", stamps(), comma(SP), comma(OP), comma(PV), sep=";"),
        "csv",
        "",
    ),
    "points for thousands": (
        text("Time;OP;PV", stamps(), comma(OP), grouped(PV), sep=";"),
        "csv",
        "",
    ),
    "utf-16 with tabs": (
        text("Time\tSP\tOP\tPV", stamps(), SP, OP, PV, sep="\t").encode("utf-16"),
        "txt",
        "",
    ),
    "windows-1252": (
        text("Time,OP (%),PV (m\u00b3/h)", stamps(), OP, PV).encode("cp1252"),
        "csv",
        "Windows-1252",
    ),
    "row of units": (
        "Time,SP,OP,PV\n,m3/h,%,m3/h\n" + text("", stamps(), SP, OP, PV)[1:],
        "csv",
        "taken as units",
    ),
    "preamble": (
        "Historian export\nServer: P1, zone UTC\n\n" + text("Time,OP,PV", stamps(), OP, PV),
        "csv",
        "2 lines above",
    ),
    "states: Bad": (
        text("Time,OP,PV", stamps(), losing(OP, "Bad"), losing(PV, "Bad Input")),
        "csv",
        "say 'Bad'",
    ),
    "states: No Data": (
        text("Time,OP,PV", stamps(), OP, losing(PV, "No Data")),
        "csv",
        "say 'No Data'",
    ),
    "states: -9999": (
        text("Time,OP,PV", stamps(), OP, losing(PV, "-9999")),
        "csv",
        "3 cells of PV hold -9999",
    ),
    "times of their own, paired": (
        text("Timestamp,PV,Timestamp.1,OP", stamps(), PV, stamps(), OP),
        "csv",
        "",
    ),
    "quality per signal": (
        text("Time,OP,PV,PV_Quality", stamps(), OP, WRONG, GOOD),
        "csv",
        "calls bad",
    ),
    "quality as OPC code": (text("Time,OP,PV,Status", stamps(), OP, WRONG, DA), "csv", "calls bad"),
    "long": (
        long_text(long_rows(("FIC101.OP", OP), ("FIC101.PV", PV), ("FIC101.SP", SP))),
        "csv",
        "",
    ),
    "long, stored on change": (
        long_text(
            long_rows(
                ("FIC101.OP", OP),
                ("FIC101.PV", PV),
                ("FIC101.SP", SP),
                keep=lambda tag, k: k in KEPT[tag],
            )
        ),
        "csv",
        "archive: PV holds",
    ),
    "wide, stored on change": (
        text("Time,OP,PV", stamps(), sparse(OP, BAND_OP), sparse(PV, BAND_PV)),
        "csv",
        "archive: OP holds",
    ),
    "OUT and MEAS": (
        text("Time,FIC101.SPT,FIC101.OUT,FIC101.MEAS", stamps(), SP, OP, PV),
        "csv",
        "PV is 'FIC101.MEAS'",
    ),
    "CO, with suffixes": (
        text("Time,101/PID1/CO.CV,101/PID1/PV.CV", stamps(), OP, PV),
        "csv",
        "OP is '101/PID1/CO.CV'",
    ),
    "date and clock apart": (
        text("Date,Time,OP,PV", stamps("%d.%m.%Y"), stamps("%H:%M:%S"), OP, PV),
        "csv",
        "",
    ),
    "milliseconds since 1970": (
        text("timestamp,OP,PV", [1709596200000 + 5000 * int(k) for k in K], OP, PV),
        "csv",
        "millisec",
    ),
    "minutes": (
        text("Time (min),OP,PV", [f"{k * TS / 60:.6f}" for k in K], OP, PV),
        "csv",
        "in min",
    ),
    "excel below a title": (excel, "xlsx", "1 lines above"),
}


def written(folder, content, suffix):
    path = folder / f"FIC101.{suffix}"
    if callable(content):
        content(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("name", READ)
def test_variant_is_read_right_and_what_was_done_is_noted(tmp_path, name):
    content, suffix, note = READ[name]
    record = read_record(written(tmp_path, content, suffix))
    assert record.Ts == pytest.approx(TS, abs=1e-3)
    assert record.n == N
    on_change = "on change" in name
    lost = [k for k in K if k in LOST and ("states" in name or "quality" in name)]
    there = np.setdiff1d(K, lost)
    for x, truth, band in ((record.op, OP, BAND_OP), (record.pv, PV, BAND_PV)):
        assert np.max(np.abs(x - truth)[there]) <= (band if on_change else 0.0)
    if record.sp is not None:
        assert np.array_equal(record.sp, SP)
    notes = " | ".join(record.notes)
    assert (note in notes) if note else notes == ""


MORE = {
    "three decimals behind a comma, tabs": (
        text("Time\tOP\tPV", stamps(), [f"{v:.3f}".replace(".", ",") for v in OP], K, sep="\t"),
        "may be",
    ),
    "comma here, point there": (
        text("Time;OP;PV", stamps(), comma(OP), PV, sep=";"),
        "one of them is needed",
    ),
    "points for thousands alone": (
        text("Time;OP;PV", stamps(), OP, [f"{v:,}".replace(",", ".") for v in 980 + K], sep=";"),
        "beside whole",
    ),
    "two clocks": (
        text("Local Time,UTC Time,PV,OP", stamps(), stamps(), PV, OP),
        "may be the time",
    ),
    "MV may be OP": (
        text("Time,PV,SV,MV", stamps(), PV, SP, OP),
        "MV may be the controller's output",
    ),
    "two loops": (
        text("Time,A.OP,A.PV,B.OP,B.PV", stamps(), OP, PV, OP, PV),
        "A.OP or B.OP may be OP",
    ),
    "a tenth of a spreadsheet's day": (
        text("time,OP,PV", [45000 + 0.1 * k for k in K], OP, PV),
        "days of a spreadsheet",
    ),
    "quality in part": (
        text("Time,OP,PV,Quality", stamps(), OP, PV, losing(GOOD, "Sort of")),
        "says 'sort of'",
    ),
    "quality 0 may be good": (text("Time,OP,PV,Quality", stamps(), OP, PV, 0 * K), "192 as good"),
    "OP in volts": (text("Time,OP [V],PV", stamps(), OP / 10, PV), "op_span"),
    "time in fortnights": (text("Time (fn),OP,PV", K, OP, PV), "known units of time"),
    "an unknown state": (
        text("Time,OP,PV", stamps(), OP, losing(PV, "odd")),
        "line 33: PV is 'odd'",
    ),
    "a third missing at random": (
        text(
            "Time,OP,PV",
            stamps(),
            OP,
            np.where(np.random.default_rng(1).random(N) < 0.33, "", PV.astype(str)),
        ),
        "missing",
    ),
    "tags of two loops": (
        long_text(long_rows(("A.OP", OP), ("A.PV", PV), ("B.OP", OP), ("B.PV", PV))),
        "2 loops, A, B",
    ),
}


@pytest.mark.parametrize("name", MORE)
def test_what_is_open_is_asked_for(tmp_path, name):
    content, sentence = MORE[name]
    with pytest.raises(RecordError, match=sentence) as caught:
        read_record(written(tmp_path, content, "csv"))
    assert "\n" not in str(caught.value)


def test_the_loop_of_a_table_with_several_is_named(tmp_path):
    file = written(tmp_path, text("Time,A1.OP,A1.PV,B2.OP,B2.PV", stamps(), K, K, OP, PV), "csv")
    assert np.array_equal(read_record(file, loop="B2").op, OP)
    tags = long_rows(("A1.OP", K), ("A1.PV", K), ("B2.OP", OP), ("B2.PV", PV))
    assert np.array_equal(read_record(written(tmp_path, long_text(tags), "txt"), loop="B2").pv, PV)
    with pytest.raises(RecordError, match="no column of loop 'C3'"):
        read_record(file, loop="C3")


def test_milliamperes_are_a_standard_and_noted(tmp_path):
    record = read_record(
        written(tmp_path, text("Time,OP [mA],PV", stamps(), 4 + 0.16 * OP, PV), "csv")
    )
    assert record.op_percent == pytest.approx(OP)
    assert "4 to 20 mA" in record.notes[0]


def test_days_of_a_spreadsheet_and_a_time_that_counts_seconds_are_distinguished(tmp_path):
    days = [f"{45000 + k * TS / 86400:.9f}" for k in K]
    assert read_record(
        written(tmp_path, text("time,OP,PV", days, OP, PV), "csv")
    ).Ts == pytest.approx(TS, abs=2e-3)
    assert read_record(
        written(tmp_path, text("t_s,OP,PV", 45000 + 0.1 * K, OP, PV), "csv")
    ).Ts == pytest.approx(0.1)


def test_a_sampled_signal_is_not_taken_for_one_stored_on_change():
    rng = np.random.default_rng(0)
    kept = np.sort(rng.choice(2000, 900, replace=False))
    t = np.arange(2000.0)
    for x in (np.sin(t / 9), rng.normal(size=2000).cumsum(), np.round(np.sin(t / 9), 1)):
        assert not stored_on_change(t[kept], x[kept])
        assert not stored_on_change(t[::5], x[::5])
        at = np.array(changes(x, 0.35 * x.std()))
        assert stored_on_change(t[at], x[at])
    assert base_step(np.array([0.0, 2.0, 8.0])) == 2.0
    assert base_step(np.array([0.0, 2.0, 5.0])) is None


def test_separate_times_are_joined_when_the_period_is_given_and_refused_otherwise(tmp_path):
    rows = [(t, "X.OP", v) for t, v in zip(T, OP)] + [
        (t + timedelta(seconds=2), "X.PV", v) for t, v in zip(T, PV)
    ]
    record = read_record(written(tmp_path, long_text(sorted(rows)), "csv"))
    assert record.Ts == TS
    assert np.array_equal(record.pv, PV[: record.n])
    assert "last value before" in " ".join(record.notes) or "holds" in " ".join(record.notes)
    uneven = [
        (t + timedelta(seconds=int(d)), n, v)
        for (t, n, v), d in zip(rows, np.random.default_rng(0).integers(0, 4, 2 * N))
    ]
    with pytest.raises(RecordError, match="say which sampling period Ts"):
        read_record(written(tmp_path, long_text(sorted(uneven)), "txt"))


def test_three_decimals_next_to_whole_numbers_of_their_size_are_decimals(tmp_path):
    rows = [
        f"{k},{50 + k % 7},{500 + 3 * (k % 9)},{'514.503' if k > 60 else '512'}" for k in range(120)
    ]
    path = tmp_path / "r.csv"
    path.write_text("t,op,pv,sp\n" + "\n".join(rows) + "\n", encoding="utf-8")
    record = read_record(path)
    assert record.sp is not None
    assert record.sp.max() == 514.503
