"""Loop files, grids and records at random: never a traceback, a hang or a sentence without
content.

`FUZZ=5000 pytest tests/simbench/boundary/test_fuzz.py` draws more of each, anew every time; without
it they stay the same.
"""

from __future__ import annotations

import json
import os

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.simbench.boundary.conftest import asked
from tests.simbench.boundary.test_loops import text as loop_text
from tests.simbench.boundary.test_records import csv

MANY = settings(
    max_examples=int(os.environ.get("FUZZ", "8")),
    derandomize="FUZZ" not in os.environ,
    deadline=None,
    database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
WORDS = st.sampled_from(
    [
        "foptd",
        "PI",
        "integrating",
        "choudhury",
        "ideal",
        "sine",
        "input",
        "K",
        "nan",
        "é",
        "a.b",
        "",
    ]
)
NUMBERS = st.one_of(
    st.integers(-5, 5),
    st.integers(),
    st.floats(-1e3, 1e3),
    st.floats(),
    st.sampled_from([1e300, -1e-300, 0.0, 1e12]),
)
SCALARS = st.one_of(NUMBERS, WORDS, st.booleans(), st.text(max_size=8))
VALUES = st.recursive(
    SCALARS,
    lambda v: st.one_of(st.lists(v, max_size=4), st.dictionaries(WORDS, v, max_size=3)),
    max_leaves=6,
)
# what happens to a text: at a place (a share of its length), so many characters go and these come
CUTS = st.lists(
    st.tuples(
        st.floats(0, 1),
        st.integers(0, 6),
        st.text(alphabet='0123456789.-+e,;"[]{}=#\n\t nainf\0é', max_size=5),
    ),
    min_size=1,
    max_size=4,
)


def cut(text: str, cuts: list[tuple[float, int, str]]) -> str:
    for place, gone, more in cuts:
        at = int(place * len(text))
        text = text[:at] + more + text[at + gone :]
    return text


def toml(value) -> str:
    """Write a value as TOML does, or nearly so."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(str(k))} = {toml(v)}" for k, v in value.items()) + "}"
    return str(value)


def changed(text: str, line: float, value) -> str:
    """The text with another value, or another name, in one of its lines."""
    lines = text.splitlines()
    places = [k for k, one in enumerate(lines) if " = " in one]
    at = places[int(line * (len(places) - 1))]
    lines[at] = f"{lines[at].partition(' = ')[0]} = {toml(value)}"
    return "\n".join(lines) + "\n"


LINES = st.lists(st.tuples(st.floats(0, 1), VALUES), min_size=1, max_size=3)


def spoilt(text: str, lines, cuts) -> str:
    """The text with other values in some lines, and with cuts."""
    for line, value in lines:
        text = changed(text, line, value)
    return cut(text, cuts)


@MANY
@given(lines=LINES, cuts=st.one_of(st.just([]), CUTS))
def test_loop_files(tmp_path, lines, cuts):
    file, out = tmp_path / "loop.toml", tmp_path / "out.csv"
    # long records are the business of other tests
    text = spoilt(loop_text(), lines, cuts).replace("n = 200", "n = 60")
    file.write_text(text, encoding="utf-8", errors="surrogatepass")
    out.unlink(missing_ok=True)
    code, _, message = asked(["simulate", file, "-o", out])
    assert out.exists() is (code == 0), message
    if code == 2:
        assert "loop.toml" in message
    else:
        assert np.isfinite(np.genfromtxt(out, delimiter=",", skip_header=1)).all()


@MANY
@given(cuts=CUTS, raw=st.one_of(st.just(b""), st.binary(max_size=6)), place=st.floats(0, 1))
def test_records(tmp_path, cuts, raw, place):
    content = cut(csv()[:4000], cuts).encode("utf-8", "surrogatepass")
    at = int(place * len(content))
    file = tmp_path / "rec.csv"
    file.write_bytes(content[:at] + raw + content[at:])
    code, _, message = asked(["detect", file, "--method", "horch_histogram", "--json"])
    assert code != 2 or "rec.csv" in message


@MANY
@given(
    content=st.one_of(
        st.binary(max_size=300), st.text(max_size=300).map(lambda t: t.encode("utf-8", "replace"))
    )
)
def test_bytes(tmp_path, content):
    for name, words in (("x.csv", ["detect"]), ("x.toml", ["predict"])):
        (tmp_path / name).write_bytes(content)
        code, _, message = asked([*words, tmp_path / name])
        assert code == 2
        assert name in message or not content
