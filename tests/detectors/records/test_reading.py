"""Every file is read right, or refused in one sentence with the options that read it; holes are
bridged or cut, and that is said.
"""

from __future__ import annotations

import shlex

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from simbench.detectors.errors import ParameterError, RecordError
from simbench.detectors.records.columns import parse, words_of
from simbench.detectors.records.folder import read_folder, read_labels
from simbench.detectors.records.io import read_columns, read_record, read_records
from simbench.usage import column_pairs
from tests.detectors.records import layouts
from tests.detectors.records.layouts import LOOPS, OP, PV, SP, TS, K, N, stamps, wide, written


@pytest.mark.parametrize("name", layouts.READ)
def test_a_file_is_read_right_and_what_was_done_is_noted(tmp_path, name):
    content, suffix, options, note = layouts.READ[name]
    record = read_record(written(tmp_path, content, suffix), **options)
    lost = np.isin(K, (40, 41)) if name in ("states", "a number for no data") else K < 0
    assert record.Ts == pytest.approx(TS, abs=1e-9)
    assert np.array_equal(record.pv[~lost], PV[~lost])
    op = record.op if record.op_span is None else record.op_percent
    assert np.allclose(op, OP, atol=1e-3)
    assert record.sp is None or np.array_equal(record.sp, SP)
    assert note in " | ".join(record.notes)
    assert bool(note) or not record.notes


@pytest.mark.parametrize("name", layouts.REFUSED)
def test_a_file_is_refused_in_one_sentence_with_options_that_read_it(tmp_path, name):
    content, options, words, cure = layouts.REFUSED[name]
    file = written(tmp_path, content, "csv")
    with pytest.raises(RecordError, match=words) as caught:
        read_record(file, **options)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert caught.value.cure == cure
    if cure and "SECONDS" not in cure:
        assert read_record(file, **{**options, **options_of(cure)}).n > 100


def options_of(cure):
    """Return the options of a command as those of a function."""
    option, *values = shlex.split(cure)
    return {
        "--columns": lambda: {"columns": column_pairs(values)},
        "--tag": lambda: {"tag": values[0]},
        "--ts": lambda: {"Ts": float(values[0])},
        "--resample": lambda: {"resample": values[0]},
        "--op-span": lambda: {"op_span": (float(values[0]), float(values[1]))},
    }[option]()


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("FIC101.PV", ("pv", ("fic101",))),
        ("[default]U1/FIC101/OUT.CV", ("op", ("u1", "fic101"))),
        ("feed_flow_sp", ("sp", ("feed", "flow"))),
        ("ZT1010.PV", ("mv", ("zt1010", "pv"))),
        ("valve travel (%)", ("mv", ())),
        ("FIC101 MODE.ACTUAL", ("mode", ("fic101",))),
        ("Elapsed Time (min)", ("t", ())),
        ("FIC101.PV.Quality", ("quality", ())),
        ("Flow", ("", ("flow",))),
    ],
)
def test_the_name_of_a_column_says_the_signal_and_the_loop(name, found):
    assert parse(name)[:2] == found
    assert words_of(name) == words_of(name.upper())


def test_a_set_point_holds_its_value_and_an_empty_one_is_unknown(tmp_path):
    sp = np.where(K < 20, "10", np.where(K < 22, "", "12"))
    record = read_record(written(tmp_path, wide("t,op,pv,sp", K, OP, PV, sp), "csv"))
    assert record.sp is not None
    assert np.array_equal(record.sp, np.where(K < 22, 10.0, 12.0))
    empty = read_record(written(tmp_path, wide("t,op,pv,sp", K, OP, PV, [""] * N), "csv"))
    assert (empty.sp, empty.notes) == (None, ())


def test_a_time_step_that_differs_is_noted(tmp_path):
    t = K + 0.3 * (K > 100)
    record = read_record(written(tmp_path, wide("t,op,pv", t, OP, PV), "csv"))
    assert record.n == N
    assert "1 of 299 time steps differ from Ts = 1 s" in record.notes[0]
    t = K + 0.002 * (-1.0) ** K
    assert read_record(written(tmp_path, wide("t,op,pv", t, OP, PV), "csv")).notes == ()


def test_samples_at_uneven_times_are_resampled_where_that_is_asked_for():
    t = np.sort(np.random.default_rng(1).choice(1500, 900, replace=False)).astype(float)
    table = {"t": t, "op": 50 + np.sin(t / 20), "pv": 20 + np.cos(t / 20)}
    linear = read_columns(table, resample="linear")
    assert linear.Ts == 1.0
    assert np.allclose(linear.op, 50 + np.sin((t[0] + linear.t) / 20), atol=0.05)
    assert "900 samples at uneven times on a grid of 1 s" in linear.notes[0]
    held = read_columns(table, resample="held", Ts=2.0)
    last = np.searchsorted(t, t[0] + held.t, side="right") - 1
    assert np.array_equal(held.pv, table["pv"][last])
    with pytest.raises(ParameterError, match="did you mean 'linear'"):
        read_columns(table, resample="linea")


@pytest.mark.parametrize(
    ("automatic", "manual"),
    [("AUTO", "MAN"), ("RCAS", "Hand"), ("P-AUTO", "IMAN"), (1, 0), (8, 16)],
)
def test_the_longest_stretch_in_automatic_is_judged(tmp_path, automatic, manual):
    modes = [manual] * 60 + [automatic] * 200 + [manual] * 10 + [automatic] * 30
    file = written(tmp_path, wide("Time,PV,OP,Mode", stamps(), PV, OP, modes), "csv")
    record = read_record(file)
    assert np.array_equal(record.pv, PV[60:260])
    assert "MAN 23%; judged samples 60 to 259 of 300 (67%)" in record.notes[0]
    whole = read_record(file, automatic=False)
    assert whole.n == N
    assert np.array_equal(np.flatnonzero(whole.meta["manual"]), [*range(60), *range(260, 270)])


def test_words_that_are_no_mode_are_noted(tmp_path):
    some = ["AUTO"] * 280 + ["UNKNOWN"] * 20
    for modes, note in ((some, "20 samples say 'UNKNOWN'"), (["x"] * N, "is not understood")):
        file = written(tmp_path, wide("t,op,pv,mode", K, OP, PV, modes), "csv")
        assert note in read_record(file).notes[0]


def test_every_loop_of_a_file_is_a_record(tmp_path):
    records, refused = read_records(written(tmp_path, LOOPS, "csv"))
    assert (list(records), refused) == (["FIC101", "LIC7"], {})
    assert np.array_equal(records["LIC7"].op, PV)


def test_complex_numbers_of_a_matlab_file_are_refused(tmp_path):
    file = written(tmp_path, layouts.mat(pv=PV, op=OP, sp=SP + 1j), "mat")
    with pytest.raises(RecordError, match="sp holds complex numbers; real ones are needed"):
        read_record(file, Ts=1.0)


def test_what_a_matlab_file_states_of_its_loops_is_read(tmp_path):
    loop = {"PV": PV, "OP": OP, "SP": 1210.0, "Ts": 2, "Type": 1, "Comments": "Level control"}
    other = {**loop, "Type": "Flow", "Comments": ["FC145", "stiction"]}
    bad = {**loop, "OP": OP[:3]}
    content = layouts.mat(
        cdata={"chemicals": {"loop1": loop, "loop2": other}, "mining": {"loop1": bad}}
    )
    records, refused = read_folder(written(tmp_path, content, "mat"))
    one, two = records["chemicals.loop1"], records["chemicals.loop2"]
    assert (one.kind, one.process, one.Ts, one.tag) == (
        "level",
        "integrating",
        2.0,
        "chemicals.loop1",
    )
    assert one.sp is not None
    assert np.all(one.sp == 1210)
    assert (two.kind, two.process) == ("flow", None)
    assert "no OP column" in refused["mining.loop1"]


def test_a_table_of_loops_states_what_the_file_does_not(tmp_path):
    file = written(tmp_path, wide("Time,A,B,C,D", *layouts.TWO), "csv")
    table = tmp_path / "plant.toml"
    table.write_text(
        '[[loop]]\ntag = "FIC1"\nkind = "flow"\nop_span = [0, 200]\ncolumns = {pv = "A", op ='
        ' "B"}\n[[loop]]\ntag = "LIC2"\ncolumns = {pv = "C", op = "D"}\n'
    )
    flow = read_records(file, loops=table)[0]["FIC1"]
    assert (flow.kind, flow.op_span, flow.tag) == ("flow", (0.0, 200.0), "FIC1")
    assert np.array_equal(read_record(file, loops=table, tag="LIC2").pv, OP)
    for text, words in (
        ('[[loop]]\ntag = "A"\nknd = "flow"\n', "unknown key 'knd', did you mean 'kind'"),
        ('[[loop]]\nkind = "flow"\n', "a tag is needed"),
        (
            '[[loop]]\ntag = "A"\nop_span = [1]\ncolumns = {pv = "A", op = "B"}',
            "op_span = .1.; two",
        ),
        ('[[loop]]\ntag = "A"\ncolumns = {pv = 3}', "columns as a table of names"),
        ('[[loop]]\ntag = "A"\nTs = "x"\ncolumns = {pv = "A", op = "B"}', "Ts = x s"),
        ("loop = 3", "it has loop"),
        ("[[", "is no TOML"),
    ):
        table.write_text(text)
        with pytest.raises(RecordError, match=words):
            read_record(file, loops=table)


def test_a_tag_names_the_loop_of_a_file_whose_columns_name_none_but_not_of_every_file(tmp_path):
    file = written(tmp_path, layouts.named("PV", "OP"), "csv")
    record = read_record(file, tag="FIC1")
    assert record.tag == "FIC1"
    assert "tag: no column names a loop; the only one is read as FIC1" in record.notes
    with pytest.raises(RecordError, match="no column of loop 'FIC1'"):
        read_folder(tmp_path, tag="FIC1")
    table = tmp_path / "plant.toml"
    table.write_text('[[loop]]\ntag = "FIC1"\n[[loop]]\ntag = "LIC2"\n')
    assert set(read_records(file, loops=table)[1]) == {"FIC1", "LIC2"}
    table.write_text(f'[[loop]]\ntag = "FIC1"\nfile = "{file.name}"\n')
    assert np.array_equal(read_records(file, loops=table)[0]["FIC1"].pv, PV)


def test_a_folder_keeps_good_records_and_names_the_others(tmp_path):
    for name in ("a.csv", "a.txt", "b.csv"):
        (tmp_path / name).write_text(layouts.named("PV", "OP"))
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    records, refused = read_folder(tmp_path, each={"b": {"kind": "flow"}})
    assert list(records) == ["a.csv", "a.txt", "b"]
    assert records["b"].kind == "flow"
    assert "no PV column" in refused["other"]
    assert list(read_folder(tmp_path, names=["b"])[0]) == ["b"]
    (tmp_path / "empty").mkdir()
    for place, words in (
        (tmp_path / "empty", "no loop record found"),
        (tmp_path / "no", "does not exist"),
    ):
        with pytest.raises(RecordError, match=words):
            read_folder(place)


def test_labels_are_read_with_underscores_as_hyphens(tmp_path):
    file = tmp_path / "labels.csv"
    file.write_text("id,label,type,dynamics\na,stiction,diff_pressure,self_regulating\n7,,none,\n")
    one, two = read_labels(file).values()
    assert (one["kind"], one["process"], one["unit_group"]) == (
        "diff-pressure",
        "self-regulating",
        "a",
    )
    assert (two["kind"], two["process"], two["loop"], two["label"]) == ("", "", "7", "")
    for text, words in (
        ("name,label\na,1\n", "needs the columns id"),
        ("id,label\na,stikton\n", "line 2: label"),
    ):
        file.write_text(text)
        with pytest.raises(RecordError, match=words):
            read_labels(file)


def test_a_large_parquet_file_is_refused_before_it_is_read(tmp_path, monkeypatch):
    file = tmp_path / "rec.parquet"
    pd.DataFrame({"t": np.arange(400.0), "op": 50.0, "pv": 20.0}).to_parquet(file)
    monkeypatch.setattr("simbench.detectors.records.files.MOST_UNPACKED", 100)
    monkeypatch.setattr(parquet, "read_table", lambda *path, **how: pytest.fail("it was read"))
    with pytest.raises(RecordError, match="unpacks to"):
        read_record(file)
