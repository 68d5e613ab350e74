"""A law is recognised where it acts, pays on unseen samples, closes the gap, and is written as a
file that simulates it.
"""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from simbench.cli import main
from simbench.contract import check_file
from simbench.detectors.errors import ParameterError
from simbench.files import write_record
from simbench.gap.closed_loop.gap import Shrinkage
from simbench.gap.discover.blocks import Located
from simbench.gap.discover.discovery import described, discover
from simbench.gap.discover.effect_file import lent_effect, refuse_effect_file, write_effect
from simbench.gap.discover.search import Finding, chance
from simbench.gap.law import FoundLaw, spells_of, windows_of
from simbench.loop.effects import PLUGINS
from simbench.loop.laws import forms
from simbench.loop.simulate import simulate
from simbench.scenarios.spec import Loop

TABLE = {
    "plant": {"type": "foptd", "K": 1.2, "T": 20.0, "Td": 4.0},
    "controller": {"type": "PI", "Kc": 1.0, "Ti": 20.0},
    "sampling": {"Ts": 1.0, "n": 1600},
    "noise": {"std": 0.1},
    "setpoint": {"value": 50.0, "steps": [[100 * k, 50 + 4 * (-1) ** k] for k in range(1, 16)]},
}
BASELINE = Loop.from_table(TABLE)
LOAD = [{"type": "coloured", "amplitude": 0.4, "period": 30.0}]


def hidden(form, numbers, seed=4):
    """Return a record of the loop with a law in it."""
    with lent_effect(FoundLaw(form, numbers, 0.0)) as name:
        return simulate(
            Loop.from_table({**TABLE, "disturbance": LOAD, "effect": [{"name": name, **numbers}]}),
            seed,
        ).record


def slow(*case):
    return pytest.param(*case, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("form", "numbers", "block", "near"),
    [
        ("rate", {"slowness": 4.0}, "valve", "slew_limit"),
        # of a block of which another law is asked always
        slow("zero", {"lead": -20.0, "lag": 6.0}, "process", "dead_time_mismatch"),
        slow("derivative", {"Td": 8.0, "filter": 1.0}, "controller", "derivative_action"),
        slow("idle", {"share": 0.3, "length": 8.0}, "controller", "missed_executions"),
        slow("held", {"share": 0.2, "length": 12.0}, "sensor", "frozen_sensor"),
        slow("limits", {"low": 47.0, "high": 52.0}, "controller", "saturation"),
    ],
)
def test_a_hidden_law_is_recognised_in_its_form(form, numbers, block, near):
    discovery = discover(hidden(form, numbers), BASELINE)
    assert discovery.law is not None, discovery.why
    assert (discovery.law.form, discovery.law.block, discovery.nearest) == (form, block, near)
    for name, value in numbers.items():
        assert discovery.law.numbers.get(name, value) == pytest.approx(value, rel=0.5)
    assert discovery.gap.after < discovery.gap.recalibrated
    assert chance(discovery.law.nats) < 0.01
    answer = discovery.as_json()
    assert list(answer) == ["block", "law", "windows", "certificate", "gap", "nearest"]
    assert (list(answer["law"]), list(answer["certificate"]), list(answer["gap"])) == (
        ["form", "numbers", "text"],
        ["nats", "p"],
        ["before", "recalibrated", "after", "floor"],
    )


def test_a_load_that_is_strong_in_spells_is_recognised_with_its_spells(monkeypatch):
    spells, drawn = [], forms.spells
    monkeypatch.setattr(forms, "spells", lambda *a: spells.append(drawn(*a)) or spells[-1])
    record = hidden("bursts", {"std": 10.0, "time": 5.0, "share": 0.2, "length": 60.0}, seed=3312)
    discovery = discover(record, BASELINE)
    assert (discovery.law.form, discovery.block) == ("bursts", "disturbance")
    on = spells[0][: record.n] > 0.0
    assert 2 * np.sum(on & discovery.on) / (on.sum() + discovery.on.sum()) > 0.8


def test_nothing_is_reported_of_a_record_without_a_law():
    discovery = discover(
        simulate(Loop.from_table({**TABLE, "disturbance": LOAD}), 5).record, BASELINE
    )
    assert discovery.law is None
    assert discovery.as_json() == {"law": None, "why": discovery.why}
    assert discovery.probability < 0.6
    assert "If anything is missing" not in discovery.as_text()
    doubtful = replace(discovery, block="valve", probability=0.75)
    assert doubtful.as_json() == {"law": None, "why": discovery.why, "block": "valve"}
    assert doubtful.as_text().endswith(
        "If anything is missing, it is in the valve block (probability 0.75)."
    )
    assert "no form pays" in discovery.one_line()
    assert "no explanation stands out of the noise" in discovery.why


@pytest.mark.slow  # a search, and a diagnosis with one more effect
def test_the_verb_writes_an_effect_that_keeps_the_contract_and_is_known_to_the_diagnosis(
    tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    write_record(hidden("rate", {"slowness": 4.0}), tmp_path / "rec.csv")
    (tmp_path / "loop.toml").write_text(BASELINE.to_toml())
    words = [
        "gap",
        "discover",
        "rec.csv",
        "--baseline",
        "loop.toml",
        "--write-effect",
        "slow.py",
        "--html",
        "law.html",
        "--json",
    ]
    assert main(words) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["block"] == "valve"
    assert "What it looks like" in (tmp_path / "law.html").read_text(encoding="utf-8")
    assert check_file(tmp_path / "slow.py").broken == ()
    PLUGINS.forget("slow")
    assert (
        main(
            [
                "gap",
                "diagnose",
                "rec.csv",
                "--baseline",
                "loop.toml",
                "--effect-plugin",
                "slow.py",
                "--json",
            ]
        )
        == 0
    )
    ranked = {r["effect"] for r in json.loads(capsys.readouterr().out)["ranking"]}
    assert "slow" in ranked
    assert "slow" not in PLUGINS.names()


def test_a_written_file_makes_the_curve_of_the_law(tmp_path):
    law = FoundLaw(
        "curve", {"q1": 45.0, "q2": 50.0, "q3": 55.0, "k1": 0.4, "k2": -0.2, "k3": 0.3}, 20.0
    )
    write_effect(law, tmp_path / "bent.py", "found", 'fitted to "x"')
    PLUGINS.add_file(tmp_path / "bent.py")
    try:
        record = simulate(Loop.from_table({**TABLE, "effect": [{"name": "bent"}]}), 1).record
    finally:
        PLUGINS.forget("bent")
    knots = sum(
        law.numbers[f"k{i}"] * np.maximum(record.op - law.numbers[f"q{i}"], 0.0) for i in (1, 2, 3)
    )
    made = record.op + knots
    assert record.mv - made == pytest.approx(np.full(record.n, record.mv[0] - made[0]), abs=1e-9)


@pytest.mark.parametrize("name", ["law.txt", "My.py", "stiction.py", "none.py", "a-b.py"])
def test_a_file_whose_name_can_be_no_effect_s_is_refused(name):
    with pytest.raises(ParameterError, match="--write-effect"):
        refuse_effect_file(name)


def test_spells_are_where_the_evidence_outweighs_the_price_of_a_change():
    evidence = np.concatenate(
        [np.full(50, -1.0), np.full(40, 1.0), np.full(3, -1.0), np.full(40, 1.0), np.full(50, -1.0)]
    )
    assert windows_of(spells_of(evidence, 6.0), 2.0) == [[100.0, 266.0]]
    assert windows_of(spells_of(evidence, 1.0), 1.0) == [[50.0, 90.0], [93.0, 133.0]]
    assert windows_of(spells_of(-np.ones(9), 1.0), 1.0) == []


@pytest.mark.parametrize(
    ("block", "closes", "kept"),
    [("", 0.6, True), ("", 0.4, False), ("valve", 0.4, True), ("valve", -0.1, False)],
)
def test_a_law_that_only_the_likelihood_names_must_remove_half_of_the_gap(
    monkeypatch, block, closes, kept
):
    law = FoundLaw("rate", {"slowness": 4.0}, 30.0)
    gap = Shrinkage(4.0, 3.9, 2.5, 1.0, True, closes, 0.0, 1.0, {})
    seen = Located("valve", {"valve": 0.9}, "", {})
    place = "simbench.gap.discover.discovery"
    finding = Finding(law, None, None, block=block)
    monkeypatch.setattr(f"{place}.search", lambda s, first: finding)
    monkeypatch.setattr(f"{place}.held_out", lambda s: 65)
    monkeypatch.setattr(f"{place}.located", lambda *evidence: seen)
    monkeypatch.setattr(f"{place}._simulated", lambda *case: (gap, {}))
    situation = SimpleNamespace(record=SimpleNamespace(n=100))
    told = described(situation, None)
    assert (told.law is law) == kept
    assert kept or "of the gap only" in told.why
