"""Loop files nobody should write: refused in one sentence that names the key, or simulated to
finite numbers.
"""

from __future__ import annotations

import re
from itertools import product

import numpy as np
import pytest

from simbench.detectors.records.io import read_record
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import load_loop
from tests.simbench.boundary.conftest import asked, new_tokens, refused, sampled

GOOD = {
    "plant": {"type": '"foptd"', "K": "1.0", "T": "10.0", "Td": "2.0"},
    "controller": {"type": '"PI"', "Kc": "1.0", "Ti": "10.0", "direction": '"reverse"'},
    "operating_point": {"op0": "50.0", "pv0": "50.0"},
    "valve": {"model": '"choudhury"', "S": "5.0", "J": "2.0"},
    "sampling": {"Ts": "1.0", "n": "200"},
    "noise": {"std": "0.1", "mv_std": "0.1"},
    "setpoint": {"value": "50.0", "steps": "[[10.0, 55.0]]"},
    "[disturbance]": {"type": '"sine"', "amplitude": "1.0", "period": "30.0", "at": '"output"'},
    "[effect]": {"name": '"noise"', "std": "0.1"},
}
NUMBERS = [(s, k) for s, keys in GOOD.items() for k, v in keys.items() if v[0] in "0123456789"]
WORDS = [(s, k) for s, keys in GOOD.items() for k, v in keys.items() if v[0] == '"']
NEVER = (
    "nan",
    "inf",
    "-inf",
    '"many"',
    '"1.0"',
    "true",
    "[]",
    "[1.0]",
    "{}",
    '""',
    "2024-05-31",
    "1" * 400,
    "1" * 5000,
)
EXTREME = ("0.0", "-1.0", "1e300", "-1e300", "1e-300", "1e12", "1e-9", "101.0")
MORE = {
    "no plant": ("[plant]", "[plan]", "plan"),
    "no value": ("K = 1.0", "K = ", "line"),
    "twice": ("K = 1.0", "K = 1.0\nK = 2.0", "line"),
    "no section": ("[sampling]\nTs = 1.0\nn = 200\n", "", "sampling"),
    "section as number": ("[plant]", "plant = 1\n[x]", "plant"),
    "valve twice": ("[valve]", "[[valve]]", "valve"),
    "disturbance once": ("[[disturbance]]", "[disturbance]", "disturbance"),
    "valve without model": ('model = "choudhury"', "", "model"),
    "J of another valve": ("J = 2.0", "J = 2.0\nfriction = 3.0", "friction"),
    "unknown key": ("Td = 2.0", "tau = 2.0", "tau"),
    "positive feedback": ("K = 1.0", "K = -1.0", "positive feedback"),
    "two steps in one": ("[[10.0, 55.0]]", "[[10.0, 55.0, 3.0]]", "steps"),
    "step back in time": ("[[10.0, 55.0]]", "[[-10.0, 55.0]]", "steps"),
    "steps as numbers": ("[[10.0, 55.0]]", "[10.0, 55.0]", "steps"),
    "infinite step": ("[[10.0, 55.0]]", "[[10.0, inf]]", "steps"),
    "P with Ti": ('type = "PI"', 'type = "P"', "Ti"),
    "integrating with T": ('type = "foptd"', 'type = "integrating"', "T"),
    "n as fraction": ("n = 200", "n = 200.5", "n"),
    "n too large": ("n = 200", "n = 100000000000", "n"),
    "n negative": ("n = 200", "n = -5", "n"),
    "nested without end": ("K = 1.0", f"K = {'[' * 3000}{']' * 3000}", "nested"),
    "inline without end": ("K = 1.0", f"K = {'{a=' * 3000}1{'}' * 3000}", "nested"),
}
NO_LOOP = [b"", b"\0\1\2", "K = ä".encode("utf-16"), b"[plant", b"= 1", b'"' * 100, b"a.b.c = 1"]


def text(section: str = "", key: str = "", value: str = "") -> str:
    lines = []
    for name, keys in GOOD.items():
        lines.append(f"[{name}]")
        lines += [f"{k} = {value if (name, k) == (section, key) else v}" for k, v in keys.items()]
    return "\n".join(lines) + "\n"


def put(folder, content: str | bytes):
    """Write a loop file."""
    path = folder / "loop.toml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


SIMULATE = "simulate loop.toml -o r.csv"


def pairs(keys, values, every: int) -> list:
    """Cases of (section, key, value)."""
    return sampled([(*key, value) for key, value in product(keys, values)], every)


def test_the_loop_that_is_spoilt_here_is_good_and_its_record_reads_back_to_the_same_bits(here):
    put(here, text())
    assert asked(f"{SIMULATE} --seed 3")[0] == 0
    back, expected = read_record("r.csv"), simulate(load_loop("loop.toml"), 3).record
    for name in ("op", "pv", "mv", "sp"):
        np.testing.assert_array_equal(getattr(back, name), getattr(expected, name))


@pytest.mark.parametrize(("section", "key", "value"), pairs(NUMBERS, NEVER, 12))
def test_what_is_no_number_is_refused(here, section, key, value):
    put(here, text(section, key, value))
    if len(value) == 5000:  # of longer ones Python reads no digit
        refused(SIMULATE, "loop.toml", "digits")
    else:
        message = refused(SIMULATE, "loop.toml", key, values=[value])
        fault = rf"\b{key} = .*(is no number|is not finite|should be|needed)"
        assert re.search(fault, message), message
        assert message.count("; ") <= 1, message
    assert not (here / "r.csv").exists()


@pytest.mark.parametrize(
    ("section", "key", "value"), pairs(WORDS, ["1", "true", '""', '"zzz"', "[]", "nan"], 5)
)
def test_what_is_no_known_word_is_refused(here, section, key, value):
    put(here, text(section, key, value))
    message = refused(SIMULATE, "loop.toml", values=[value])
    assert key in message or section.strip("[]") in message, message


@pytest.mark.parametrize(("section", "key", "value"), pairs(NUMBERS, EXTREME, 7))
def test_an_extreme_number_is_refused_or_simulated_to_finite_numbers(here, section, key, value):
    put(here, text(section, key, value))
    code, _, message = asked(SIMULATE)
    if code == 2:
        assert key in message or "K" in message, message
        return
    record = read_record("r.csv")
    for signal in (record.op, record.pv, record.mv):
        assert np.isfinite(signal).all()


@pytest.mark.parametrize("name", sampled(MORE, 2))
def test_a_misshapen_file_is_refused(here, name):
    old, new, part = MORE[name]
    assert old in text()
    # of what is no TOML the line is named, and of what is nested nothing can be quoted
    values = [v for v in new_tokens(old, new) if part not in ("line", "nested")]
    put(here, text().replace(old, new, 1))
    refused(SIMULATE, "loop.toml", part, values=values[:1])


@pytest.mark.parametrize("content", NO_LOOP, ids=repr)
def test_no_loop_at_all(here, content):
    put(here, content)
    for verb in ("predict", "confirm gain-change", "confirm travel"):
        refused(f"{verb} loop.toml", "loop.toml")
