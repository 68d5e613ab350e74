"""Record files nobody should trust: refused in one sentence that names the file, or judged with
JSON that is JSON.
"""

from __future__ import annotations

import io
import json
import zipfile
from itertools import product

import numpy as np
import pandas as pd
import pytest

from detectors.records import tables
from tests.simbench.boundary.conftest import held

N = 300
TIME = np.arange(N)
OP = 50 + 3 * np.sin(TIME / 5)
PV = 50 - 2 * np.sin(TIME / 5 - 1)
QUICK = "horch,horch_histogram,rossi_scali"


def csv(t=TIME, op=OP, pv=PV, **more) -> str:
    return pd.DataFrame({"t": t, "op": op, "pv": pv, **more}).to_csv(index=False)


def with_cell(column: str, text: str) -> str:
    lines = csv().splitlines()
    cells = lines[100].split(",")
    cells[["t", "op", "pv"].index(column)] = text
    return "\n".join([*lines[:100], ",".join(cells), *lines[101:]])


WRONG_CELLS = (
    "off",
    "1.2.3",
    "inf",
    "-inf",
    "1e999",
    "0x10",
    "Sort of",
    "12:30",
    "1_000x",
    "+-",
    "1;2",
    "9" * 400,
)
WRONG_TEXTS = {
    "nothing": b"",
    "one byte": b"\0",
    "line breaks": b"\n\n\n",
    "spaces": b"   \n  \n",
    "zeros": b"\0" * 5000,
    "every byte": bytes(range(256)) * 20,
    "half of utf-16": csv().encode("utf-16")[:-1],
    "latin-1": "t,op,pv\n0,1,2 ä\n".encode("latin-1"),
    "header alone": b"t,op,pv\n",
    "one sample": b"t,op,pv\n0,1,2\n",
    "two samples": b"t,op,pv\n0,1,2\n1,2,3\n",
    "no header": "\n".join(csv().splitlines()[1:]).encode(),
    "ragged": b"t,op,pv\n0,1,2\n1,2\n2,3,4\n3,4,5\n",
    "too many cells": b"t,op,pv\n0,1,2\n1,2,3,4\n2,3,4\n3,4,5\n",
    "no op": b"t,x,pv\n0,1,2\n1,2,3\n2,3,4\n",
    "no pv": b"t,op,x\n0,1,2\n1,2,3\n2,3,4\n",
    "no time": b"op,pv\n0,1\n1,2\n2,3\n",
    "empty names": b",,\n0,1,2\n1,2,3\n2,3,4\n",
    "time back": b"t,op,pv\n0,1,2\n2,2,3\n1,3,4\n3,4,5\n",
    "time stands": b"t,op,pv\n0,1,2\n0,2,3\n0,3,4\n",
    "time empty": b"t,op,pv\n,1,2\n,2,3\n,3,4\n",
    "time infinite": b"t,op,pv\n0,1,2\n1,2,3\ninf,3,4\n",
    "time as words": b"t,op,pv\nmon,1,2\ntue,2,3\nwed,3,4\n",
    "time far apart": b"t,op,pv\n0,1,2\n1,2,3\n2,3,4\n1e18,4,5\n",
    "steps of nothing": b"t,op,pv\n0,1,2\n1e-320,2,3\n2e-320,3,4\n",
    "all empty": b"t,op,pv\n" + b"".join(f"{k},,\n".encode() for k in range(50)),
    "half empty": b"t,op,pv\n"
    + b"".join((f"{k},,\n" if k % 2 else f"{k},1,2\n").encode() for k in range(50)),
    "a page": b"<html><body>404</body></html>",
    "json": b'{"op": [1, 2, 3]}',
    "a zip": b"PK\x03\x04" + b"\1" * 100,
    "quote without end": b't,op,pv\n0,"1,2\n1,2,3\n2,3,4\n',
    "a cell too long": b"t,op,pv\n0," + b"1" * 200_000 + b",2\n1,2,3\n2,3,4\n",
    "date of no calendar": b"t,op,pv\n2024-13-45,1,2\n2024-13-46,2,3\n2024-13-47,3,4\n",
    "huge op": csv(op=OP * 1e200).encode(),
    "huge pv": csv(pv=PV * 1e200).encode(),
    "largest pv": csv(pv=np.sign(PV - 50) * 1.7e308).encode(),
    "tiny pv": csv(pv=PV * 1e-250).encode(),
    "tiny op": csv(op=OP * 1e-250).encode(),
}
READERS = {
    "detect": ["detect", None, "--method", QUICK, "--json"],
    "diagnose": ["diagnose", None, "--json"],
    "gap": ["gap", "diagnose", None, "--identify", "--json"],
    "valve": ["valve", None, "--model", "deadband", "--param", "S=2", "-o", "/dev/null"],
}


def ask(verb: str, path) -> list:
    return [path if a is None else a for a in READERS[verb]]


def put(tmp_path, content: str | bytes, name: str = "rec.csv"):
    path = tmp_path / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("verb", ["detect", "diagnose", "gap"])
@pytest.mark.parametrize("name", WRONG_TEXTS)
def test_no_record_at_all(refused, tmp_path, verb, name):
    refused(ask(verb, put(tmp_path, WRONG_TEXTS[name])), "rec.csv")


@pytest.mark.parametrize("text", WRONG_CELLS, ids=lambda t: t[:10])
@pytest.mark.parametrize(
    ("verb", "column"),
    [*product(["detect", "gap"], ["op", "pv", "t"]), ("valve", "op"), ("valve", "t")],
)
def test_a_cell_that_is_no_number(refused, tmp_path, verb, column, text):
    refused(
        ask(verb, put(tmp_path, with_cell(column, text))),
        "rec.csv",
        "line 101",
        column,
        values=[text],
    )


def frame(**columns) -> pd.DataFrame:
    return pd.DataFrame({"t": TIME, "op": OP, "pv": PV, **columns})


def binary(suffix: str) -> bytes:
    out = io.BytesIO()
    if suffix == ".parquet":
        frame().to_parquet(out)
    elif suffix == ".xlsx":
        frame().head(60).to_excel(out, index=False)
    else:
        from scipy.io import savemat

        savemat(
            out, {"cdata": {"chemicals": {"loop1": {"PV": PV, "OP": OP, "SP": PV * 0, "Ts": 1.0}}}}
        )
    return out.getvalue()


@pytest.mark.parametrize("suffix", [".parquet", ".xlsx", ".mat"])
@pytest.mark.parametrize("damage", ["cut", "half", "head", "zeros", "text", "empty", *range(12)])
def test_a_damaged_binary_file(told, tmp_path, suffix, damage):
    whole = bytearray(binary(suffix))
    at = {"cut": len(whole) - 10, "half": len(whole) // 2, "head": 20}
    if damage in at:
        content = bytes(whole[: at[damage]])
    elif isinstance(damage, str):
        content = {"zeros": b"\0" * 2000, "text": b"t,op,pv\n0,1,2\n", "empty": b""}[damage]
    else:
        for place in np.random.default_rng(damage).integers(0, len(whole), 20):
            whole[place] ^= 0xFF
        content = bytes(whole)
    code, said = told(ask("detect", put(tmp_path, content, f"rec{suffix}")))
    if isinstance(damage, str):
        assert code == 2, said
    if code == 2:
        assert f"rec{suffix}" in said
        held(said)


@pytest.mark.parametrize(
    "values",
    [["a"] * N, [None] * N, [[1, 2]] * N, [b"\0"] * N, [True] * N],
    ids=lambda v: repr(v[0]),
)
@pytest.mark.parametrize("column", ["op", "pv", "t"])
def test_a_parquet_column_of_another_type(refused, tmp_path, column, values):
    if values[0] is None and column == "t":
        values = [None] * N
    path = tmp_path / "rec.parquet"
    frame(**{column: pd.Series(values, dtype=object)}).to_parquet(path)
    refused(ask("detect", path), "rec.parquet")


@pytest.mark.parametrize("limit", ["MOST_ROWS", "MOST_UNPACKED"])
def test_a_small_sheet_that_unpacks_to_a_large_one_is_refused(
    refused, tmp_path, monkeypatch, limit
):
    monkeypatch.setattr(tables, limit, {"MOST_ROWS": 5000, "MOST_UNPACKED": 500_000}[limit])
    path = tmp_path / "bomb.xlsx"
    with (
        zipfile.ZipFile(io.BytesIO(binary(".xlsx"))) as good,
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bad,
    ):
        for item in good.namelist():
            if item != "xl/worksheets/sheet1.xml":
                bad.writestr(item, good.read(item))
        with bad.open("xl/worksheets/sheet1.xml", "w") as sheet:
            sheet.write(
                b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
            )
            sheet.write(b"<row><c><v>1</v></c><c><v>1</v></c><c><v>1</v></c></row>" * 10_000)
            sheet.write(b"</sheetData></worksheet>")
    refused(
        ask("detect", path), "bomb.xlsx", {"MOST_ROWS": "rows", "MOST_UNPACKED": "unpacks"}[limit]
    )


SHAPES = {
    "constant pv": {"pv": 0 * PV + 3},
    "constant op": {"op": 0 * OP + 3},
    "constant both": {"op": 0 * OP + 3, "pv": 0 * PV},
    "zeros": {"op": 0 * OP, "pv": 0 * PV},
    "one spike": {"pv": np.where(TIME == 150, 1e9, 0.0)},
    "pv large": {"pv": PV * 1e90},
    "pv small": {"pv": (PV - 50) * 1e-90},
    "pv far away": {"pv": PV + 1e12},
    "op far outside": {"op": OP * 1e9},
    "alternating": {"pv": (-1.0) ** TIME, "op": 50 + (-1.0) ** TIME},
    "staircase": {"op": np.round(OP), "pv": np.round(PV)},
    "exponential": {"pv": np.exp(TIME / 10.0)},
    "almost constant": {"pv": 50 + 1e-13 * np.sin(TIME / 5)},
    "denormal noise": {"pv": 50 + 5e-324 * TIME},
    "op equal pv": {"op": OP, "pv": OP},
    "minus": {"op": -OP, "pv": -PV},
    "sp wild": {"sp": np.where(TIME % 2, 1e80, -1e80)},
    "mv constant": {"mv": 0 * OP},
    "mv wild": {"mv": OP * 1e80},
    "manual with a loop": {"op": np.where(TIME < 150, 50.0, 51.0)},
    "slow time": {"t": TIME * 1e8},
    "fast time": {"t": TIME * 1e-8},
}


@pytest.mark.parametrize("verb", ["detect", "diagnose", "gap"])
@pytest.mark.parametrize("name", SHAPES)
def test_a_record_of_a_strange_shape_gets_json_or_a_sentence(told, tmp_path, verb, name):
    path = put(tmp_path, csv(**{"sp": 0 * PV + 50, **SHAPES[name]}))
    code, said = told(["detect", path, "--raw", "--json"] if verb == "detect" else ask(verb, path))
    if verb == "detect" and code == 0:
        assert all(v["reason"] for v in json.loads(said))
        assert not any("failed" in v["reason"] for v in json.loads(said)), said
