"""What is wrong on the command line itself: verbs, options, files in the wrong place, outputs that
cannot be.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from detectors import usage
from detectors.usage import exit_code
from simbench.cli import app
from tests.simbench.boundary.conftest import answer_to, refused, sampled
from tests.simbench.boundary.test_loops import text

RECORD = "t,sp,op,pv\n" + "".join(f"{k},50,{50 + k % 7},{50 + k % 5}\n" for k in range(300))
# words with LOOP, REC, OUT, DIR for a good loop file, a good record, a file to write and an empty
# folder; a word of it
WRONG = [
    ("", "verb"),
    ("simulte LOOP", "simulate"),
    ("--colour", "--colour"),
    ("simulate", "loop file"),
    ("simulate LOOP", "-o"),
    ("simulate LOOP -o OUT --seed -1", "seed"),
    ("simulate LOOP -o OUT --seed x", "seed"),
    ("simulate LOOP -o", "-o"),
    ("simulate LOOP LOOP -o OUT", "argument"),
    ("simulate LOOP -o LOOP", "written over"),
    ("simulate DIR -o OUT", "folder"),
    ("simulate LOOP -o DIR", "folder"),
    ("simulate LOOP -o /proc/nothing/x.csv", "/proc"),
    ("simulate REC -o OUT", "TOML"),
    ("simulate LOOP -o OUT --kick many", "kick"),
    ("simulate LOOP -o OUT --kick nan", "kick"),
    ("simulate LOOP -o OUT --kick 1e300", "kick"),
    ("simulate --from DIR -o OUT", "--id"),
    ("simulate --from DIR --id x -o OUT", "run"),
    ("simulate none.toml -o OUT", "none.toml"),
    ("valve REC -o OUT", "model"),
    ("valve REC --model deadband -o OUT", "S"),
    ("valve REC --model dedband -o OUT", "deadband"),
    ("valve REC --model deadband --param S=x -o OUT", "S"),
    ("valve REC --model deadband --param S=nan -o OUT", "S"),
    ("valve REC --model deadband --param S=-1 -o OUT", "S"),
    ("valve REC --model deadband --param S -o OUT", "NAME=VALUE"),
    ("valve REC --model deadband --param R=1 -o OUT", "R"),
    ("valve REC --model deadband --param S=2 -o REC", "written over"),
    ("valve LOOP --model deadband --param S=2 -o OUT", "loop.toml"),
    ("valve none.csv --model ideal -o OUT", "none.csv"),
    ("predict", "LOOP"),
    ("predict REC", "TOML"),
    ("predict none.toml", "none.toml"),
    ("predict LOOP --jsn", "--json"),
    ("detect", "REC"),
    ("detect none.csv", "none.csv"),
    ("detect REC --method horhc", "horch"),
    ("detect REC --process gas", "process"),
    ("detect REC --kind smell", "kind"),
    ("detect REC --op-span 1", "op-span"),
    ("detect REC --op-span 1 1", "op_span"),
    ("detect REC --op-span 100 0", "op_span"),
    ("detect REC --op-span nan 1", "op_span"),
    ("detect REC --pv-span 0 inf", "pv_span"),
    ("detect REC --labels REC", "label"),
    ("detect DIR", "no loop record"),
    ("detect LOOP --method he", "loop.toml"),
    ("detect REC --thresholds REC", "thresholds"),
    ("detect REC --thresholds none.json", "none.json"),
    ("detect REC --plugin none.py", "none.py"),
    ("detect REC --plugin LOOP", "loop.toml"),
    ("detect REC --time-limit x", "time-limit"),
    ("diagnose DIR", "file"),
    ("diagnose REC --picture REC", "written over"),
    ("map", "GRID"),
    ("map smoke", "-o"),
    ("map smok -o OUT", "smoke"),
    ("map none.toml -o OUT", "none.toml"),
    ("map smoke -o OUT --points 49", "points"),
    ("map smoke -o OUT --points 0", "points"),
    ("map smoke -o OUT --points many", "points"),
    ("map smoke -o OUT --x Td_over_TT", "Td_over_T"),
    ("map smoke -o OUT --y wind", "--y"),
    ("map smoke -o OUT --x tuning", "--x"),
    ("map smoke -o OUT --x disturbance --y disturbance", "axes"),
    ("map smoke -o OUT --method horhc", "horch"),
    ("map smoke -o OUT -j 0", "-j"),
    ("map smoke -o OUT --backend slurm", "slurm"),
    ("map smoke -o REC", "rec.csv"),
    ("map smoke -o /proc/nothing", "/proc"),
    ("map LOOP -o OUT", "loop"),
    ("map smoke extra -o OUT", "argument"),
    ("score DIR", "run"),
    ("score none", "run"),
    ("score REC", "run"),
    ("check DIR", "against"),
    ("check DIR --against DIR", "run"),
    ("check DIR --against DIR --margin 2", "margin"),
    ("check DIR --against DIR --update", "run"),
    ("history DIR", "history"),
    ("calibrate smok", "smoke"),
    ("calibrate smoke --false-alarm 2", "false"),
    ("calibrate smoke --false-alarm nan", "false"),
    ("calibrate smoke -j 0", "-j"),
    ("worst horhc", "horch"),
    ("worst horch --budget 0", "budget"),
    ("worst", "METHOD"),
    ("figure fig-11-99 -o DIR", "fig-11-9"),
    ("figure fig-11-4", "-o"),
    ("figure score-map -o DIR --run DIR", "run"),
    ("confirm", "verb"),
    ("confirm trvel LOOP", "travel"),
    ("confirm travel REC", "TOML"),
    ("confirm travel none.toml", "none.toml"),
    ("gap", "verb"),
    ("gap diagnose", "REC"),
    ("gap diagnose REC", "--baseline"),
    ("gap diagnose REC --baseline none.toml", "none.toml"),
    ("gap diagnose REC --baseline LOOP --identify", "either"),
    ("gap diagnose REC --identify -j 0", "-j"),
    ("gap diagnose REC --identify -j 100000", "-j"),
    ("gap diagnose REC --identify --window 5 2", "window"),
    ("gap diagnose REC --identify --window 0 9999", "window"),
    ("gap diagnose REC --baseline LOOP --write-loop LOOP", "written over"),
    ("gap diagnose REC --baseline LOOP --html REC", "written over"),
    ("gap diagnose REC --baseline REC", "TOML"),
    ("gap withheld make DIR --key DIR --seed 1 -n 3", "records"),
    ("gap withheld make DIR --seed 1", "key"),
    ("gap withheld answer DIR", "empty"),
    ("gap withheld open DIR", "DIR"),
    ("gap withheld answer DIR -j 0", "-j"),
    ("exam make", "GRID"),
    ("exam make smoke", "--out"),
    ("exam make smoke -o OUT", "--key"),
    ("exam make smok -o OUT --key k", "smoke"),
    ("exam make smoke -o OUT --key OUT/key", "inside"),
    ("exam make smoke -o OUT --key k --n 0", "--n"),
    ("exam make smoke -o OUT --key k --n x", "--n"),
    ("exam make smoke -o OUT --key k -j 0", "-j"),
    ("exam make smoke -o REC --key k", "rec.csv"),
    ("exam make LOOP -o OUT --key k", "loop"),
    ("exam make smoke -o OUT --key k --nn 3", "--n"),
    ("exam answer", "EXAM"),
    ("exam answer DIR", "--out"),
    ("exam answer DIR -o a.csv", "exam.json"),
    ("exam answer none -o a.csv", "none"),
    ("exam answer REC -o a.csv", "rec.csv"),
    ("exam answer DIR -o a.csv -j 0", "-j"),
    ("exam answer DIR -o a.csv -j x", "-j"),
    ("exam answer DIR -o a.csv --resum", "--resume"),
    ("exam answer DIR -o a.csv --method", "--method"),
    ("exam answer LOOP -o a.csv", "loop.toml"),
    ("exam answer DIR --sed 1 -o a.csv", "--sed"),
    ("exam open", "EXAM"),
    ("exam open DIR", "ANSWERS"),
    ("exam open DIR REC", "--key"),
    ("exam open DIR --key k", "ANSWERS"),
    ("exam open DIR REC --key k", "exam.json"),
    ("exam open none REC --key k", "none"),
    ("exam open REC REC --key k", "rec.csv"),
    ("exam open DIR REC --key k -j 0", "-j"),
    ("exam open DIR REC --key k --label l.csv", "--labels"),
    ("exam open DIR REC --key k --ful", "--full"),
    ("exam open LOOP REC --key k", "loop.toml"),
    ("list detectrs", "detectors"),
    ("list LOOP", "detectors"),
    ("list detectors valves", "argument"),
    ("list figures --jsn", "--json"),
    ("run", "GRID"),
    ("run smok -o OUT", "smoke"),
    ("run smoke -o REC", "rec.csv"),
    ("run LOOP -o OUT", "loop"),
    ("run smoke -o /proc/nothing", "/proc"),
    ("run smoke -o OUT --method nothing", "nothing"),
    ("trust", "REC"),
    ("trust none.csv", "none.csv"),
    ("trust DIR", "file"),
    ("trust LOOP", "loop.toml"),
    ("trust REC --loop REC", "TOML"),
    ("trust REC --loop none.toml", "none.toml"),
    ("trust REC --method horhc", "horch"),
    ("trust REC --html REC", "written over"),
    ("trust REC --html DIR", "folder"),
    ("trust REC --op-span 1 1", "op_span"),
    ("trust REC --process gas", "process"),
    ("trust REC --kind smell", "kind"),
    ("trust REC --loop LOOP --html LOOP", "written over"),
    ("report", "FOLDER"),
    ("report none", "none"),
    ("report DIR", "no loop record"),
    ("report LOOP -o OUT", "loop.toml"),
    ("report DIR --labels none.csv", "none.csv"),
    ("report DIR --labels LOOP", "loop.toml"),
    ("report DIR -j 0", "-j"),
    ("report DIR -j 100000", "-j"),
    ("report DIR -o DIR", "is a folder"),
    ("report DIR --jobs many", "jobs"),
    ("history none", "none"),
    ("history REC", "rec.csv"),
    ("history DIR -o DIR", "history"),
    ("history DIR --jsn", "--json"),
    ("gap study", "RECORDS"),
    ("gap study DIR", "--grid"),
    ("gap study DIR --grid smoke", "record"),
    ("gap study none --grid smoke", "none"),
    ("gap study RECS --grid smoke", "at least 5"),
    ("gap study DIR --grid LOOP", "loop"),
    ("gap study REC --grid smoke", "rec.csv"),
    ("gap study DIR --grid smoke --labels none.csv", "none.csv"),
    ("gap study DIR --grid smoke --labels LOOP", "loop.toml"),
    ("gap study DIR --grid smoke --html DIR", "folder"),
    ("gap study DIR --grid smoke --write-grid DIR", "folder"),
    ("gap stdy DIR --grid smoke", "study"),
    ("gap plan", "argument"),
    ("gap plan REC", "--baseline"),
    ("gap plan none.csv --baseline LOOP", "none.csv"),
    ("gap plan REC --baseline none.toml", "none.toml"),
    ("gap plan REC --baseline REC", "TOML"),
    ("gap plan REC --baseline LOOP --limits none.toml", "none.toml"),
    ("gap plan REC --baseline LOOP --html REC", "written over"),
    ("gap plan REC --baseline LOOP --limits REC", "TOML"),
    ("gap plan REC --baseline LOOP --test none.csv", "none.csv"),
    ("gap plan REC --baseline LOOP --kind smell", "smell"),
    ("gap plan REC --baseline LOOP --html DIR", "folder"),
    ("gap plan DIR --baseline LOOP", "file"),
    ("gap plan REC --baseline LOOP --limits LOOP", "loop.toml"),
    ("gap predict", "argument"),
    ("gap predict REC --set controller.Kc=2", "--baseline"),
    ("gap predict REC --baseline LOOP", "--set"),
    ("gap predict REC --baseline LOOP --set controller.Kc", "NAME=VALUE"),
    ("gap predict REC --baseline LOOP --set plant.K=2", "not a setting"),
    ("gap predict REC --baseline LOOP --set controller.Kcc=2", "Kc"),
    ("gap predict REC --baseline LOOP --set controller.Kc=0", "greater"),
    ("gap predict REC --baseline LOOP --set controller.Kc=fast", "Kc"),
    ("gap predict none.csv --baseline LOOP --set controller.Kc=2", "none.csv"),
    ("gap predict REC --baseline none.toml --set controller.Kc=2", "none.toml"),
    ("gap discover", "argument"),
    ("gap discover REC", "--baseline"),
    ("gap discover none.csv --baseline LOOP", "none.csv"),
    ("gap discover REC --baseline none.toml", "none.toml"),
    ("gap discover REC --baseline REC", "TOML"),
    ("gap discover REC --baseline LOOP --html REC", "written over"),
    ("gap discover REC --baseline LOOP --html DIR", "folder"),
    ("gap discover REC --baseline LOOP --write-effect REC", "written over"),
    ("gap discover DIR --baseline LOOP", "file"),
    ("gap discover REC --baseline LOOP --write-effect DIR", "folder"),
    ("gap discover REC --baseline LOOP --ts 0", "Ts"),
    ("gap discover REC --baseline LOOP --html OUT --write-effect OUT", "two outputs"),
    ("gap leave-out", "argument"),
    ("gap leave-out REC", "rec.csv"),
    ("gap leave-out OUT -n 0", "-n"),
    ("gap leave-out OUT --world owm", "own"),
    ("gap leave-out OUT -j 0", "-j"),
    ("gap leave-out OUT --seed -1", "seed"),
    ("gap leave-out LOOP", "loop.toml"),
    ("gap leave-out /proc/nothing", "/proc"),
    ("gap withheld", "verb"),
    ("gap withheld make DIR --key REC --seed 1 -n 100", "rec.csv"),
    ("gap withheld answer none", "none"),
    ("gap withheld open none --key LOOP", "none"),
    ("confirm travel DIR", "folder"),
    ("confirm gain-change", "LOOP"),
    ("confirm gain-change none.toml", "none.toml"),
    ("confirm gain-change REC", "TOML"),
    ("confirm travel LOOP --picture LOOP", "written over"),
    ("confirm travel LOOP --picture OUT", ".svg"),
    ("confirm gain-change LOOP --picture LOOP", "written over"),
    ("confirm gain-change --records REC REC --picture REC", "written over"),
    ("diagnose REC --picture OUT", ".svg"),
    ("history DIR -o REC", ".svg"),
    ("report RECS -o RECS/one.html", "one.csv"),
    ("gap study RECS --grid LOOP --html LOOP", "written over"),
    ("gap study RECS --grid smoke --write-grid RECS/one.csv", "written over"),
    ("report RECS --labels REC -o PAGE", "written"),
    ("contract", "FILE"),
    ("contract none.py", "none.py"),
    ("contract DIR", "directory"),
    ("contract REC", "rec.csv"),
    ("contract none.toml", "none.toml"),
    ("contract LOOP --jsn", "--json"),
    ("worst horch -o DIR --budget 1", "folder"),
    ("worst horch --seed -1", "seed"),
    ("worst horch --budget x", "budget"),
    ("calibrate LOOP", "loop"),
    ("calibrate smoke -o REC", "rec.csv"),
    ("calibrate smoke --method horhc", "horch"),
    ("figure", "argument"),
    ("figure all -o REC", "rec.csv"),
    ("list detectors extra", "argument"),
    ("detect REC --csv REC", "written over"),
    ("detect REC --html REC", "written over"),
    ("detect REC --csv DIR", "folder"),
    ("detect REC --csv OUT --html OUT", "two outputs"),
    ("detect RECS --csv RECS/one.csv", "written over"),
    ("detect REC --csv /proc/nothing/x.csv", "/proc"),
    ("detect REC --csv x.parquet", ".csv"),
    ("detect REC --columns op=op,op=pv", "already"),
    ("detect REC --columns op=pv,pv=pv", "two roles"),
    ("detect REC --columns op", "ROLE=NAME"),
    ("detect REC --columns xx=op", "xx"),
    ("detect REC --columns pv=PV2", "PV2"),
    ("detect REC --front-end acf2", "acf"),
    ("detect REC --front-end", "--front-end"),
    ("detect REC --ts 0", "Ts"),
    ("detect REC --ts nan", "Ts"),
    ("detect REC --ts 1e-300", "Ts"),
    ("detect TAGS --loop FIC101", "FIC101"),
    ("detect REC --method horch@publishd", "horch@publishd"),
    ("detect RECS --labels LABELS", "stictoin"),
    ("report RECS --labels LABELS", "stictoin"),
    ("gap study RECS --grid smoke --labels LABELS", "stictoin"),
    ("simulate LOOP -o x.parquet", ".csv"),
    ("valve REC --model ideal -o x.xlsx", ".csv"),
    ("simulate LOOP -o OUT --valve-plugin LOOP", "loop.toml"),
    ("simulate LOOP -o OUT --effect-plugin none.py", "none.py"),
    ("valve REC --model choudhury --param S=5 --param S=6 -o OUT", "already"),
    ("run smoke -o OUT --set K=1 --set K=2", "already"),
    ("run smoke -o OUT --axis K=1 --axis K=2", "already"),
    ("run smoke -o OUT --front-end acff", "acf"),
    ("confirm gain-change --records REC REC --factor nan", "fold"),
    ("confirm gain-change --records REC REC --factor 0", "fold"),
    ("confirm gain-change --records REC REC --factor -2", "fold"),
    ("confirm gain-change --records REC REC", "--ratio"),
    ("confirm gain-change LOOP --factor 1", "factor"),
    ("confirm gain-change LOOP --factor 1e9", "factor"),
    ("confirm gain-change LOOP --records REC REC", "either"),
    ("confirm gain-change --records REC", "--records"),
    ("confirm gain-change --records REC REC --op-span 0 0", "op_span"),
    ("confirm travel SLOW", "slow.toml"),
    ("confirm travel --record REC --process gas", "process"),
    ("confirm travel LOOP --record REC", "either"),
    ("confirm travel --record none.csv", "none.csv"),
    ("confirm travel --record REC --op-span 0 nan", "op_span"),
    ("confirm travel --record REC --picture x.gif", ".svg"),
    ("gap diagnose SHARE --identify", "--op-span"),
    ("gap diagnose REC --baseline LOOP --html OUT --write-loop OUT", "two outputs"),
    ("gap diagnose REC --baseline LOOP --picture DIR", "folder"),
    ("gap leave-out DIR -n 1 --world nope", "world"),
    ("gap withheld make OUT --key k --seed 1 -n 100 --world ../own", "world"),
    ("score DIR --report DIR", "folder"),
    ("check DIR --against DIR --markdown DIR", "folder"),
    ("history DIR -o x.gif", ".svg"),
    ("run smoke -o OUT --thresholds LOOP", "thresholds"),
    ("run smoke -o OUT --time-limit 0 --plugin REC", "time limit"),
    ("history LOOP", "loop.toml"),
    ("history RECS", "records"),
    ("history DIR extra", "argument"),
    ("calibrate smoke --false-alarm -1", "false"),
    ("calibrate smoke --false-alarm x", "false"),
    ("calibrate smoke -j 100000", "-j"),
    ("calibrate none.toml", "none.toml"),
    ("calibrate smoke extra", "argument"),
    ("worst horch --budget -5", "budget"),
    ("worst horch --seed x", "seed"),
    ("worst oracle", "oracle"),
    ("worst horch --budget 1e3", "budget"),
    ("figure fig-11-4 -o /proc/nothing", "/proc"),
    ("figure table-11-9 -o DIR", "table"),
    ("figure fig-11-4 fig-9 -o DIR", "fig-11-9"),
    ("figure fig-11-4 -o DIR --isdb none.mat", "none.mat"),
    ("figure fig-11-4 -o DIR --isdb LOOP", "loop.toml"),
    ("figure score-map -o DIR --run none", "none"),
    ("contract OUT", "out"),
    ("contract LOOP extra", "argument"),
    ("contract x.txt", "x.txt"),
    ("contract rec.py", "rec.py"),
    ("list grid", "grids"),
    ("list valve --json", "valves"),
    ("list figurs", "figures"),
    ("list effekte", "effects"),
    ("list detectors --jsn", "--json"),
    ("gap leave-out OUT -n x", "-n"),
    ("gap leave-out OUT --seed -1", "seed"),
    ("gap withheld make OUT", "key"),
    ("gap withheld make OUT --key OUT/key --seed 1 -n 100", "key"),
    ("gap withheld make OUT --key k --seed x", "seed"),
    ("gap withheld make OUT --key k --seed -1", "seed"),
    ("gap withheld make OUT --key k --seed 1 -n 99", "-n"),
    ("gap withheld make REC --key OUT --seed 1 -n 100", "rec.csv"),
    ("gap withheld make OUT --key k --seed 1 -n 100 -j 0", "-j"),
    ("gap withheld answer none", "none"),
    ("gap withheld make OUT --key k --seed 1 -n 100 --world onw", "own"),
    ("gap withheld answer REC", "rec.csv"),
    ("gap withheld answer RECS", "records"),
    ("gap withheld answer DIR -j x", "-j"),
    ("gap withheld answer", "argument"),
    ("gap withheld answer LOOP", "loop.toml"),
    ("gap withheld answer DIR extra", "argument"),
    ("gap withheld answer DIR --jsn", "--jsn"),
    ("gap withheld open", "argument"),
    ("gap withheld open none", "none"),
    ("gap withheld open REC", "rec.csv"),
    ("gap withheld open RECS", "records"),
    ("gap withheld open DIR --key REC", "empty"),
    ("gap withheld open DIR --jsn", "--json"),
    ("gap withheld open DIR extra", "argument"),
    ("gap withheld open DIR --scores REC", "empty"),
    ("gap withheld open DIR --key none", "empty"),
    ("predict OUT", "out"),
    ("predict RECS", "folder"),
    ("predict LOOP --seed 1", "--seed"),
    ("score OUT", "out"),
    ("score RECS", "records"),
    ("score DIR --jsn", "--json"),
    ("score DIR --paired", "run"),
    ("check OUT --against DIR", "out"),
    ("predict LOOP extra", "argument"),
    ("predict DIR", "folder"),
    ("predict FAST", "Ts"),
    ("diagnose", "REC"),
    ("diagnose none.csv", "none.csv"),
    ("diagnose REC --process gas", "gas"),
    ("diagnose REC --kind smell", "smell"),
    ("diagnose REC --op-span 1 1", "op_span"),
    ("diagnose LOOP", "loop.toml"),
    ("diagnose REC --jsn", "--json"),
    ("score LOOP", "loop.toml"),
    ("score DIR extra", "argument"),
    ("check none --against DIR", "none"),
    ("check DIR --margin nan", "margin"),
    ("check DIR --margin x", "margin"),
    ("check REC --against DIR", "rec.csv"),
    ("run smoke -o OUT --until-width 2", "until_width"),
    ("run smoke -o OUT --backend slurm", "slurm"),
    ("verify", "RUN"),
    ("verify DIR", "run"),
    ("verify none", "none"),
    ("verify REC", "rec.csv"),
    ("verify OUT", "out"),
    ("verify RECS", "records"),
    ("verify DIR extra", "argument"),
    ("verify DIR --share 2", "share"),
    ("verify DIR --share nan", "share"),
    ("verify DIR --share x", "share"),
    ("verify DIR -j 0", "-j"),
    ("verify DIR --jsn", "--json"),
    ("verify DIR --plugin", "--plugin"),
    ("run smoke -o OUT --time-limit nan", "time limit"),
    ("simulate LOOP -o OUT --time-limit -1", "time limit"),
]


@pytest.mark.parametrize(("line", "part"), sampled(WRONG, 6))
def test_a_wrong_command(here, line, part):
    share = "".join(f"{k},{0.5 + k % 7 / 100},{50 + k % 5}\n" for k in range(300))
    files = {
        "LOOP": ("loop.toml", text()),
        "REC": ("rec.csv", RECORD),
        "LABELS": ("labels.csv", "id,label\none,stictoin\n"),
        "SLOW": ("slow.toml", text("plant", "Td", "1e6")),
        "FAST": ("fast.toml", text("sampling", "Ts", "1e-6")),
        "SHARE": ("share.csv", f"t,op,pv\n{share}"),
        "TAGS": ("tags.csv", RECORD.replace("sp,op,pv", "LIC7.SP,LIC7.OP,LIC7.PV", 1)),
        "RECS/one.csv": ("records/one.csv", RECORD),
    }
    for folder in ("empty", "records"):
        (here / folder).mkdir()
    for name, content in files.values():
        (here / name).write_text(content)
    places = {word: here / name for word, (name, _) in files.items()}
    places |= {"OUT": here / "out", "DIR": here / "empty", "RECS": here / "records"}
    places |= {"PAGE": here / "rec.html", "RECS/one.html": here / "records" / "one.html"}
    places["OUT/key"] = here / "out" / "key"
    values = wrong_values(line.split(), places, part)
    words = [places.get(word, word) for word in line.split()]
    refused(words, "empty" if part == "DIR" else part, values=values)
    for name, content in files.values():
        assert (here / name).read_text() == content
    assert not (here / "out").exists()
    assert not list((here / "empty").iterdir())


RIGHT = "smoke all horch deadband fig-11-4 score-map detectors figures none 1 100"


def wrong_values(words: list[str], places: dict, part: str) -> list[str]:
    """What is wrong on a command line, where it is a value: not what the sentence names anyway, no
    option, verb or file.
    """
    right = {*places, *RIGHT.split(), *" ".join(verbs(typer.main.get_command(app))).split()}
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
        assert sum(line.startswith(verb) for line, _ in WRONG) >= 10, verb


THRESHOLDS = [
    "",
    "{",
    "[]",
    "null",
    '{"horch": 1}',
    '{"horch": {"dtau_low": "x"}}',
    '{"horch": {"dtau_low": NaN}}',
    '{"horch": {"dtau_low": true}}',
    '{"horch": {"dtau_low": 7}}',
    '{"horch": {"dtau": 0.1}}',
    '{"horhc": {"dtau_low": 0.1}}',
    '{"horch": {"no_stiction_below": 0.1}}',
    "[" * 100_000,
    '{"horch": {"dtau_low": ' + "1" * 5000 + "}}",
    "\0",
    '{"horch": {"dtau_low": [1]}}',
    '{"horch": {"stiction_above": 1e400}}',
]


@pytest.mark.parametrize("verb", ["detect rec.csv", "run smoke -o run"])
def test_wrong_thresholds(here, verb):
    (here / "rec.csv").write_text(RECORD)
    for content in THRESHOLDS:
        (here / "cuts.json").write_text(content)
        message = refused(f"{verb} --method horch --thresholds cuts.json")
        assert re.search("cuts.json|horch|horhc", message), message
        assert not (here / "run").exists()


def test_faults_of_the_program_are_one_sentence_that_names_its_log_and_logs_do_not_pile_up(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.delenv(usage.RAISED)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "simbench-report.log").write_text("not ours")
    for number in range(usage.LOGS + 5):

        def fault(number=number):
            raise ZeroDivisionError(f"nobody\nthought of {number}")

        assert exit_code(fault) == 2
    message = capsys.readouterr().err.splitlines()[-1]
    assert f"nobody thought of {usage.LOGS + 4}" in message
    assert len(list(tmp_path.glob(f"{usage.LOG}*"))) == usage.LOGS
    log = Path(message.rpartition(" ")[2]).read_text()
    assert "Traceback" in log
    assert f"thought of {usage.LOGS + 4}" in log
    assert (tmp_path / "simbench-report.log").exists()


def test_json_with_exit_0_is_json():
    for kind in ("detectors", "grids", "effects", "valves", "figures"):
        assert json.loads(answer_to(f"list {kind} --json"))


def test_a_reader_that_goes_away_is_no_fault():
    line = f"{sys.executable} -m simbench.cli list detectors | head -c 1; exit ${{PIPESTATUS[0]}}"
    done = subprocess.run(["bash", "-c", line], capture_output=True, text=True)
    assert done.returncode in (0, 1)
    assert done.stderr == ""
