"""Hostile valves and effects: what one does is a sentence or a row with its name, and no other
record or verdict notices.
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from detectors.errors import ParameterError
from detectors.plugins import host
from simbench.cli import main
from simbench.loop import hosted as parts
from simbench.loop.effects import EFFECTS as VOCABULARY
from simbench.loop.effects import PLUGINS as EFFECTS
from simbench.loop.parameters import VALVES
from simbench.loop.valves import deadband
from tests.simbench.boundary.test_loops import put
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
# where it stands, what is done there, and a word of the sentence
VALVE = {
    "raises": (REST, 'raise ValueError("on purpose")', "on purpose"),
    "raises its own": (REST, "class E(BaseException): pass\n    raise E('mine')", "mine"),
    "exits": (REST, "sys.exit(0)", "SystemExit"),
    "exits hard": (REST, "os._exit(7)", "exit status 7"),
    "kills itself": (REST, "os.kill(os.getpid(), 9)", "signal 9"),
    "never ends": (REST, "while True: pass", "longer than"),
    "takes all memory": (REST, "x = [np.ones(10_000_000) for _ in range(1000)]", "memory"),
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
    "raises": (APPLY, 'raise ValueError("on purpose")', "on purpose"),
    "exits": (APPLY, "sys.exit(0)", "SystemExit"),
    "exits hard": (APPLY, "os._exit(7)", "exit status 7"),
    "never ends": (APPLY, "while True: pass", "longer than"),
    "takes all memory": (APPLY, "x = [np.ones(10_000_000) for _ in range(1000)]", "memory"),
    "no numbers": (APPLY, "setup.pv_add[:] = np.nan", "finite"),
    "signals of another length": (APPLY, "setup.sp = np.zeros(3)", "mine"),
    "a word as signal": (APPLY, "setup.Td = 'loud'", "mine"),
    "block unknown": ('BLOCK = "sensor"', 'BLOCK = "roof"', "roof"),
    "acts nowhere": ('ACTS = "loop"', "ACTS = 3", "ACTS"),
    "import raises": (HEAD, "1 / 0", "ZeroDivisionError"),
}


def hostile(tmp_path: Path, source: str, place: str, deed: str, name: str = "mine") -> Path:
    assert place in source
    file = tmp_path / f"{name}.py"
    whole = deed if place.split()[0] in deed else f"{deed}\n{place}"
    if place.startswith("    "):
        whole = f"    {deed}\n{place}"
    file.write_text(source.replace(place, whole, 1))
    return file


def loop_file(tmp_path: Path, valve: str = "deadband", effect: str = "noise") -> Path:
    text = loop().replace('model = "choudhury"', f'model = "{valve}"').replace("J = 2.0\n", "")
    return put(
        tmp_path,
        (
            text
            if effect == "noise"
            else text.replace('name = "noise"\nstd = 0.1', f'name = "{effect}"')
        ),
    )


@pytest.fixture(autouse=True)
def nothing_remains():
    before = VALVES.names(), EFFECTS.names()
    yield
    assert (VALVES.names(), EFFECTS.names()) == before
    assert not parts._hosts
    assert not VALVES._hosts
    assert not EFFECTS._hosts


@pytest.fixture
def short(monkeypatch, request):
    monkeypatch.setattr(host, "BYTES", 1 << 30)
    monkeypatch.setattr(host, "START", 60.0 if "never" not in request.node.callspec.id else 10.0)


@pytest.mark.parametrize("name", VALVE)
def test_a_hostile_valve_is_one_sentence_that_names_it(refused, tmp_path, short, name):
    place, deed, word = VALVE[name]
    file = hostile(tmp_path, PLAY, place, deed)
    limit = {"never ends": 3, "never steps": 20}.get(name, 60)
    refused(
        [
            "simulate",
            loop_file(tmp_path, "mine"),
            "-o",
            tmp_path / "r.csv",
            "--valve-plugin",
            file,
            "--time-limit",
            limit,
        ],
        "mine",
        word,
    )
    assert not (tmp_path / "r.csv").exists()


@pytest.mark.parametrize("name", EFFECT)
def test_a_hostile_effect_is_one_sentence_that_names_it(refused, tmp_path, short, name):
    place, deed, word = EFFECT[name]
    file, limit = hostile(tmp_path, HUM, place, deed), 3 if name == "never ends" else 60
    words = [
        "simulate",
        loop_file(tmp_path, effect="mine"),
        "-o",
        tmp_path / "r.csv",
        "--effect-plugin",
        file,
    ]
    refused([*words, "--time-limit", limit], "mine", word)
    assert not (tmp_path / "r.csv").exists()


@pytest.mark.parametrize("name", ["raises", "exits hard", "never ends", "steps to no number"])
def test_a_hostile_valve_refuses_a_column_in_one_sentence(refused, tmp_path, short, name):
    place, deed, word = VALVE[name]
    (tmp_path / "op.csv").write_text("op\n50\n52\n54\n56\n")
    file = hostile(tmp_path, PLAY, place, deed)
    limit = 3 if name == "never ends" else 60
    words = [
        "valve",
        tmp_path / "op.csv",
        "--model",
        "mine",
        "--param",
        "S=5",
        "-o",
        tmp_path / "mv.csv",
    ]
    refused([*words, "--valve-plugin", file, "--time-limit", limit], "mine", word)
    assert not (tmp_path / "mv.csv").exists()


@pytest.mark.parametrize(
    "deed",
    [
        "np.random.seed(1); np.pi = 3.0; os.nice(1); sys.setrecursionlimit(300)",
        "os.chdir('/'); os.environ.clear()",
        "print('noise'); os.write(1, b'noise'); os.write(2, b'noise')",
        "VALVES = None; import gc; gc.disable()",
    ],
)
def test_what_a_valve_changes_changes_nothing_outside_it(tmp_path, capfd, deed):
    import numpy as np

    here, words = os.getcwd(), dict(os.environ)
    file = hostile(tmp_path, PLAY, REST, deed)
    assert main(["simulate", str(loop_file(tmp_path)), "-o", str(tmp_path / "a.csv")]) == 0
    said = [
        "simulate",
        str(loop_file(tmp_path, "mine")),
        "-o",
        str(tmp_path / "b.csv"),
        "--valve-plugin",
        str(file),
    ]
    assert main(said) == 0
    assert (tmp_path / "a.csv").read_bytes() == (tmp_path / "b.csv").read_bytes()
    assert (os.getcwd(), dict(os.environ)) == (here, words)
    assert np.pi > 3.1
    assert "noise" not in "".join(capfd.readouterr())


@pytest.mark.parametrize(
    ("option", "name"),
    [
        ("--valve-plugin", "deadband"),
        ("--valve-plugin", "Mine"),
        ("--valve-plugin", "a b"),
        ("--valve-plugin", "absent"),
        ("--effect-plugin", "noise"),
        ("--effect-plugin", "none"),
        ("--effect-plugin", "unknown"),
        ("--effect-plugin", "my-file"),
    ],
)
def test_a_name_that_means_something_already_is_refused(refused, tmp_path, option, name):
    file = tmp_path / f"{name}.py"
    if name != "absent":
        file.write_text(PLAY if option == "--valve-plugin" else HUM)
    refused(["simulate", loop_file(tmp_path), "-o", tmp_path / "r.csv", option, file], f"{name}.py")
    assert not (tmp_path / "r.csv").exists()


def test_two_files_of_one_name_are_refused_and_nothing_is_known_afterwards(tmp_path):
    (tmp_path / "b").mkdir()
    first, second = (
        hostile(tmp_path, PLAY, HEAD, "pass"),
        hostile(tmp_path / "b", PLAY, HEAD, "pass"),
    )
    with pytest.raises(ParameterError, match="taken"), parts.hosted_parts([first, second]):
        pass


def test_a_valve_and_an_effect_of_a_loop_share_one_process_and_give_what_the_house_gives(tmp_path):
    valve, effect = (
        hostile(tmp_path, PLAY, HEAD, "pass"),
        hostile(tmp_path, HUM, HEAD, "pass", "hum"),
    )
    mine = loop_file(tmp_path, "mine", "hum")
    plugins = ["--valve-plugin", str(valve), "--effect-plugin", str(effect)]
    assert main(["simulate", str(mine), "-o", str(tmp_path / "own.csv"), *plugins]) == 0
    try:
        VALVES.add_file(valve), EFFECTS.add_file(effect)
        assert main(["simulate", str(mine), "-o", str(tmp_path / "here.csv")]) == 0
    finally:
        VALVES.forget("mine"), EFFECTS.forget("hum")
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "here.csv").read_bytes()


GRID = """
title = "strangers among the house's own"
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
MEMBER = '[[block.member]]\nname = "{0}"\nvalve = "{0}"\n'


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_a_run_keeps_every_row_of_the_house_and_names_the_offender(tmp_path, capsys, jobs):
    """The siblings of a hostile valve, from the same cell, have the bits they have without it; a
    fine one has its twin's.
    """
    deeds = {
        "loud": (REST, "raise ValueError('on purpose')"),
        "gone": (REST, "os._exit(3)"),
        "fine": (HEAD, "pass"),
    }
    deeds["vandal"] = (REST, "np.mean = np.std = None; os.environ.clear()")
    files = [hostile(tmp_path, PLAY, *deed, name) for name, deed in deeds.items()]
    for name, members in (
        ("without", ["deadband", "ideal"]),
        ("with", ["deadband", *deeds, "ideal"]),
    ):
        (tmp_path / f"{name}.toml").write_text(GRID + "".join(MEMBER.format(m) for m in members))
    words = ["--method", "horch,rossi_scali,oracle", "-j", jobs, "--json"]
    assert main(["run", str(tmp_path / "without.toml"), "-o", str(tmp_path / "a"), *words]) == 0
    capsys.readouterr()
    plugins = [w for f in files for w in ("--valve-plugin", str(f))]
    assert (
        main(["run", str(tmp_path / "with.toml"), "-o", str(tmp_path / "b"), *words, *plugins]) == 1
    )
    failed = json.loads(capsys.readouterr().out)["failed"]
    assert failed["scenarios"] >= 2
    assert any(
        "valve plug-in 'loud': ValueError: on purpose" in reason for reason in failed["reasons"]
    )
    assert any(
        "valve plug-in 'gone': ended its process (exit status 3)" in reason
        for reason in failed["reasons"]
    )

    found = {}
    for run in ("a", "b"):
        rows = pd.read_parquet(tmp_path / run / "scenarios.parquet").set_index("scenario_id")
        said = pd.read_parquet(tmp_path / run / "verdicts.parquet").drop(columns="runtime_s")
        said["member"] = said.scenario_id.map(rows.member)
        found[run] = (
            rows.set_index("member"),
            said.set_index(["member", "method"]).drop(columns="scenario_id"),
        )
    for part in ("deadband", "ideal"):
        assert found["a"][0].record_hash[part] == found["b"][0].record_hash[part]
        pd.testing.assert_frame_equal(
            found["a"][1].loc[part], found["b"][1].loc[part], check_exact=True
        )
    same = ["record_hash", "cycled", "cycle_period", "predicted", "theory_period", "sticky"]
    assert found["b"][0].loc["fine", same].equals(found["b"][0].loc["deadband", same])
    pd.testing.assert_frame_equal(
        found["b"][1].loc["fine"], found["b"][1].loc["deadband"], check_exact=True
    )


def test_a_scenario_of_a_run_is_repeated_with_its_valve(tmp_path, capsys):
    file = hostile(tmp_path, PLAY, HEAD, "pass")
    (tmp_path / "g.toml").write_text(GRID + MEMBER.format("mine"))
    plugin = ["--valve-plugin", str(file)]
    assert (
        main(
            [
                "run",
                str(tmp_path / "g.toml"),
                "-o",
                str(tmp_path / "run"),
                "--method",
                "horch",
                *plugin,
            ]
        )
        == 0
    )
    ident = pd.read_parquet(tmp_path / "run" / "scenarios.parquet").scenario_id[0]
    assert main(["score", str(tmp_path / "run"), "--report", str(tmp_path / "one.html")]) == 0
    words = [
        "simulate",
        "--from",
        str(tmp_path / "run"),
        "--id",
        ident,
        "-o",
        str(tmp_path / "r.csv"),
    ]
    assert main([*words, *plugin]) == 0
    capsys.readouterr()
    assert main(words) == 2
    assert "'mine'" in capsys.readouterr().err


def test_a_run_in_which_nothing_can_be_simulated_says_so(tmp_path, capsys):
    file = hostile(tmp_path, PLAY, *VALVE["raises"][:2])
    (tmp_path / "g.toml").write_text(GRID + MEMBER.format("mine"))
    words = [
        "run",
        str(tmp_path / "g.toml"),
        "-o",
        str(tmp_path / "run"),
        "--method",
        "horch,oracle",
    ]
    assert main([*words, "--valve-plugin", str(file)]) == 1
    assert "valve plug-in 'mine': ValueError: on purpose" in capsys.readouterr().err
    assert (
        main(
            [
                "score",
                "--allow-failed",
                "1",
                str(tmp_path / "run"),
                "--report",
                str(tmp_path / "none.html"),
            ]
        )
        == 0
    )


def test_the_process_of_a_part_ends_with_the_question(tmp_path):
    file = hostile(
        tmp_path, PLAY, REST, f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid()))"
    )
    assert (
        main(
            [
                "simulate",
                str(loop_file(tmp_path, "mine")),
                "-o",
                str(tmp_path / "r.csv"),
                "--valve-plugin",
                str(file),
            ]
        )
        == 0
    )
    child, until = int((tmp_path / "pid").read_text()), time.monotonic() + 10.0
    while Path(f"/proc/{child}").exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert not Path(f"/proc/{child}").exists()


@pytest.fixture
def published(tmp_path, monkeypatch):
    """Publish valves and effects as another distribution does, for every process."""

    def publish(**what: tuple[str, str]) -> None:
        about = tmp_path / "strangers-1.0.dist-info"
        about.mkdir()
        (about / "METADATA").write_text("Metadata-Version: 2.1\nName: strangers\nVersion: 1.0\n")
        groups = {
            g: [n for n, (s, _) in what.items() if s is source]
            for g, source in (("valves", PLAY), ("effects", HUM))
        }
        text = "".join(
            f"[simbench.{g}]\n" + "".join(f"{n} = theirs.{n}\n" for n in names)
            for g, names in groups.items()
        )
        (about / "entry_points.txt").write_text(text)
        (tmp_path / "theirs").mkdir()
        for name, (source, (place, deed)) in what.items():
            hostile(tmp_path / "theirs", source, place, deed, name)
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.setenv("PYTHONPATH", str(tmp_path))
        forget()

    def forget() -> None:
        for folder in (VALVES, EFFECTS):
            folder.__dict__.pop("_entry_points", None)
        VOCABULARY.__dict__.pop("_all", None)

    yield publish
    monkeypatch.undo()
    forget()


def test_installed_parts_live_in_processes_of_their_own_too(published, tmp_path, refused, capsys):
    published(
        mine=(PLAY, (HEAD, "pass")), gone=(PLAY, (REST, "os._exit(3)")), hum=(HUM, (HEAD, "pass")),
        loud=(HUM, (APPLY, "sys.exit(3)")),
    )  # fmt: skip
    out = tmp_path / "r.csv"
    assert main(["simulate", str(loop_file(tmp_path, "mine", "hum")), "-o", str(out)]) == 0
    assert not [m for m in sys.modules if m.startswith("theirs")]
    assert (
        main(["simulate", str(loop_file(tmp_path, "deadband")), "-o", str(tmp_path / "house.csv")])
        == 0
    )
    out.unlink(), capsys.readouterr()
    refused(
        ["simulate", loop_file(tmp_path, "gone"), "-o", out],
        "valve plug-in 'gone'",
        "exit status 3",
    )
    refused(
        ["simulate", loop_file(tmp_path, effect="loud"), "-o", out],
        "effect plug-in 'loud'",
        "SystemExit",
    )
    assert not out.exists()


def test_a_run_names_the_installed_valve_that_fails_and_keeps_the_rest(published, tmp_path, capsys):
    published(fine=(PLAY, (HEAD, "pass")), gone=(PLAY, (REST, "os._exit(3)")))
    (tmp_path / "g.toml").write_text(
        GRID + "".join(MEMBER.format(m) for m in ("deadband", "fine", "gone"))
    )
    words = [
        "run",
        str(tmp_path / "g.toml"),
        "-o",
        str(tmp_path / "run"),
        "--method",
        "horch,oracle",
        "-j",
        "2",
        "--json",
    ]
    assert main(words) == 1
    reasons = json.loads(capsys.readouterr().out)["failed"]["reasons"]
    assert any(
        "valve plug-in 'gone': ended its process (exit status 3)" in reason for reason in reasons
    )
    rows = pd.read_parquet(tmp_path / "run" / "scenarios.parquet").set_index("member")
    assert rows.record_hash["fine"] == rows.record_hash["deadband"]


@pytest.mark.parametrize("verb", ["simulate", "list"])
def test_an_installed_part_that_cannot_be_imported_is_named_with_its_distribution(
    published, tmp_path, refused, verb
):
    published(broken=(HUM, (HEAD, "raise OSError('no licence')")))
    loop = loop_file(tmp_path, effect="broken")
    words = (
        ["simulate", loop, "-o", tmp_path / "r.csv"] if verb == "simulate" else ["list", "effects"]
    )
    refused(words, "broken", "strangers", "no licence")
