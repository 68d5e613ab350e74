"""Answers that are kept: read back to the same bits, never executed, and asked again where they are
not what was written.
"""

import json
import os
import pickle
from dataclasses import dataclass

import numpy as np
import pytest

from simbench.bench.store.checksums import with_checksum
from simbench.detectors.record import LoopRecord
from simbench.plant import resumed as resuming
from simbench.plant.resumed import resumed

ASKED = []


@dataclass(frozen=True)
class Answer:
    record: LoopRecord
    many: dict[int, tuple[float, ...]]
    note: str | None = None


@dataclass(frozen=True)
class Other:
    command: str

    def __post_init__(self):
        raise AssertionError("nobody asked for one")


def ask(number: float) -> Answer | str:
    ASKED.append(number)
    if number < 0:
        return f"no answer to {number}"
    x = np.arange(5.0) / 3.0 + number
    return Answer(LoopRecord(op=x, pv=x, Ts=1 / 3), {1: (float("nan"), 0.1), 2: ()})


def answered(folder, about=((0.7,), (-1.0,))):
    ASKED.clear()
    return resumed(ask, about, jobs=1, keep=folder, what="numbers"), list(ASKED)


def test_kept_answers_have_the_bits_of_those_given(tmp_path):
    first, asked = answered(tmp_path)
    assert asked == [0.7, -1.0]
    again, asked = answered(tmp_path)
    assert asked == []
    assert again[0].record.pv.tobytes() == first[0].record.pv.tobytes()
    assert (again[0].record.Ts, repr(again[0].many), again[0].note, again[1]) == (
        1 / 3,
        repr(first[0].many),
        None,
        first[1],
    )


class Trap:
    def __reduce__(self):
        return os.system, ("echo caught > trap",)


TRAPS = {
    "pickle": pickle.dumps(Trap()),
    "class": json.dumps(
        with_checksum({"answer": {"of": "Other", "with": {"command": "echo"}}})
    ).encode(),
    "no checksum": json.dumps({"answer": "another one"}).encode(),
    "half": b'{"answer": {"of": "tup',
    "empty": b"",
    "deep": b"[" * 100_000,
    "no text": b"\xff\xfe\x00",
}


@pytest.mark.parametrize("content", TRAPS.values(), ids=TRAPS)
def test_other_content_in_place_of_an_answer_is_not_executed_and_asked_again(
    tmp_path, monkeypatch, content
):
    monkeypatch.chdir(tmp_path)
    kept = tmp_path / "kept"
    first, _ = answered(kept)
    for file in kept.rglob("*.json"):
        file.write_bytes(content)
    again, asked = answered(kept)
    assert asked == [0.7, -1.0]
    assert repr(again[0].many) == repr(first[0].many)
    assert [p.name for p in tmp_path.iterdir()] == ["kept"]
    assert answered(kept)[1] == []


def test_answers_to_other_questions_are_not_mistaken_for_this_one(tmp_path):
    answered(tmp_path)
    assert answered(tmp_path, [(0.8,)])[1] == [0.8]


def test_what_nobody_asks_any_more_is_removed_and_other_sources_answer_anew(tmp_path, monkeypatch):
    answered(tmp_path)
    assert answered(tmp_path, [(0.7,)])[1] == []
    assert len(list(tmp_path.iterdir())) == 1
    monkeypatch.setattr(resuming, "_code", lambda: "another")
    assert answered(tmp_path, [(0.7,)])[1] == [0.7]


def test_an_array_of_another_kind_than_numbers_is_no_answer(tmp_path):
    first, _ = answered(tmp_path)
    for file in tmp_path.iterdir():
        content = json.loads(file.read_text())
        if isinstance(content["answer"], dict):
            content["answer"]["with"]["record"]["with"]["pv"]["dtype"] = "|O"
            file.write_text(json.dumps(with_checksum(content)))
    again, asked = answered(tmp_path)
    assert asked == [0.7]
    assert again[0].record.pv.tobytes() == first[0].record.pv.tobytes()
