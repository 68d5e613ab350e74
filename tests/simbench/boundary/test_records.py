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
from scipy.io import savemat

from simbench.detectors.records import files
from tests.simbench.boundary.conftest import asked, check_sentence, refused, sampled

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
    "time repeats": b"t,op,pv\n0,1,2\n0,2,3\n0,3,4\n",
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
    "detect": f"detect {{0}} --method {QUICK} --json",
    "diagnose": "diagnose {0} --json",
    "gap": "gap diagnose {0} --identify --json",
    "valve": "valve {0} --model deadband --param S=2 -o /dev/null",
}


def put(folder, content: str | bytes, name: str = "rec.csv"):
    """Write a record."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize(
    ("verb", "name"), sampled(product(["detect", "diagnose", "gap"], WRONG_TEXTS), 4)
)
def test_no_record_at_all(here, verb, name):
    put(here, WRONG_TEXTS[name])
    refused(READERS[verb].format("rec.csv"), "rec.csv")


COLUMNS = [*product(["detect", "gap"], ["op", "pv", "t"]), ("valve", "op"), ("valve", "t")]


@pytest.mark.parametrize(
    ("verb", "column", "text"),
    sampled([(*one, text) for one, text in product(COLUMNS, WRONG_CELLS)], 7),
)
def test_a_cell_that_is_no_number(here, verb, column, text):
    put(here, with_cell(column, text))
    refused(READERS[verb].format("rec.csv"), "rec.csv", "line 101", column, values=[text])


def frame(**columns) -> pd.DataFrame:
    return pd.DataFrame({"t": TIME, "op": OP, "pv": PV, **columns})


def binary(suffix: str) -> bytes:
    """A good record in a binary format."""
    out = io.BytesIO()
    if suffix == ".parquet":
        frame().to_parquet(out)
    elif suffix == ".xlsx":
        frame().head(60).to_excel(out, index=False)
    else:
        loop = {"PV": PV, "OP": OP, "SP": PV * 0, "Ts": 1.0}
        savemat(out, {"cdata": {"chemicals": {"loop1": loop}}})
    return out.getvalue()


DAMAGES = {
    "cut": lambda whole: whole[:-10],
    "half": lambda whole: whole[: len(whole) // 2],
    "head": lambda whole: whole[:20],
    "zeros": lambda whole: b"\0" * 2000,
    "text": lambda whole: b"t,op,pv\n0,1,2\n",
    "empty": lambda whole: b"",
}


@pytest.mark.parametrize(
    ("suffix", "damage"), sampled(product([".parquet", ".xlsx", ".mat"], [*DAMAGES, *range(12)]), 5)
)
def test_a_damaged_binary_file(here, suffix, damage):
    whole = binary(suffix)
    if damage in DAMAGES:
        content = DAMAGES[damage](whole)
    else:
        content = bytearray(whole)
        for place in np.random.default_rng(damage).integers(0, len(whole), 20):
            content[place] ^= 0xFF
    put(here, bytes(content), f"rec{suffix}")
    code, _, message = asked(READERS["detect"].format(f"rec{suffix}"))
    assert code == 2 or damage not in DAMAGES, message
    if code == 2:
        assert f"rec{suffix}" in message
        check_sentence(message)


@pytest.mark.parametrize("name", ["rec.xls", "rec.xlsx"])
def test_a_workbook_of_an_old_excel_or_with_a_password(here, name):
    (here / name).write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(2000))
    refused(f"detect {name}", name, "without a password is needed")


def test_a_small_sheet_that_unpacks_to_a_large_one_is_refused(here, monkeypatch):
    monkeypatch.setattr(files, "MOST_UNPACKED", 500_000)
    with (
        zipfile.ZipFile(io.BytesIO(binary(".xlsx"))) as good,
        zipfile.ZipFile("bomb.xlsx", "w", zipfile.ZIP_DEFLATED) as bad,
    ):
        for item in good.namelist():
            if item != "xl/worksheets/sheet1.xml":
                bad.writestr(item, good.read(item))
        bad.writestr(
            "xl/worksheets/sheet1.xml",
            '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">'
            + "<sheetData>"
            + "<row><c><v>1</v></c><c><v>1</v></c><c><v>1</v></c></row>" * 10_000
            + "</sheetData></worksheet>",
        )
    refused(READERS["detect"].format("bomb.xlsx"), "bomb.xlsx", "unpacks")


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


@pytest.mark.parametrize(
    ("verb", "name"),
    sampled(product(["detect", "diagnose"], SHAPES), 7)
    + sampled(product(["gap"], SHAPES), 0, [("gap", "constant pv")]),
)
def test_a_record_of_a_strange_shape_gets_json_or_a_sentence(here, verb, name):
    put(here, csv(**{"sp": 0 * PV + 50, **SHAPES[name]}))
    words = "detect rec.csv --json" if verb == "detect" else READERS[verb].format("rec.csv")
    code, answer, _ = asked(words)
    if verb == "detect" and code == 0:
        reasons = [verdict["reason"] for verdict in json.loads(answer)]
        assert all(reasons)
        assert not any("failed" in reason for reason in reasons), reasons
