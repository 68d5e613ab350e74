"""Valves and effects of files that are wrong: what one does is a sentence or a row of the run."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from simbench.loop.effects import EFFECTS as VOCABULARY
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import VALVES
from simbench.loop.valves import deadband
from tests.simbench.boundary.conftest import answer_to, refused
from tests.simbench.boundary.test_loops import text as loop

IMPORTS = "import os, sys, time\nimport numpy as np\nfrom simbench.loop"
PLAY = Path(deadband.__file__).read_text().replace("from simbench.loop", IMPORTS)
HUM = '''"""Hum: a sine on what is measured."""
import os, sys, time
import numpy as np
from simbench.loop.parameters import Number
SOURCE = "a test"
BLOCK = "sensor"
PARAMETERS = {"size": Number("PV units", low=0.0, default=0.0, says="amplitude")}
ACTS = "loop"


def apply(setup, p, rng):
    setup.pv_add += p.size * np.sin(np.arange(setup.pv_add.size))
'''
REST, STEP = "    return (min(max(u0, 0.0), 100.0),)", "    return (play(u, state[0], p.S),)"
HEAD, APPLY = "SOURCE = ", "    setup.pv_add += "
FINE = (HEAD, "pass")
# the line before which something is done, or which is replaced; what; a word of the sentence
VALVE = {
    "raises": (REST, 'raise ValueError("on purpose")', "on purpose"),
    "exits": (REST, "sys.exit(0)", "mine"),
    "steps to no number": (STEP, "return (u * np.nan,)", "finite"),
    "starts nowhere": (REST, "return 3", "mine"),
    "import exits": (HEAD, "sys.exit(3)", "SystemExit"),
    "no python": (HEAD, "def (", "SyntaxError"),
    "lacks a step": ("def step(", "def stepp(", "step"),
    "no parameters": ("PARAMETERS = {", "PARAMETERS = 3\nX = {", "PARAMETERS"),
    "a word as parameter": ("PARAMETERS = {", 'PARAMETERS = {"k": "many"}\nX = {', "PARAMETERS"),
    "friction is a word": ("FRICTION = True", 'FRICTION = "yes"', "FRICTION"),
}
EFFECT = {
    "raises": (APPLY, *VALVE["raises"][1:]),
    "exits": (APPLY, "sys.exit(0)", "SystemExit"),
    "no numbers": (APPLY, "setup.pv_add[:] = np.nan", "finite"),
    "signals of another length": (APPLY, "setup.sp = np.zeros(3)", "mine"),
    "block unknown": ('BLOCK = "sensor"', 'BLOCK = "roof"', "roof"),
    "acts nowhere": ('ACTS = "loop"', "ACTS = 3", "ACTS"),
    "import raises": (HEAD, "1 / 0", "ZeroDivisionError"),
}
SIMULATE = "simulate loop.toml -o r.csv --valve-plugin mine.py"
COLUMN = "valve op.csv --model mine --param S=5 -o mv.csv --valve-plugin mine.py"
EFFECTIVE = "simulate loop.toml -o r.csv --effect-plugin mine.py"
CASES = [(SIMULATE, name) for name in VALVE] + [(EFFECTIVE, name) for name in EFFECT]
CASES += [(COLUMN, "raises")]


def hostile(folder: Path, source: str, place: str, deed: str, name: str = "mine") -> Path:
    """Write a plug-in of which one line is replaced, or preceded by something hostile."""
    assert place in source
    file = folder / f"{name}.py"
    whole = deed if place.split()[0] in deed else f"{deed}\n{place}"
    file.write_text(
        source.replace(place, f"    {deed}\n{place}" if place.startswith("    ") else whole, 1)
    )
    return file


def loop_file(valve: str = "deadband", effect: str = "noise") -> None:
    """Write loop.toml with a valve and an effect."""
    text = loop().replace('model = "choudhury"', f'model = "{valve}"').replace("J = 2.0\n", "")
    if effect != "noise":
        text = text.replace('name = "noise"\nstd = 0.1', f'name = "{effect}"')
    Path("loop.toml").write_text(text)


@pytest.fixture(autouse=True)
def nothing_remains(here):
    before = VALVES.names(), EFFECTS.names()
    yield
    assert (VALVES.names(), EFFECTS.names()) == before


@pytest.mark.parametrize(("words", "name"), CASES)
def test_a_wrong_part_is_refused_in_one_sentence_that_names_it(here, words, name):
    source, cases = (HUM, EFFECT) if words == EFFECTIVE else (PLAY, VALVE)
    place, deed, part = cases[name]
    hostile(here, source, place, deed)
    (here / "op.csv").write_text("op\n50\n52\n54\n56\n")
    loop_file(**{"effect" if words == EFFECTIVE else "valve": "mine"})
    refused(words, "mine", part)
    assert not [*here.glob("r.csv"), *here.glob("mv.csv")]


def test_a_part_of_a_file_gives_what_the_built_in_one_gives(here):
    hostile(here, PLAY, *FINE)
    for name, plugins in (("deadband", ""), ("mine", "--valve-plugin mine.py")):
        loop_file(name)
        answer_to(f"simulate loop.toml -o {name}.csv {plugins}")
    assert (here / "deadband.csv").read_bytes() == (here / "mine.csv").read_bytes()


GRID = """
title = "plug-ins among built-in valves"
source = "own"
seed = 1
repeats = 1
[draw]
K = 1.0
T = 10.0
S = 5.0
step = 1.0
samples_per_period = 20.0
periods = 18.0
[[block]]
name = "one"
process = "foptd"
controller = "PI"
[block.axes]
Td_over_T = [0.3]
S_over_2J = [inf]
noise_ratio = [0.1]
disturbance = ["none"]
"""


# fails in one of two loops of a grid, and not in the cell that is tried before the run
LATE = (STEP, "if p.S > 6.0:\n        raise ValueError('on purpose')")


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_loop_that_a_part_fails_in_is_a_row_and_the_others_are_as_without_it(here, jobs):
    hostile(here, PLAY, *LATE)
    for name, valve in (("a", "deadband"), ("b", "mine")):
        text = GRID.replace("S = 5.0\n", "").replace("[block.axes]", "[block.axes]\nS = [4.0, 8.0]")
        member = f'[[block.member]]\nname = "one"\nvalve = "{valve}"\n'
        Path(f"{name}.toml").write_text(text + member)
    options = f"--method horch,oracle -j {jobs} --json"
    answer_to(f"run a.toml -o a {options}")
    plugin = "--valve-plugin mine.py"
    failed = json.loads(answer_to(f"run b.toml -o b {options} {plugin}", 1))["failed"]
    assert "ValueError: on purpose" in " ".join(failed["reasons"])
    one, two = (pd.read_parquet(here / run / "scenarios.parquet") for run in ("a", "b"))
    assert two.error.notna().tolist() == [False, True]
    same = ["record_hash", "cycled", "cycle_period", "predicted", "theory_period", "sticky"]
    pd.testing.assert_series_equal(one.loc[0, same], two.loc[0, same])
    scenario = two.scenario_id[0]
    words = f"simulate --from b --id {scenario} -o r.csv"
    answer_to(f"{words} {plugin}")
    refused(words, "'mine'")


@pytest.fixture
def published(here, monkeypatch):
    """Publish valves and effects as another distribution does, for every process."""

    def publish(**plugins: tuple[str, tuple[str, str]]) -> None:
        about = here / "strangers-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers\nVersion: 1.0\n")
        entries = {"valves": "", "effects": ""}
        (here / "theirs").mkdir()
        for name, (source, deed) in plugins.items():
            entries["valves" if source is PLAY else "effects"] += f"{name} = theirs.{name}\n"
            hostile(here / "theirs", source, *deed, name)
        (about / "entry_points.txt").write_text(
            "".join(f"[simbench.{group}]\n{names}" for group, names in entries.items())
        )
        monkeypatch.syspath_prepend(here)
        monkeypatch.setenv("PYTHONPATH", str(here))
        forget()

    def forget() -> None:
        for folder in (VALVES, EFFECTS):
            for name in folder.outside():
                folder.forget(name)
            folder.__dict__.pop("_entry_points", None)
        VOCABULARY.__dict__.pop("_describe_all", None)

    yield publish
    monkeypatch.undo()
    forget()


def test_installed_parts_are_known_and_named_when_they_fail(published, here):
    published(fine=(PLAY, FINE), loud=(HUM, (APPLY, "sys.exit(3)")))
    loop_file("fine")
    answer_to("simulate loop.toml -o r.csv")
    loop_file(effect="loud")
    refused("simulate loop.toml -o r2.csv", "effect 'loud'", "SystemExit")


def test_an_installed_part_that_cannot_be_imported_is_named_with_its_distribution(published, here):
    published(broken=(HUM, (HEAD, "raise OSError('no licence')")))
    loop_file(effect="broken")
    for words in ("simulate loop.toml -o r.csv", "list effects"):
        refused(words, "broken", "strangers", "no licence")
