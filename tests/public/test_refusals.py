"""What is refused: a command or a loop with one thing wrong, and what its one sentence must quote.

A refusal that keeps data from harm is a test of the room that holds the data; one that is a
sentence and no more is a line here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import control
import numpy as np
import pytest
import typer

import simbench as sb
from simbench.cli import app
from simbench.confirm.travel import travel_test
from simbench.detectors.errors import UserError
from simbench.detectors.judge import judge
from simbench.detectors.record import LoopRecord
from simbench.detectors.signal.stiction_map import valve_position
from simbench.gap.benchmark.measure import grid
from simbench.gap.gain_pair import gain_change_recorded
from simbench.loop.response import valve_response
from simbench.loop.simulate import simulate
from simbench.scenarios.errors import SpecError
from simbench.scenarios.grid import load_grid
from simbench.scenarios.sample import Sample
from simbench.scenarios.spec import Loop
from simbench.theory.describing import deadzone, stiction
from simbench.theory.tables import truth_columns
from tests.simbench.boundary.conftest import here, refused, sampled
from tests.simbench.boundary.test_loops import text

__all__ = ["here"]  # a fixture

RECORD = "t,sp,op,pv\n" + "".join(f"{k},50,{50 + k % 7},{50 + k % 5}\n" for k in range(300))
# commands that are right but for the verb's name; words in capitals are replaced by files
RIGHT = [
    "simulate LOOP -o OUT",
    "valve REC --model ideal -o OUT",
    "predict LOOP",
    "detect REC --method METHOD --csv OUT",
    "diagnose REC --picture PIC",
    "run GRID -o NEW --method METHOD -j 1",
    "score RUN --report OUT",
    "check RUN --against DIR --markdown OUT",
    "figure FIGURE -o NEW",
    "contract PLUGIN",
    "list KIND",
    "simulate smoke -o NEW",
    "run RUN --answers LABELS",
    "run RUN --add",
    "confirm gain-change LOOP --picture PIC",
    "confirm travel LOOP --picture PIC",
    "gap diagnose REC --baseline LOOP --html OUT -j 1",
    "gap grid GRID RECS --picture PIC",
    "simulate LOOP --seeds 2 --set controller.Kc=1",
]
# what stands for a word where another is wrong, and wrong words with what the sentence then holds
WORDS = {"GRID": "smoke", "METHOD": "horch", "FIGURE": "fig-11-4", "KIND": "detectors"}
WORDS |= {"NEW": "OUT", "PIC": "OUT.svg", "RUN": "DIR", "PLUGIN": "mine.py"}
SPOILT = {
    "LOOP": {"none.toml": "none.toml", "REC": "rec.csv", "DIR": "DIR"},
    "REC": {"none.csv": "none.csv", "LOOP": "loop.toml"},
    "RECS": {"none": "none", "LOOP": "loop.toml", "DIR": "DIR"},
    "RUN": {"none": "none", "REC": "rec.csv", "LOOP": "loop.toml", "DIR": "DIR", "RECS": "records"},
    "GRID": {"smok": "smoke", "none.toml": "none.toml", "LOOP": "loop"},
    "OUT": {"DIR": "DIR", "/proc/nothing/x": "/proc"},
    "NEW": {"REC": "rec.csv", "/proc/nothing": "/proc"},
    "METHOD": {"horhc": "horch", "": ""},
    "PIC": {"x.gif": ".svg"},
    "FIGURE": {"fig-11-99": "fig-11-9"},
    "KIND": {"detectrs": "detectors"},
    "PLUGIN": {"none.py": "none.py", "REC": "rec.csv", "DIR": "DIR", "OUT": "out"},
    "-j": {"-j 0": "-j", "-j x": "-j"},
}


def spoilt(line: str) -> Iterator[tuple[str, str]]:
    """Yield a right command with one thing wrong, and what the sentence about it holds."""
    words = line.split()
    for i, word in enumerate(words):
        for wrong, part in SPOILT.get(word, {}).items():
            rest = words[i + 2 :] if word == "-j" else words[i + 1 :]
            whole = [*words[:i], wrong, *rest]
            yield " ".join(WORDS.get(w, w) for w in whole if w), part
    right = " ".join(WORDS.get(word, word) for word in words)
    yield f"{right} --colour", "--colour"
    yield f"{right} surplus", "surplus"


# refusals that no other test reaches
IN_EVERY_RUN = [
    ("valve LABELS --model ideal -o OUT", "op"),
    ("valve HOT --model ideal -o OUT", "line 3: op is 'hot'"),
    ("valve BARE --model ideal -o OUT", "line 3: op is empty"),
    ("valve UNEVEN --model ideal -o OUT", "line 5: a time step of 3 s among steps of 1 s"),
    ("score DIR --truth cycle", "cycled"),
    ("run smoke -o OUT --backend dask", "--address"),
    ("figure fig-11-12 -o OUT", "--isdb"),
    ("figure fig-11-8 -o NEW --set Q=1", "Q"),
    ("figure fig-11-8 -o NEW --set S=-1", "above 0"),
    ("simulate LOOP -o OUT --kick 1e300", "kick"),
    ("gap diagnose REC", "--baseline"),
    ("confirm travel LOOP --record REC", "either"),
    ("simulate --from DIR -o OUT", "--id"),
    ("detect REC --columns op", "ROLE=NAME"),
    ("confirm gain-change --records REC REC", "--ratio"),
    ("gap grid smoke RECS --n 3", "at least 10"),
]
WRONG_COMMANDS = [
    *(each for line in RIGHT for each in spoilt(line)),
    ("simulte LOOP", "simulate"),
    ("simulate", "loop file"),
    ("simulate LOOP", "-o"),
    ("simulate LOOP -o OUT --seed -1", "seed"),
    ("simulate LOOP -o OUT --seed x", "seed"),
    ("simulate LOOP -o", "-o"),
    ("simulate LOOP -o LOOP", "written over"),
    ("simulate LOOP -o OUT --kick many", "kick"),
    ("simulate LOOP -o OUT --kick nan", "kick"),
    ("simulate --from DIR --id x -o OUT", "run"),
    ("valve REC -o OUT", "model"),
    ("valve REC --model deadband -o OUT", "S"),
    ("valve REC --model dedband -o OUT", "deadband"),
    ("valve REC --model deadband --param S=x -o OUT", "S"),
    ("valve REC --model deadband --param S=nan -o OUT", "S"),
    ("valve REC --model deadband --param S=-1 -o OUT", "S"),
    ("valve REC --model deadband --param S -o OUT", "NAME=VALUE"),
    ("valve REC --model deadband --param R=1 -o OUT", "R"),
    ("valve REC --model deadband --param S=2 -o REC", "written over"),
    ("detect REC --process gas", "process"),
    ("detect REC --kind smell", "kind"),
    ("detect REC --op-span 1", "op-span"),
    ("detect REC --op-span 1 1", "op_span"),
    ("detect REC --op-span 100 0", "op_span"),
    ("detect REC --op-span nan 1", "op_span"),
    ("detect REC --pv-span 0 inf", "pv_span"),
    ("detect REC --labels REC", "label"),
    ("detect REC --plugin none.py", "none.py"),
    ("detect REC --plugin LOOP", "loop.toml"),
    ("diagnose REC --picture REC", "written over"),
    ("check DIR", "against"),
    ("check DIR --against DIR", "run"),
    ("check DIR --against DIR --margin 2", "margin"),
    ("check DIR --against DIR --update", "run"),
    ("figure fig-11-4", "-o"),
    ("confirm", "verb"),
    ("confirm trvel LOOP", "travel"),
    ("gap", "verb"),
    ("gap diagnose REC --baseline LOOP --identify", "either"),
    ("gap diagnose REC --identify -j 100000", "-j"),
    ("gap diagnose REC --identify --window 5 2", "window"),
    ("gap diagnose REC --identify --window 0 9999", "window"),
    ("gap diagnose REC --identify --window -1 100", "window"),
    ("gap diagnose REC --identify --window 50 50", "window"),
    ("gap diagnose REC --baseline PART", "neither [plant] nor [controller]"),
    ("gap diagnose REC --baseline LOOP --write-loop LOOP", "written over"),
    ("gap diagnose REC --baseline LOOP --html REC", "written over"),
    ("simulate smoke", "-o"),
    ("simulate smoke -o OUT --n 0", "--n"),
    ("simulate smoke -o OUT --n x", "--n"),
    ("simulate smoke -o OUT --kick 2", "--kick"),
    ("run smoke --answers REC", "GRID is smoke"),
    ("run DIR --answers REC", "manifest.json"),
    ("run DIR --add --answers", "--answers"),
    ("list LOOP", "detectors"),
    ("run smoke -o OUT --method nothing", "nothing"),
    ("gap diganose REC", "diagnose"),
    ("gap diagnose REC --baseline LOOP --healthy none.csv", "none.csv"),
    ("gap diagnose REC --identify --healthy REC", "states [plant]"),
    ("gap diagnose REC --baseline LOOP --kind smell", "smell"),
    ("gap grid smoke RECS", "at least 10"),
    ("run RECS -o OUT --axis noise_ratio=0.1", "--axis"),
    ("run RECS -o OUT --fresh-seeds", "--fresh-seeds"),
    ("run RECS -o OUT --set repeats=4", "repeats=4"),
    ("run RECS -o OUT --set seed=soon", "whole number"),
    ("run RECS -o OUT --set seed=-1", "whole number"),
    ("run DIR -o OUT", "no run"),
    ("run smoke -o OUT --ts 3", "--ts"),
    ("gap grid smoke RECS --labels LOOP", "loop.toml"),
    ("gap grid smoke RECS --picture OUT", "OUT"),
    ("simulate LOOP --seeds 2 --set controller.Kc", "NAME=VALUE"),
    ("simulate LOOP --seeds 2 --set controller.Kcc=2", "Kc"),
    ("simulate LOOP --seeds 2 --set controller.Kc=0", "greater"),
    ("simulate LOOP --seeds 2 --set controller.Kc=fast", "Kc"),
    ("simulate LOOP --seeds 1", "--seeds"),
    ("simulate smoke --seeds 2", "--seeds"),
    ("confirm travel LOOP --picture LOOP", "written over"),
    ("confirm gain-change LOOP --picture LOOP", "written over"),
    ("confirm gain-change --records REC REC --picture REC", "written over"),
    ("detect REC --csv REC", "written over"),
    ("detect REC --html REC", "written over"),
    ("detect REC --csv DIR", "folder"),
    ("detect REC --csv OUT --html OUT", "two outputs"),
    ("detect RECS --csv RECS/one.csv", "written over"),
    ("detect REC --csv x.parquet", ".csv"),
    ("detect REC --columns op=op,op=pv", "already"),
    ("detect REC --columns op=pv,pv=pv", "two roles"),
    ("detect REC --columns xx=op", "xx"),
    ("detect REC --columns pv=PV2", "PV2"),
    ("detect REC --ts 0", "Ts"),
    ("detect REC --ts nan", "Ts"),
    ("detect REC --ts 1e-300", "Ts"),
    ("detect TAGS --tag FIC101", "FIC101"),
    ("detect REC --method horch@publishd", "horch@publishd"),
    ("detect RECS --labels LABELS", "stictoin"),
    ("simulate LOOP -o x.parquet", ".csv"),
    ("valve REC --model ideal -o x.xlsx", ".csv"),
    ("simulate LOOP -o OUT --valve-plugin LOOP", "loop.toml"),
    ("simulate LOOP -o OUT --effect-plugin none.py", "none.py"),
    ("valve REC --model choudhury --param S=5 --param S=6 -o OUT", "already"),
    ("run smoke -o OUT --set K=1 --set K=2", "already"),
    ("run smoke -o OUT --axis K=1 --axis K=2", "already"),
    ("confirm gain-change --records REC REC --factor nan", "fold"),
    ("confirm gain-change --records REC REC --factor 0", "fold"),
    ("confirm gain-change --records REC REC --factor -2", "fold"),
    ("confirm gain-change LOOP --factor 1", "factor"),
    ("confirm gain-change LOOP --factor 1e9", "factor"),
    ("confirm gain-change LOOP --records REC REC", "either"),
    ("confirm gain-change --records REC", "--records"),
    ("confirm gain-change --records REC REC --op-span 0 0", "op_span"),
    ("confirm travel SLOW", "slow.toml"),
    ("confirm travel --record REC --process gas", "process"),
    ("confirm travel --record none.csv", "none.csv"),
    ("confirm travel --record REC --op-span 0 nan", "op_span"),
    ("confirm travel --record REC --picture x.gif", ".svg"),
    ("gap diagnose SHARE --identify", "--op-span"),
    ("gap diagnose REC --baseline LOOP --html OUT --write-loop OUT", "two outputs"),
    ("gap diagnose REC --baseline LOOP --picture DIR", "folder"),
    ("figure table-11-9 -o DIR", "table"),
    ("figure fig-11-4 fig-9 -o DIR", "fig-11-9"),
    ("figure fig-11-4 -o DIR --isdb none.mat", "none.mat"),
    ("figure fig-11-4 -o DIR --isdb LOOP", "loop.toml"),
    ("contract x.txt", "x.txt"),
    ("contract rec.py", "rec.py"),
    ("predict LOOP --seed 1", "--seed"),
    ("score DIR --paired", "run"),
    ("check OUT --against DIR", "out"),
    ("predict FAST", "Ts"),
    ("diagnose REC --process gas", "gas"),
    ("diagnose REC --kind smell", "smell"),
    ("diagnose REC --op-span 1 1", "op_span"),
    ("check DIR --margin nan", "margin"),
    ("check DIR --margin x", "margin"),
    ("check REC --against DIR", "rec.csv"),
    ("run smoke -o OUT --backend slurm", "slurm"),
    ("list figures --jsn", "--json"),
    ("list effekte", "effects"),
    *IN_EVERY_RUN,
]


@pytest.mark.parametrize(("line", "part"), sampled(WRONG_COMMANDS, 8, IN_EVERY_RUN))
def test_a_wrong_command(here, line, part):
    # the files that words in capitals stand for
    share = "".join(f"{k},{0.5 + k % 7 / 100},{50 + k % 5}\n" for k in range(300))
    files = {
        "LOOP": ("loop.toml", text()),
        "REC": ("rec.csv", RECORD),
        "LABELS": ("labels.csv", "id,label\none,stictoin\n"),
        "SLOW": ("slow.toml", text("plant", "Td", "1e6")),
        "FAST": ("fast.toml", text("sampling", "Ts", "1e-6")),
        "PART": ("part.toml", "[noise]\nstd = 0.1\n"),
        "SHARE": ("share.csv", f"t,op,pv\n{share}"),
        "HOT": ("hot.csv", "t,op\n0,50\n1,hot\n"),
        "BARE": ("bare.csv", "t,op\n0,50\n1,\n"),
        "UNEVEN": ("uneven.csv", "t,op\n0,50\n1,51\n2,52\n5,53\n"),
        "TAGS": ("tags.csv", RECORD.replace("sp,op,pv", "LIC7.SP,LIC7.OP,LIC7.PV", 1)),
        "RECS/one.csv": ("records/one.csv", RECORD),
    }
    for folder in ("empty", "records"):
        (here / folder).mkdir()
    for name, content in files.values():
        (here / name).write_text(content)

    # the command, with those words replaced, and what of it is wrong
    places = {word: here / name for word, (name, _) in files.items()}
    places |= {"OUT": here / "out", "DIR": here / "empty", "RECS": here / "records"}
    places |= {"PAGE": here / "rec.html", "RECS/one.html": here / "records" / "one.html"}
    places["OUT/key"] = here / "out" / "key"
    values = wrong_values(line.split(), places, part)
    words = [places.get(word, word) for word in line.split()]
    refused(words, "empty" if part == "DIR" else part, values=values)

    # nothing is written, nothing is lost
    for name, content in files.values():
        assert (here / name).read_text() == content
    assert not (here / "out").exists()
    assert not list((here / "empty").iterdir())


KNOWN = "ideal OUT.svg key a.csv smoke all horch deadband fig-11-4 detectors figures none 1 100"


def wrong_values(words: list[str], places: dict, part: str) -> list[str]:
    """What is wrong on a command line, where it is a value: not what the sentence names anyway, no
    option, verb or file.
    """
    right = {*places, *KNOWN.split(), *" ".join(verbs(typer.main.get_command(app))).split()}
    pairs = [
        w.split(",")[-1].partition("=") for w in words if not w.startswith("-") or w[1:2].isdigit()
    ]
    values = [key if key == part else value or key for key, _, value in pairs]
    return [v for v in values if v not in right and not v.startswith(("none.", "/"))][-1:]


def verbs(command, words: str = "") -> Iterator[str]:
    """Yield every verb below a command, with the words before it."""
    for name, sub in command.commands.items():
        verb = f"{words} {name}".strip()
        yield from verbs(sub, verb) if hasattr(sub, "commands") else [verb]


def test_no_verb_is_missing_here():
    for verb in verbs(typer.main.get_command(app)):
        assert any(line.startswith(f"{verb} ") for line in RIGHT), verb


OUTER = {
    "plant": {"type": "foptd", "K": 1, "T": 60},
    "controller": {"type": "PI", "Kc": 1, "Ti": 60},
}
GOOD_LOOP = {
    "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "sampling": {"Ts": 1},
}
STICTION = {"name": "stiction", "S": 1.0, "J": 1.0}
SINE = {"type": "sine", "amplitude": 1, "period": 9}
ECHO = {"type": "echo", "valve": "choudhury", "S": 5.0, "J": 2.0}
LAG = {"name": "time_constant_mismatch", "factor": 1.2}
GAIN = {"name": "gain_mismatch", "factor": 2.0}


def plant(kind="foptd", **keys):
    return {"plant": {"type": kind, **keys}}


def in_z(**keys):
    return plant("tf", **{"num": [1], "den": [1, -0.2], "dt": 1} | keys)


def controller(kind="PI", **keys):
    return {"controller": {"type": kind, **keys}}


def outer(**changes):
    return {"outer": {**OUTER, **changes}}


WRONG_LOOPS = [
    ({"plnt": {}}, "unknown key 'plnt': did you mean 'plant'"),
    (plant("fopdt", K=1), "did you mean 'foptd'"),
    (plant("tnk", K=1, T=2), "tank"),
    (plant(K=1), "T is missing"),
    (plant(K=1, k=1, T=2), "'plant.k': did you mean 'K'"),
    (plant(K=-1, T=2), "positive feedback"),
    (plant(K=1, T=2, num=[1]), "belongs to"),
    (plant(K=1, T=5e-324), "T = 4.94066e-324 s is too small"),
    (plant("integrating", K=1, T=2), "no time constant"),
    (plant("tf", num=[1], den=[1, -1]), "unstable"),
    (plant("tf", num=[1, 0], den=[1, 2, 1]), "constant term"),
    (plant("tf", num=[1, 1], den=[1, 2]), "strictly proper"),
    (plant("tf", num=[1]), "den is missing"),
    (plant("tf", K=1, num=[1], den=[2, 1]), "K = 1"),
    (plant("tf", num=[-1], den=[2, 1]), "positive feedback"),
    (plant("tf", num=[1], den=[5e-324, 1]), "den begins with 4.94066e-324"),
    (plant("integrating", K=0.05, Td=2) | {"effect": [LAG]}, "no time constant"),
    (plant("tank", K=1.5, T=10) | {"effect": [GAIN]}, "tank"),
    (in_z(den=[1, -1.2]), "pole at z = 1.2; poles inside the unit circle"),
    (in_z(num=[1, 1]), "at most 1 are needed: PV answers after a sample"),
    (in_z(dt=2), "plant.dt = 2 s; the sampling period, Ts = 1 s, is needed"),
    (in_z(Td=0.5), "Td = 0.5 s is no whole number of samples"),
    (in_z() | {"effect": [GAIN]}, "stated in powers of z"),
    (controller("tf", num=[1, 0, 0], den=[1, -1], dt=1), "no OP answers to an error to come"),
    (controller("tf", num=[1], den=[1, -1]), "dt is missing"),
    (controller("tf", num=[1], den=[1, -1], dt=1, Kc=2), "Kc: a controller of type 'tf' has num"),
    (controller(Kc=1, Ti=2, num=[1]), "num belongs to a controller of type 'tf'"),
    (controller("PIDD", Kc=1), "PID"),
    (controller(Kc=1), "Ti is missing"),
    (controller(Kc=-1, Ti=2), "Kc"),
    (controller(Kc=1, Ti=2, Kp=1), "'controller.Kp': did you mean 'Kc'"),
    (controller(Kc=1, Ti=2, direction="direct"), "positive feedback"),
    (controller("P", Kc=1, Ti=2), "has none"),
    (controller("PID", Kc=1), "Ti is missing"),
    (controller(Kc=1, Ti=2, Td=1), "'PID' is needed"),
    (controller("PID", Kc=1, Ti=2, schedule=[[2, 1], [1, 2]]), "rising"),
    ({"valve": {"S": 1}}, "model"),
    ({"valve": {"modle": "kano"}}, "lacks the key 'model'"),
    ({"valve": {"model": "chodhury"}}, "choudhury"),
    ({"valve": {"model": "choudhury", "S": -1, "J": 0}}, "S = -1"),
    ({"valve": {"model": "choudhury", "S": 1, "J": -2}}, "J = -2"),
    ({"valve": {"model": "choudhury", "s": 1, "J": 1}}, "did you mean 'S'"),
    ({"valve": {"model": "deadband"}}, "needs S"),
    ({"noise": {"stdev": 1.0}}, "did you mean 'mv_std' or 'std'"),
    ({"setpoint": {"vale": 1.0}}, "did you mean 'value'"),
    ({"setpoint": {"steps": [[1]]}}, "setpoint.steps"),
    ({"operating_point": {"op": 1.0}}, "did you mean 'op0'"),
    ({"operating_point": {"op0": 120}}, "op0"),
    ({"sampling": {"Ts": 1, "warm_up": -1}}, "warm_up"),
    ({"sampling": {"Ts": 1, "warm_up": 1.5}}, "warm_up"),
    ({"sampling": {"Ts": 1, "warm_up": 10**9}}, "warm_up"),
    ({"disturbance": [SINE | {"type": "sinus"}]}, "did you mean 'sine'"),
    ({"disturbance": [SINE | {"period": 0}]}, "period"),
    ({"disturbance": [SINE | {"at": "inlet"}]}, "input"),
    ({"disturbance": [{"type": "echo", "S": 5.0, "J": 2.0}]}, "valve = None; the model of the"),
    ({"disturbance": [ECHO | {"S": 0.01, "J": 0.001}]}, "does not cycle"),
    ({"disturbance": [ECHO | {"kind": "flat"}]}, "flat"),
    ({"disturbance": [ECHO | {"cut": 0.0}]}, "cut = 0"),
    ({"disturbance": [ECHO | {"amplitude": 3.0}]},
     "disturbance 'echo': unknown parameter 'amplitude' in valve 'choudhury'"),
    ({"disturbance": [ECHO | {"valve": "chouhdury"}]}, "choudhury"),
    ({"disturbance": [ECHO, ECHO]}, "must be the last, and the only echo"),
    ({"disturbance": [ECHO, SINE]}, "must be the last, and the only echo"),
    ({"effect": [STICTION | {"name": "stictoin"}]}, "did you mean 'stiction'"),
    ({"effect": [STICTION]}, "'choudhury', which has friction already"),
    ({"effect": [{"name": "oscillation", "amplitude": 1, "period": 0}]}, "period = 0"),
    ({"effect": [{"name": "saturation", "lo": 60, "hi": 40}]}, "must be below hi"),
    (outer() | {"setpoint": {"value": 50, "steps": [[1, 2]]}}, "outer.setpoint"),
    (outer() | {"setpoint": {"value": 150}}, "sp_span"),
    (outer(plant={"type": "foptd", "K": -1, "T": 2}), "positive feedback"),
    (outer(plant={"type": "tank", "K": 1, "T": 2}), "no plug-in"),
    (outer(sp_span=[5, 5]), "rising"),
    ({"outer": {"plant": OUTER["plant"]}}, "outer.controller"),
]  # fmt: skip


@pytest.mark.parametrize(("change", "words"), WRONG_LOOPS)
def test_a_loop_that_cannot_be_is_one_sentence(change, words):
    with pytest.raises((UserError, SpecError)) as error:
        simulate(Loop.from_table({**GOOD_LOOP, **change}, "loop.toml"))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


NAN = float("nan")
BAND = {"S": 5, "J": 2}
FRICTION = ("coulomb", "karnopp", "stribeck", "lugre")
WRONG_VALVES = [
    ("chudhury", BAND, "did you mean 'choudhury'"),
    ("choudhury", {}, "needs S (% of travel)"),
    ("choudhury", {"s": 1, "J": 1}, "did you mean 'S'"),
    ("choudhury", BAND | {"S": -1}, "S = -1 is out of range, it must be in 0..100"),
    ("choudhury", BAND | {"S": 101.0}, "S = 101 is out of range"),
    ("choudhury", BAND | {"S": NAN}, "S = nan is not finite"),
    ("choudhury", BAND | {"S": "5"}, "S = '5' is no number"),
    ("choudhury", BAND | {"S": True}, "S = True is no number"),
    ("choudhury", BAND | {"S": [1.0]}, "S = [1.0] is no number"),
    ("choudhury", BAND | {"S": 10**400}, "is not finite"),
    ("choudhury", BAND | {"S": 10**5000}, "a number of thousands of digits"),
    ("characteristic", {"type": "linaer"}, "did you mean 'linear'"),
    ("hysteresis", {"S": 50, "H": 30}, "exceeds the travel"),
    ("limits", {"low": 60, "high": 40}, "must be below"),
    ("intermittent", {"S": 1, "J": 1, "period": 5, "on": 6}, "longer than period"),
    ("intermittent", {"S": 1, "J": 1, "perod": 3, "on": 1}, "did you mean 'period'"),
    ("time_varying", BAND | {"t_begin": 5, "t_end": 5}, "must come after"),
    ("he", {"S": 5}, "needs S and J together"),
    ("he", {}, "needs S and J, or fs and fd"),
    ("he", BAND | {"fs": 1}, "not some of both"),
    ("he", {"fs": 1, "fd": 2}, "is below fd"),
    ("he", {"fs": 1, "fd": -2}, "is negative"),
    ("lugre", {"S": 5, "J": 5}, "needs Fc > 0"),
    ("coulomb_viscous", {"S": 5, "Fc": 5}, "give S or Fc"),
    *(
        (model, {"substep": 5e-3}, "substep = 0.005 s is too large")
        for model in ("coulomb_viscous", *FRICTION[:3])
    ),
    *((model, {"S": 5, "J": 7}, "friction alone cannot overshoot") for model in FRICTION),
    *((model, {"Fs": 1, "Fc": 2}, "a valve at rest holds at least as hard") for model in FRICTION),
    *((model, {"k": 0}, "k = 0 is out of range, it must be > 0") for model in FRICTION),
    *((model, BAND | {"Fs": 100}, "not some of both") for model in FRICTION),
]


@pytest.mark.parametrize(("model", "parameters", "words"), WRONG_VALVES)
def test_a_valve_that_cannot_be_is_one_sentence(model, parameters, words):
    with pytest.raises(UserError) as error:
        valve_response(model, [50.0], parameters)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


WAVE = LoopRecord(op=np.sin(np.arange(300.0)), pv=np.cos(np.arange(300.0)), Ts=1.0)


def with_plant(*tf):
    return simulate(Loop.from_table(GOOD_LOOP), plant=control.tf(*tf))


MISSPELT = {"valve": {"model": "choudury"}}
WRONG_CALLS = [
    (lambda: judge(WAVE, ["horhc"]), "did you mean 'horch'"),
    (lambda: judge(WAVE, ["horch"], thresholds={"horch": {"dtau_hihg": 0.5}}), "'dtau_high'"),
    (lambda: judge(WAVE, ["horch"], thresholds={"horch": {"dtau_high": 3.0}}), "0.0 to 1.0"),
    (lambda: valve_response("ideal", [50.0, NAN]), "OP is not finite at sample 1"),
    (lambda: valve_response("ideal", [50.0], Ts=0), "Ts = 0 s must be"),
    (lambda: valve_response("ideal", [[50.0], [51.0]]), "shape (2, 1)"),
    (lambda: valve_position([50.0, 51.0], -1, 0), "valve_position: S = -1"),
    (lambda: valve_position([50.0, 51.0], 1, NAN), "valve_position: J = nan"),
    (lambda: Sample.of(load_grid("smoke"), 49), "smoke: 49 points; 1 to 48 are allowed"),
    (lambda: stiction(5.0, -1.0), "describing function"),
    (lambda: deadzone(0.0), "describing function"),
    (lambda: with_plant([1], [1, 1], 0.1), "discrete"),
    (lambda: with_plant([1], [1, -1]), "unstable"),
    (lambda: with_plant([1, 1], [1, 2]), "strictly proper"),
    (lambda: with_plant([-1], [1, 1]), "positive feedback"),
    (lambda: truth_columns(Loop.from_table(GOOD_LOOP | MISSPELT)), "did you mean 'choudhury'"),
    (lambda: sb.figure("fig-11-8", S="x"), "above 0 is needed"),
    (lambda: sb.figure("fig-11-25", S=3.0), "shows no loop with S"),
    (lambda: sb.figure("fig-11-2", S=3.0), "shows no simulated loop"),
    (lambda: travel_test(Loop.from_table(GOOD_LOOP), 0.2, 60), "increment"),
    (lambda: travel_test(Loop.from_table(GOOD_LOOP), NAN, 10), "increment"),
    (lambda: gain_change_recorded(WAVE, replace(WAVE, Ts=2.0)), "Ts = 1 s before and 2 s after"),
    (lambda: gain_change_recorded(WAVE, WAVE, factor=1.1), "at least 20 %"),
    (lambda: grid("smoke", dict.fromkeys("abcdefghijkl", WAVE), additions=["x"]), "addition 'x'"),
    (lambda: sb.run("smoke", "he", out="never", backend="dusk"), "did you mean 'dask'"),
]


@pytest.mark.parametrize(("call", "words"), WRONG_CALLS)
def test_a_call_that_cannot_be_answered_is_one_sentence(call, words):
    with pytest.raises((UserError, SpecError)) as error:
        call()
    assert words in str(error.value)
    assert "\n" not in str(error.value)
