"""One conclusion per record: verdict, probability, cause and next step agree with each other and in every verb."""

import contextlib
import io
import json
import os
import re
from pathlib import Path

import pandas as pd
import pytest

from detectors.verdict import NO_STICTION, STICTION
from simbench.blind.making import write_item
from simbench.blind.world import WORLDS
from simbench.cli import main
from simbench.gap.stiction.conclusion import WORDS
from simbench.plant.report.fleet import survey
from simbench.plant.report.page import table

REAL = Path(__file__).parents[5] / "shared" / "data" / "real"
EXAMPLE = Path(__file__).parents[4] / "docs" / "example" / "model.toml"
COUNT = int(os.environ.get("RECORDS", "40"))
LONGEST = int(os.environ.get("SAMPLES", "600"))
WORLD_NAMES = ("own", "mill", "refinery")
HEALTHY = ("none", "sensor_lag", "oscillation", "detuning", "noise", "load_steps", "valve_lag", "dead_time_mismatch", "drift")
FRICTION = ("stiction", "deadband")
SEED = 431


def contradictions(c):
    """Return what of one conclusion, as JSON, contradicts itself."""
    p, verdict, cause, step = c["probability"], c["verdict"], c["cause"], c["next"]
    friction = any(f in cause for f in FRICTION)
    rules = {
        "stiction claimed at less than even odds": verdict == STICTION and (p is None or p < 0.5),
        "stiction denied at more than even odds": verdict == NO_STICTION and (p is None or p > 0.5),
        "cause friction without a claim": verdict != STICTION and friction,
        "a claim with another cause": verdict == STICTION and not friction,
        "a claim without work on the valve": verdict == STICTION and "valve" not in step,
        "repair without a claim": verdict != STICTION and "repair" in step,
        "no reason": not c["reason"].strip(),
        "no next step": not step.strip(),
    }
    return [said for said, wrong in rules.items() if wrong]


def printed(*words):
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()):
        code = main([str(w) for w in words])
    return out.getvalue() if code == 0 else None


def of_text(text):
    """Return the conclusion that a verb printed for people, probability to two digits."""
    word, p, cause = re.search(r"^(.*) \(probability of stiction (.*)\)\. Cause: (.*)\.$", text, re.MULTILINE).groups()
    verdict = {word: verdict for verdict, word in WORDS.items()}[word.lower()]
    step = re.search(r"^Next: (.*)\.$", text, re.MULTILINE).group(1)
    reason = re.search(r"^Reason: (.*)\.$", text, re.MULTILINE).group(1)
    return {
        "verdict": verdict, "probability": None if p == "unknown" else float(p), "cause": cause, "reason": reason, "next": step,
    }  # fmt: skip


def alone(file):
    """Return the conclusion of each verb that sees a record only."""
    out = {name: json.loads(printed(name, file, "--json", *more))["conclusion"] for name, more in (
        ("diagnose", ()), ("trust", ("--method", "he")),
    )}  # fmt: skip
    out["detect"] = of_text(printed("detect", file, "--method", "likelihood"))
    gap = printed("gap", "diagnose", file, "--identify", "--json")
    if gap is not None:  # where the gap refuses a record it shows nothing
        out["gap diagnose"] = json.loads(gap)["conclusion"]
    with contextlib.redirect_stderr(io.StringIO()):
        row = table(survey(file.parent, jobs=1)).iloc[0]
    p = None if pd.isna(row["probability_of_stiction"]) else row["probability_of_stiction"]
    verdict = {word: verdict for verdict, word in WORDS.items()}[row["answer"]]
    out["report"] = {
        "verdict": verdict, "probability": p, "cause": row["cause"], "reason": row["reason"], "next": row["next"],
    }  # fmt: skip
    return out


def with_loop(file, loop):
    """Return the conclusion of each verb that takes a loop file."""
    both = (("gap diagnose", ("gap", "diagnose", file, "--baseline", loop)), ("trust", ("trust", file, "--loop", loop)))
    out = {name: printed(*words, "--json", *(("--method", "he") if name == "trust" else ())) for name, words in both}
    return {name: json.loads(text)["conclusion"] for name, text in out.items() if text is not None}


def differ(shown):
    """Return what contradicts in what the verbs show of one record."""
    wrong = [f"{verb}: {said}" for verb, c in shown.items() for said in contradictions(c)]
    one = next(iter(shown.values()))
    for verb, c in shown.items():
        same = (c["verdict"], c["cause"]) == (one["verdict"], one["cause"])
        near = (c["probability"] is None) == (one["probability"] is None) and (
            c["probability"] is None or abs(c["probability"] - one["probability"]) < 0.006
        )
        # a report adds to the step what it knows of the loop
        if not (same and near and (c["next"].startswith(one["next"]) or one["next"].startswith(c["next"]))):
            wrong.append(f"{verb} differs: {c} against {one}")
    return wrong


def drawn(place, number):
    """Return the files of record and loop of a simulated loop: every other one sticks."""
    effect = FRICTION[0] if number % 2 else HEALTHY[number // 2 % len(HEALTHY)]
    world = WORLD_NAMES[number // 2 % len(WORLD_NAMES)]
    strength = ("weak", "medium", "strong")[number // 6 % 3]
    about = {"kind": "none"} if effect == "none" else {"kind": "single", "effect": effect, "strength": strength}
    item = WORLDS.load(world).draw(SEED, number, about | {"mv": False})
    (place / "drawn").mkdir(parents=True)
    record, loop = write_item(item, place / "drawn", "loop")
    cut = pd.read_csv(record).iloc[:LONGEST]
    (place / "record").mkdir()
    cut.to_csv(place / "record" / "loop.csv", index=False)
    return place / "record" / "loop.csv", loop, effect


@pytest.mark.timeout(3600)
def test_40_records_have_one_conclusion_whichever_verb_is_asked(tmp_path, monkeypatch):
    """Simulated loops of three simulators, with and without loop file, and recorded ones; replicates change no conclusion."""
    monkeypatch.setattr("simbench.plant.trust.trust.draw_twins", lambda *a, **k: [])
    monkeypatch.setattr("simbench.plant.trust.trust.over_time", lambda *a: None)
    monkeypatch.setattr("simbench.plant.report.fleet.what_if", lambda *a: ())
    monkeypatch.setattr("simbench.plant.report.fleet.judge", lambda *a: [])
    monkeypatch.setattr("simbench.plant.report.fleet.choose_methods", lambda names: ["bicoherence"])
    real = sorted(REAL.glob("*[0-9].csv"))[:: max(64 * 4 // COUNT, 1)] if REAL.is_dir() else []
    wrong, rows = [], []
    for number in range(COUNT - len(real)):
        file, loop, effect = drawn(tmp_path / f"{number}", number)
        for shown in (alone(file), with_loop(file, loop)):
            wrong += [(number, effect, said) for said in differ(shown)] if shown else []
            rows += [(effect, len(shown), c["verdict"], c["probability"]) for c in list(shown.values())[:1]]
    for source in real:
        (tmp_path / source.stem).mkdir()
        copy = tmp_path / source.stem / source.name
        copy.write_bytes(source.read_bytes())
        wrong += [(source.stem, said) for said in differ(alone(copy))]
    print(*rows, sep="\n")
    assert not wrong, "\n".join(map(str, wrong))
