"""Six verbs read one export the same way, from one set of options; a refusal ends with the command
that works.
"""

from __future__ import annotations

import contextlib
import importlib
import shlex

import numpy as np
import pytest

from simbench import cli
from simbench.detectors.example_loop import example_loop
from simbench.detectors.records.io import read_record
from simbench.gap import command as gap_command
from tests.detectors.records import layouts


class _Read(Exception):
    """Raised in place of a long computation, with the record that reached it."""


@pytest.fixture(scope="module")
def export(tmp_path_factory):
    place = tmp_path_factory.mktemp("plant")
    one, two = example_loop(noise=0.1), example_loop(noise=0.2)
    cells = {"Time": one.t}
    for tag, record in (("FIC101", one), ("LIC7", two)):
        cells |= {f"[default]U1/{tag}/PV": record.pv, f"[default]U1/{tag}/OP": record.op}
    lines = [
        ",".join(cells),
        *(",".join(f"{v:.6g}" for v in row) for row in zip(*cells.values(), strict=True)),
    ]
    (place / "unit.csv").write_text("\n".join(lines) + "\n")
    (place / "loop.toml").write_text(
        '[plant]\ntype = "foptd"\nK = 1\nT = 10\nTd = 1\n[controller]\ntype = "PI"\nKc = 1\nTi ='
        " 10\n[sampling]\nTs = 1\n"
    )
    return place


@pytest.fixture
def caught(monkeypatch):
    """Return the records that reached the computations of the slow verbs."""
    got = []

    def stop(record, *_, **__):
        got.append(record)
        raise _Read

    monkeypatch.setattr(gap_command, "diagnose", stop)
    monkeypatch.setattr("simbench.gap.stiction.conclusion.judged", stop)
    # `simbench.confirm` is a function too
    recorded = importlib.import_module("simbench.confirm.recorded")
    monkeypatch.setattr(recorded, "travel_recorded", stop)
    monkeypatch.setattr("simbench.gap.gain_pair.gain_change_recorded", stop)
    return got


VERBS = {
    "diagnose": "diagnose {f}",
    "gap diagnose": "gap diagnose {f} --identify",
    "confirm travel": "confirm travel --record {f}",
    "confirm gain-change": "confirm gain-change --records {f} {f} --ratio 0.5",
}


def typed(words):
    try:
        return cli.main(words)
    except _Read:
        return 0


@pytest.mark.parametrize("verb", VERBS)
def test_the_command_that_a_refusal_ends_with_works(export, caught, capsys, verb):
    assert typed(VERBS[verb].format(f=export / "unit.csv").split()) == 2
    refusal = capsys.readouterr().err.strip()
    program, *again = shlex.split(refusal.split("try: ")[1])
    assert program == "simbench"
    assert again[-2:] == ["--tag", "[default]U1/FIC101"]
    assert typed(again) == 0
    assert caught[0].tag == "[default]U1/FIC101"
    assert not np.array_equal(caught[0].pv, example_loop(noise=0.2).pv)


@pytest.mark.parametrize("verb", VERBS)
def test_what_is_known_of_a_record_is_given_by_the_same_options(export, caught, verb):
    words = VERBS[verb].format(f=export / "unit.csv").split()
    columns = "pv=[default]U1/LIC7/PV,op=[default]U1/LIC7/OP"
    known = ["--columns", columns, "--ts", "3", "--op-span", "0", "200", "--kind", "level"]
    assert typed([*words, *known, "--process", "integrating"]) == 0
    record = caught[0]
    assert (record.Ts, record.op_span, record.kind, record.process) == (
        3.0,
        (0.0, 200.0),
        "level",
        "integrating",
    )


READERS = [*VERBS]


@pytest.mark.parametrize("verb", READERS)
def test_every_file_reaches_every_verb_as_the_same_record(tmp_path, caught, verb):
    for name in list(layouts.READ)[READERS.index(verb) :: len(READERS)]:
        content, suffix, options, _ = layouts.READ[name]
        file = layouts.written(tmp_path, content, suffix)
        caught.clear()
        with contextlib.suppress(IndexError):
            assert typed(VERBS[verb].format(f=file).split() + as_typed(options)) == 0, name
        one = read_record(file, automatic=verb in ("diagnose", "confirm gain-change"), **options)
        got = caught[0].pv.tobytes(), caught[0].op.tobytes(), caught[0].Ts, caught[0].notes
        assert got == (one.pv.tobytes(), one.op.tobytes(), one.Ts, one.notes), name


def as_typed(options):
    """Return options of `read_record` as a command line has them."""
    words = []
    for key, value in options.items():
        text = ",".join(f"{r}={n}" for r, n in value.items()) if key == "columns" else str(value)
        words += [f"--{key.lower()}", text]
    return words


CURED = [name for name, (*_, cure) in layouts.REFUSED.items() if cure]


@pytest.mark.parametrize("name", CURED)
def test_what_a_verb_refuses_it_reads_when_its_command_is_typed(tmp_path, caught, capsys, name):
    content, options, *_ = layouts.REFUSED[name]
    file = layouts.written(tmp_path, content, "csv")
    line = [*VERBS.values()][CURED.index(name) % len(VERBS)]
    assert typed(line.format(f=file).split() + as_typed(options)) == 2
    _, *again = shlex.split(capsys.readouterr().err.strip().split("try: ")[1])
    assert typed(again) == 0
    assert caught[0].n > 100
