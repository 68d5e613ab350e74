"""Hostile valves and effects: what one does is a sentence or a row with its name, and no other
record or verdict notices.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from simbench.detectors.errors import ParameterError
from simbench.detectors.plugins import host
from simbench.loop import hosted as parts
from simbench.loop.effects import EFFECTS as VOCABULARY
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import VALVES
from simbench.loop.valves import deadband
from tests.simbench.boundary.conftest import answer_to, refused, run_verb, sampled
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
REST, STEP, BAND = (
    "    return (min(max(u0, 0.0), 100.0),)",
    "    x = min(max(u, 0.0), 100.0)",
    "    return p.S, 0.0",
)
HEAD, APPLY = "SOURCE = ", "    setup.pv_add += "
FINE = (HEAD, "pass")
MEMORY = "x = [np.ones(10_000_000) for _ in range(1000)]"
# the line before which something is done, or which is replaced; what; a word of the sentence
VALVE = {
    "raises": (REST, 'raise ValueError("on purpose")', "on purpose"),
    "raises a class": (REST, "class E(BaseException): pass\n    raise E('mine')", "mine"),
    "exits": (REST, "sys.exit(0)", "SystemExit"),
    "exits hard": (REST, "os._exit(7)", "exit status 7"),
    "kills itself": (REST, "os.kill(os.getpid(), 9)", "signal 9"),
    "never ends": (REST, "while True: pass", "longer than"),
    "takes all memory": (REST, MEMORY, "memory"),
    "starts with a word": (REST, 'return ("closed",)', "float"),
    "starts nowhere": (REST, "return 3", "int"),
    "numpy without arrays": (REST, "np.empty = 3", "not callable"),
    "steps to no number": (STEP, "return (u * np.nan,)", "mine"),
    "never steps": (STEP, "while u > -1.0:\n        u = u * 1.0", "longer than"),
    "two states of one": (STEP, "return (u, u)", "mine"),
    "steps to nowhere": (STEP, "return None", "mine"),
    "band raises": (BAND, "raise OSError('no band')", "no band"),
    "band is a word": (BAND, "return 'wide'", "mine"),
    "import exits": (HEAD, "sys.exit(3)", "SystemExit"),
    "import never ends": (HEAD, "time.sleep(1000)", "longer than"),
    "import ends its process": (HEAD, "os._exit(0)", "exit status 0"),
    "no python": (HEAD, "def (", "SyntaxError"),
    "lacks a step": ("def step(", "def stepp(", "step"),
    "no parameters": ("PARAMETERS = {", "PARAMETERS = 3\nX = {", "PARAMETERS"),
    "a word as parameter": ("PARAMETERS = {", 'PARAMETERS = {"k": "many"}\nX = {', "PARAMETERS"),
    "friction is a word": ("FRICTION = True", 'FRICTION = "yes"', "FRICTION"),
}
EFFECT = {
    "raises": (APPLY, *VALVE["raises"][1:]),
    "exits": (APPLY, *VALVE["exits"][1:]),
    "exits hard": (APPLY, *VALVE["exits hard"][1:]),
    "never ends": (APPLY, *VALVE["never ends"][1:]),
    "takes all memory": (APPLY, MEMORY, "memory"),
    "no numbers": (APPLY, "setup.pv_add[:] = np.nan", "finite"),
    "signals of another length": (APPLY, "setup.sp = np.zeros(3)", "mine"),
    "a word as signal": (APPLY, "setup.Td = 'loud'", "mine"),
    "block unknown": ('BLOCK = "sensor"', 'BLOCK = "roof"', "roof"),
    "acts nowhere": ('ACTS = "loop"', "ACTS = 3", "ACTS"),
    "import raises": (HEAD, "1 / 0", "ZeroDivisionError"),
}
SIMULATE = "simulate loop.toml -o r.csv --valve-plugin mine.py"
COLUMN = "valve op.csv --model mine --param S=5 -o mv.csv --valve-plugin mine.py"
EFFECTIVE = "simulate loop.toml -o r.csv --effect-plugin mine.py"
ALWAYS = [
    (SIMULATE, "exits hard"),
    (SIMULATE, "lacks a step"),
    (COLUMN, "raises"),
    (COLUMN, "never ends"),
    (EFFECTIVE, "raises"),
    (EFFECTIVE, "block unknown"),
]
CASES = [(SIMULATE, name) for name in VALVE] + [(EFFECTIVE, name) for name in EFFECT]
CASES += [(COLUMN, name) for name in ("raises", "exits hard", "never ends", "steps to no number")]


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
    assert not parts._hosts
    assert not VALVES._hosts
    assert not EFFECTS._hosts


@pytest.mark.parametrize(("words", "name"), sampled(CASES, 0, ALWAYS))
def test_a_hostile_part_is_refused_in_one_sentence_that_names_it(here, monkeypatch, words, name):
    monkeypatch.setattr(host, "BYTES", 1 << 30)
    monkeypatch.setattr(host, "START", 10.0 if "never" in name else 60.0)
    source, cases = (HUM, EFFECT) if words == EFFECTIVE else (PLAY, VALVE)
    place, deed, part = cases[name]
    hostile(here, source, place, deed)
    (here / "op.csv").write_text("op\n50\n52\n54\n56\n")
    loop_file(**{"effect" if words == EFFECTIVE else "valve": "mine"})
    limit = {"never ends": 1, "never steps": 20}.get(name, 60)
    refused(f"{words} --time-limit {limit}", "mine", part)
    assert not [*here.glob("r.csv"), *here.glob("mv.csv")]


def test_what_a_valve_changes_changes_nothing_outside_it(here, capfd):
    environment = dict(os.environ)
    hostile(
        here,
        PLAY,
        REST,
        "np.random.seed(1); np.pi = 3.0; os.nice(1); sys.setrecursionlimit(300);"
        " os.chdir('/'); os.environ.clear(); VALVES = None; import gc; gc.disable();"
        " print('noise'); os.write(1, b'noise'); os.write(2, b'noise')",
    )
    loop_file()
    answer_to("simulate loop.toml -o a.csv")
    loop_file("mine")
    answer_to("simulate loop.toml -o b.csv --valve-plugin mine.py")
    assert (here / "a.csv").read_bytes() == (here / "b.csv").read_bytes()
    assert (os.getcwd(), dict(os.environ)) == (str(here), environment)
    assert np.pi > 3.1
    assert "noise" not in "".join(capfd.readouterr())


@pytest.mark.parametrize(
    ("option", "source", "names"),
    [
        ("--valve-plugin", PLAY, ("deadband", "Mine", "a b", "absent")),
        ("--effect-plugin", HUM, ("noise", "none", "unknown", "my-file")),
    ],
)
def test_a_name_that_means_something_already_is_refused(here, option, source, names):
    loop_file()
    for name in names:
        file = here / f"{name}.py"
        if name != "absent":
            file.write_text(source)
        refused(["simulate", "loop.toml", "-o", "r.csv", option, file], file.name)
    assert not (here / "r.csv").exists()


def test_two_files_of_one_name_are_refused_and_nothing_is_known_afterwards(here):
    (here / "b").mkdir()
    files = [hostile(folder, PLAY, *FINE) for folder in (here, here / "b")]
    with pytest.raises(ParameterError, match="taken"), parts.hosted_parts(files):
        pass


def test_a_valve_and_an_effect_of_a_loop_share_one_process_and_give_what_the_built_in_ones_give(
    here,
):
    """The process ends with the command."""
    number = f"open({str(here / 'pid')!r}, 'a').write(str(os.getpid()) + ' ')"
    valve = hostile(here, PLAY, REST, number)
    effect = hostile(here, HUM, APPLY, number, "hum")
    loop_file("mine", "hum")
    plugins = "--valve-plugin mine.py --effect-plugin hum.py"
    answer_to(f"simulate loop.toml -o apart.csv {plugins}")
    [process], until = set((here / "pid").read_text().split()), time.monotonic() + 10.0
    while Path(f"/proc/{process}").exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert not Path(f"/proc/{process}").exists()
    for file, source in ((valve, PLAY), (effect, HUM)):
        file.write_text(source)
    try:
        VALVES.add_file(valve), EFFECTS.add_file(effect)
        answer_to("simulate loop.toml -o here.csv")
    finally:
        VALVES.forget("mine"), EFFECTS.forget("hum")
    assert (here / "apart.csv").read_bytes() == (here / "here.csv").read_bytes()


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


def grid_file(name: str, *members: str) -> None:
    """Write a grid with one scenario for each valve."""
    tables = (f'[[block.member]]\nname = "{m}"\nvalve = "{m}"\n' for m in members)
    Path(name).write_text(GRID + "".join(tables))


LOUD, GONE = (REST, "raise ValueError('on purpose')"), (REST, "os._exit(3)")
VANDAL = (REST, "np.mean = np.std = None; os.environ.clear()")


@pytest.mark.parametrize(
    ("jobs", "deeds"),
    [
        (1, {"loud": LOUD, "vandal": VANDAL}),
        pytest.param(
            2,
            {"loud": LOUD, "gone": GONE, "fine": FINE, "vandal": VANDAL},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_run_keeps_every_row_of_the_built_in_valves_and_names_the_offender(here, jobs, deeds):
    """The siblings of a hostile valve, from the same cell, have the bits they have without it; a
    fine one has its twin's.
    """
    files = [hostile(here, PLAY, *deed, name) for name, deed in deeds.items()]
    grid_file("without.toml", "deadband", "ideal")
    grid_file("with.toml", "deadband", *deeds, "ideal")
    # however busy the machine is
    options = f"--method horch,rossi_scali,oracle -j {jobs} --time-limit 600 --json "
    answer_to(f"run without.toml -o a {options}")
    plugins = " ".join(f"--valve-plugin {file.name}" for file in files)
    failed = json.loads(answer_to(f"run with.toml -o b {options}{plugins}", 1))["failed"]
    reasons = " ".join(failed["reasons"])
    assert "valve plug-in 'loud': ValueError: on purpose" in reasons
    assert "gone" not in deeds or "'gone': ended its process (exit status 3)" in reasons
    rows, verdicts = {}, {}
    for run in ("a", "b"):
        table = pd.read_parquet(here / run / "scenarios.parquet").set_index("scenario_id")
        answers = pd.read_parquet(here / run / "verdicts.parquet").drop(columns="runtime_s")
        answers["member"] = answers.scenario_id.map(table.member)
        rows[run] = table.set_index("member")
        verdicts[run] = answers.set_index(["member", "method"]).drop(columns="scenario_id")
    for member in ("deadband", "ideal"):
        assert rows["a"].record_hash[member] == rows["b"].record_hash[member]
        pd.testing.assert_frame_equal(
            verdicts["a"].loc[member], verdicts["b"].loc[member], check_exact=True
        )
    if "fine" in deeds:
        same = ["record_hash", "cycled", "cycle_period", "predicted", "theory_period", "sticky"]
        assert rows["b"].loc["fine", same].equals(rows["b"].loc["deadband", same])
        pd.testing.assert_frame_equal(
            verdicts["b"].loc["fine"], verdicts["b"].loc["deadband"], check_exact=True
        )


@pytest.mark.slow
def test_a_scenario_of_a_run_is_repeated_with_its_valve(here):
    hostile(here, PLAY, *FINE)
    grid_file("g.toml", "mine")
    answer_to("run g.toml -o run --method horch --valve-plugin mine.py")
    scenario = pd.read_parquet(here / "run" / "scenarios.parquet").scenario_id[0]
    answer_to("score run --report one.html")
    words = f"simulate --from run --id {scenario} -o r.csv"
    answer_to(f"{words} --valve-plugin mine.py")
    refused(words, "'mine'")


@pytest.mark.slow
def test_a_run_in_which_nothing_can_be_simulated_says_so(here):
    hostile(here, PLAY, *LOUD)
    grid_file("g.toml", "mine")
    code, _, message = run_verb("run g.toml -o run --method oracle --valve-plugin mine.py")
    assert code == 1
    assert "valve plug-in 'mine': ValueError: on purpose" in message
    answer_to("score --allow-failed 1 run --report none.html")


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
            folder.__dict__.pop("_entry_points", None)
        VOCABULARY.__dict__.pop("_all", None)

    yield publish
    monkeypatch.undo()
    forget()


def test_installed_parts_run_in_processes_of_their_own_too(published, here):
    published(gone=(PLAY, GONE), loud=(HUM, (APPLY, "sys.exit(3)")))
    loop_file("gone")
    refused("simulate loop.toml -o r.csv", "valve plug-in 'gone'", "exit status 3")
    loop_file(effect="loud")
    refused("simulate loop.toml -o r.csv", "effect plug-in 'loud'", "SystemExit")
    assert not [module for module in sys.modules if module.startswith("theirs")]


@pytest.mark.slow
def test_a_run_names_the_installed_valve_that_fails_and_keeps_the_rest(published, here):
    published(fine=(PLAY, FINE), gone=(PLAY, GONE), hum=(HUM, FINE))
    loop_file("fine", "hum")
    answer_to("simulate loop.toml -o r.csv")
    grid_file("g.toml", "deadband", "fine", "gone")
    failed = json.loads(answer_to("run g.toml -o run --method oracle -j 2 --json", 1))["failed"]
    assert "valve plug-in 'gone': ended its process (exit status 3)" in str(failed["reasons"])
    rows = pd.read_parquet(here / "run" / "scenarios.parquet").set_index("member")
    assert rows.record_hash["fine"] == rows.record_hash["deadband"]


def test_an_installed_part_that_cannot_be_imported_is_named_with_its_distribution(published, here):
    published(broken=(HUM, (HEAD, "raise OSError('no licence')")))
    loop_file(effect="broken")
    for words in ("simulate loop.toml -o r.csv", "list effects"):
        refused(words, "broken", "strangers", "no licence")
