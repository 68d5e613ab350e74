"""Names of files that are no text, turn a terminal or look like a formula: every verb takes them,
and shows them escaped.
"""

import os
import sys

import numpy as np
import pytest

from tests.simbench.boundary.conftest import run_verb, sampled
from tests.simbench.boundary.test_hostile import write

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="file names are bytes")
NAMES = [b"n\xff", b"esc\x1b[31m", b"line\nbreak", "r\u202etl".encode(), b"x;=1+1", b"--help"]
ODD = os.fsdecode(b"n\xff\x1b")
RAW = ("\udcff", "\x1b", "\u202e", "\nbreak")
CHAINS = {
    "detect": ["detect plant --method horch_histogram --csv v.csv --html v.html"],
    "diagnose": [
        "gap diagnose ODD.csv --identify --html g.html --write-loop ODD.toml",
        "simulate ODD.toml -o again.csv",
    ],
    "run": [
        "run smoke -o ODD --method horch_histogram --set disturbance=none",
        "score ODD --report ODD.html",
        "check ODD --against base --update",
    ],
    "answers": [
        "run smoke -o ODD --method horch_histogram --set disturbance=none",
        "simulate ODD -o ODDrecords",
        "run ODD --add --method horch -o ODDmore",
    ],
}


@pytest.mark.parametrize("chain", sampled(CHAINS, 0, ["answers"]))
def test_a_name_that_is_no_text_is_taken_and_shown_escaped(here, chain):
    (here / "plant").mkdir()
    for k, name in enumerate(NAMES):
        write(here / "plant" / f"{os.fsdecode(name)}.csv", np.arange(300 + 20 * k))
    write(here / f"{ODD}.csv", np.arange(400))
    for words in CHAINS[chain]:
        named = [word.replace("ODD", ODD) for word in words.split()]
        code, answer, message = run_verb(named)
        assert code == 0, message
        assert not any(raw in answer + message for raw in RAW)
    for page in (*here.glob("*.html"), *here.glob("v.csv")):
        text = page.read_text(encoding="utf-8")
        assert not any(raw in text for raw in RAW), page
        assert page.suffix != ".csv" or ";=" not in text
