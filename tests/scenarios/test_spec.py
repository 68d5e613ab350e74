"""The loop schema: what it refuses, in which words, and that a loop survives writing and
reading.
"""

from __future__ import annotations

import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simbench.scenarios.errors import SpecError
from simbench.scenarios.spec import Loop, Scenario
from simbench.scenarios.toml import content_hash, read_loop

TABLE = {
    "plant": {"type": "foptd", "K": 1, "T": 10, "Td": 2},
    "controller": {"type": "PI", "Kc": 1, "Ti": 10},
    "valve": {"model": "choudhury", "S": 5, "J": 2},
    "sampling": {"Ts": 1},
    "disturbance": [{"type": "sine", "amplitude": 1.0, "period": 50, "at": "output"}],
    "effect": [{"name": "valve_lag", "tau": 3.0}],
    "setpoint": {"value": 40, "steps": [[10, 42.5]]},
}


def test_a_loop_survives_writing_and_reading():
    loop = Loop.from_table(TABLE)
    assert Loop.from_table(tomllib.loads(loop.to_toml())) == loop


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=1e-12, max_value=1e12))
def test_every_number_survives_writing_and_reading(T):
    loop = Loop.from_table(TABLE).with_("plant.T", T)
    assert tomllib.loads(loop.to_toml())["plant"]["T"] == T


def test_id_is_a_hash_of_content_not_of_spelling():
    whole = Scenario(loop=Loop.from_table(TABLE), seed=1)
    spelled = Scenario(
        loop=Loop.from_table({**TABLE, "valve": {"J": 2.0, "S": 5.0, "model": "choudhury"}}), seed=1
    )
    assert whole.id == spelled.id
    assert whole.id != Scenario(loop=whole.loop, seed=2).id
    assert whole.id != Scenario(loop=whole.loop.with_("valve.S", 5.0000001), seed=1).id


def test_a_changed_key_is_checked_like_a_written_one():
    loop = Loop.from_table(TABLE)
    assert loop.with_("plant.Td", 7).plant.Td == 7.0
    for key, value, word in [
        ("plant.Tdd", 1, "Td"),
        ("plnt.Td", 1, "plant"),
        ("plant.Td", -1, "-1"),
        ("disturbance.x", 1, "list"),
    ]:
        with pytest.raises(SpecError, match=word):
            loop.with_(key, value)


def test_hash_does_not_change_between_versions():
    # a join key that other people's tables hold: a change here breaks them
    assert content_hash({"a": 1, "b": [2.5, "x", None]}) == content_hash(
        {"b": [2.5, "x", None], "a": 1.0}
    )


def test_a_key_of_very_many_parts_is_refused_before_it_is_parsed(tmp_path, monkeypatch):
    monkeypatch.setattr(tomllib, "loads", None)
    (tmp_path / "deep.toml").write_text(".".join("a" * 20_000) + " = 1\n")
    with pytest.raises(SpecError, match="nested too deeply"):
        read_loop(tmp_path / "deep.toml")
