"""One conclusion per record: verdict, probability, cause and next step agree with each other and in
every verb.
"""

import contextlib
import io
import json
import os
import re
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from results.studies.withheld.files import write_item
from results.studies.worlds import NAMES as WORLD_NAMES
from results.studies.worlds import load_world
from simbench.cli import main
from simbench.detectors.verdict import NO_DECISION, NO_STICTION, STICTION
from simbench.gap import conclude, diagnose
from simbench.gap.decide.posterior import Posterior
from simbench.gap.stiction.conclusion import WORDS, from_posterior
from simbench.gap.stiction.deniable import Deniable
from simbench.loop.effects import BLOCKS, EFFECTS, NONE, UNKNOWN
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop, load_loop

REPORTING = import_module("simbench.gap.reporting")

REAL = Path(__file__).parents[5] / "shared" / "data" / "real"
EXAMPLE = Path(__file__).parents[4] / "docs" / "example" / "model.toml"
COUNT = int(os.environ.get("RECORDS", "40"))
LONGEST = int(os.environ.get("SAMPLES", "600"))
HEALTHY = (
    "none",
    "sensor_lag",
    "oscillation",
    "detuning",
    "noise",
    "load_steps",
    "valve_lag",
    "dead_time_mismatch",
    "drift",
)
FRICTION = ("stiction", "deadband")
SEED = 431
WAVE = np.sin(np.arange(300.0) / 5.0)


def contradictions(c):
    """Return what of one conclusion, as JSON, contradicts itself."""
    p, verdict, cause, step = c["probability"], c["verdict"], c["cause"], c["next"]
    friction = bool(set(cause.split(" and ")) & set(FRICTION))
    rules = {
        "stiction claimed at less than even odds": verdict == STICTION and (p is None or p < 0.5),
        "stiction denied at more than even odds": verdict == NO_STICTION and (p is None or p > 0.5),
        "cause friction without a claim": verdict != STICTION and friction,
        "a claim with another cause": verdict == STICTION and not friction,
        "a claim without work on the valve": verdict == STICTION and "valve" not in step,
        "repair without a claim": verdict != STICTION and "repair" in step,
        "left open in spite of its probability": (
            verdict == NO_DECISION and p is not None and not 0.2 <= p <= 0.8
        ),
        "no reason": not c["reason"].strip(),
        "no next step": not step.strip(),
    }
    return [message for message, wrong in rules.items() if wrong]


def printed(*words):
    with (
        contextlib.redirect_stdout(io.StringIO()) as out,
        contextlib.redirect_stderr(io.StringIO()),
    ):
        code = main([str(w) for w in words])
    return out.getvalue() if code == 0 else None


def of_text(text):
    """Return the conclusion that a verb printed for people, probability to two digits."""
    text = text.replace("\n  ", " ")  # long sentences go on in lines that are set in
    word, p, cause = re.search(
        r"^(.*) \(probability of stiction (.*)\)\. Cause: (.*)\.$", text, re.MULTILINE
    ).groups()
    word = word.lower().partition(" worth repairing, ")[0]  # and from which size on
    verdict = {word: verdict for verdict, word in WORDS.items()}[word]
    step = re.search(r"^Next: (.*)\.$", text, re.MULTILINE).group(1)
    reason = re.search(r"^Reason: (.*)\.$", text, re.MULTILINE).group(1)
    return {
        "verdict": verdict,
        "probability": None if p == "unknown" else float(p),
        "cause": cause,
        "reason": reason,
        "next": step,
    }


def alone(file):
    """Return the conclusion of each verb that sees a record only."""
    out = {name: json.loads(printed(name, file, "--json", *more))["conclusion"] for name, more in (
        ("diagnose", ()),
    )}  # fmt: skip
    out["detect"] = of_text(printed("detect", file, "--method", "likelihood"))
    gap = printed("gap", "diagnose", file, "--identify", "--json")
    if gap is not None:  # where the gap refuses a record it shows nothing
        out["gap diagnose"] = json.loads(gap)["conclusion"]
    return out


def with_loop(file, loop):
    """Return the conclusion of each verb that takes a loop file."""
    text = printed("gap", "diagnose", file, "--baseline", loop, "--json")
    return {} if text is None else {"gap diagnose": json.loads(text)["conclusion"]}


def differ(shown):
    """Return what contradicts in what the verbs show of one record."""
    wrong = [f"{verb}: {message}" for verb, c in shown.items() for message in contradictions(c)]
    one = next(iter(shown.values()))
    for verb, c in shown.items():
        same = (c["verdict"], c["cause"]) == (one["verdict"], one["cause"])
        near = (c["probability"] is None) == (one["probability"] is None) and (
            c["probability"] is None or abs(c["probability"] - one["probability"]) < 0.006
        )
        # a report adds to the step what it knows of the loop
        if not (
            same
            and near
            and (c["next"].startswith(one["next"]) or one["next"].startswith(c["next"]))
        ):
            wrong.append(f"{verb} differs: {c} against {one}")
    return wrong


def drawn(place, number):
    """Return the files of record and loop of a simulated loop: every other one sticks."""
    effect = FRICTION[0] if number % 2 else HEALTHY[number // 2 % len(HEALTHY)]
    world = WORLD_NAMES[number // 2 // len(HEALTHY) % len(WORLD_NAMES)]
    strength = ("weak", "medium", "strong")[number // 6 % 3]
    about = (
        {"kind": "none"}
        if effect == "none"
        else {"kind": "single", "effect": effect, "strength": strength}
    )
    item = load_world(world).draw(SEED, number, about | {"mv": False})
    (place / "drawn").mkdir(parents=True)
    record, loop = write_item(item, place / "drawn", "loop")
    cut = pd.read_csv(record).iloc[:LONGEST]
    (place / "record").mkdir()
    cut.to_csv(place / "record" / "loop.csv", index=False)
    return place / "record" / "loop.csv", loop, effect


def assessed(chosen=()):
    return SimpleNamespace(
        chosen=list(chosen),
        parameters={},
        friction_alone=0.5,
        situation=SimpleNamespace(op=WAVE, record=SimpleNamespace(pv=WAVE, Ts=1.0, mv=None)),
    )


def test_no_posterior_leads_to_a_conclusion_that_contradicts_itself_or_the_effect_named():
    rng, answers = np.random.default_rng(5), (*EFFECTS, NONE, UNKNOWN)
    seen = set()
    for _ in range(2000):
        shares = rng.dirichlet(np.full(len(answers), rng.choice([0.02, 0.1, 1.0])))
        w = Posterior(dict(zip(answers, map(float, shares), strict=True)), str(rng.choice(BLOCKS)))
        if w.first in FRICTION and w.friction < 0.2:
            continue  # a diagnosis answers unknown, or none, there
        c = from_posterior(w, [w.first], assessed([w.first]), None, None)
        assert contradictions(c.as_json()) == [], (w, c)
        assert c.probability == w.friction
        if c.verdict == STICTION:
            assert w.first in FRICTION
        seen.add(c.verdict)
    assert seen == {STICTION, NO_STICTION, NO_DECISION}


def test_friction_of_the_loop_file_is_not_claimed_beside_another_effect():
    table = load_loop(EXAMPLE).to_table() | {"valve": {"model": "deadband", "S": 3.0}}
    loop = Loop.from_table(table)
    for effects in ([], [{"name": "sensor_lag", "tau": 8.0}]):
        record = simulate(Loop.from_table(table | {"effect": effects}), 3).record.without_mv()
        report = diagnose(record, loop)
        named = {e["effect"] for e in report.effects}
        assert report.probability_of_stiction < 0.5 or named & set(FRICTION), report
        assert contradictions(report.conclusion.as_json()) == []
        assert any("more friction than it states" in note for note in report.notes)
        # a valve whose friction is stated is not said to be sound
        assert report.probability_of_stiction >= 0.2 - 1e-9
        assert report.conclusion.verdict != NO_STICTION


def test_with_a_loop_file_a_record_in_which_no_friction_would_show_denies_none(monkeypatch):
    why = "friction cannot be ruled out"
    monkeypatch.setattr(REPORTING, "deniable", lambda view: Deniable(np.inf, why))
    record = simulate(load_loop(EXAMPLE), 3).record.without_mv()
    report = diagnose(record, load_loop(EXAMPLE))
    c, shares = report.conclusion, {r.effect: r.probability for r in report.ranking}
    assert (report.effect, c.verdict) == (NONE, NO_DECISION)
    assert c.probability == pytest.approx(0.2)
    assert sum(shares[e] for e in FRICTION) == pytest.approx(c.probability)
    assert why in c.reason


def test_what_cannot_be_judged_has_no_probability_and_a_reason():
    c = conclude(op=np.full(300, 50.0), pv=np.sin(np.arange(300.0)), Ts=1.0)
    assert (c.verdict, c.probability) == (NO_DECISION, None)
    assert "OP is constant (50)" in c.reason
    assert contradictions(c.as_json()) == []


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_40_records_have_one_conclusion_whichever_verb_is_asked(tmp_path):
    """Simulated loops of two simulators, with and without loop file, and recorded ones."""
    real = sorted(REAL.glob("*[0-9].csv"))[:: max(64 * 4 // COUNT, 1)] if REAL.is_dir() else []
    wrong, rows = [], []
    for number in range(COUNT - len(real)):
        file, loop, effect = drawn(tmp_path / f"{number}", number)
        for shown in (alone(file), with_loop(file, loop)):
            wrong += [(number, effect, message) for message in differ(shown)] if shown else []
            rows += [
                (effect, len(shown), c["verdict"], c["probability"])
                for c in list(shown.values())[:1]
            ]
    for source in real:
        (tmp_path / source.stem).mkdir()
        copy = tmp_path / source.stem / source.name
        copy.write_bytes(source.read_bytes())
        wrong += [(source.stem, message) for message in differ(alone(copy))]
    print(*rows, sep="\n")
    assert not wrong, "\n".join(map(str, wrong))
